# SPDX-License-Identifier: GPL-3.0-or-later
"""The texture of a Wavefront OBJ, as colours of its vertices."""

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from ..errors import InputError, readable
from ..memory import check_memory
from ..vectors import Array
from .scan_colours import Colours, colours_at

MOST_BYTES = 500_000_000
"""Of a file whose texture is read: it takes some ten times that."""
MOST_LIBRARY_BYTES = 10_000_000
"""Of a file of materials."""
MOST_LETTERS = 100
"""Of what a file says that is repeated in a sentence."""
BYTES_A_PIXEL = 16
"""That reading a picture takes at its peak; measured 15.3."""


def texture_colours(path: Path, library: str, points: Array) -> tuple[Colours | None, str]:
    """Colours of vertices (n, 3), and a sentence where there is a texture that cannot be used.

    Parameters
    ----------
    library : the file of the materials, as the OBJ names it.
    """
    try:
        colours, why = _colours(path, library, points)
    except InputError as error:
        colours, why = None, error.problem
    except Exception as error:  # noqa: BLE001 - the terrain is of use without its colours
        colours, why = None, f"{type(error).__name__}: {readable(str(error), MOST_LETTERS)}"
    return colours, f"The colours of its texture are left out: {why}." if why else ""


def _colours(path: Path, library: str, points: Array) -> tuple[Colours | None, str]:
    """Colours, or why there are none; empty where there is no texture."""
    beside = path.parent / library
    if not _is_file(beside):
        return None, f"{readable(library, MOST_LETTERS)} is not beside it"
    if beside.stat().st_size > MOST_LIBRARY_BYTES:
        return None, f"{readable(library, MOST_LETTERS)} is too large for a file of materials"
    pictures = _pictures(beside)
    if not pictures:
        return None, ""
    missing = [name for name in pictures if not _is_file(beside.parent / name)]
    if missing:
        return None, f"{readable(', '.join(missing[:3]), MOST_LETTERS)} is not beside it"
    if path.stat().st_size > MOST_BYTES:
        return None, f"the file is larger than {MOST_BYTES / 1e6:.0f} MB"
    import trimesh

    with _large_pictures([beside.parent / name for name in pictures]):
        scene = trimesh.load_scene(path, process=False)
        parts = [_part(mesh) for mesh in scene.geometry.values() if isinstance(mesh, trimesh.Trimesh)]
    known = [part for part in parts if part is not None]
    if not known or len(known) < len(parts):
        return None, "a part of the mesh has none"
    return colours_at(points, *(np.concatenate(each) for each in zip(*known, strict=True))), ""


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name that no file can have
        return False


@contextmanager
def _large_pictures(files: Sequence[Path]) -> Iterator[None]:
    """Textures of scans are larger than what Pillow takes for an attack: memory is what they are held against.

    Raises
    ------
    InputError : they need more than there is.
    """
    from PIL import Image

    usual = Image.MAX_IMAGE_PIXELS
    Image.MAX_IMAGE_PIXELS = None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            pixels = 0
            for file in files:
                with Image.open(file) as picture:  # reads its header alone
                    pixels += picture.width * picture.height
            check_memory("the texture", BYTES_A_PIXEL * pixels, files[0])
            yield
    finally:
        Image.MAX_IMAGE_PIXELS = usual


def _pictures(library: Path) -> list[str]:
    """The files of the colours, each once."""
    text = library.read_text(encoding="utf-8", errors="replace")
    lines = [line.split(maxsplit=1) for line in text.splitlines() if line.strip().lower().startswith("map_kd")]
    return list(dict.fromkeys(line[1].strip().replace("\\", "/") for line in lines if len(line) == 2))


def _part(mesh: "object") -> tuple[Array, Colours] | None:
    visual = mesh.visual  # type: ignore[attr-defined]
    if visual.kind != "texture" or visual.uv is None or getattr(visual.material, "image", None) is None:
        return None
    colours = np.asarray(visual.to_color().vertex_colors[:, :3], dtype=np.uint8)
    return np.asarray(mesh.vertices, dtype=np.float64), colours  # type: ignore[attr-defined]

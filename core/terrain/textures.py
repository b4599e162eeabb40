# SPDX-License-Identifier: GPL-3.0-or-later
"""The texture of a Wavefront OBJ, as colours of its vertices."""

from pathlib import Path

import numpy as np

from ..vectors import Array
from .scan_colours import Colours, colours_at

MOST_BYTES = 500_000_000
"""Of a file whose texture is read: it takes some ten times that."""


def texture_colours(path: Path, library: str, points: Array) -> tuple[Colours | None, str]:
    """Colours of vertices (n, 3), and a sentence where there is a texture that cannot be used.

    Parameters
    ----------
    library : the file of the materials, as the OBJ names it.
    """
    beside = path.parent / library
    if not beside.is_file():
        return None, f"The colours of its texture are left out: {library} is not beside it."
    pictures = _pictures(beside)
    if not pictures:
        return None, ""
    missing = [name for name in pictures if not (beside.parent / name).is_file()]
    if missing:
        return None, f"The colours of its texture are left out: {', '.join(missing[:3])} is not beside it."
    if path.stat().st_size > MOST_BYTES:
        return None, f"The colours of its texture are left out: the file is larger than {MOST_BYTES / 1e6:.0f} MB."
    import trimesh

    try:
        scene = trimesh.load_scene(path, process=False)
        parts = [_part(mesh) for mesh in scene.geometry.values() if isinstance(mesh, trimesh.Trimesh)]
    except Exception as error:  # noqa: BLE001 - the terrain is of use without its colours
        return None, f"The colours of its texture are left out: {type(error).__name__}: {str(error)[:100]}."
    known = [part for part in parts if part is not None]
    if not known or len(known) < len(parts):
        return None, "The colours of its texture are left out: a part of the mesh has none."
    return colours_at(points, *(np.concatenate(each) for each in zip(*known, strict=True))), ""


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

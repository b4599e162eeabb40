# SPDX-License-Identifier: GPL-3.0-or-later
"""World files: six numbers beside a picture that say where it is."""

from pathlib import Path

import numpy as np

from ..errors import InputError
from ..vectors import Array

EXTENSIONS = (".tfw", ".tifw", ".tiffw", ".wld")
"""Beside a TIFF, the first of them that is there counts, in any case."""
MOST_BYTES = 10_000


def world_file_beside(path: Path) -> Path | None:
    """The world file of a TIFF; None when there is none."""
    try:
        beside = {other.name.lower(): other for other in path.parent.iterdir() if other.stem in (path.stem, path.name)}
    except OSError:
        return None
    names = [f"{path.stem}{extension}" for extension in EXTENSIONS] + [f"{path.name}w", f"{path.name}.wld"]
    return next((beside[name.lower()] for name in names if name.lower() in beside), None)


def read_world_file(path: Path) -> Array:
    """(2, 3) from (column, row, 1) of the centre of a pixel, counted from 0, to x, y; turned pictures too.

    The file has x per column, y per column, x per row, y per row, and x and y of the centre of the first pixel.

    Raises
    ------
    InputError : not six finite numbers, or no picture has such pixels.
    """
    if path.stat().st_size > MOST_BYTES:
        raise InputError("This is no world file: it is too long", file=path, advice="Give one with six numbers")
    words = path.read_text("utf-8-sig", "replace").replace(",", ".").split()
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        numbers = []
    if len(numbers) != 6 or not np.isfinite(numbers).all():
        raise InputError("The world file does not have six numbers", file=path, advice="Export it again, or remove it")
    affine = np.array(numbers).reshape(3, 2).T
    if affine[0, 0] * affine[1, 1] == affine[0, 1] * affine[1, 0]:
        raise InputError("The pixels of the world file have no area", file=path, advice="Export it again, or remove it")
    return affine

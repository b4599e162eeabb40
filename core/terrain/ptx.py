# SPDX-License-Identifier: GPL-3.0-or-later
"""Scans in PTX, the text format of Leica Cyclone: a grid of directions for each place of the scanner."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..reading import AGAIN
from ..vectors import Array
from .crs import system_beside
from .scan_colours import colours_of
from .source import Source
from .text import number_table, read_text, shown

HEADER_ROWS = 10
"""Columns and rows of the grid; place and axes of the scanner, 4 rows; transformation, 4 rows."""
COLOURED = 7
"""Columns of a scan with colours: x, y, z, intensity, red, green, blue."""
SOME = "The colours are left out: some scans have none."
TOLERANCE = 1e-3
"""Files round their rotations to some digits."""


def read_ptx(path: Path) -> Source:
    """Read all scans of a PTX file, each put in its place by the transformation of its header.

    Directions in which nothing was measured (all zeros) are left out.

    Raises
    ------
    InputError : a header or a point that is none, with its row; fewer points than a header promises.
    """
    lines = read_text(path).split(b"\n")
    while lines and not lines[-1].strip():
        lines.pop()
    parts, colours, at, empty = [], [], 0, 0
    while at < len(lines):
        count, transformation = _header(lines, at, path)
        at += HEADER_ROWS
        held = len(lines) - at
        if count > held:
            raise InputError(
                f"The file is truncated: its header promises {count:,} points, {held:,} rows follow",
                file=path,
                row=at - HEADER_ROWS + 1,
                advice="Copy or export it again",
            )
        table = number_table(lines[at : at + count], range(at + 1, at + count + 1), path, "Coordinates")
        if count and table.shape[1] < 3:
            raise InputError(f"{table.shape[1]} values, where x, y and z are needed", file=path, row=at + 1)
        points = table[:, :3]
        measured = (points != 0).any(axis=1)
        empty += count - int(measured.sum())
        parts.append(points[measured] @ transformation[:3, :3] + transformation[3, :3])
        colours.append(table[measured, 4:7] if table.shape[1] == COLOURED else table[:0, :3])
        at += count
    points = np.concatenate(parts)
    if not len(points):
        raise InputError("Nothing was measured in any direction", file=path, advice="Export the scans again")
    scans = "a scan" if len(parts) == 1 else f"{len(parts)} scans"
    note = f"Cloud of {len(points):,} points in {scans}; {empty:,} directions without a point."
    numbers = np.concatenate(colours)
    found, said = colours_of(numbers) if len(numbers) == len(points) else (None, SOME if len(numbers) else "")
    notes = (note, said) if said else (note,)
    return Source(points, system=system_beside(path), notes=notes, colours=found)


def _header(lines: Sequence[bytes], at: int, path: Path) -> tuple[int, Array]:
    """Number of points, and the transformation (4, 4) of rows: the last one is the place."""
    sizes = []
    for row in (at, at + 1):
        text = lines[row].strip() if row < len(lines) else b""
        if not text.isdigit() or len(text) > 9:
            raise InputError(
                f'"{shown(text)}" is no number of columns or rows, with which a scan begins',
                file=path,
                row=row + 1,
                advice=AGAIN,
            )
        sizes.append(int(text))
    rows = range(at + HEADER_ROWS - 3, at + HEADER_ROWS + 1)
    found = number_table(lines[at + HEADER_ROWS - 4 : at + HEADER_ROWS], rows, path, "Four numbers")
    if found.shape != (4, 4) or not np.isfinite(found).all():
        raise InputError("The transformation is not four rows of four numbers", file=path, row=rows[0], advice=AGAIN)
    turned = found[:3, :3] @ found[:3, :3].T  # of a rotation times a scale: the scale squared on the diagonal
    scale2 = float(np.trace(turned)) / 3
    skew = np.abs(turned - scale2 * np.eye(3)).max()
    if not (scale2 > 0 and skew < TOLERANCE * scale2 and np.abs(found[:, 3] - [0, 0, 0, 1]).max() < TOLERANCE):
        raise InputError(
            "The transformation is no rotation, shift and scale", file=path, row=rows[0], advice="Export it again"
        )
    return sizes[0] * sizes[1], found

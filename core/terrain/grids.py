# SPDX-License-Identifier: GPL-3.0-or-later
"""Elevation grids in text: ESRI ASCII."""

from pathlib import Path

import numpy as np

from ..errors import InputError
from ..reading import AGAIN
from ..vectors import Array
from .crs import crs_beside
from .source import Source
from .text import all_numbers, read_text, shown

ASC_KEYS = (
    "ncols",
    "nrows",
    "xllcorner",
    "yllcorner",
    "xllcenter",
    "yllcenter",
    "cellsize",
    "dx",
    "dy",
    "nodata_value",
)


def read_ascii_grid(path: Path) -> Source:
    """Read an ESRI ASCII grid: heights at the centres of its cells, the northern row first.

    Raises
    ------
    InputError : a header line that is missing or makes no sense, too few or too many heights, a non-number; its row.
    """
    lines = read_text(path).split(b"\n")
    header: dict[str, float] = {}
    first = 0
    for row, line in enumerate(lines):
        words = line.decode("utf-8", "replace").split()
        if not words:
            continue
        if not words[0][0].isalpha() or words[0].lower() in ("nan", "inf"):
            first = row
            break
        key = words[0].lower()
        if key not in ASC_KEYS or len(words) != 2:
            raise InputError(
                f'"{shown(line)}" is no header line of an ESRI ASCII grid',
                file=path,
                row=row + 1,
                advice="The header has ncols, nrows, xllcorner, yllcorner, cellsize and NODATA_value",
            )
        try:
            header[key] = float(words[1])
        except ValueError as error:
            raise InputError(
                f'"{shown(words[1].encode())}" is not a number, for {key}', file=path, row=row + 1, advice=AGAIN
            ) from error
    else:
        raise InputError("The grid has no heights after its header", file=path, advice="Export it again")
    columns, rows = _count(header, "ncols", path), _count(header, "nrows", path)
    dx, dy = (header.get(key, header.get("cellsize", np.nan)) for key in ("dx", "dy"))
    origin = []
    for axis, step in (("x", dx), ("y", dy)):
        if not step > 0 or not np.isfinite(step):
            raise InputError("The header needs a positive cellsize", file=path, advice="Add the cell size [m] to it")
        if f"{axis}llcenter" in header:
            origin.append(header[f"{axis}llcenter"])
        elif f"{axis}llcorner" in header:
            origin.append(header[f"{axis}llcorner"] + step / 2)
        else:
            raise InputError(f"The header has no {axis}llcorner or {axis}llcenter", file=path, advice="Add it")
    heights = _ascii_heights(lines, first, rows, columns, path)
    heights[heights == header.get("nodata_value", -9999.0)] = np.nan
    x = origin[0] + dx * np.arange(columns)
    y = origin[1] + dy * np.arange(rows)[::-1]
    points = np.stack([*np.broadcast_arrays(x[None, :], y[:, None]), heights.reshape(rows, columns)], axis=-1)
    crs, geographic = crs_beside(path)
    note = f"Grid of {columns} × {rows} heights, cell {dx:g} × {dy:g}."
    return Source(points.reshape(-1, 3), grid_shape=(rows, columns), crs=crs, geographic=geographic, notes=(note,))


def _count(header: dict[str, float], key: str, path: Path) -> int:
    value = header.get(key)
    if value is None:
        raise InputError(f"The header has no {key}", file=path, advice="Check that this is an ESRI ASCII grid")
    if not value >= 2 or not np.isfinite(value) or value % 1:
        raise InputError(f"{key} is {value:g}, where a whole number of at least 2 is needed", file=path, advice=AGAIN)
    return int(value)


def _ascii_heights(lines: list[bytes], first: int, rows: int, columns: int, path: Path) -> Array:
    values = all_numbers(b"\n".join(lines[first:]))
    if values is None:
        for row, line in enumerate(lines[first:], start=first + 1):
            if all_numbers(line) is None:
                word = next(w for w in line.split() if all_numbers(w) is None)
                raise InputError(
                    f'"{shown(word)}" is not a number',
                    file=path,
                    row=row,
                    advice="Heights are needed here, with a point as the decimal mark",
                )
        raise InputError("The heights cannot be read", file=path, advice="Export the grid again")
    if values.size != rows * columns:
        last = max(i for i, line in enumerate(lines) if line.strip()) + 1
        raise InputError(
            f"{values.size} heights, where {rows} rows of {columns} need {rows * columns}",
            file=path,
            row=last,
            advice="The file is truncated or its header is wrong: copy or export it again",
        )
    return values

# SPDX-License-Identifier: GPL-3.0-or-later
"""Elevation grids in text: ESRI ASCII."""

import codecs
import re
from itertools import batched
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..formats.gdal_metadata import band_beside
from ..reading import AGAIN
from ..vectors import Array
from .crs import system_beside, system_from_wkt
from .no_data import ZERO_GAP_M, declared, without_fillers
from .source import Source, unit_of_band
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
OTHER_KEYS = {"nodata": "nodata_value", "xllcentre": "xllcenter", "yllcentre": "yllcenter"}
"""Other spellings of the words of a header, in lower case."""
NO_DATA = "-9999"
"""Where the header names none: as Esri's programs read such files."""
WORDS_OF_NO_HEIGHT = re.compile(rb"[-+]?1\.#(?:QNAN|SNAN|IND|INF)\d*", re.IGNORECASE)
"""How old programs of Windows write what is no number."""


def read_ascii_grid(path: Path) -> Source:
    """Read an ESRI ASCII grid: heights at the centres of its cells, the northern row first.

    Decimal commas are read where the file has no point. The no-data value is compared in single precision.

    Raises
    ------
    InputError : a header line that is missing or makes no sense, too few or too many heights, a non-number; its row.
    """
    text = read_text(path).removeprefix(codecs.BOM_UTF8)
    notes = []
    if b"," in text and b"." not in text:
        text = text.replace(b",", b".")
        notes.append("Commas are read as decimal marks.")
    lines = text.split(b"\n")
    header: dict[str, str] = {}
    first = 0
    for row, line in enumerate(lines):
        words = line.decode("utf-8", "replace").split()
        if not words:
            continue
        if not words[0][0].isalpha() or words[0].lower() in ("nan", "inf"):
            first = row
            break
        pairs = (
            [(OTHER_KEYS.get(key.lower(), key.lower()), value) for key, value in batched(words, 2, strict=False)]
            if (len(words) % 2 == 0)
            else []
        )
        if not pairs or any(key not in ASC_KEYS for key, _ in pairs):
            raise InputError(
                f'"{shown(line)}" is no header line of an ESRI ASCII grid',
                file=path,
                row=row + 1,
                advice="The header has ncols, nrows, xllcorner, yllcorner, cellsize and NODATA_value",
            )
        for key, value in pairs:
            if key in header and _number(header[key]) != _number(value):
                raise InputError(f"The header has {key} twice", file=path, row=row + 1, advice="Remove one of them")
            if _number(value) is None:
                raise InputError(
                    f'"{shown(value.encode())}" is not a number, for {key}', file=path, row=row + 1, advice=AGAIN
                )
            header[key] = value
    else:
        raise InputError("The grid has no heights after its header", file=path, advice="Export it again")
    numbers = {key: float(value) for key, value in header.items()}
    columns, rows = _count(numbers, "ncols", path), _count(numbers, "nrows", path)
    dx, dy = (numbers.get(key, numbers.get("cellsize", np.nan)) for key in ("dx", "dy"))
    origin = []
    for axis, step in (("x", dx), ("y", dy)):
        if not step > 0 or not np.isfinite(step):
            raise InputError("The header needs a positive cellsize", file=path, advice="Add the cell size [m] to it")
        if f"{axis}llcenter" in numbers:
            origin.append(numbers[f"{axis}llcenter"])
        elif f"{axis}llcorner" in numbers:
            origin.append(numbers[f"{axis}llcorner"] + step / 2)
        else:
            raise InputError(f"The header has no {axis}llcorner or {axis}llcenter", file=path, advice="Add it")
    values = _ascii_heights(lines, first, rows, columns, path)
    band = band_beside(path)
    no_data = band.no_data or header.get("nodata_value", NO_DATA)
    scale, offset = 1.0 if band.scale is None else band.scale, band.offset or 0.0
    with np.errstate(over="ignore"):
        empty = declared(values.astype(np.float32), no_data)
    heights, filled = without_fillers(values, empty, None if offset else ZERO_GAP_M / abs(scale))
    if scale != 1.0 or offset:
        heights = heights * scale + offset
        notes.append(f"Heights are {scale:g} times the numbers of the file, plus {offset:g}, as its .aux.xml says.")
    x = origin[0] + dx * np.arange(columns)
    y = origin[1] + dy * np.arange(rows)[::-1]
    points = np.stack([*np.broadcast_arrays(x[None, :], y[:, None]), heights.reshape(rows, columns)], axis=-1)
    system = system_from_wkt(band.wkt).filled(system_beside(path))
    return Source(
        points.reshape(-1, 3),
        grid_shape=(rows, columns),
        system=system.with_height_unit(unit_of_band(band.unit, path)),
        notes=(f"Grid of {columns} × {rows} heights, cell {dx:g} × {dy:g}.", *notes, *filled),
    )


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _count(header: dict[str, float], key: str, path: Path) -> int:
    value = header.get(key)
    if value is None:
        raise InputError(f"The header has no {key}", file=path, advice="Check that this is an ESRI ASCII grid")
    if not value >= 2 or not np.isfinite(value) or value % 1:
        raise InputError(f"{key} is {value:g}, where a whole number of at least 2 is needed", file=path, advice=AGAIN)
    return int(value)


def _ascii_heights(lines: list[bytes], first: int, rows: int, columns: int, path: Path) -> Array:
    body = b"\n".join(lines[first:])
    values = all_numbers(body)
    if values is None and b"#" in body:
        lines = [*lines[:first], *WORDS_OF_NO_HEIGHT.sub(b"nan", body).split(b"\n")]
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

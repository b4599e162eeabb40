# SPDX-License-Identifier: GPL-3.0-or-later
"""Elevation grids: ESRI ASCII and GeoTIFF."""

import struct
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..vectors import Array
from .crs import crs_beside, crs_from_geokeys
from .source import Source
from .text import all_numbers, read_text

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
PIXEL_IS_POINT, RASTER_TYPE = 2, 1025
NO_HEIGHT = 1e30
"""Beyond this a value is a filler that the file forgot to declare, as float32's lowest number often is."""


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
                f'"{line[:60].decode("utf-8", "replace").strip()}" is no header line of an ESRI ASCII grid',
                file=path,
                row=row + 1,
                advice="The header has ncols, nrows, xllcorner, yllcorner, cellsize and NODATA_value",
            )
        try:
            header[key] = float(words[1])
        except ValueError as error:
            raise InputError(f'"{words[1]}" is not a number, for {key}', file=path, row=row + 1) from error
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
    if value != int(value) or value < 2:
        raise InputError(f"{key} is {value:g}, where a whole number of at least 2 is needed", file=path)
    return int(value)


def _ascii_heights(lines: list[bytes], first: int, rows: int, columns: int, path: Path) -> Array:
    values = all_numbers(b"\n".join(lines[first:]))
    if values is None:
        for row, line in enumerate(lines[first:], start=first + 1):
            if all_numbers(line) is None:
                word = next(w for w in line.split() if all_numbers(w) is None)
                raise InputError(
                    f'"{word[:40].decode("utf-8", "replace")}" is not a number',
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


def read_geotiff(path: Path) -> Source:
    """Read a GeoTIFF of heights (OGC 19-008r4); the first band of several.

    Raises
    ------
    InputError : not a TIFF, truncated, without a georeference, an image instead of heights.
    """
    import tifffile

    if not path.stat().st_size:
        raise InputError("The file is empty", file=path, advice="Export it again")
    try:
        with tifffile.TiffFile(path) as tiff:
            page = tiff.pages.first
            tags = {tag.code: tag.value for tag in page.tags}
            heights = np.asarray(page.asarray())
            bands_first = page.planarconfig == tifffile.PLANARCONFIG.SEPARATE
    except (tifffile.TiffFileError, struct.error, ValueError, OSError, RuntimeError, LookupError, TypeError) as error:
        raise InputError(
            f"The TIFF file cannot be read ({error})", file=path, advice="It may be truncated: copy or export it again"
        ) from error
    notes: list[str] = []
    if heights.ndim == 3:
        bands = heights.shape[0] if bands_first else heights.shape[2]
        if heights.dtype == np.uint8:
            raise InputError(
                f"The TIFF is a picture of {bands} bands, not heights", file=path, advice="Choose the elevation model"
            )
        heights = heights[0] if bands_first else heights[:, :, 0]
        notes.append(f"The first of {bands} bands is taken as the height.")
    if heights.ndim != 2 or min(heights.shape) < 2 or not np.issubdtype(heights.dtype, np.number):
        raise InputError(f"The TIFF holds no grid of heights (shape {heights.shape})", file=path)
    heights = heights.astype(np.float64)
    nodata = str(tags.get(42113, "")).strip("\0 ")
    try:
        no_value = float(nodata) if nodata else np.nan
    except ValueError as error:
        raise InputError(f'The NODATA value "{nodata}" is not a number', file=path) from error
    heights[(heights == no_value) | (heights == np.float64(np.float32(no_value))) | (np.abs(heights) > NO_HEIGHT)] = (
        np.nan
    )
    keys = _geokeys(tags.get(34735, ()))
    rows, columns = heights.shape
    half = 0.0 if dict(keys).get(RASTER_TYPE) == PIXEL_IS_POINT else 0.5
    affine = _affine(tags, path)
    column, row = np.meshgrid(np.arange(columns) + half, np.arange(rows) + half)
    x = affine[0, 0] * column + affine[0, 1] * row + affine[0, 2]
    y = affine[1, 0] * column + affine[1, 1] * row + affine[1, 2]
    crs, geographic = crs_from_geokeys(keys)
    if not crs and not geographic:
        crs, geographic = crs_beside(path)
    cell = np.hypot(*affine[:, :2])
    notes.insert(0, f"Grid of {columns} × {rows} heights, cell {cell[0]:g} × {cell[1]:g}.")
    points = np.stack([x, y, heights], axis=-1).reshape(-1, 3)
    return Source(points, grid_shape=(rows, columns), crs=crs, geographic=geographic, notes=tuple(notes))


def _geokeys(directory: object) -> list[tuple[int, int]]:
    """(id, value) of the keys whose value stands in the directory itself."""
    numbers = [int(n) for n in directory] if isinstance(directory, tuple | list) else []
    return [(numbers[i], numbers[i + 3]) for i in range(4, len(numbers) - 3, 4) if numbers[i + 1] == 0]


def _affine(tags: dict[int, tuple[float, ...]], path: Path) -> Array:
    """(2, 3) from (column, row, 1) to x, y."""
    if 34264 in tags:
        matrix = np.array(tags[34264], dtype=np.float64).reshape(4, 4)
        return matrix[:2, [0, 1, 3]]
    if 33550 not in tags or 33922 not in tags:
        raise InputError(
            "The TIFF has no georeference (ModelPixelScale and ModelTiepoint, or ModelTransformation)",
            file=path,
            advice="Export it as a GeoTIFF; a world file (.tfw) is not read",
        )
    (sx, sy, *_), (i, j, _, x, y, *_) = tags[33550], tags[33922]
    return np.array([[sx, 0.0, x - i * sx], [0.0, -sy, y + j * sy]])

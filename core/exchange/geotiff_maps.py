# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps as GeoTIFF (OGC 19-008r4): tiles of 32-bit floats with overviews, and what they mean in GDAL's metadata."""

from collections.abc import Mapping
from math import isfinite
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..georeference import GlobalShift, epsg_code
from ..hazard.cells import Cells
from ..hazard.maps import Layer
from ..output import output_file
from ..terrain.crs import IN_METRES
from ..vectors import Array

NODATA = -9999.0
"""In the file, where a map has nothing to say."""
UNKNOWN = "unknown"
TILE = 256
LARGE_BYTES = 3_500_000_000
"""Files that may be larger have 64-bit offsets."""
PIXEL_SCALE, TIE_POINT, GEOKEYS, GDAL_METADATA, GDAL_NODATA = 33550, 33922, 34735, 42112, 42113
DOUBLE, SHORT, ASCII = 12, 3, 2
MODEL_TYPE, PROJECTED, RASTER_TYPE, AREA, PROJECTED_CRS, LINEAR_UNIT, METRE = 1024, 1, 1025, 1, 3072, 3076, 9001
VERTICAL_CRS, VERTICAL_UNIT = 4096, 4099


def write_map(
    path: str | Path,
    cells: Cells,
    values: Array,
    layer: Layer,
    shift: GlobalShift,
    about: Mapping[str, str] | None = None,
) -> None:
    """Write one map.

    Parameters
    ----------
    values : (rows, columns), the first row in the south; NaN where there is nothing to say.
    layer : title, unit and meaning, which go into the file as the description of its band.
    shift : where the local origin is, and in which coordinate system. A system without an EPSG code is only named in
        the metadata, and one that is not known is "unknown" there.
    about : what else the metadata shall say.

    Raises
    ------
    InputError : another number of cells than the map has, cells that are not finite; the file cannot be written.

    Notes
    -----
    A cell of an overview has the greatest value of its four: a thin path, or the one cell in which blocks are quick,
    does not vanish when one zooms out.
    """
    if values.shape != cells.shape:
        raise InputError(f"A map of {values.shape} values is not one of {cells.shape} cells", file=Path(path))
    import tifffile

    said = {
        "MEANING": layer.meaning,
        "CRS": shift.crs or UNKNOWN,
        "VERTICAL_DATUM": shift.vertical or UNKNOWN,
        **(about or {}),
    }
    tags = [*_place(cells, shift, Path(path)), (GDAL_METADATA, ASCII, 0, _metadata(layer, said), True)]
    nodata = (GDAL_NODATA, ASCII, 0, f"{NODATA:g}", True)
    pictures = _with_overviews(np.ascontiguousarray(values[::-1], dtype=np.float32))
    size = sum(picture.nbytes for picture in pictures)
    with output_file(path) as draft, tifffile.TiffWriter(draft, bigtiff=size > LARGE_BYTES) as tiff:
        for place, picture in enumerate(pictures):
            tiff.write(
                np.where(np.isnan(picture), np.float32(NODATA), picture),
                tile=(TILE, TILE),
                compression="zlib",
                photometric="minisblack",
                subfiletype=1 if place else 0,
                software=False if place else "Rockfall",
                metadata=None,
                extratags=[nodata] if place else [*tags, nodata],
            )


def _place(cells: Cells, shift: GlobalShift, path: Path) -> list[tuple[int, int, int, object, bool]]:
    """The tags that say where the cells are, and in which coordinate system."""
    west, north = cells.x0_m + shift.x, cells.y0_m + cells.rows * cells.size_m + shift.y
    if not (isfinite(west) and isfinite(north) and cells.size_m > 0):
        raise InputError("The cells of the map have no finite place", file=path, advice="Give metres")
    tie = (0.0, 0.0, 0.0, round(west, 6), round(north, 6), 0.0)
    tags: list[tuple[int, int, int, object, bool]] = [
        (PIXEL_SCALE, DOUBLE, 3, (cells.size_m, cells.size_m, 0.0), True),
        (TIE_POINT, DOUBLE, 6, tie, True),
    ]
    code = epsg_code(shift.crs.removesuffix(IN_METRES))  # the unit that is stated goes before the system's own
    if code is not None:  # without one any key would make readers invent a system
        keys = [(MODEL_TYPE, PROJECTED), (RASTER_TYPE, AREA), (PROJECTED_CRS, code), (LINEAR_UNIT, METRE)]
        vertical = epsg_code(shift.vertical.removesuffix(IN_METRES))
        if vertical is not None:
            keys += [(VERTICAL_CRS, vertical), (VERTICAL_UNIT, METRE)]
        directory = [1, 1, 0, len(keys)] + [number for key, value in keys for number in (key, 0, 1, value)]
        tags.append((GEOKEYS, SHORT, len(directory), tuple(directory), True))
    return tags


def _metadata(layer: Layer, said: Mapping[str, str]) -> str:
    """As GDAL writes them: description and unit of the band, then words about the file. Tags are in ASCII."""
    band = [("DESCRIPTION", "description", layer.title), ("UNITTYPE", "unittype", layer.unit)]
    items = [f'<Item name="{name}" sample="0" role="{role}">{escape(text)}</Item>' for name, role, text in band if text]
    items += [f'<Item name="{escape(name)}">{escape(text)}</Item>' for name, text in said.items()]
    text = f"<GDALMetadata>{''.join(items)}</GDALMetadata>"
    return text.encode("ascii", "xmlcharrefreplace").decode("ascii")


def _with_overviews(picture: NDArray[np.float32]) -> list[NDArray[np.float32]]:
    """The picture, then each half as large as the one before until it fits into one tile."""
    pictures = [picture]
    while max(pictures[-1].shape) > TILE:
        last = pictures[-1]
        even = np.pad(last, [(0, length % 2) for length in last.shape], constant_values=np.nan)
        four = even.reshape(even.shape[0] // 2, 2, even.shape[1] // 2, 2)
        pictures.append(np.fmax.reduce(np.fmax.reduce(four, axis=3), axis=1))
    return pictures

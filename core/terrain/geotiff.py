# SPDX-License-Identifier: GPL-3.0-or-later
"""Elevation grids as GeoTIFF: tifffile reads the tags and what is uncompressed or deflated, OpenCV decodes the rest."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..memory import check_memory
from ..opencv import quiet_opencv
from ..reading import check_promise, reading
from ..vectors import Array
from .crs import crs_beside, crs_from_geokeys, vertical_from_geokeys
from .source import Source

PIXEL_IS_POINT, RASTER_TYPE = 2, 1025
BYTES_OF_HEIGHT = 200
"""Of memory, while a grid is read and meshed (measured)."""
NO_HEIGHT = 1e30
"""Beyond this a value is a filler that the file forgot to declare, as float32's lowest number often is."""
NONE, LZW, PACKBITS, DEFLATE = 1, 5, 32773, (8, 32946)
READABLE = (NONE, LZW, PACKBITS, *DEFLATE)
FLOATING_POINT = 3
"""Of the predictors, the one that tifffile leaves to other libraries."""
PHOTOMETRIC, ORIENTATION = 262, 274
DAMAGED = "It may be truncated: copy or export it again"
EXPORT_ADVICE = "Export the heights alone, uncompressed or with LZW or deflate, as 16-bit integers or 32-bit floats"


def read_geotiff(path: Path) -> Source:
    """Read a GeoTIFF of heights (OGC 19-008r4); the first band of several.

    Raises
    ------
    InputError : not a TIFF, truncated, without a georeference, an image instead of heights, another compression.
    """
    import tifffile

    if not path.stat().st_size:
        raise InputError("The file is empty", file=path, advice="Export it again")
    with reading(path, "TIFF file", DAMAGED), tifffile.TiffFile(path) as tiff:
        page = tiff.pages.first
        tags = {tag.code: tag.value for tag in page.tags}
        heights = _first_band(page, path).astype(np.float64)
        bands = page.samplesperpixel
    nodata = str(tags.get(42113, "")).strip("\0 ")
    try:
        no_value = float(nodata) if nodata else np.nan
    except ValueError as error:
        raise InputError(f'The NODATA value "{nodata}" is not a number', file=path, advice=DAMAGED) from error
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
    notes = [f"Grid of {columns} × {rows} heights, cell {cell[0]:g} × {cell[1]:g}."]
    if bands > 1:
        notes.append(f"The first of {bands} bands is taken as the height.")
    points = np.stack([x, y, heights], axis=-1).reshape(-1, 3)
    return Source(
        points,
        grid_shape=(rows, columns),
        crs=crs,
        geographic=geographic,
        notes=tuple(notes),
        vertical=vertical_from_geokeys(keys),
    )


def _first_band(page: Any, path: Path) -> NDArray[Any]:
    """(rows, columns) as they are stored."""
    bands, kind = page.samplesperpixel, page.dtype
    if bands > 1 and kind == np.uint8:
        raise InputError(
            f"The TIFF is a picture of {bands} bands, not heights", file=path, advice="Choose the elevation model"
        )
    if kind is None or kind.kind not in "iuf" or min(page.imagelength, page.imagewidth) < 2 or page.imagedepth > 1:
        shape = " × ".join(map(str, page.shape))
        raise InputError(f"The TIFF holds no grid of heights ({shape})", file=path, advice=EXPORT_ADVICE)
    _check_size(page, path)
    if page.bitspersample != 8 * kind.itemsize:
        raise InputError(f"The TIFF has heights of {page.bitspersample} bits", file=path, advice=EXPORT_ADVICE)
    compression = getattr(page.compression, "name", page.compression)
    if page.compression not in READABLE:
        raise InputError(f"The TIFF's compression ({compression}) cannot be read", file=path, advice=EXPORT_ADVICE)
    if page.compression in (NONE, *DEFLATE) and page.predictor != FLOATING_POINT:
        heights = page.asarray()
        return heights if bands == 1 else heights[0] if page.planarconfig == 2 else heights[..., 0]
    if bands > 1:
        raise InputError(
            f"The TIFF's {bands} bands cannot be read with this compression ({compression})",
            file=path,
            advice=EXPORT_ADVICE,
        )
    return _decoded(page, path)


def _check_size(page: Any, path: Path) -> None:
    """Before memory is taken: the strips or tiles that are there can hold so much, and it fits into the memory."""
    rows, columns = page.imagelength, page.imagewidth
    what = f"{rows} × {columns} heights"
    pieces = page.chunked if isinstance(page.chunked, tuple) else ()
    number = max(int(np.prod(pieces, dtype=np.float64)), 1)
    held = sum(1 for count in page.databytecounts if count)
    size = page.dtype.itemsize * page.samplesperpixel * rows * columns * min(held / number, 1.0)
    check_promise(what, int(size), path.stat().st_size, path, packed=page.compression != NONE)
    check_memory(f"A grid of {what}", rows * columns * BYTES_OF_HEIGHT, path)


def _decoded(page: Any, path: Path) -> NDArray[Any]:
    """The heights of a file of one band, by OpenCV."""
    data = np.fromfile(path, np.uint8)
    for code in (PHOTOMETRIC, ORIENTATION):  # else OpenCV would invert or turn the picture
        if code in page.tags:
            at = page.tags[code].valueoffset
            data[at : at + 2] = np.array([1], f"{page.parent.byteorder}u2").view(np.uint8)
    with quiet_opencv() as cv2:
        try:
            heights = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
        except cv2.error:  # more than 2³⁰ heights or 2³¹ bytes
            heights = None
    if heights is None or heights.shape != page.shape or heights.dtype != page.dtype.newbyteorder("="):
        raise InputError("The heights cannot be decoded", file=path, advice=f"Copy the file again. {EXPORT_ADVICE}")
    return heights


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

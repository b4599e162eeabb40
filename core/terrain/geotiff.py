# SPDX-License-Identifier: GPL-3.0-or-later
"""Elevation grids as GeoTIFF: tifffile reads the tags and what is uncompressed or deflated, OpenCV decodes the rest."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..formats.gdal_metadata import BandMetadata, band_beside, band_of_tag
from ..formats.world_file import read_world_file, world_file_beside
from ..memory import check_memory
from ..opencv import quiet_opencv
from ..reading import check_promise, reading
from ..vectors import Array, Mask
from .crs import CoordinateSystem, geokeys, system_beside, system_from_geokeys, system_from_wkt
from .no_data import ZERO_GAP_M, declared, empty_sentence, without_fillers
from .source import Source, unit_of_band

PIXEL_IS_POINT, RASTER_TYPE = 2, 1025
PIXEL_SCALE, TIE_POINTS, TRANSFORMATION = 33550, 33922, 34264
GEOKEYS, KEY_DOUBLES, KEY_TEXTS, GDAL_METADATA, GDAL_NODATA = 34735, 34736, 34737, 42112, 42113
BYTES_OF_HEIGHT = 200
"""Of memory, while a grid is read and meshed (measured)."""
NONE, LZW, PACKBITS, DEFLATE = 1, 5, 32773, (8, 32946)
READABLE = (NONE, LZW, PACKBITS, *DEFLATE)
FLOATING_POINT = 3
"""Of the predictors, the one that tifffile leaves to other libraries."""
PHOTOMETRIC, ORIENTATION = 262, 274
GREY = (0, 1)
"""Photometric interpretations of a single number: neither colours nor a palette."""
REDUCED, MASK = 1, 4
"""Bits of NewSubfileType: an overview, and a mask."""
ALPHA = (1, 2)
"""Kinds of extra samples that say which pixels are there."""
MOST_PAGES = 200
"""Of a file are looked at."""
SAME_PLACE = 0.01
"""Of a cell, by which two statements of a place may differ."""
DAMAGED = "It may be truncated: copy or export it again"
EXPORT_ADVICE = "Export the heights alone, uncompressed or with LZW or deflate, as 16-bit integers or 32-bit floats"


def read_geotiff(path: Path) -> Source:
    """Read a GeoTIFF of heights (OGC 19-008r4); the first band of several.

    Scale, offset, unit and no-data value of GDAL's metadata are applied, in the file or in the ``.aux.xml`` beside it;
    so are masks and alpha bands. The place is that of the ``.aux.xml``, of the GeoTIFF's tags, or of a world file.

    Raises
    ------
    InputError : not a TIFF, truncated, without a georeference, an image instead of heights, another compression, a mask
        or metadata that cannot be read.
    """
    import tifffile

    if not path.stat().st_size:
        raise InputError("The file is empty", file=path, advice="Export it again")
    with reading(path, "TIFF file", DAMAGED), tifffile.TiffFile(path) as tiff:
        pages: list[Any] = [tiff.pages[i] for i in range(MOST_PAGES) if i == 0 or _has_page(tiff, i)]
        page = next((one for one in pages if not int(one.subfiletype) & (REDUCED | MASK)), pages[0])
        tags = {tag.code: tag.value for tag in page.tags}
        values, alpha = _first_band(page, path)
        missing = _missing_pieces(page)
        masked, more = _masked(pages, page, path)
        bands = page.samplesperpixel
    band = band_beside(path).filled(band_of_tag(str(tags.get(GDAL_METADATA, "")), path))
    rows, columns = values.shape
    known = [
        (declared(values, band.no_data or str(tags.get(GDAL_NODATA, ""))), ""),
        (alpha == 0 if alpha is not None else None, "the alpha band"),
        (masked, "the file's mask"),
        (missing, "a piece of the file that is not there"),
    ]
    notes, empty = [], np.zeros(values.shape, np.bool_)
    for cells, why in known:
        if cells is not None and cells.any():
            notes += [empty_sentence(int(cells.sum()), why)] if why else []
            empty |= cells
    scale, offset = 1.0 if band.scale is None else band.scale, band.offset or 0.0
    heights, filled = without_fillers(values.astype(np.float64), empty, None if offset else ZERO_GAP_M / abs(scale))
    notes += filled
    if scale != 1.0 or offset:
        heights = heights * scale + offset
        notes.append(f"Heights are {scale:g} times the numbers of the file, plus {offset:g}, as it says.")
    affine, where = _affine(tags, band, path)
    system = _system(tags, band, path)
    height_unit = unit_of_band(band.unit, path)
    column, row = np.meshgrid(np.arange(columns), np.arange(rows))
    x = affine[0, 0] * column + affine[0, 1] * row + affine[0, 2]
    y = affine[1, 0] * column + affine[1, 1] * row + affine[1, 2]
    cell = np.hypot(*affine[:, :2])
    first = [f"Grid of {columns} × {rows} heights, cell {cell[0]:g} × {cell[1]:g}."]
    if bands > 1:
        first.append(f"The first of {bands} bands is taken as the height.")
    if more:
        first.append(f"The first of {more + 1} pictures in the file is taken as the heights.")
    if values.dtype == np.uint8:
        first.append("The heights have 8 bits, 0 to 255: check that this is an elevation model, not a picture of one.")
    points = np.stack([x, y, heights], axis=-1).reshape(-1, 3)
    return Source(
        points,
        grid_shape=(rows, columns),
        system=system.with_height_unit(height_unit),
        notes=(*first, *where, *notes),
    )


def _has_page(tiff: Any, number: int) -> bool:
    """Whether there is a page of a number; pages are found one after the other."""
    try:
        tiff.pages[number]
    except IndexError:
        return False
    return True


def _first_band(page: Any, path: Path) -> tuple[NDArray[Any], NDArray[Any] | None]:
    """(rows, columns) as they are stored, and the band that says which of them count."""
    bands, kind = page.samplesperpixel, page.dtype
    if bands > 1 and kind == np.uint8:
        raise InputError(
            f"The TIFF is a picture of {bands} bands, not heights", file=path, advice="Choose the elevation model"
        )
    if int(page.photometric) not in GREY:
        name = getattr(page.photometric, "name", str(page.photometric)).lower()
        what = "a palette of colours" if name == "palette" else f"colours ({name})"
        raise InputError(
            f"The TIFF is a picture with {what}, not heights", file=path, advice="Choose the elevation model"
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
        if bands == 1:
            return heights, None
        each = heights if page.planarconfig == 2 else np.moveaxis(heights, -1, 0)
        extra = tuple(map(int, page.extrasamples))
        return each[0], next((each[bands - len(extra) + i] for i, kind in enumerate(extra) if kind in ALPHA), None)
    if bands > 1:
        raise InputError(
            f"The TIFF's {bands} bands cannot be read with this compression ({compression})",
            file=path,
            advice=EXPORT_ADVICE,
        )
    return _decoded(page, path), None


def _missing_pieces(page: Any) -> Mask | None:
    """Cells of the strips or tiles of the first band that the file leaves out, as GDAL does where all is empty."""
    rows, columns = page.imagelength, page.imagewidth
    height, width = (page.tilelength, page.tilewidth) if page.is_tiled else (min(page.rowsperstrip, rows), columns)
    across, down = -(-columns // width), -(-rows // height)
    left_out = [i for i, count in enumerate(page.databytecounts[: across * down]) if not count]
    if not left_out:
        return None
    cells = np.zeros((rows, columns), np.bool_)
    for i in left_out:
        row, column = height * (i // across), width * (i % across)
        cells[row : row + height, column : column + width] = True
    return cells


def _masked(pages: list[Any], page: Any, path: Path) -> tuple[Mask | None, int]:
    """Cells that a mask in the file, or in the ``.msk`` beside it, takes out; and how many more pictures there are."""
    import tifffile

    shape = (page.imagelength, page.imagewidth)
    masks = [one for one in pages if int(one.subfiletype) & MASK and (one.imagelength, one.imagewidth) == shape]
    more = sum(1 for one in pages if one is not page and not int(one.subfiletype) & (REDUCED | MASK))
    if masks:
        return _outside(masks[0], path), more
    beside = path.with_name(f"{path.name}.msk")
    if not beside.is_file():
        return None, more
    with reading(beside, "mask", "Remove it, or export the grid again"), tifffile.TiffFile(beside) as tiff:
        mask: Any = tiff.pages[0]
        if (mask.imagelength, mask.imagewidth) != shape:
            raise InputError(
                "The mask has another size than its grid", file=beside, advice="Remove it, or export again"
            )
        return _outside(mask, beside), more


def _outside(mask: Any, path: Path) -> Mask:
    if mask.compression not in (NONE, *DEFLATE) or mask.dtype is None or mask.dtype.kind not in "bu":
        raise InputError("The TIFF's mask cannot be read", file=path, advice=f"{EXPORT_ADVICE}, with a no-data value")
    _check_size(mask, path)
    values = mask.asarray()
    if values.ndim > 2:
        values = values[0] if mask.planarconfig == 2 else values[..., 0]
    return np.asarray(values == 0)


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


def _system(tags: dict[int, Any], band: BandMetadata, path: Path) -> CoordinateSystem:
    """Of the ``.aux.xml``, of the GeoTIFF's keys, or of the ``.prj`` beside it."""
    directory = tags.get(GEOKEYS, ())
    numbers = [int(n) for n in directory] if isinstance(directory, tuple | list) else []
    entries = [(numbers[i], numbers[i + 1], numbers[i + 2], numbers[i + 3]) for i in range(4, len(numbers) - 3, 4)]
    doubles = np.atleast_1d(tags.get(KEY_DOUBLES, ())).astype(np.float64).tolist()
    own = system_from_geokeys(geokeys(entries, doubles, str(tags.get(KEY_TEXTS, ""))))
    own = system_from_wkt(band.wkt).filled(own)
    return own if own.name or own.kind != "plane" else own.filled(system_beside(path))


def _affine(tags: dict[int, Any], band: BandMetadata, path: Path) -> tuple[Array, list[str]]:
    """(2, 3) from (column, row, 1) of the centre of a cell to x, y; and what to say of it."""
    own, notes = _affine_of_tags(tags)
    if band.affine is not None:
        return _of_centres(band.affine), notes
    world = world_file_beside(path)
    counted = own is not None and (np.abs(_of_corners(own)) == np.eye(2, 3)).all()
    if own is not None and not (counted and (world is not None or own[1, 1] > 0)):
        if world is not None:
            other = read_world_file(world)
            cell = float(np.hypot(*own[:, 0]))
            if np.abs(own[:, 2] - other[:, 2]).max() > SAME_PLACE * cell:
                notes.append(f"{world.name} says another place than the GeoTIFF, which goes before it.")
        return own, notes
    if world is not None:
        return read_world_file(world), [*notes, f"Its place is that of {world.name}."]
    if own is None and TIE_POINTS in tags:
        raise InputError(
            f"The TIFF has control points ({len(tags[TIE_POINTS]) // 6}), not a georeference",
            file=path,
            advice="Rectify it first (gdalwarp), so that its cells are a grid",
        )
    raise InputError(
        "The TIFF has no georeference (ModelPixelScale and ModelTiepoint, or ModelTransformation)"
        if own is None
        else "The TIFF's georeference only counts its pixels",
        file=path,
        advice="Export it as a GeoTIFF, or with a world file (.tfw)",
    )


def _affine_of_tags(tags: dict[int, Any]) -> tuple[Array | None, list[str]]:
    """(2, 3) from (column, row, 1) of the centre of a cell to x, y; None when the GeoTIFF does not say it."""
    notes: list[str] = []
    directory = tags.get(GEOKEYS, ())
    keys = directory[4:] if isinstance(directory, tuple | list) else ()
    is_point = any(keys[i] == RASTER_TYPE and keys[i + 3] == PIXEL_IS_POINT for i in range(0, len(keys) - 3, 4))
    if TRANSFORMATION in tags:
        matrix = np.array(tags[TRANSFORMATION], dtype=np.float64).reshape(4, 4)
        affine = matrix[:2, [0, 1, 3]]
    elif PIXEL_SCALE in tags and TIE_POINTS in tags:
        (sx, sy, *sz), (i, j, _, x, y, *_) = tags[PIXEL_SCALE], tags[TIE_POINTS]
        if sy < 0:
            sy = -sy
            notes.append("Its rows are taken to run south, though the file gives them a negative height, as GDAL does.")
        if sz and sz[0] not in (0.0, 1.0):
            notes.append(f"ModelPixelScale gives z a scale of {sz[0]:g}, which is not applied to heights, as in GDAL.")
        affine = np.array([[sx, 0.0, x - i * sx], [0.0, -sy, y + j * sy]])
    else:
        return None, notes
    return affine if is_point else _of_centres(affine), notes


def _of_corners(affine: Array) -> Array:
    """From an affine (2, 3) of the centres of cells."""
    return np.column_stack([affine[:, :2], affine[:, 2] - affine[:, :2].sum(axis=1) / 2])


def _of_centres(affine: Array) -> Array:
    """From an affine (2, 3) of the corners of cells."""
    return np.column_stack([affine[:, :2], affine[:, 2] + affine[:, :2].sum(axis=1) / 2])

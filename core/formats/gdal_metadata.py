# SPDX-License-Identifier: GPL-3.0-or-later
"""What GDAL writes about a raster: the XML in a tag of a GeoTIFF, and the file ``.aux.xml`` beside any format."""

from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from ..errors import InputError
from ..vectors import Array

MOST_BYTES = 10_000_000


@dataclass(frozen=True, eq=False)
class BandMetadata:
    """About one band; None or empty where nothing is said.

    Attributes
    ----------
    scale, offset : a value is scale · number + offset.
    unit : of the values, as it is written.
    no_data : the number that stands for no value, before the scale, as it is written.
    wkt : the coordinate system.
    affine : (2, 3) from (column, row, 1) of the corner of a pixel to x, y.
    """

    scale: float | None = None
    offset: float | None = None
    unit: str = ""
    no_data: str = ""
    wkt: str = ""
    affine: Array | None = None

    def filled(self, other: "BandMetadata") -> "BandMetadata":
        """With what another one says where this one says nothing."""
        return BandMetadata(
            other.scale if self.scale is None else self.scale,
            other.offset if self.offset is None else self.offset,
            self.unit or other.unit,
            self.no_data or other.no_data,
            self.wkt or other.wkt,
            other.affine if self.affine is None else self.affine,
        )


def band_of_tag(text: str, path: Path, band: int = 0) -> BandMetadata:
    """From the tag GDAL_METADATA (42112) of a GeoTIFF; bands are counted from 0.

    Raises
    ------
    InputError : it is not XML, a scale or an offset is not a number.
    """
    if not text.strip("\0 \n"):
        return BandMetadata()
    found = {
        str(item.get("role")): (item.text or "").strip()
        for item in _root(text, path, path).iter("Item")
        if item.get("sample") == str(band) and item.get("role") in ("scale", "offset", "unittype")
    }
    scale, offset = (_number(found.get(role, ""), role, path) for role in ("scale", "offset"))
    return BandMetadata(scale, offset, found.get("unittype", ""))


def band_beside(path: Path, band: int = 0) -> BandMetadata:
    """From the ``.aux.xml`` beside a raster, if there is one; it goes before what the raster itself says, as in GDAL.

    Raises
    ------
    InputError : see `band_of_tag`; the numbers of its place are not six.
    """
    file = path.with_name(f"{path.name}.aux.xml")
    if not file.is_file():
        return BandMetadata()
    if file.stat().st_size > MOST_BYTES:
        raise InputError("The file beside the grid is too long", file=file, advice="Remove it, or export again")
    root = _root(file.read_text("utf-8", "replace"), file, path)
    place = _text(root, "GeoTransform")
    own = next((one for one in root.findall("PAMRasterBand") if one.get("band", "1") == str(band + 1)), None)
    affine = None if not place else _affine(place, file)
    if own is None:
        return BandMetadata(wkt=_text(root, "SRS"), affine=affine)
    return BandMetadata(
        _number(_text(own, "Scale"), "scale", file),
        _number(_text(own, "Offset"), "offset", file),
        _text(own, "UnitType"),
        _text(own, "NoDataValue"),
        _text(root, "SRS"),
        affine,
    )


def _root(text: str, file: Path, raster: Path) -> ElementTree.Element:
    try:
        if "<!DOCTYPE" in text or "<!ENTITY" in text:
            raise ElementTree.ParseError("it defines entities")
        return ElementTree.fromstring(text.strip("\0 \n"))
    except ElementTree.ParseError as error:
        raise InputError(
            f"GDAL's metadata of {raster.name} cannot be read ({error}): they may scale the heights",
            file=file,
            advice="Export the grid again",
        ) from error


def _text(element: ElementTree.Element, name: str) -> str:
    found = element.find(name)
    return "" if found is None else (found.text or "").strip()


def _number(text: str, what: str, file: Path) -> float | None:
    if not text:
        return None
    try:
        number = float(text)
    except ValueError:
        number = np.nan
    if not isfinite(number) or (what == "scale" and number == 0.0):
        raise InputError(f'The {what} "{text[:40]}" of the heights is no number to use', file=file, advice="Correct it")
    return number


def _affine(text: str, file: Path) -> Array:
    try:
        numbers = [float(word) for word in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != 6 or not np.isfinite(numbers).all():
        raise InputError("The GeoTransform does not have six numbers", file=file, advice="Correct or remove it")
    x, x_column, x_row, y, y_column, y_row = numbers
    return np.array([[x_column, x_row, x], [y_column, y_row, y]])

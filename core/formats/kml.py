# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines and polygons of KML (OGC 12-007r2), plain or packed as KMZ. Coordinates are degrees of WGS 84.

Heights count only where a geometry says that they are absolute; all others are on the ground, or relative to it.
"""

import re
import zipfile
from collections.abc import Iterator
from pathlib import Path
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

import numpy as np

from ..errors import InputError
from ..vectors import Array
from .archives import MOST_BYTES, names_in, unpacked
from .features import MOST_POINTS, Feature, Features

SUFFIXES = (".kml", ".kmz")
WGS84 = "EPSG:4326"
DEEPEST, MOST_ELEMENTS = 100, 2_000_000
ADVICE = "Save it again, or as GeoJSON"


def read_kml(path: Path) -> Features:
    """Read a file, or the main one of an archive.

    Raises
    ------
    InputError : no KML, a damaged one, one with definitions of its own (DTD), only links to other files, a feature
        without a geometry, coordinates that are no numbers.
    """
    root = _tree(_content(path), path)
    placemarks = list(root.iter("Placemark"))
    if not placemarks and next(root.iter("NetworkLink"), None) is not None:
        raise InputError(
            "This file only links to another", file=path, advice="Open it in Google Earth, and save the place itself"
        )
    found: list[Feature] = []
    left = MOST_POINTS
    for number, placemark in enumerate(placemarks, start=1):
        features = list(_features(placemark, number, path))
        if not features:
            raise InputError(f"The place {number} has no geometry", file=path, advice="Delete it, or draw it")
        left -= sum(len(part) for feature in features for part in feature.parts)
        if left < 0:
            raise InputError(f"It has more than {MOST_POINTS:,} points", file=path, advice="Simplify it")
        found += features
    return Features(tuple(found), WGS84)


def _content(path: Path) -> bytes:
    if path.suffix.lower() != ".kmz":
        if path.stat().st_size > MOST_BYTES:
            raise InputError(f"It is larger than {MOST_BYTES // 10**6} MB", file=path, advice="Simplify it")
        return path.read_bytes()
    with zipfile.ZipFile(path) as archive:
        names = names_in(archive, ".kml", path)
        if not names:
            raise InputError("The archive has no .kml", file=path, advice=ADVICE)
        return unpacked(archive, "doc.kml" if "doc.kml" in names else names[0], path)


def _tree(data: bytes, path: Path) -> Element:
    """The elements, their names without namespaces."""
    builder, depth, elements = TreeBuilder(), 0, 0
    parser = expat.ParserCreate()
    parser.buffer_text = True

    def start(name: str, attributes: dict[str, str]) -> None:
        nonlocal depth, elements
        depth, elements = depth + 1, elements + 1
        if depth > DEEPEST:
            raise InputError("It is nested too deeply", file=path, advice=ADVICE)
        if elements > MOST_ELEMENTS:
            raise InputError(f"It has more than {MOST_ELEMENTS:,} elements", file=path, advice="Simplify it")
        builder.start(name.rpartition(":")[2], attributes)

    def end(name: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(name.rpartition(":")[2])

    def refuse(*_: object) -> None:
        raise InputError("It defines words of its own (DTD), which no KML needs", file=path, advice=ADVICE)

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = builder.data, refuse
    try:
        parser.Parse(data, True)
        root = builder.close()
    except expat.ExpatError as error:
        raise InputError(f"This is no KML, or damaged: {error}", file=path, advice=ADVICE) from error
    if root.tag != "kml" and next(root.iter("Placemark"), None) is None:
        raise InputError(f"This is no KML: it begins with <{root.tag[:40]}>", file=path, advice=ADVICE)
    return root


def _features(placemark: Element, number: int, path: Path) -> Iterator[Feature]:
    properties = _properties(placemark)
    for element in _geometries(placemark):
        absolute = _text(element, "altitudeMode") == "absolute"
        match element.tag:
            case "LineString" | "LinearRing":
                points = _points(_text(element, "coordinates"), absolute, number, path)
                yield Feature("line", element.tag, number, (points,), properties)
            case "Polygon":
                outer = [
                    one for side in element if side.tag == "outerBoundaryIs" for one in side if one.tag == "LinearRing"
                ]
                inner = [
                    one for side in element if side.tag == "innerBoundaryIs" for one in side if one.tag == "LinearRing"
                ]
                if len(outer) != 1:
                    raise InputError(f"The polygon {number} has no outline", file=path, advice="Draw it again")
                rings = tuple(_points(_text(ring, "coordinates"), absolute, number, path) for ring in (*outer, *inner))
                yield Feature("polygon", "Polygon", number, rings, properties)
            case _:
                yield Feature("", element.tag, number, (), properties)


def _geometries(element: Element) -> Iterator[Element]:
    """Single geometries, those of collections too."""
    for one in element:
        if one.tag in ("MultiGeometry", "MultiTrack"):
            yield from _geometries(one)
        elif one.tag in ("LineString", "LinearRing", "Polygon", "Point", "Model", "Track"):
            yield one


def _properties(placemark: Element) -> dict[str, object]:
    """The name, and what programs have added."""
    found: dict[str, object] = {}
    for one in placemark.iter("Data"):
        value = _text(one, "value")
        if value and one.get("name"):
            found[str(one.get("name"))] = value
    for one in placemark.iter("SimpleData"):
        if one.text and one.get("name"):
            found[str(one.get("name"))] = one.text.strip()
    name = _text(placemark, "name")
    return {"name": name, **{key: value for key, value in found.items() if key != "name"}} if name else found


def _text(element: Element, name: str) -> str:
    return (element.findtext(name) or "").strip()


def _points(text: str, absolute: bool, number: int, path: Path) -> Array:
    """(k, 3) longitude, latitude [°] and height [m], NaN where it is not absolute."""
    places = re.sub(r"\s*,\s*", ",", text).split()
    try:
        rows = [[float(part) for part in place.split(",")] for place in places]
        if any(len(row) not in (2, 3) for row in rows):
            raise ValueError
    except ValueError as error:
        raise InputError(
            f"The place {number} has coordinates that are not two or three numbers", file=path, advice="Draw it again"
        ) from error
    return np.array(
        [[row[0], row[1], row[2] if absolute and len(row) > 2 else np.nan] for row in rows], dtype=np.float64
    ).reshape(-1, 3)

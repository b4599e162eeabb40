# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines and polygons of GeoJSON (RFC 7946, and the ``crs`` of 2008 that GIS still write)."""

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..reading import reading
from ..vectors import Array
from .features import Feature, Features, Kind

SUFFIXES = (".geojson", ".json")
KINDS: Mapping[str, Kind] = {
    "LineString": "line",
    "MultiLineString": "line",
    "Polygon": "polygon",
    "MultiPolygon": "polygon",
}
WGS84 = "EPSG:4326"
DEEPEST = 20
"""Collections within collections."""

type Geometry = tuple[int, dict[str, Any], Mapping[str, object]]
"""Number of the feature, geometry, properties."""


def read_geojson(path: Path) -> Features:
    """Read a file.

    Raises
    ------
    InputError : no GeoJSON, a feature without a geometry, coordinates that are no numbers.
    """
    with reading(path, "GeoJSON file", "Export it again"):
        text = path.read_text(encoding="utf-8-sig")
        content = json.loads(text)
        if "\\ud" in text.lower():  # half of a pair is no character, and no table could be written with it
            json.dumps(content, ensure_ascii=False).encode()
    if not isinstance(content, dict):
        raise InputError("This is no GeoJSON: it has no object", file=path, advice="Export it again")
    found = []
    for number, geometry, properties in _geometries(content, path):
        found += _features_of(geometry, number, properties, path)
    return Features(tuple(found), _crs(content))


def _features_of(
    geometry: Mapping[str, Any], number: int, properties: Mapping[str, object], path: Path
) -> list[Feature]:
    """The single lines and polygons of a geometry; what is neither comes without parts."""
    type_ = str(geometry.get("type"))
    kind = KINDS.get(type_)
    if kind is None:
        return [Feature("", type_, number)]
    where, coordinates = f"The geometry {number}", geometry.get("coordinates")
    groups = _listed(coordinates, where, path) if type_.startswith("Multi") else [coordinates]
    found = []
    for group in groups:
        parts = [group] if kind == "line" else _listed(group, where, path)
        found.append(Feature(kind, type_, number, tuple(_points(part, where, path) for part in parts), properties))
    return found


def _crs(content: Mapping[str, Any]) -> str:
    """The system that a file names, as a code; empty without one."""
    named = content.get("crs")
    properties = named.get("properties") if isinstance(named, dict) else None
    text = str(properties.get("name", "")) if isinstance(properties, dict) else ""
    if text.strip().upper().endswith("CRS84"):
        return WGS84
    code = re.search(r"EPSG:+(?:[\d.]*:)?(\d+)$", text.strip())
    return f"EPSG:{code[1]}" if code else ""


def _geometries(content: Mapping[str, Any], path: Path) -> Iterator[Geometry]:
    """All single geometries with the numbers and properties of their features."""
    if content.get("type") != "FeatureCollection":
        yield from _geometries_of(content, path, 1, {}, 0)
        return
    for number, one in enumerate(_listed(content.get("features"), "The list of features", path), start=1):
        yield from _geometries_of(one, path, number, {}, 0)


def _geometries_of(
    content: object, path: Path, number: int, properties: Mapping[str, object], depth: int
) -> Iterator[Geometry]:
    if not isinstance(content, dict):
        raise InputError(
            f"The feature or geometry {number} is empty", file=path, advice="Leave it out, or export again"
        )
    if depth > DEEPEST:
        raise InputError("Its collections are nested too deeply", file=path, advice="Export single lines and polygons")
    match content.get("type"):
        case "Feature":
            own = content.get("properties")
            own = own if isinstance(own, dict) else {}
            yield from _geometries_of(content.get("geometry"), path, number, own, depth + 1)
        case "GeometryCollection":
            for one in _listed(content.get("geometries"), "The list of geometries", path):
                yield from _geometries_of(one, path, number, properties, depth + 1)
        case str():
            yield number, content, properties
        case _:
            raise InputError("This is no GeoJSON: an object has no type", file=path, advice="Export it again")


def _listed(value: object, what: str, path: Path) -> list[Any]:
    if not isinstance(value, list):
        raise InputError(f"{what} has no list, where GeoJSON needs one", file=path, advice="Export it again")
    return value


def _points(value: object, what: str, path: Path) -> Array:
    """(k, 3), NaN for heights that are not there."""
    rows = _listed(value, what, path)
    try:
        points = np.array([[float(row[0]), float(row[1]), float(row[2]) if len(row) > 2 else np.nan] for row in rows])
    except (TypeError, ValueError, IndexError, KeyError, OverflowError) as error:
        raise InputError(
            f"{what} has a point that is not two or three numbers", file=path, advice="Correct it"
        ) from error
    return points.reshape(-1, 3)

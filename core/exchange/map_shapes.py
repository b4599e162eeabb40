# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines and polygons by name, from GeoJSON, a GeoPackage or a table of their points, in survey coordinates.

    name,x_m,y_m,z_m
    cliff,2600010.0,1200040.0,
    cliff,2600030.0,1200044.0,

A table's rows are points in their order; `name` tells several shapes apart, and `z_m` may be missing or empty. What
else is there is a property of the shape: the first cell of each that is not empty.
"""

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ..errors import InputError
from ..georeference import GlobalShift
from ..plausibility import GREATEST_M
from ..reading import reader, reading
from ..simulation.polygons import Polygon
from ..terrain.crs import named_system, surely_different
from ..vectors import Array
from .csv_text import read_table
from .geopackage_shapes import read_features

Kind = Literal["line", "polygon"]
REQUIRED = ("x_m", "y_m")
KNOWN = (*REQUIRED, "z_m", "name")
GEOJSON, GEOPACKAGE = (".geojson", ".json"), (".gpkg",)
GEOMETRIES: Mapping[str, Kind] = {
    "LineString": "line",
    "MultiLineString": "line",
    "Polygon": "polygon",
    "MultiPolygon": "polygon",
}


@dataclass(frozen=True, eq=False)
class MapShape:
    """A line, or a polygon with its holes.

    Attributes
    ----------
    name : empty where the file gives none.
    parts : a line's points (k, 3), or a polygon's rings, local [m]; NaN for heights that are not given.
    properties : what else the file says of it.
    """

    name: str
    parts: tuple[Array, ...]
    properties: Mapping[str, object] = field(default_factory=dict)


@reader("map")
def read_lines(path: str | Path, shift: GlobalShift) -> tuple[MapShape, ...]:
    """The lines of a file.

    Raises
    ------
    InputError : no such file, neither GeoJSON nor a GeoPackage nor a table, polygons in it, none at all, another
        coordinate system, coordinates that are no numbers.
    """
    return _read(Path(path), "line", shift)


@reader("map")
def read_polygons(path: str | Path, shift: GlobalShift) -> tuple[MapShape, ...]:
    """The polygons of a file; see `read_lines`."""
    return _read(Path(path), "polygon", shift)


def polygon_of(shape: MapShape, path: str | Path) -> Polygon:
    """A shape as a polygon in plan.

    Raises
    ------
    InputError : see `Polygon`.
    """
    try:
        return Polygon(shape.name, tuple(part[:, :2] for part in shape.parts))
    except InputError as error:
        raise InputError(error.problem, file=path, advice=error.advice) from error


def _read(path: Path, kind: Kind, shift: GlobalShift) -> tuple[MapShape, ...]:
    if path.suffix.lower() in GEOJSON:
        shapes = _read_geojson(path, kind, shift)
    elif path.suffix.lower() in GEOPACKAGE:
        shapes = _shapes(*read_features(path, GEOMETRIES, kind), path, kind, shift)
    else:
        shapes = _read_points(path, kind, shift)
    least = 2 if kind == "line" else 3
    for shape in shapes:
        for part in shape.parts:
            different = len(np.unique(part if kind == "line" else part[:, :2], axis=0))
            if different < least:
                name = f" {shape.name}" if shape.name else ""
                raise InputError(
                    f"The {kind}{name} has {different} different point{'s' if different > 1 else ''}",
                    file=path,
                    advice=f"A {kind} needs at least {least}",
                )
    return shapes


def _read_points(path: Path, kind: Kind, shift: GlobalShift) -> tuple[MapShape, ...]:
    table = read_table(path, REQUIRED, KNOWN)
    places = np.column_stack([table.numbers(name, required=True) for name in REQUIRED])
    places = shift.to_local(np.column_stack([places, table.numbers("z_m")]))
    names = np.array(table.text("name"), dtype=np.str_)
    rest = table.rest(KNOWN)
    shapes = []
    for name in dict.fromkeys(names.tolist()):
        rows = np.flatnonzero(names == name)
        properties: dict[str, object] = {}
        for key, cells in rest.items():
            said = [cell for cell in dict.fromkeys(cells[rows].tolist()) if cell]
            if len(said) > 1:
                i = int(rows[np.flatnonzero(cells[rows] == said[1])[0]])
                raise table.error(i, f"{key} of {name or 'the ' + kind} is {said[0]} and {said[1]}", "Give one value")
            if said:
                properties[key] = said[0]
        shapes.append(MapShape(name, (places[rows],), properties))
    return tuple(shapes)


def _read_geojson(path: Path, kind: Kind, shift: GlobalShift) -> tuple[MapShape, ...]:
    content = _json(path)
    return _shapes(_crs(content), _geometries(content, path, {}), path, kind, shift)


def _shapes(
    crs: str,
    features: Iterable[tuple[dict[str, Any], Mapping[str, object]]],
    path: Path,
    kind: Kind,
    shift: GlobalShift,
) -> tuple[MapShape, ...]:
    known = named_system(crs)
    if surely_different(crs, shift.crs):
        raise InputError(
            f"The file is in {crs}, the terrain in {shift.crs}", file=path, advice="Export it in the terrain's system"
        )
    shapes = []
    for number, (geometry, properties) in enumerate(features, start=1):
        type_ = geometry.get("type")
        where = f"The geometry {number}"
        if GEOMETRIES.get(str(type_)) != kind:
            raise InputError(
                f"{where} is a {type_}, where {kind}s are needed", file=path, advice=f"Give a file with {kind}s alone"
            )
        name = next((str(properties[key]) for key in ("name", "Name", "NAME") if properties.get(key) is not None), "")
        rest = {key: value for key, value in properties.items() if key not in ("name", "Name", "NAME")}
        coordinates = geometry.get("coordinates")
        groups: list[Any] = [coordinates] if type_ in ("LineString", "Polygon") else _listed(coordinates, where, path)
        for group in groups:
            parts = [group] if kind == "line" else _listed(group, where, path)
            arrays = tuple(_places(part, where, path, shift, known.unit_m or 1.0) for part in parts)
            if kind == "polygon":
                arrays = tuple(
                    ring[:-1] if len(ring) > 1 and (ring[0, :2] == ring[-1, :2]).all() else ring for ring in arrays
                )
            shapes.append(MapShape(name, arrays, rest))
    if not shapes:
        raise InputError(f"The file has no {kind}", file=path, advice=f"Export at least one {kind}")
    return tuple(shapes)


def _json(path: Path) -> dict[str, Any]:
    with reading(path, "GeoJSON file", "Export it again"):
        text = path.read_text(encoding="utf-8-sig")
        content = json.loads(text)
        if "\\ud" in text.lower():  # half of a pair is no character, and no table could be written with it
            json.dumps(content, ensure_ascii=False).encode()
    if not isinstance(content, dict):
        raise InputError("This is no GeoJSON: it has no object", file=path, advice="Export it again")
    return content


def _crs(content: Mapping[str, Any]) -> str:
    """The system that a file names, which GeoJSON of 2008 did and GIS still write; empty without one."""
    named = content.get("crs")
    properties = named.get("properties") if isinstance(named, dict) else None
    text = str(properties.get("name", "")) if isinstance(properties, dict) else ""
    code = re.search(r"EPSG:+(?:[\d.]*:)?(\d+)$", text.strip())
    return f"EPSG:{code[1]}" if code else ""


def _geometries(
    content: object, path: Path, properties: Mapping[str, object]
) -> Iterator[tuple[dict[str, Any], Mapping[str, object]]]:
    """All single geometries with the properties of their features."""
    if not isinstance(content, dict):
        raise InputError("A feature or geometry is empty", file=path, advice="Leave it out, or export again")
    match content.get("type"):
        case "FeatureCollection":
            for one in _listed(content.get("features"), "The list of features", path):
                yield from _geometries(one, path, {})
        case "Feature":
            own = content.get("properties")
            yield from _geometries(content.get("geometry"), path, own if isinstance(own, dict) else {})
        case "GeometryCollection":
            for one in _listed(content.get("geometries"), "The list of geometries", path):
                yield from _geometries(one, path, properties)
        case str():
            yield content, properties
        case _:
            raise InputError("This is no GeoJSON: an object has no type", file=path, advice="Export it again")


def _listed(value: object, what: str, path: Path) -> list[Any]:
    if not isinstance(value, list):
        raise InputError(f"{what} has no list, where GeoJSON needs one", file=path, advice="Export it again")
    return value


def _places(value: object, what: str, path: Path, shift: GlobalShift, unit_m: float) -> Array:
    """(k, 3) local points [m] of some in the unit of the file's system; NaN for heights that are not there."""
    rows = _listed(value, what, path)
    try:
        places = np.array([[float(row[0]), float(row[1]), float(row[2]) if len(row) > 2 else np.nan] for row in rows])
    except (TypeError, ValueError, IndexError, KeyError, OverflowError) as error:
        raise InputError(
            f"{what} has a point that is not two or three numbers", file=path, advice="Correct it"
        ) from error
    places = places.reshape(-1, 3)
    if not np.isfinite(places[:, :2]).all():
        raise InputError(f"{what} has a coordinate that is not finite", file=path, advice="Correct it")
    if (np.abs(places) >= GREATEST_M).any():
        raise InputError(f"{what} has a coordinate beyond every survey (1e9 m)", file=path, advice="Correct it")
    if shift.vector[:2].any() and len(places) and (np.abs(places[:, :2]) <= (180.0, 90.0)).all():
        raise InputError(
            f"{what} seems to be in degrees, the terrain is not",
            file=path,
            advice="Export it in the terrain's coordinate system",
        )
    return shift.to_local(places * unit_m)

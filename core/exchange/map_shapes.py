# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines and polygons by name, in survey coordinates: GeoJSON, GeoPackages, shapefiles, KML, or a table of their points.

    name,x_m,y_m,z_m
    cliff,2600010.0,1200040.0,
    cliff,2600030.0,1200044.0,

A table's rows are points in their order; `name` tells several shapes apart, and `z_m` may be missing or empty. What
else is there is a property of the shape: the first cell of each that is not empty.

A file that states another coordinate reference system than the terrain is transformed where both are known here
(`terrain.map_systems`), and refused else.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import overload

import numpy as np

from ..errors import InputError
from ..formats.features import Feature, Features, Kind
from ..formats.geojson import SUFFIXES as GEOJSON
from ..formats.geojson import read_geojson
from ..formats.geopackage import SUFFIXES as GEOPACKAGE
from ..formats.geopackage import read_geopackage
from ..formats.kml import SUFFIXES as KML
from ..formats.kml import read_kml
from ..formats.shapefile import BESIDE, read_shapefile
from ..formats.shapefile import SUFFIXES as SHAPEFILE
from ..georeference import GlobalShift
from ..plausibility import GREATEST_M
from ..reading import reader
from ..remarks import Remark
from ..simulation.polygons import Polygon
from ..terrain.crs import named_system, surely_different
from ..terrain.map_systems import (
    WGS84,
    MapSystem,
    name_of_wkt,
    same_system,
    system_of,
    system_of_wkt,
    transformed,
    unit_of_wkt,
    vertical_unit_of_wkt,
)
from ..vectors import Array
from .csv_text import read_table

REQUIRED = ("x_m", "y_m")
KNOWN = (*REQUIRED, "z_m", "name")
NAMES = ("name", "Name", "NAME")
ZIPPED = (".zip",)
SUFFIXES = (*GEOJSON, *GEOPACKAGE, *SHAPEFILE, *ZIPPED, *KML, ".csv")
"""Of files of lines and polygons."""
EXPORT = "Export it in the coordinate system of the terrain"


@dataclass(frozen=True, eq=False)
class MapShape:
    """A line, or a polygon with its holes.

    Attributes
    ----------
    name : empty where the file gives none.
    parts : a line's points (k, 3), or a polygon's rings, local [m]; NaN for heights that are not given.
    properties : what else the file says of it.
    kind : line or polygon.
    number : of the feature in the file, from 1.
    """

    name: str
    parts: tuple[Array, ...]
    properties: Mapping[str, object] = field(default_factory=dict)
    kind: Kind = "line"
    number: int = 1


@dataclass(frozen=True, eq=False)
class MapShapes(Sequence[MapShape]):
    """The shapes of a file, and what a user should know of how they were read."""

    shapes: tuple[MapShape, ...]
    remarks: tuple[Remark, ...] = ()

    def __len__(self) -> int:
        return len(self.shapes)

    @overload
    def __getitem__(self, place: int) -> MapShape: ...
    @overload
    def __getitem__(self, place: slice) -> tuple[MapShape, ...]: ...
    def __getitem__(self, place: int | slice) -> MapShape | tuple[MapShape, ...]:
        return self.shapes[place]


@reader("map")
def read_lines(path: str | Path, shift: GlobalShift) -> MapShapes:
    """The lines of a file; see `read_shapes`."""
    return _read(Path(path), ("line",), shift)


@reader("map")
def read_polygons(path: str | Path, shift: GlobalShift) -> MapShapes:
    """The polygons of a file; see `read_shapes`."""
    return _read(Path(path), ("polygon",), shift)


@reader("map")
def read_shapes(path: str | Path, shift: GlobalShift) -> MapShapes:
    """The lines and polygons of a file; the points of a table are lines.

    Raises
    ------
    InputError : no such file, a format that is not read, shapes of another kind in it, none at all, one without a
        geometry, a coordinate system that is neither the terrain's nor can be transformed into it, coordinates that are
        no numbers.
    """
    return _read(Path(path), ("line", "polygon"), shift)


def polygon_of(shape: MapShape, path: str | Path) -> Polygon:
    """A shape as a polygon in plan.

    Raises
    ------
    InputError : see `Polygon`.
    """
    try:
        return Polygon(shape.name, tuple(part[:, :2] for part in shape.parts), shape.number)
    except InputError as error:
        raise InputError(error.problem, file=path, advice=error.advice) from error


def _read(path: Path, kinds: tuple[Kind, ...], shift: GlobalShift) -> MapShapes:
    suffix = path.suffix.lower()
    if suffix in BESIDE:
        raise InputError("This is a part of a shapefile", file=path, advice="Give the file that ends with .shp")
    if suffix in GEOJSON:
        shapes = _shapes(read_geojson(path), path, kinds, shift)
    elif suffix in GEOPACKAGE:
        shapes = _shapes(read_geopackage(path, kinds), path, kinds, shift)
    elif suffix in SHAPEFILE or suffix in ZIPPED:
        shapes = _shapes(read_shapefile(path), path, kinds, shift)
    elif suffix in KML:
        shapes = _shapes(read_kml(path), path, kinds, shift)
    else:
        shapes = MapShapes(_read_points(path, kinds[0], shift))
    for shape in shapes:
        least = 2 if shape.kind == "line" else 3
        for part in shape.parts:
            different = len(np.unique(part if shape.kind == "line" else part[:, :2], axis=0))
            if different < least:
                name = f" {shape.name}" if shape.name else ""
                raise InputError(
                    f"The {shape.kind}{name} has {different} different point{'s' if different > 1 else ''}",
                    file=path,
                    advice=f"A {shape.kind} needs at least {least}",
                )
    return shapes


def _read_points(path: Path, kind: Kind, shift: GlobalShift) -> tuple[MapShape, ...]:
    table = read_table(path, REQUIRED, KNOWN)
    places = np.column_stack([table.numbers(name, required=True) for name in REQUIRED])
    places = shift.to_local(np.column_stack([places, table.numbers("z_m")]))
    names = np.array(table.text("name"), dtype=np.str_)
    rest = table.rest(KNOWN)
    shapes = []
    for number, name in enumerate(dict.fromkeys(names.tolist()), start=1):
        rows = np.flatnonzero(names == name)
        properties: dict[str, object] = {}
        for key, cells in rest.items():
            said = [cell for cell in dict.fromkeys(cells[rows].tolist()) if cell]
            if len(said) > 1:
                i = int(rows[np.flatnonzero(cells[rows] == said[1])[0]])
                raise table.error(i, f"{key} of {name or 'the ' + kind} is {said[0]} and {said[1]}", "Give one value")
            if said:
                properties[key] = said[0]
        shapes.append(MapShape(name, (places[rows],), properties, kind, number))
    return tuple(shapes)


def _shapes(content: Features, path: Path, kinds: tuple[Kind, ...], shift: GlobalShift) -> MapShapes:
    wanted = " or ".join(f"{kind}s" for kind in kinds)
    for feature in content.features:
        if feature.kind not in kinds:
            raise InputError(
                f"The geometry {feature.number} is a {feature.type}, where {wanted} are needed",
                file=path,
                advice=f"Give a file with {wanted} alone",
            )
    if not content.features:
        raise InputError(f"The file has no {kinds[0]}", file=path, advice=f"Export at least one {kinds[0]}")
    to_survey, remarks = _to_survey(content, path, shift)
    shapes = []
    for feature in content.features:
        properties = feature.properties
        name = next((str(properties[key]) for key in NAMES if properties.get(key) is not None), "")
        rest = {key: value for key, value in properties.items() if key not in NAMES}
        parts = tuple(_local(part, feature, to_survey, path, shift) for part in feature.parts)
        if feature.kind == "polygon":
            parts = tuple(
                ring[:-1] if len(ring) > 1 and (ring[0, :2] == ring[-1, :2]).all() else ring for ring in parts
            )
        shapes.append(MapShape(name, parts, rest, feature.kind or "line", feature.number))
    return MapShapes(tuple(shapes), remarks)


def _local(
    points: Array, feature: Feature, to_survey: Callable[[Array], Array], path: Path, shift: GlobalShift
) -> Array:
    """(k, 3) local points; NaN for heights that are not there."""
    what = f"The geometry {feature.number}"
    if not np.isfinite(points[:, :2]).all():
        raise InputError(f"{what} has a coordinate that is not finite", file=path, advice="Correct it")
    if (np.abs(points) >= GREATEST_M).any():
        raise InputError(f"{what} has a coordinate beyond every survey (1e9 m)", file=path, advice="Correct it")
    survey = to_survey(points)
    if not np.isfinite(survey[:, :2]).all() or (np.abs(survey[:, :2]) >= GREATEST_M).any():
        raise InputError(
            f"{what} is where the terrain's coordinate system {shift.crs} does not reach", file=path, advice=EXPORT
        )
    return shift.to_local(survey)


def _to_survey(
    content: Features, path: Path, shift: GlobalShift
) -> tuple[Callable[[Array], Array], tuple[Remark, ...]]:
    """What makes the file's coordinates those of the terrain, and what is to be said of it."""
    stated, source = _stated(content, path, shift)
    degrees = _in_degrees(content)
    if source is not None and source.geographic and not _could_be_degrees(content):
        raise InputError(
            f"The file says that it is in degrees ({stated}), and its coordinates are not", file=path, advice=EXPORT
        )
    if not stated:
        if degrees and shift.vector[:2].any():
            raise InputError(
                f"The geometry {content.features[0].number} seems to be in degrees, the terrain is not",
                file=path,
                advice=_advice(shift),
            )
        if path.suffix.lower() in (*SHAPEFILE, *ZIPPED):
            text = f"{path.name} states no coordinate system (.prj): its coordinates are taken as the terrain's."
            return _identity, (Remark(text, "advice", "map"),)
        return _identity, ()
    geographic = source is not None and source.geographic
    target = system_of(shift.crs) if shift.crs else None
    known = named_system(stated)
    unit = 1.0 if geographic else unit_of_wkt(content.wkt) if content.wkt else known.unit_m or 1.0
    height_unit = (vertical_unit_of_wkt(content.wkt) if content.wkt else known.height_unit_m) or unit
    if not shift.crs and not geographic:
        text = f"{path.name} is in {stated}, and the terrain states no coordinate system: it is taken as the same."
        return _scaled(unit, height_unit), (Remark(text, "advice", "map"),)
    same_code = _are_codes(stated, shift.crs) and not surely_different(stated, shift.crs)
    if not geographic and (same_code or (source is not None and target is not None and same_system(source, target))):
        return _scaled(unit, height_unit), ()
    if source is not None and target is not None and not target.geographic:
        probe = transformed(content.features[0].parts[0][:1, :2] * (1.0 if geographic else unit), source, target)
        if probe is not None:
            text = f"{path.name} was transformed from {stated} to the terrain's {shift.crs}, to a metre or two."
            return _transforming(source, target, unit, height_unit), (Remark(text, "note", "map"),)
    elif not geographic and not _are_codes(stated, shift.crs):
        text = f"{path.name} is in {stated}, the terrain in {shift.crs}: they are taken as the same, check it."
        return _scaled(unit, height_unit), (Remark(text, "warning", "map"),)
    there = f"the terrain in {shift.crs}" if shift.crs else "and the terrain states no coordinate system"
    raise InputError(f"The file is in {stated}, {there}", file=path, advice=_advice(shift))


def _stated(content: Features, path: Path, shift: GlobalShift) -> tuple[str, MapSystem | None]:
    """The name of the file's system, and the system as far as it is known here; GeoJSON without one is in WGS 84."""
    if content.wkt:
        stated = content.crs or name_of_wkt(content.wkt) or "a system without a name"
        return stated, system_of_wkt(content.wkt) or system_of(stated)
    if content.crs:
        return content.crs, system_of(content.crs)
    if path.suffix.lower() in GEOJSON and _in_degrees(content) and system_of(shift.crs) is not None:
        return "WGS 84", WGS84  # RFC 7946
    return "", None


def _in_degrees(content: Features) -> bool:
    """Whether all coordinates are so small that they seem to be degrees."""
    return all((np.abs(part[:, :2]) <= (180.0, 90.0)).all() for one in content.features for part in one.parts)


def _could_be_degrees(content: Features) -> bool:
    return all((np.abs(part[:, :2]) <= (360.0, 90.0)).all() for one in content.features for part in one.parts)


def _advice(shift: GlobalShift) -> str:
    return f"Export it in the terrain's system, {shift.crs}" if shift.crs else f"{EXPORT} (in metres)"


def _are_codes(a: str, b: str) -> bool:
    """Whether both are codes of the EPSG, so that it is certain whether they are the same."""
    return surely_different(a, "EPSG:0") and surely_different(b, "EPSG:0")


def _identity(points: Array) -> Array:
    return points


def _scaled(unit: float, height_unit: float) -> Callable[[Array], Array]:
    return lambda points: points * [unit, unit, height_unit]


def _transforming(source: MapSystem, target: MapSystem, unit: float, height_unit: float) -> Callable[[Array], Array]:
    def convert(points: Array) -> Array:
        plan = transformed(points[:, :2] * (1.0 if source.geographic else unit), source, target)
        assert plan is not None
        return np.column_stack([plan, points[:, 2] * (1.0 if source.geographic else height_unit)])

    return convert

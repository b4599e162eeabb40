# SPDX-License-Identifier: GPL-3.0-or-later
"""Zones of the ground with parameters of their own: polygons of a map, or the values of an attribute of the terrain.

A zone's properties are ``friction``, parameters of the models by name (``rt``, of every model of the simulation that
has it), or of one model (``noel_2017.rt``). For polygons they are the properties of GeoJSON, or further columns of the
table of corners. For an attribute they are the columns of a table with a row for each ``value``, and its ``name``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from math import isfinite
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..impact_models.registry import MODELS, find_model
from ..reading import reader
from ..remarks import Remark
from ..simulation.ground import element_places
from ..simulation.zones import ZoneCover, Zones, face_values, nearest_values, zones_of_values, zones_within
from ..terrain.cloud import Cloud
from ..terrain.opening import HowToRead
from ..terrain.ply_attributes import PlyAttribute, read_ply_attributes
from ..terrain.surface import Surface
from ..vectors import Array
from .csv_text import read_table
from .map_shapes import polygon_of, read_polygons
from .tables import Columns, write_columns

FRICTION = "friction"
VALUE_REQUIRED = ("value",)
SHAPEFILE_LETTERS = 10
"""Names of properties are cut to so many letters in shapefiles."""
VALUE_KNOWN = (*VALUE_REQUIRED, "name")


@dataclass
class _Properties:
    """What was found in a file so far."""

    parameters: dict[str, dict[str, dict[str, object]]] = field(default_factory=dict)
    friction: dict[str, float] = field(default_factory=dict)
    unused: dict[str, None] = field(default_factory=dict)


@reader("map of zones")
def read_zones(path: str | Path, terrain: Surface | Cloud, models: Sequence[str]) -> Zones:
    """Zones of the polygons in a file; see `read_polygons` for its formats, `zones_within` for what overlaps.

    Parameters
    ----------
    models : of the simulation.

    Raises
    ------
    InputError : see `read_polygons`, `Polygon` and `zones_within`; a property that is nearly a parameter, a value out
        of range, one zone with two values.
    """
    shapes = read_polygons(path, terrain.shift)
    found = _Properties()
    for shape in shapes:
        _take(found, shape.name, shape.properties, models, Path(path))
    try:
        cover = zones_within(terrain, [polygon_of(shape, path) for shape in shapes])
    except InputError as error:
        raise InputError(error.problem, file=path, advice=error.advice) from error
    return _zones(replace(cover, remarks=(*shapes.remarks, *cover.remarks)), found, models)


@reader("table of zones")
def read_attribute_zones(
    path: str | Path, terrain: Surface | Cloud, attribute: PlyAttribute, places: Array, models: Sequence[str]
) -> Zones:
    """Zones of the values of an attribute, what each value means in a table.

    Parameters
    ----------
    places : (k, 3) of the attribute's vertices or faces, local [m].

    Raises
    ------
    InputError : anything wrong with the table; see `zones_of_values`, `read_zones`.
    """
    table = read_table(path, VALUE_REQUIRED, VALUE_KNOWN)
    numbers = table.numbers("value", required=True)
    names = [name or f"{number:g}" for name, number in zip(table.text("name"), numbers.tolist(), strict=True)]
    for i in range(len(table)):
        if numbers[i] in numbers[:i]:
            raise table.error(i, f"The value {numbers[i]:g} is there twice", "Give each value one row")
    rest, found = table.rest(VALUE_KNOWN), _Properties()
    for i, name in enumerate(names):
        try:
            _take(found, name, {key: str(cells[i]) for key, cells in rest.items()}, models, Path(path))
        except InputError as error:
            raise table.error(i, error.problem, error.advice or "Correct it") from error
    if isinstance(terrain, Surface) and not attribute.of_faces:
        values = face_values(terrain, nearest_values(terrain.vertices, places, attribute.values))
    else:
        values = nearest_values(element_places(terrain), places, attribute.values)
    try:
        cover = zones_of_values(terrain, values, names, numbers.tolist())
    except InputError as error:
        raise InputError(error.problem, file=path, advice=error.advice) from error
    return _zones(cover, found, models)


def zones_with(cover: ZoneCover, properties: Mapping[str, Mapping[str, object]], models: Sequence[str]) -> Zones:
    """Zones whose properties do not come from a file.

    Parameters
    ----------
    properties : zone → its properties.

    Raises
    ------
    InputError : a property that is nearly a parameter, a value out of range.
    """
    found = _Properties()
    for name, values in properties.items():
        _take(found, name, values, models, None)
    return _zones(cover, found, models)


def write_attribute_zones(zones: Zones, path: str | Path) -> None:
    """Write the table that `read_attribute_zones` reads, for an attribute that has the zones' numbers from 1 on."""
    keys = list(
        dict.fromkeys(
            f"{model}.{name}"
            for models in zones.parameters.values()
            for model, values in models.items()
            for name in values
        )
    )
    columns: Columns = {
        "value": [str(number) for number in range(1, len(zones.names))],
        "name": list(zones.names[1:]),
        FRICTION: np.array([zones.friction.get(name, np.nan) for name in zones.names[1:]]),
    }
    for key in keys:
        model, _, parameter = key.partition(".")
        own = [zones.parameters.get(name, {}).get(model, {}) for name in zones.names[1:]]
        columns[key] = [str(values.get(parameter, "")) for values in own]
    write_columns(path, columns)


def open_zones(
    path: str | Path,
    attribute: str,
    terrain: Surface | Cloud,
    models: Sequence[str],
    *,
    terrain_files: Sequence[str | Path],
    how: HowToRead,
) -> Zones:
    """Zones of polygons, or of an attribute of the terrain's file where one is named.

    Parameters
    ----------
    terrain_files, how : what the terrain was read from, and how.

    Raises
    ------
    InputError : see `read_zones`, `read_ply_attributes` and `read_attribute_zones`.
    """
    if not attribute:
        return read_zones(path, terrain, models)
    values = read_ply_attributes(terrain_files, attribute, how)
    return read_attribute_zones(path, terrain, values, terrain.shift.to_local(values.places), models)


def _zones(cover: ZoneCover, found: _Properties, models: Sequence[str]) -> Zones:
    remarks = list(cover.remarks)
    if found.unused:
        text = f"Not used of the zones: {', '.join(found.unused)}, no parameters of {', '.join(models)}."
        remarks.append(Remark(text, "advice", "zones"))
    plain = [name for name in cover.names[1:] if name not in found.friction and not found.parameters.get(name)]
    if plain:
        remarks.append(Remark(f"Zones without parameters of their own: {', '.join(plain)}.", "advice", "zones"))
    return Zones(cover.names, cover.of_element, found.parameters, found.friction, tuple(remarks))


def _take(
    found: _Properties, zone: str, properties: Mapping[str, object], models: Sequence[str], path: Path | None
) -> None:
    """Add what a file says of a zone."""
    for key, value in properties.items():
        if value is None or value == "":
            continue
        if key == FRICTION:
            number = _friction(value, zone, path)
            if found.friction.setdefault(zone, number) != number:
                raise _twice(zone, key, path)
            continue
        for model, parameter in _meant(key, models, found, path):
            try:
                checked = find_model(model).parameter(parameter).checked(value, model)
            except InputError as error:
                raise InputError(f"Zone {zone}: {error.problem}", file=path, advice=error.advice) from error
            if found.parameters.setdefault(zone, {}).setdefault(model, {}).setdefault(parameter, checked) != checked:
                raise _twice(zone, key, path)


def _meant(key: str, models: Sequence[str], found: _Properties, path: Path | None) -> list[tuple[str, str]]:
    """The models and parameters that a property is for."""
    model, point, parameter = key.partition(".")
    if point:
        try:
            find_model(model).parameter(parameter)
        except InputError as error:
            raise InputError(error.problem, file=path, advice=error.advice) from error
        if model not in models:
            found.unused[key] = None
            return []
        return [(model, parameter)]
    known = {name: [spec.name for spec in find_model(name).parameters] for name in models}
    if len(key) == SHAPEFILE_LETTERS:
        whole = {one for ones in known.values() for one in ones if one.startswith(key)}
        key = whole.pop() if len(whole) == 1 else key
    of = [(name, key) for name in models if key in known[name]]
    if of:
        return of
    elsewhere = any(key in [spec.name for spec in one.parameters] for one in MODELS.values())
    names = sorted({FRICTION, *(one for ones in known.values() for one in ones)})
    near = [] if elsewhere else get_close_matches(key.lower(), names, n=1, cutoff=0.7)
    if near:
        raise InputError(
            f"{key!r} is no parameter of {', '.join(models)}",
            file=path,
            advice=f"Did you mean {near[0]}? There are {', '.join(names)}",
        )
    found.unused[key] = None
    return []


def _friction(value: object, zone: str, path: Path | None) -> float:
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        number = -1.0
    if not (isfinite(number) and number >= 0):
        raise InputError(
            f"Zone {zone}: the friction is {value!r}", file=path, advice="Give a number of zero or more, with a point"
        )
    return number


def _twice(zone: str, key: str, path: Path | None) -> InputError:
    return InputError(
        f"The polygons of zone {zone} have different values of {key}", file=path, advice="Give them one, or two names"
    )

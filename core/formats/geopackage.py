# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines and polygons of a GeoPackage (OGC 12-128r18, ISO 13249-3 for the geometries)."""

import sqlite3
import struct
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from .features import MOST_POINTS, Feature, Features, Kind
from .sqlite import endless, foreign_database, is_plain_table

SUFFIXES = (".gpkg",)
TYPES: Mapping[int, tuple[str, Kind | None]] = {
    1: ("Point", None), 2: ("LineString", "line"), 3: ("Polygon", "polygon"), 4: ("MultiPoint", None),
    5: ("MultiLineString", "line"), 6: ("MultiPolygon", "polygon"),
}  # fmt: skip
POINT, LINE, POLYGON = 1, 2, 3
ENVELOPE_BYTES = (0, 32, 48, 48, 64)
ADVICE = "Save it again, or as GeoJSON"
LAYERS = """
    SELECT g.table_name, g.column_name, s.organization, s.organization_coordsys_id,
        substr(s.definition, 1, 20000) AS definition
    FROM gpkg_geometry_columns AS g JOIN gpkg_contents AS c ON c.table_name = g.table_name
    LEFT JOIN gpkg_spatial_ref_sys AS s ON s.srs_id = g.srs_id
    WHERE c.data_type = 'features' ORDER BY g.table_name LIMIT 201
"""
MOST_LAYERS = 200
METADATA = ("gpkg_geometry_columns", "gpkg_contents", "gpkg_spatial_ref_sys")


def read_geopackage(path: Path, kinds: Sequence[Kind]) -> Features:
    """The features of the layer that has those of some kinds.

    Raises
    ------
    InputError : no GeoPackage, a damaged one, several layers of the kind, none; a layer that is a view or has computed
        columns, a feature without a geometry.
    """
    try:
        with foreign_database(path) as database:
            for table in METADATA:
                _refuse_computed(database, table, path)
            found = []
            layers = database.execute(LAYERS).fetchall()
            if len(layers) > MOST_LAYERS:
                raise ValueError(f"it has more than {MOST_LAYERS} layers")
            for table, column, organization, code, definition in layers:
                _refuse_computed(database, table, path)
                features = tuple(_features(database, str(table), str(column)))
                if any(feature.kind in kinds for feature in features):
                    epsg = str(organization).upper() == "EPSG" and isinstance(code, int) and code > 0
                    wkt = definition if isinstance(definition, str) and "[" in definition else ""
                    found.append((str(table), Features(features, f"EPSG:{code}" if epsg else "", wkt)))
    except (sqlite3.Error, struct.error, ValueError, IndexError, KeyError, TypeError, OverflowError) as error:
        said = "one of its layers has no end" if endless(error) else error
        raise InputError(f"This GeoPackage cannot be read: {said}", file=path, advice=ADVICE) from error
    kind = " or ".join(f"{kind}s" for kind in kinds)
    if not found:
        raise InputError(f"No layer of this GeoPackage has {kind}", file=path, advice=f"Give one with {kind}")
    if len(found) > 1:
        names = ", ".join(name for name, _ in found)
        raise InputError(
            f"Several layers of this GeoPackage have {kind}: {names}", file=path, advice="Save one of them by itself"
        )
    content = found[0][1]
    for feature in content.features:
        if feature.type == "":
            raise InputError(f"The feature {feature.number} has no geometry", file=path, advice="Delete it, or draw it")
    return content


def _refuse_computed(database: sqlite3.Connection, table: object, path: Path) -> None:
    if not (isinstance(table, str) and is_plain_table(database, table)):
        there = database.execute("SELECT 1 FROM sqlite_schema WHERE name = ? COLLATE NOCASE", (str(table),)).fetchone()
        if there is None:
            raise ValueError(f"no such table: {table}")
        raise InputError(
            f"The layer {table} of this GeoPackage is a view, or has computed columns",
            file=path,
            advice="Save it as a layer of its own, or as GeoJSON",
        )


def _features(database: sqlite3.Connection, table: str, column: str) -> Iterator[Feature]:
    quoted, left = table.replace('"', '""'), MOST_POINTS
    for number, row in enumerate(database.execute(f'SELECT * FROM "{quoted}"'), start=1):
        names = {name.lower(): name for name in row.keys()}  # noqa: SIM118
        own = names[column.lower()]
        rest = {key: row[key] for key in names.values() if key != own and row[key] is not None}
        blob = row[own]
        geometry = None if blob is None else _geometry(bytes(blob))
        if geometry is None:
            yield Feature("", "", number, (), rest)
            continue
        type_, coordinates = geometry
        name, kind = TYPES[type_]
        if kind is None:
            yield Feature("", name, number, (), rest)
            continue
        for group in coordinates if type_ > POLYGON else [coordinates]:
            parts = (group,) if kind == "line" else tuple(group)
            left -= sum(map(len, parts))
            if left < 0:
                raise ValueError(f"it has more than {MOST_POINTS:,} points")
            yield Feature(kind, name, number, parts, rest)


def _geometry(blob: bytes) -> tuple[int, Any] | None:
    """Type, and coordinates; None for an empty one."""
    if blob[:2] != b"GP":
        raise ValueError("a geometry is none")
    flags = blob[3]
    if flags & 0x10:
        return None
    type_, coordinates, _ = _well_known(blob, 8 + ENVELOPE_BYTES[flags >> 1 & 7], 0)
    return type_, coordinates


def _well_known(blob: bytes, at: int, depth: int) -> tuple[int, Any, int]:
    """Type, coordinates, and where the next begins."""
    order = "<" if blob[at] == 1 else ">"
    (code,) = struct.unpack_from(f"{order}I", blob, at + 1)
    at += 5
    dimensions, type_ = code // 1000, code % 1000
    if type_ not in TYPES or dimensions > 3 or depth > 1:
        raise ValueError(f"a geometry of the type {code}")
    width = (2, 3, 3, 4)[dimensions]

    def number_of() -> int:
        nonlocal at
        (number,) = struct.unpack_from(f"{order}I", blob, at)
        at += 4
        return int(number)

    def points(number: int) -> Any:
        nonlocal at
        values = np.frombuffer(blob, f"{order}f8", number * width, at).reshape(number, width)
        at += values.nbytes
        places = np.full((number, 3), np.nan)
        places[:, : 3 if dimensions in (1, 3) else 2] = values[:, : 3 if dimensions in (1, 3) else 2]
        return places

    if type_ == POINT:
        return type_, points(1)[0], at
    if type_ == LINE:
        return type_, points(number_of()), at
    if type_ == POLYGON:
        return type_, [points(number_of()) for _ in range(number_of())], at
    parts = []
    for _ in range(number_of()):
        _, part, at = _well_known(blob, at, depth + 1)
        parts.append(part)
    return type_, parts, at

# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines and polygons of a GeoPackage, in the words of GeoJSON (OGC 12-128r18, ISO 13249-3 for the geometries)."""

import sqlite3
import struct
from collections.abc import Iterator, Mapping
from contextlib import closing
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError

TYPES = {1: "Point", 2: "LineString", 3: "Polygon", 4: "MultiPoint", 5: "MultiLineString", 6: "MultiPolygon"}
POINT, LINE, POLYGON = 1, 2, 3
ENVELOPE_BYTES = (0, 32, 48, 48, 64)
ADVICE = "Save it again, or as GeoJSON"
STEPS, LEAST_STEPS, STEPS_A_BYTE = 100_000, 50_000_000, 10
"""Of SQLite's machine: between two looks, and so many that a file may take. A feature takes some ten; a view that is
defined by itself has no end."""
LAYERS = """
    SELECT g.table_name, g.column_name, s.organization, s.organization_coordsys_id
    FROM gpkg_geometry_columns AS g JOIN gpkg_contents AS c ON c.table_name = g.table_name
    LEFT JOIN gpkg_spatial_ref_sys AS s ON s.srs_id = g.srs_id
    WHERE c.data_type = 'features' ORDER BY g.table_name
"""

type Feature = tuple[dict[str, Any], dict[str, object]]
"""Geometry and properties, as GeoJSON has them."""


def read_features(path: Path, types: Mapping[str, str], kind: str) -> tuple[str, list[Feature]]:
    """The coordinate system, "EPSG:…" or empty, and the features of the layer that has those of a kind.

    Parameters
    ----------
    types : GeoJSON's types of geometries → kind.

    Raises
    ------
    InputError : no GeoPackage, a damaged one, several layers of the kind, none.
    """
    try:
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as database:
            database.row_factory = sqlite3.Row
            looks, most = count(1), LEAST_STEPS + STEPS_A_BYTE * path.stat().st_size
            database.set_progress_handler(lambda: STEPS * next(looks) > most, STEPS)
            found = []
            for table, column, organization, code in database.execute(LAYERS).fetchall():
                features = list(_features(database, table, column))
                if any(types.get(geometry["type"]) == kind for geometry, _ in features):
                    crs = f"EPSG:{code}" if str(organization).upper() == "EPSG" else ""
                    found.append((str(table), crs, features))
    except (sqlite3.Error, struct.error, ValueError, IndexError, KeyError, TypeError, OverflowError) as error:
        endless = getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_INTERRUPT
        said = "one of its layers has no end" if endless else error
        raise InputError(f"This GeoPackage cannot be read: {said}", file=path, advice=ADVICE) from error
    if not found:
        raise InputError(f"No layer of this GeoPackage has {kind}s", file=path, advice=f"Give one with {kind}s")
    if len(found) > 1:
        names = ", ".join(name for name, _, _ in found)
        raise InputError(
            f"Several layers of this GeoPackage have {kind}s: {names}", file=path, advice="Save one of them by itself"
        )
    return found[0][1:]


def _features(database: sqlite3.Connection, table: str, column: str) -> Iterator[Feature]:
    quoted = table.replace('"', '""')
    for row in database.execute(f'SELECT * FROM "{quoted}"'):
        blob = row[column]
        geometry = None if blob is None else _geometry(bytes(blob))
        if geometry is not None:
            rest = {key: row[key] for key in row.keys() if key != column and row[key] is not None}  # noqa: SIM118
            yield geometry, rest


def _geometry(blob: bytes) -> dict[str, Any] | None:
    """None for an empty one."""
    if blob[:2] != b"GP":
        raise ValueError("a geometry is none")
    flags = blob[3]
    if flags & 0x10:
        return None
    type_, coordinates, _ = _well_known(blob, 8 + ENVELOPE_BYTES[flags >> 1 & 7])
    return {"type": TYPES[type_], "coordinates": coordinates}


def _well_known(blob: bytes, at: int) -> tuple[int, list[Any], int]:
    """Type, coordinates, and where the next begins."""
    order = "<" if blob[at] == 1 else ">"
    (code,) = struct.unpack_from(f"{order}I", blob, at + 1)
    at += 5
    dimensions, type_ = code // 1000, code % 1000
    if type_ not in TYPES or dimensions > 3:
        raise ValueError(f"a geometry of the type {code}")
    width = (2, 3, 3, 4)[dimensions]

    def number_of() -> int:
        nonlocal at
        (number,) = struct.unpack_from(f"{order}I", blob, at)
        at += 4
        return int(number)

    def points(number: int) -> list[list[float]]:
        nonlocal at
        values = np.frombuffer(blob, f"{order}f8", number * width, at).reshape(number, width)
        at += values.nbytes
        return values[:, : 3 if dimensions in (1, 3) else 2].tolist()

    if type_ == POINT:
        return type_, points(1)[0], at
    if type_ == LINE:
        return type_, points(number_of()), at
    if type_ == POLYGON:
        return type_, [points(number_of()) for _ in range(number_of())], at
    parts = []
    for _ in range(number_of()):
        _, part, at = _well_known(blob, at)
        parts.append(part)
    return type_, parts, at

# SPDX-License-Identifier: GPL-3.0-or-later
"""GeoPackage (OGC 12-128r19, version 1.4) by SQLite alone: points, lines and polygons in space, and their styles."""

import sqlite3
import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from errno import EIO, ENOSPC
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..georeference import GlobalShift, epsg_code
from ..output import output_file
from ..vectors import Array, Indices
from .geopackage_schema import LAYER_STYLES, RTREE, SCHEMA, SYSTEMS, WGS_84
from .geotiff_maps import UNKNOWN

APPLICATION_ID, USER_VERSION = 0x47504B47, 10400
UNDEFINED_CARTESIAN = -1
"""The standard's own system for coordinates in metres of which no more is known."""
LITTLE_ENDIAN_XYZ, LITTLE_ENDIAN_NO_ENVELOPE = 0b0000_0101, 0b0000_0001
POINT_Z, LINE_STRING_Z, POLYGON_Z = 1001, 1002, 1003
AT_ONCE = 20_000
"""Rows that are written together."""
TYPES: Mapping[str, str] = {"f": "REAL", "i": "INTEGER", "u": "INTEGER", "b": "BOOLEAN", "U": "TEXT"}
DISK = {sqlite3.SQLITE_FULL: ENOSPC, sqlite3.SQLITE_IOERR: EIO}


@dataclass(frozen=True, eq=False)
class FeatureLayer:
    """A layer of points, of lines, or of polygons.

    Attributes
    ----------
    name : of the table.
    description : a sentence for who opens it.
    points : (k, 3) local [m], finite.
    first : (n + 1,) the first point of each line, and k; None for points.
    columns : name → (n,) numbers or words; NaN is empty.
    style : of QGIS; empty for none.
    closed : the lines are the outlines of polygons, each of which ends in its first point.
    """

    name: str
    description: str
    points: Array
    first: Indices | None = None
    columns: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    style: str = ""
    closed: bool = False

    def __len__(self) -> int:
        return len(self.points) if self.first is None else self.first.size - 1


def write_geopackage(
    path: str | Path, layers: Iterable[FeatureLayer], shift: GlobalShift, about: Mapping[str, str] | None = None
) -> tuple[str, ...]:
    """Write layers into a new file.

    Parameters
    ----------
    layers : drawn one after the other, so that they need not all be in memory. Those without features are left out.
    shift : where the local origin is, and in which system; one without an EPSG code is only named in the table `about`,
        and the coordinates are in the standard's undefined Cartesian system.
    about : what else the table `about` shall say, name → value.

    Returns
    -------
    The names of the layers.

    Raises
    ------
    InputError : coordinates that are not finite, a line of less than two points; the file cannot be written.
    """
    written: list[str] = []
    with output_file(path) as draft, _database(draft) as database:
        system = _systems(database, shift)
        spatial = _has_rtree(database)
        for layer in layers:
            if len(layer):
                _check(layer, Path(path))
                _write_layer(database, layer, shift, system, spatial)
                written.append(layer.name)
        _write_styles(database)
        said = {"crs": shift.crs or UNKNOWN, "vertical_datum": shift.vertical or UNKNOWN, "unit": "m", **(about or {})}
        _write_about(database, said)
    return tuple(written)


@contextmanager
def _database(path: Path) -> Iterator[sqlite3.Connection]:
    """A new database; what its disk says of it is an `OSError`, as of any file."""
    path.unlink(missing_ok=True)
    try:
        with closing(sqlite3.connect(path, isolation_level=None)) as database:
            database.execute("PRAGMA journal_mode = OFF")  # the file is staged: whole, or not there
            database.execute("PRAGMA synchronous = OFF")
            database.execute(f"PRAGMA application_id = {APPLICATION_ID}")
            database.execute(f"PRAGMA user_version = {USER_VERSION}")
            database.execute("BEGIN")
            for statement in SCHEMA:
                database.execute(statement)
            yield database
            database.execute("COMMIT")
    except sqlite3.OperationalError as error:
        code = DISK.get(error.sqlite_errorcode & 0xFF)
        if code is None:
            raise
        raise OSError(code, str(error), str(path)) from error


def _systems(database: sqlite3.Connection, shift: GlobalShift) -> int:
    """Name the coordinate systems; returns the one of the layers."""
    database.executemany("INSERT INTO gpkg_spatial_ref_sys VALUES (?, ?, ?, ?, ?, ?)", SYSTEMS)
    code = epsg_code(shift.crs)
    if code is None:
        return UNDEFINED_CARTESIAN
    if code != WGS_84:
        row = (f"EPSG:{code}", code, "EPSG", code, "undefined", "Defined by its EPSG code")
        database.execute("INSERT INTO gpkg_spatial_ref_sys VALUES (?, ?, ?, ?, ?, ?)", row)
    return code


def _check(layer: FeatureLayer, path: Path) -> None:
    if not np.isfinite(layer.points).all():
        raise InputError(f"The layer {layer.name} has a coordinate that is not finite", file=path)
    if layer.first is not None and (np.diff(layer.first) < 2).any():
        raise InputError(f"The layer {layer.name} has a line of less than two points", file=path)
    if layer.closed and layer.first is not None:
        ends = layer.points[layer.first[:-1]] == layer.points[layer.first[1:] - 1]
        if not (ends.all() and (np.diff(layer.first) >= 4).all()):
            raise InputError(f"The layer {layer.name} has an outline that is not closed", file=path)


def _write_layer(
    database: sqlite3.Connection, layer: FeatureLayer, shift: GlobalShift, system: int, spatial: bool
) -> None:
    line = layer.first is not None
    places = np.ascontiguousarray(shift.to_survey(layer.points), dtype="<f8")
    low, high = _boxes(places, layer.first)
    columns = ", ".join(f'"{name}" {TYPES[values.dtype.kind]}' for name, values in layer.columns.items())
    kind = "POLYGON" if layer.closed else "LINESTRING" if line else "POINT"
    database.execute(
        f'CREATE TABLE "{layer.name}" (fid INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, '
        f"geom {kind}{', ' + columns if columns else ''})"
    )
    extent = [float(value) for value in (*low[:, :2].min(axis=0), *high[:, :2].max(axis=0))]
    database.execute(
        "INSERT INTO gpkg_contents VALUES (?, 'features', ?, ?, ?, ?, ?, ?, ?, ?)",
        (layer.name, layer.name, layer.description, _now(), *extent, system),
    )
    database.execute("INSERT INTO gpkg_geometry_columns VALUES (?, 'geom', ?, ?, 1, 0)", (layer.name, kind, system))
    values = [_plain(one) for one in layer.columns.values()]
    marks = ", ".join("?" * (2 + len(values)))
    insert = f'INSERT INTO "{layer.name}" VALUES ({marks})'
    for start in range(0, len(layer), AT_ONCE):
        stop = min(start + AT_ONCE, len(layer))
        shapes = _geometries(places, layer, low, high, system, start, stop)
        database.executemany(
            insert, zip(range(start + 1, stop + 1), shapes, *(one[start:stop] for one in values), strict=True)
        )
    if spatial:
        _index(database, layer.name, low, high)
    if layer.style:
        database.execute(LAYER_STYLES[1], (layer.name, layer.name, layer.style, layer.description, _now()))


def _boxes(places: Array, first: Indices | None) -> tuple[Array, Array]:
    """The lowest and the highest coordinates (n, 3) of each feature."""
    if first is None:
        return places, places
    return np.minimum.reduceat(places, first[:-1]), np.maximum.reduceat(places, first[:-1])


def _geometries(
    places: Array, layer: FeatureLayer, low: Array, high: Array, system: int, start: int, stop: int
) -> Iterator[bytes]:
    """GeoPackageBinary of some features: a header, of lines and polygons with their box, then well-known binary."""
    first = layer.first
    if first is None:
        head = b"GP" + struct.pack("<BBiBI", 0, LITTLE_ENDIAN_NO_ENVELOPE, system, 1, POINT_Z)
        data = places[start:stop].tobytes()
        yield from (head + data[at : at + 24] for at in range(0, len(data), 24))
        return
    head = b"GP" + struct.pack("<BBi", 0, LITTLE_ENDIAN_XYZ, system)
    boxes = np.stack([low[start:stop], high[start:stop]], axis=2).astype("<f8").tobytes()
    begin = int(first[start])
    data = places[begin : int(first[stop])].tobytes()
    ends = (first[start : stop + 1] - begin).tolist()
    for place, (at, end) in enumerate(pairwise(ends)):
        form = (
            struct.pack("<BIII", 1, POLYGON_Z, 1, end - at)
            if layer.closed
            else struct.pack("<BII", 1, LINE_STRING_Z, end - at)
        )
        yield head + boxes[48 * place : 48 * place + 48] + form + data[24 * at : 24 * end]


def _plain(values: NDArray[Any]) -> Sequence[object]:
    """As Python's own numbers and words, None for NaN."""
    plain: list[object] = values.tolist()
    if values.dtype.kind == "f":
        for place in np.flatnonzero(~np.isfinite(values)).tolist():
            plain[place] = None
    return plain


def _has_rtree(database: sqlite3.Connection) -> bool:
    """Whether this SQLite can make the spatial index, which a GeoPackage may have."""
    return any(name == "ENABLE_RTREE" for (name,) in database.execute("PRAGMA compile_options"))


def _index(database: sqlite3.Connection, name: str, low: Array, high: Array) -> None:
    """The spatial index of a layer, with the triggers that keep it so when a GIS edits the layer."""
    database.execute(f'CREATE VIRTUAL TABLE "rtree_{name}_geom" USING rtree(id, minx, maxx, miny, maxy)')
    boxes = np.column_stack([low[:, 0], high[:, 0], low[:, 1], high[:, 1]])
    rows = ((place, *box) for place, box in enumerate(boxes.tolist(), start=1))
    database.executemany(f'INSERT INTO "rtree_{name}_geom" VALUES (?, ?, ?, ?, ?)', rows)
    database.execute(
        "INSERT INTO gpkg_extensions VALUES (?, 'geom', 'gpkg_rtree_index', "
        "'http://www.geopackage.org/spec120/#extension_rtree', 'write-only')",
        (name,),
    )
    for trigger in RTREE:
        database.execute(trigger.replace("{t}", name))


def _write_styles(database: sqlite3.Connection) -> None:
    """Name QGIS's table of styles, where there are any."""
    if database.execute("SELECT count(*) FROM layer_styles").fetchone()[0]:
        _name_table(database, "layer_styles", "Styles of QGIS")
    else:
        database.execute("DROP TABLE layer_styles")


def _write_about(database: sqlite3.Connection, said: Mapping[str, str]) -> None:
    database.execute("CREATE TABLE about (fid INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, name TEXT, value TEXT)")
    database.executemany("INSERT INTO about (name, value) VALUES (?, ?)", said.items())
    _name_table(
        database, "about", "What the layers are: coordinate system, vertical datum, unit, and how they were made"
    )


def _name_table(database: sqlite3.Connection, name: str, description: str) -> None:
    database.execute(
        "INSERT INTO gpkg_contents VALUES (?, 'attributes', ?, ?, ?, NULL, NULL, NULL, NULL, 0)",
        (name, name, description, _now()),
    )


def _now() -> str:
    return datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%S.000Z")

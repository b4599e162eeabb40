# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines and polygons of GeoPackages that GDAL and Rockfall have written, and of damaged ones."""

import sqlite3
import struct
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.exchange.geopackage import FeatureLayer, write_geopackage
from rockfall.core.exchange.map_shapes import read_lines, read_polygons
from rockfall.core.exchange.qgis_styles import line_style
from rockfall.core.exchange.screens import read_screens
from rockfall.core.georeference import GlobalShift

SHIFT = GlobalShift(2600000.0, 1200000.0, 0.0, crs="EPSG:2056")
ROAD = [(2600010.0, 1200040.0, 800.0), (2600030.0, 1200044.0, 801.0), (2600050.0, 1200040.0, 802.0)]


def line(points: list[tuple[float, ...]]) -> bytes:
    width = len(points[0])
    values = np.array(points).ravel().tolist()
    return struct.pack(f"<BII{len(values)}d", 1, 2 + 1000 * (width == 3), len(points), *values)


def write(path: Path, geometries: list[bytes], type_: str, layer: str = "map", **fields: object) -> None:
    raw = pytest.importorskip("pyogrio.raw")
    append = path.exists()
    raw.write(
        path, np.array(geometries, dtype=object), [np.array(value, dtype=object) for value in fields.values()],
        np.array(list(fields), dtype=object), layer=layer, driver="GPKG", geometry_type=type_, crs="EPSG:2056",
        append=append,
    )  # fmt: skip


def test_screens_that_a_gis_has_saved(tmp_path: Path) -> None:
    path = tmp_path / "map.gpkg"
    flat = [point[:2] for point in ROAD]
    both = struct.pack("<BII", 1, 5, 2) + line(flat) + line([(x, y + 9) for x, y in flat])
    write(path, [line(flat), both], "Unknown", name=["road", "nets"], height_m=[None, 4.0], capacity_kJ=[None, 2000.0])
    road, one, other = read_screens(path, SHIFT)
    assert (road.name, one.name, road.capacity_j, one.capacity_j, one.height_m) == ("road", "nets", None, 2e6, 4.0)
    np.testing.assert_allclose(road.line, [(10, 40), (30, 44), (50, 40)])
    np.testing.assert_allclose(other.line, road.line + np.array([0, 9]))


def test_heights_and_holes(tmp_path: Path) -> None:
    write(tmp_path / "line.gpkg", [line(ROAD)], "LineString Z", name=["road"])
    (shape,) = read_lines(tmp_path / "line.gpkg", SHIFT)
    np.testing.assert_allclose(shape.parts[0], np.array(ROAD) - [2600000, 1200000, 0])
    outer = [(2600000.0, 1200000.0), (2600040.0, 1200000.0), (2600040.0, 1200040.0), (2600000.0, 1200000.0)]
    inner = [(2600030.0, 1200010.0), (2600035.0, 1200010.0), (2600035.0, 1200015.0), (2600030.0, 1200010.0)]
    rings = b"".join(struct.pack("<I8d", 4, *np.ravel(ring)) for ring in (outer, inner))
    write(tmp_path / "area.gpkg", [struct.pack("<BII", 1, 3, 2) + rings], "Polygon", name=["forest"])
    (area,) = read_polygons(tmp_path / "area.gpkg", SHIFT)
    assert [len(part) for part in area.parts] == [3, 3]
    with pytest.raises(InputError, match="No layer of this GeoPackage has lines"):
        read_lines(tmp_path / "area.gpkg", SHIFT)


def test_what_rockfall_writes_comes_back(tmp_path: Path) -> None:
    points = np.array(ROAD) - [2600000, 1200000, 0]
    layer = FeatureLayer(
        "screens", "", points, np.array([0, 3]), {"name": np.array(["road"])}, line_style((0, 0, 0), 1)
    )
    write_geopackage(tmp_path / "own.gpkg", [layer], SHIFT, {})
    (shape,) = read_lines(tmp_path / "own.gpkg", SHIFT)
    np.testing.assert_allclose(shape.parts[0], points)
    assert shape.name == "road"
    with pytest.raises(InputError, match=r"in EPSG:2056, the terrain in EPSG:27572"):
        read_lines(tmp_path / "own.gpkg", GlobalShift(2600000.0, 1200000.0, 0.0, crs="EPSG:27572"))


def test_two_layers_of_lines_are_not_guessed_from(tmp_path: Path) -> None:
    for layer in ("nets", "roads"):
        write(tmp_path / "map.gpkg", [line(ROAD)], "LineString Z", layer, name=["x"])
    with pytest.raises(InputError, match=r"have lines: nets, roads\. Save one of them by itself"):
        read_lines(tmp_path / "map.gpkg", SHIFT)


def test_damaged_geopackages_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "map.gpkg"
    layer = FeatureLayer(
        "screens", "", np.array(ROAD), np.array([0, 3]), {"name": np.array(["road"])}, line_style((0, 0, 0), 1)
    )
    write_geopackage(path, [layer], GlobalShift(), {})
    whole = path.read_bytes()
    rng = np.random.default_rng(1)
    refused = 0
    for _ in range(150):
        damaged = bytearray(whole)
        for at in rng.integers(0, len(whole), 40):
            damaged[at] = rng.integers(0, 256)
        path.write_bytes(damaged[: rng.integers(100, len(whole))] if rng.random() < 0.3 else damaged)
        try:
            read_lines(path, GlobalShift())
        except InputError:
            refused += 1
    assert refused > 20
    path.write_bytes(b"no database")
    with pytest.raises(InputError, match="This GeoPackage cannot be read: file is not a database"):
        read_lines(path, SHIFT)
    with pytest.raises(InputError, match=r"missing\.gpkg"):
        read_lines(tmp_path / "missing.gpkg", SHIFT)


def test_a_view_without_end_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "map.gpkg"
    column = {"height_m": np.array([1.0])}
    layer = FeatureLayer("map", "a line", np.array(ROAD) - [2600000, 1200000, 0], np.array([0, 3]), column)
    write_geopackage(path, [layer], SHIFT)
    assert len(read_lines(path, SHIFT)) == 1
    with closing(sqlite3.connect(path)) as database:
        endless = "WITH RECURSIVE r(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM r) SELECT n, NULL AS geom FROM r"
        database.executescript(f"DROP TABLE map; CREATE VIEW map AS {endless};")
    with pytest.raises(InputError, match=r"map of this GeoPackage is a view, or has computed columns\. Save it"):
        read_lines(path, SHIFT)

# SPDX-License-Identifier: GPL-3.0-or-later
"""GeoPackages: what the standard asks for, and what GDAL reads in them."""

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.cli import main
from rockfall.core.errors import InputError, RockfallError
from rockfall.core.exchange.geopackage import FeatureLayer, write_geopackage
from rockfall.core.exchange.project import read_project
from rockfall.core.exchange.qgis_styles import line_style
from rockfall.core.exchange.simulation_geopackage import measured_layer, write_simulation_geopackage
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.sampling import TrajectorySamples
from rockfall.core.simulation.engine import Settings, Simulation, simulate
from rockfall.core.simulation.ground import make_ground
from rockfall.core.simulation.release import make_releases
from rockfall.core.simulation.run_lines import lines_of
from rockfall.core.terrain.surface import Surface
from rockfall.core.workflow.opening import open_terrain

DEMO = Path(__file__).parents[2] / "assets" / "demo"
SHIFT = GlobalShift(2_600_000.0, 1_200_000.0, 800.0, "EPSG:2056")
POINTS = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0], [5.0, 5.0, 5.0], [6.0, 4.0, 5.5], [7.0, 3.0, 5.25]])


def layers() -> list[FeatureLayer]:
    columns = {
        "name": np.array(["a", "b"]),
        "count": np.array([3, 4]),
        "value": np.array([1.5, np.nan]),
        "held": np.array([True, False]),
    }
    lines = FeatureLayer("lines", "Two lines", POINTS, np.array([0, 2, 5]), columns, line_style((0.9, 0.4, 0.0), 0.3))
    return [lines, FeatureLayer("points", "Five points", POINTS), FeatureLayer("none", "No points", POINTS[:0])]


def written(folder: Path, shift: GlobalShift = SHIFT) -> Path:
    path = folder / "a.gpkg"
    assert write_geopackage(path, layers(), shift, {"seed": "7"}) == ("lines", "points")
    return path


def rows(path: Path, question: str) -> list[tuple[object, ...]]:
    with closing(sqlite3.connect(path)) as database:
        return database.execute(question).fetchall()


def test_the_file_says_what_it_is(tmp_path: Path) -> None:
    path = written(tmp_path)
    assert path.read_bytes()[68:72] == b"GPKG"
    assert rows(path, "PRAGMA user_version") == [(10400,)]
    assert rows(path, "PRAGMA integrity_check") == [("ok",)]
    assert rows(path, "PRAGMA foreign_key_check") == []
    systems = dict(rows(path, "SELECT srs_id, organization FROM gpkg_spatial_ref_sys"))
    assert systems == {-1: "NONE", 0: "NONE", 4326: "EPSG", 2056: "EPSG"}
    contents = rows(path, "SELECT table_name, data_type, srs_id, min_x, max_y FROM gpkg_contents ORDER BY table_name")
    assert contents == [
        ("about", "attributes", 0, None, None),
        ("layer_styles", "attributes", 0, None, None),
        ("lines", "features", 2056, 2_600_000.0, 1_200_005.0),
        ("points", "features", 2056, 2_600_000.0, 1_200_005.0),
    ]
    shapes = rows(path, "SELECT table_name, geometry_type_name, z, m FROM gpkg_geometry_columns")
    assert shapes == [("lines", "LINESTRING", 1, 0), ("points", "POINT", 1, 0)]
    assert rows(path, "SELECT f_table_name, useAsDefault FROM layer_styles") == [("lines", 1)]


def test_gdal_reads_what_was_written(tmp_path: Path) -> None:
    raw = pytest.importorskip("pyogrio.raw", reason="pyogrio, an independent reader of GeoPackages, is not installed")
    path = written(tmp_path)
    meta, _, shapes, fields = raw.read(path, layer="lines")
    assert (meta["crs"], meta["geometry_type"]) == ("EPSG:2056", "LineString Z")
    assert list(meta["fields"]) == ["name", "count", "value", "held"]
    assert [values.tolist() for values in fields[:2]] == [["a", "b"], [3, 4]]
    np.testing.assert_array_equal(fields[2], [1.5, np.nan])
    assert fields[3].tolist() == [True, False]
    places = [np.frombuffer(shape[9:], "<f8").reshape(-1, 3) for shape in shapes]
    np.testing.assert_allclose(np.concatenate(places), POINTS + SHIFT.vector, rtol=0, atol=1e-6)
    assert [len(place) for place in places] == [2, 3]
    _, _, shapes, _ = raw.read(path, layer="points")
    np.testing.assert_allclose([np.frombuffer(shape[5:], "<f8") for shape in shapes], POINTS + SHIFT.vector)


def test_the_spatial_index_finds_what_is_in_a_box_and_follows_edits(tmp_path: Path) -> None:
    raw = pytest.importorskip("pyogrio.raw", reason="pyogrio, an independent reader of GeoPackages, is not installed")
    path = written(tmp_path)
    box = (2_600_004.5, 1_200_002.5, 2_600_008.0, 1_200_006.0)
    for layer, expected in (("lines", ["b"]), ("points", [3, 4, 5])):
        found = raw.read(path, layer=layer, bbox=box, return_fids=True)
        assert (found[3][0].tolist() if layer == "lines" else found[1].tolist()) == expected
    extra = np.array([b"\x01" + (1001).to_bytes(4, "little") + np.array([2_600_005.0, 1_200_003.0, 800.0]).tobytes()])
    raw.write(path, extra.astype(object), [], [], layer="points", geometry_type="Point Z", crs="EPSG:2056", append=True)
    assert raw.read(path, layer="points", bbox=box, return_fids=True)[1].tolist() == [3, 4, 5, 6]
    assert rows(path, "SELECT count(*) FROM rtree_points_geom") == [(6,)]


@pytest.mark.parametrize(("crs", "said"), [("", "unknown"), ("LV95", "LV95"), ("EPSG:25832", "EPSG:25832")])
def test_the_system_is_known_by_its_code_named_or_unknown(tmp_path: Path, crs: str, said: str) -> None:
    vertical = "EPSG:7837" if crs.startswith("EPSG") else ""
    path = written(tmp_path, GlobalShift(0.0, 0.0, 0.0, crs, vertical))
    about = dict(rows(path, "SELECT name, value FROM about"))
    assert about == {"crs": said, "vertical_datum": vertical or "unknown", "unit": "m", "seed": "7"}
    system = 25832 if said.startswith("EPSG") else -1
    assert rows(path, "SELECT DISTINCT srs_id FROM gpkg_geometry_columns") == [(system,)]


def test_places_and_lines_that_cannot_be_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.gpkg"
    for points, first in ((np.full((2, 3), np.nan), None), (POINTS, np.array([0, 1, 5]))):
        with pytest.raises(InputError, match="The layer bad has"):
            write_geopackage(path, [FeatureLayer("bad", "", points, first)], SHIFT)
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_is_full_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SQLite's own refusal, by a file that may have only a few pages."""
    from rockfall.core.exchange import geopackage

    monkeypatch.setattr(geopackage, "SCHEMA", ("PRAGMA max_page_count = 20", *geopackage.SCHEMA))
    many = FeatureLayer("points", "", np.zeros((5000, 3)))
    with pytest.raises(InputError, match="Make room") as told:
        write_geopackage(tmp_path / "a.gpkg", [many], SHIFT)
    assert told.value.file == tmp_path / "a.gpkg"
    assert list(tmp_path.iterdir()) == []


@pytest.fixture(scope="module")
def simulation() -> Simulation:
    """Blocks that fly from a step onto a plane and roll to a stop."""
    vertices = np.array([[x, y, -0.4 * min(x, 40.0)] for x in (-1.0, 40.0, 200.0) for y in (-20.0, 20.0)])
    faces = np.array([[0, 2, 1], [1, 2, 3], [2, 4, 3], [3, 4, 5]], np.int32)
    ground = make_ground(Surface(vertices, faces, SHIFT, "step"))
    places = np.column_stack([np.zeros(12), np.linspace(-5.0, 5.0, 12), np.full(12, 6.0)])
    velocity = np.tile([4.0, 0.0, 2.0], (12, 1))
    releases = make_releases(places, velocity=velocity, diameter_m=0.5)
    return simulate(ground, releases, Settings("noel_2017", seed=3))


def test_lines_keep_to_the_parabolas(simulation: Simulation) -> None:
    lines = lines_of(simulation, 0.05)
    assert lines.first.size == len(simulation) + 1
    for run in range(len(simulation)):
        line = lines.points[lines.first[run] : lines.first[run + 1]]
        np.testing.assert_array_equal(line[0], simulation.releases.position[run])
        np.testing.assert_array_equal(line[-1], simulation.position[run])
    line = lines.points[lines.first[0] : lines.first[1]]
    time = np.linspace(0.0, 1.0, 200)  # of the first flight, which lasts longer
    x, z = 4.0 * time, 6.0 + 2.0 * time - 0.5 * 9.81 * time**2
    gap = np.abs(np.interp(x, line[:, 0], line[:, 2]) - z)
    assert 0.02 < gap.max() <= 0.05 + 1e-9
    assert len(lines_of(simulation, 0.5).points) < len(lines.points)


def test_lines_need_all_moments(simulation: Simulation) -> None:
    ends = simulate(simulation.ground, simulation.releases, simulation.settings, record="ends")
    with pytest.raises(RockfallError, match="record"):
        lines_of(ends)


def test_a_simulation_has_its_paths_stops_and_impacts(tmp_path: Path, simulation: Simulation) -> None:
    path = tmp_path / "simulation.gpkg"
    names = write_simulation_geopackage([simulation], path)
    assert names == ("releases", "trajectories", "impacts", "stops")
    assert rows(path, "SELECT count(*) FROM impacts") == [(int(simulation.impacts.sum()),)]
    told = rows(path, 'SELECT run, "end", v_max_mps FROM trajectories ORDER BY fid')
    assert [row[0] for row in told] == list(range(1, 13))
    np.testing.assert_array_equal([row[2] for row in told], simulation.v_max_mps)
    only_ends = simulate(simulation.ground, simulation.releases, simulation.settings, record="ends")
    assert write_simulation_geopackage([only_ends], path) == ("releases", "stops")
    assert rows(path, "SELECT value FROM about WHERE name = 'blocks'") == [("12",)]


def test_measured_trajectories_break_where_nothing_was_seen() -> None:
    n = 6
    samples = TrajectorySamples(
        np.full(n, "observed"), np.array(["A", "A", "A", "A", "B", "B"]), np.array([1, 1, 2, 2, 1, 1]),
        np.arange(n, dtype=float), np.arange(3.0 * n).reshape(n, 3), np.ones((n, 3)) * np.arange(n)[:, None],
        np.array([1.0, np.nan, 2.0, 3.0, np.nan, np.nan]), np.full(n, 2000.0),
    )  # fmt: skip
    layer = measured_layer(samples)
    assert layer.first is not None
    assert layer.first.tolist() == [0, 2, 4, 6]
    assert layer.columns["trajectory"].tolist() == ["A", "A", "B"]
    np.testing.assert_array_equal(layer.columns["height_max_m"], [1.0, 3.0, np.nan])
    np.testing.assert_allclose(layer.columns["v_max_mps"], np.sqrt(3) * np.array([1.0, 3.0, 5.0]))


def test_the_command_writes_what_was_measured_and_screens_beside(tmp_path: Path) -> None:
    """The demo: each measured path ends at its pick, and a screen lies on the terrain."""
    line = "name,x_m,y_m,height_m,capacity_kJ\nfence,988391.6,6375682,3.0,15\nfence,988428.4,6375648,3.0,15\n"
    (tmp_path / "screens.csv").write_text(line, encoding="utf-8")
    asked = ["simulate", str(DEMO / "project.toml"), "--model", "noel_2017", "--number", "2", "--geopackage"]
    assert main([*asked, "--screen", str(tmp_path / "screens.csv"), "--out", str(tmp_path / "out")]) == 0
    path = tmp_path / "out" / "simulation.gpkg"
    counts = {
        name: rows(path, f"SELECT count(*) FROM {name}")[0][0]
        for (name,) in rows(path, "SELECT table_name FROM gpkg_geometry_columns")
    }
    assert counts.keys() == {
        "releases", "trajectories", "impacts", "stops", "measured", "measured_impacts", "screens",
    }  # fmt: skip
    assert counts["trajectories"] == counts["stops"] == counts["releases"] == 30
    assert (counts["measured"], counts["measured_impacts"], counts["screens"]) == (15, 104, 1)
    assert rows(path, "SELECT name, height_m, capacity_kJ FROM screens") == [("fence", 3.0, 15.0)]
    (shape,) = rows(path, "SELECT geom FROM screens")[0]
    ends = np.frombuffer(shape[65:], "<f8").reshape(-1, 3)
    np.testing.assert_allclose(ends[:, :2], [[988391.6, 6375682], [988428.4, 6375648]])
    surface = open_terrain(read_project(DEMO / "project.toml"))
    assert surface is not None
    local = surface.shift.to_local(ends)
    near = [surface.vertices[np.hypot(*(surface.vertices - place)[:, :2].T).argmin(), 2] for place in local]
    np.testing.assert_allclose(local[:, 2], near, atol=1.0)

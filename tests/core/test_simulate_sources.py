# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall simulate`` without a table of releases: lines, polygons, steep terrain, impacts, drawn blocks, zones."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.cli import main
from rockfall.core.georeference import GlobalShift
from rockfall.core.terrain.surface import Surface
from rockfall.core.terrain.writers import write_ply

EAST, NORTH = 2_600_000.0, 1_200_000.0


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


@pytest.fixture(scope="module")
def terrain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A plain at 500 m, a slope of 60° from x = 10 to 30, and a plain below."""
    line = np.arange(0.0, 61.0, 2.0)
    x, y = np.meshgrid(line, line)
    z = 500 - np.tan(np.radians(60)) * np.clip(x - 10, 0, 20)
    i = np.arange(line.size**2).reshape(line.size, -1)
    lower = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:]], axis=-1).reshape(-1, 3)
    upper = np.stack([i[:-1, :-1], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 3)
    faces = np.concatenate([lower, upper]).astype(np.int32)
    path = tmp_path_factory.mktemp("ground") / "slope.ply"
    vertices = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    write_ply(Surface(vertices, faces, GlobalShift(EAST, NORTH, 0.0), "slope"), path)
    return path


@pytest.fixture
def simulate(terrain: Path, tmp_path: Path):
    def run(*options: str) -> tuple[int, Path]:
        out = tmp_path / f"out{len(list(tmp_path.glob('out*')))}"
        argv = ["simulate", "--terrain", str(terrain), "--model", "noel_2017", "--out", str(out), "--record", "impacts"]
        return main([*argv, *options]), out

    return run


def polygon_file(tmp_path: Path, *corners: tuple[float, float]) -> str:
    path = tmp_path / "area.geojson"
    ring = [[EAST + x, NORTH + y, 0.0] for x, y in [*corners, corners[0]]]
    content = {
        "type": "Feature",
        "properties": {"name": "niche"},
        "geometry": {"type": "Polygon", "coordinates": [ring]},
    }
    path.write_text(json.dumps(content), encoding="utf-8")
    return str(path)


def test_steep_terrain_a_line_and_a_polygon_release_blocks(simulate, tmp_path: Path) -> None:
    code, out = simulate("--steeper-than", "50", "--number", "30", "--diameter", "0.3..0.6", "--shape", "cube")
    assert code == 0
    rows = rows_of(out / "runs.csv")
    assert len(rows) == 30
    assert all(EAST + 10 < float(row["x0_m"]) < EAST + 31 for row in rows)
    sizes = np.array([float(row["diameter_m"]) for row in rows])
    assert 0.3 <= sizes.min() < 0.4 < 0.5 < sizes.max() <= 0.6
    np.testing.assert_allclose([float(row["mass_kg"]) for row in rows], 2650 * sizes**3)

    code, out = simulate(
        "--from-polygon", polygon_file(tmp_path, (2, 5), (8, 5), (8, 9)), "--number", "8", "--density", "normal:2500,50"
    )
    assert code == 0
    rows = rows_of(out / "runs.csv")
    assert {row["release"] for row in rows} == {"niche"}
    assert len({row["mass_kg"] for row in rows}) == 8
    assert all(float(row["y0_m"]) - NORTH < 9 and float(row["x0_m"]) - EAST < 8 for row in rows)
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert summary["inputs"]["polygon"]["file"] == "area.geojson"

    line = tmp_path / "line.csv"
    line.write_text(f"x_m,y_m\n{EAST + 5},{NORTH + 10}\n{EAST + 5},{NORTH + 20}\n", encoding="utf-8")
    code, out = simulate("--from-line", str(line), "--evenly", "--number", "5", "--diameter", "1.2x0.9x0.6")
    assert code == 0
    rows = rows_of(out / "runs.csv")
    np.testing.assert_allclose([float(row["y0_m"]) - NORTH for row in rows], [11, 13, 15, 17, 19], atol=1e-6)
    np.testing.assert_allclose([float(row["diameter_m"]) for row in rows], 0.9)
    np.testing.assert_allclose([float(row["mass_kg"]) for row in rows], 2650 * np.pi / 6 * 1.2 * 0.9 * 0.6)


def test_simulated_impacts_release_blocks_that_go_on_in_the_same_way(simulate) -> None:
    code, out = simulate("--steeper-than", "50", "--number", "3")
    assert code == 0
    impacts = rows_of(out / "impacts.csv")
    code, again = simulate("--from-impacts", str(out / "impacts.csv"))
    assert code == 0
    runs = rows_of(again / "runs.csv")
    leaving = [row for row in impacts if "into_ground" not in row["flags"]]
    assert len(runs) == len(leaving)
    for run, impact in zip(runs, leaving, strict=True):
        assert run["release"] == f"{impact['trajectory']} {impact['impact']}"
        speed = np.linalg.norm([float(impact[f"v2{axis}_mps"]) for axis in "xyz"])
        assert float(run["v_max_mps"]) >= speed - 1e-9
        assert float(run["diameter_m"]) == pytest.approx(0.35)


def test_measured_sizes_are_drawn_from_their_table(simulate, tmp_path: Path) -> None:
    table = tmp_path / "sizes.csv"
    table.write_text("d1_m,d2_m,d3_m,density_kgpm3\n0.5,0.4,0.3,2500\n0.9,0.6,0.6,\n", encoding="utf-8")
    code, out = simulate("--steeper-than", "50", "--number", "12", "--diameter", str(table))
    assert code == 0
    masses = {round(float(row["mass_kg"]), 6) for row in rows_of(out / "runs.csv")}
    assert masses == {round(np.pi / 6 * v, 6) for v in (2500 * 0.06, 2650 * 0.324)}


def test_a_table_of_releases_may_leave_the_sizes_to_a_law(simulate, tmp_path: Path) -> None:
    table = tmp_path / "releases.csv"
    table.write_text(
        f"release,x_m,y_m,diameter_m,number\na,{EAST + 5},{NORTH + 9},,4\nb,{EAST + 5},{NORTH + 12},0.9,2\n",
        encoding="utf-8",
    )
    code, out = simulate(str(table), "--diameter", "lognormal:0.5,0.1", "--seed", "3")
    assert code == 0
    sizes = [float(row["diameter_m"]) for row in rows_of(out / "runs.csv")]
    assert len(set(sizes[:4])) == 4
    assert sizes[4:] == [0.9, 0.9]


def test_zones_have_parameters_of_their_own(simulate, tmp_path: Path, capsys) -> None:
    """Everything below x = 30 stops at once; the same blocks go on without the zone."""
    zones = tmp_path / "zones.csv"
    corners = [(29, 0), (61, 0), (61, 61), (29, 61)]
    rows = [f"bog,{EAST + x},{NORTH + y},9.0,0.1,0" for x, y in corners]
    zones.write_text("\n".join(["name,x_m,y_m,friction,noel_2017.rt,noel_2017.rt_sd", *rows]), encoding="utf-8")
    options = ("--steeper-than", "50", "--number", "20", "--seed", "2")
    code, free = simulate(*options)
    assert code == 0
    code, held = simulate(*options, "--zones", str(zones))
    assert code == 0
    assert "are in no zone: they have the parameters of the whole" in capsys.readouterr().out
    reach = [np.mean([float(row["x_m"]) - EAST for row in rows_of(out / "runs.csv")]) for out in (free, held)]
    assert reach[1] < reach[0] - 2
    summary = json.loads((held / "summary.json").read_text(encoding="utf-8"))
    assert summary["inputs"]["zones"]["file"] == "zones.csv"
    assert summary["models"]["noel_2017"]["zone_friction"] == {"bog": 9.0}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ((), "Nothing says where blocks start"),
        (("--steeper-than", "50", "--from-impacts", "x.csv"), "--steeper-than and --from-impacts both say"),
        (("--steeper-than", "89"), "the steepest is 60.0°"),
        (("--steeper-than", "-3"), "no angle of a slope"),
        (("--steeper-than", "nan"), "no angle of a slope"),
        (("--steeper-than", "50", "--number", "0"), "0 blocks"),
        (("--steeper-than", "50", "--number", "1000000000"), "too many for this memory"),
        (("--steeper-than", "50", "--diameter", "500"), "larger than the terrain"),
        (("--steeper-than", "50", "--diameter", "normal:0.1,1"), "below a tenth of its mean"),
        (("--steeper-than", "50", "--diameter", "1x2"), "no number and no law"),
        (("--steeper-than", "50", "--diameter", "1x2xwide"), "not three diameters"),
        (("--steeper-than", "50", "--density", "0"), "The density cannot be 0. The value of 0 is not above zero"),
        (("--steeper-than", "50", "--shape", "cube", "--proportions", "3:2:1"), "three equal diameters"),
        (("--steeper-than", "50", "--shape", "box", "--proportions", "3:2"), "not three numbers"),
        (("--steeper-than", "50", "--evenly"), "--evenly goes with --from-line"),
        (("--steeper-than", "50", "--zone-attribute", "soil"), "Give --zones FILE"),
        (("--from-line", "nowhere.csv"), "nowhere.csv: There is no such file"),
        (("--from-polygon", "nowhere.geojson"), "nowhere.geojson: There is no such file"),
    ],
)
def test_bad_options_are_refused_and_leave_nothing(simulate, capsys, options, message: str) -> None:
    code, out = simulate(*options)
    assert code == 1
    assert message in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("line.csv", f"x_m,y_m\n{EAST + 5},{NORTH + 5}\n", "1 different point. A line needs at least 2"),
        ("line.csv", "x_m,y_m\n900,5\n900,9\n", "The line of releases is wholly outside of the terrain"),
        ("line.csv", f"x_m,y_m\n{EAST},north\n", "row 2: 'north'"),
        ("line.geojson", "{", "The GeoJSON file cannot be read"),
        ("line.geojson", "[]", "no object"),
        ("line.geojson", '{"type": "FeatureCollection", "features": []}', "has no line"),
        ("line.geojson", '{"type": "Point", "coordinates": [1, 2]}', "is a Point, where lines are needed"),
        ("line.geojson", '{"type": "LineString", "coordinates": [[1, "x"], [1, 2]]}', "not two or three numbers"),
        ("line.geojson", '{"type": "LineString", "coordinates": 3}', "has no list"),
        ("line.geojson", '{"type": "Feature", "geometry": null}', "is empty"),
        ("line.geojson", '{"type": "LineString", "coordinates": [[8.1, 46.2], [8.2, 46.3]]}', "seems to be in degrees"),
    ],
)
def test_bad_lines_are_refused_with_their_file(simulate, tmp_path: Path, capsys, name, text, message) -> None:
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    code, out = simulate("--from-line", str(path))
    error = capsys.readouterr().err
    assert code == 1
    assert message in error.replace(str(path), "")
    assert name in error
    assert not out.exists()


def test_bad_polygons_are_refused(simulate, tmp_path: Path, capsys) -> None:
    for corners, message in (
        (((2, 5), (8, 5)), "2 different points"),
        (((2, 5), (8, 5), (5, 5)), "no area"),
        (((2, 5), (8, 5), (2, 9), (8, 8)), "crosses itself"),
        (((900, 5), (908, 5), (908, 9)), "wholly outside of the terrain"),
    ):
        assert simulate("--from-polygon", polygon_file(tmp_path, *corners))[0] == 1
        assert message in capsys.readouterr().err


def test_bad_tables_of_sizes_are_refused(simulate, tmp_path: Path, capsys) -> None:
    path = tmp_path / "sizes.csv"
    for text, message in (
        ("d1_m,d2_m,d3_m\n1,2,\n", "row 2: The block has no size"),
        ("diameter_m\n0.5\n-1\n", "row 3: The diameter is -1"),
        ("diameter_m,density_kgpm3\n0.5,0\n", "row 2: The density is 0"),
        ("diameter_m\nbig\n", "row 2: 'big'"),
    ):
        path.write_text(text, encoding="utf-8")
        assert simulate("--steeper-than", "50", "--diameter", str(path))[0] == 1
        assert message in capsys.readouterr().err

# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall simulate PROJECT``: what a project states is what falls."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.cli import main
from rockfall.core.exchange.project import read_project
from rockfall.core.georeference import GlobalShift
from rockfall.core.impact_models.registry import COMPARED
from rockfall.core.reconstruction.drag import Drag
from rockfall.core.terrain.surface import Surface
from rockfall.core.terrain.writers import write_ply
from rockfall.core.workflow.scenarios import open_simulation
from rockfall.core.workflow.simulation import ground_of

EAST, NORTH, SLOPE = 2_600_000.0, 1_200_000.0, 0.6
G = 9.81


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def numbers(rows: list[dict[str, str]], *names: str) -> np.ndarray:
    return np.array([[float(row[name]) for name in names] for row in rows])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A plane of 200 m, a release that flies 2 s, and an impact after it."""
    vertices = np.array([[x, y, -SLOPE * x] for y in (0.0, 200.0) for x in (0.0, 200.0)])
    faces = np.array([[0, 1, 3], [0, 3, 2]], np.int32)
    write_ply(Surface(vertices, faces, GlobalShift(EAST, NORTH, 500.0), "plane"), tmp_path / "terrain.ply")
    places = [(0.0, 30.0, 100.0, "release"), (2.0, 60.0, 101.0, "impact"), (4.0, 90.0, 102.0, "impact")]
    lines = [f"B01,{t},{EAST + x},{NORTH + y},{500 - SLOPE * x:.9f},{kind}" for t, x, y, kind in places]
    text = "trajectory,time_s,x_m,y_m,z_m,kind\n" + "\n".join(lines) + "\n"
    (tmp_path / "picks.csv").write_text(text, encoding="utf-8")
    return tmp_path


def project(folder: Path, simulation: str) -> Path:
    path = folder / "project.toml"
    head = 'schema = 1\n[terrain]\nfile = "terrain.ply"\n[picks]\nfile = "picks.csv"\n[block]\nd1_m = 0.4\nd2_m = 0.4\n'
    path.write_text(f"{head}d3_m = 0.4\n{simulation}", encoding="utf-8")
    return path


def test_a_project_without_a_simulation_releases_what_was_measured(folder: Path) -> None:
    path = project(folder, "")
    scenario, inputs = open_simulation(read_project(path), path)
    assert tuple(scenario.models) == COMPARED
    assert set(inputs) == {"project", "terrain", "picks"}
    releases = scenario.releases(ground_of(scenario))
    assert releases.name.tolist() == ["B01"]
    np.testing.assert_allclose(releases.diameter_m, 0.4)
    place = scenario.terrain.shift.to_survey(releases.position)[0] - [EAST + 30, NORTH + 100, 500 - SLOPE * 30]
    np.testing.assert_allclose(place, 0.2 * np.array([SLOPE, 0, 1]) / np.hypot(1, SLOPE), atol=1e-4)


def test_what_was_reconstructed_with_drag_falls_with_it_unless_the_project_says_otherwise(folder: Path) -> None:
    drag = "[reconstruction]\ndrag = true\ndrag_coefficient = 0.7\n"
    for section, expected in ((drag, Drag(coefficient=0.7)), (f"{drag}[simulation]\nseed = 1", None), ("", None)):
        path = project(folder, section)
        assert open_simulation(read_project(path), path)[0].drag == expected


def test_the_first_flight_is_the_measured_one(folder: Path) -> None:
    """v = ((60 − 30)/2, …): the release's velocity is that of the parabola through both picks."""
    path = project(
        folder, '[models.noel_2017]\nrn_limit = 0.8\n[simulation]\nmodels = ["noel_2017"]\nrecord = ["impacts"]'
    )
    out = folder / "out"
    assert main(["simulate", str(path), "--out", str(out)]) == 0
    first = rows_of(out / "impacts.csv")[0]
    fall = SLOPE * 30
    expected = [15.0, 0.5, -fall / 2 - G]
    np.testing.assert_allclose(numbers([first], "v1x_mps", "v1y_mps", "v1z_mps")[0], expected, atol=0.05)
    assert float(first["time_s"]) == pytest.approx(2.0, abs=0.05)
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert summary["models"]["noel_2017"]["parameters"] == {"rn_limit": 0.8}
    later = project(folder, '[simulation.releases]\ntrajectory = "B01"\ntime_s = 2.0')
    assert main(["simulate", str(later), "--model", "noel_2017", "--record", "none", "--out", str(out)]) == 0
    assert float(rows_of(out / "runs.csv")[0]["x0_m"]) == pytest.approx(EAST + 60, abs=0.4)


SOURCES = {
    "points": f"points_m = [[{EAST + 40}, {NORTH + 50}], [{EAST + 60}, {NORTH + 80}]]",
    "line": f"points_m = [[{EAST + 40}, {NORTH + 50}], [{EAST + 40}, {NORTH + 80}]]",
    "polygon": f"points_m = [[{EAST + 40}, {NORTH + 50}], [{EAST + 60}, {NORTH + 50}], [{EAST + 50}, {NORTH + 80}]]",
    "steep": "steeper_than_deg = 30",
    "table": 'file = "releases.csv"',
}


@pytest.mark.parametrize("source", SOURCES)
def test_each_source_releases_its_blocks(folder: Path, source: str) -> None:
    (folder / "releases.csv").write_text(f"x_m,y_m\n{EAST + 50},{NORTH + 60}\n", encoding="utf-8")
    section = f'[simulation]\nmodels = ["noel_2017"]\n[simulation.releases]\nfrom = "{source}"\nnumber = 4\n'
    out = folder / "out"
    path = project(folder, f"{section}{SOURCES[source]}\ndiameter_m = 0.6")
    assert main(["simulate", str(path), "--record", "none", "--out", str(out)]) == 0
    runs = rows_of(out / "runs.csv")
    assert len(runs) == (8 if source == "points" else 4)
    np.testing.assert_allclose(numbers(runs, "diameter_m"), 0.6)
    x, y, z = (numbers(runs, "x0_m", "y0_m", "z0_m") - [EAST, NORTH, 500.0]).T
    np.testing.assert_allclose((z + SLOPE * x) / np.hypot(1, SLOPE), 0.3, atol=1e-5)
    if source != "steep":
        assert ((x > 39.5) & (x < 60.5) & (y > 49.5) & (y < 80.5)).all()


def test_options_go_before_the_project(folder: Path, capsys) -> None:
    path = project(folder, '[simulation]\nmodels = ["noel_2017"]\nseed = 5\nrolling = "coulomb"\nrecord = []')
    argv = ["simulate", str(path), "--out", str(folder / "out")]
    chosen = [
        "--model",
        "stevens_1998",
        "--set",
        "stevens_1998.rn=0.3",
        "--number",
        "3",
        "--seed",
        "9",
        "--friction",
        "0.7",
    ]
    assert main([*argv, *chosen]) == 0
    summary = json.loads((folder / "out" / "summary.json").read_text(encoding="utf-8"))
    assert list(summary["models"]) == ["stevens_1998"]
    assert summary["models"]["stevens_1998"]["parameters"] == {"rn": 0.3}
    assert (summary["seed"], summary["rolling"], summary["friction"]) == (9, "coulomb", 0.7)
    assert len(rows_of(folder / "out" / "runs.csv")) == 3
    assert main([*argv, "--terrain", "other.ply"]) == 1
    assert "--terrain is what a project says itself" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("simulation", "problem"),
    [
        ('[simulation.releases]\ntrajectory = "B09"', "There is no trajectory 'B09' to release blocks from"),
        ('[simulation.releases]\nfrom = "steep"\nsteeper_than_deg = 60', "No terrain is steeper than 60"),
        ('[simulation.releases]\nfrom = "points"\npoints_m = [[0, 0]]', "There is no terrain"),
        (
            '[simulation.releases]\nfrom = "line"\npoints_m = [[2600050, 1200050], [2600090, 1200060]]\n'
            "diameter_m = 4e3",
            "is larger than the terrain",
        ),
    ],
)
def test_what_cannot_be_released_is_said(folder: Path, capsys, simulation: str, problem: str) -> None:
    out = folder / "out"
    assert main(["simulate", str(project(folder, simulation)), "--out", str(out)]) == 1
    place, _, said = capsys.readouterr().err.partition("project.toml: ")
    assert place.endswith(f"rockfall: {folder}/")
    assert problem in said
    assert not out.exists()


def test_a_project_without_terrain_is_refused(folder: Path, capsys) -> None:
    path = folder / "project.toml"
    path.write_text('schema = 1\n[picks]\nfile = "picks.csv"\n', encoding="utf-8")
    assert main(["simulate", str(path), "--out", str(folder / "out")]) == 1
    assert "The project names no terrain" in capsys.readouterr().err


def test_zones_of_a_project_have_their_parameters(folder: Path, capsys) -> None:
    """The half of the plane whose middle is at two thirds of its width."""
    corners = [(100, 0), (200, 0), (200, 200), (100, 200)]
    rows = [f"wood,{EAST + x},{NORTH + y},0.9,0.3" for x, y in corners]
    (folder / "zones.csv").write_text("\n".join(["name,x_m,y_m,friction,rt", *rows]), encoding="utf-8")
    path = project(folder, '[simulation]\nmodels = ["noel_2017"]\n[simulation.zones]\nfile = "zones.csv"')
    scenario, inputs = open_simulation(read_project(path), path)
    assert inputs["zones"] == folder / "zones.csv"
    assert scenario.zones is not None
    assert sorted(scenario.zones.of_face.tolist()) == [0, 1]
    (settings,) = scenario.settings
    assert settings.zone_friction == {"wood": 0.9}
    assert settings.zones == {"wood": {"rt": 0.3}}
    assert main(["simulate", str(path), "--record", "none", "--out", str(folder / "out")]) == 0
    assert "1 of 2 faces are in no zone" in capsys.readouterr().out
    with_attribute = project(folder, '[simulation.zones]\nfile = "zones.csv"\nattribute = "soil"')
    assert main(["simulate", str(with_attribute), "--record", "none", "--out", str(folder / "other")]) == 1
    assert "The file has no attribute 'soil'" in capsys.readouterr().err


def test_a_project_is_reconstructed_and_compared_as_its_table_with_the_same_options(folder: Path, capsys) -> None:
    path = project(folder, "[reconstruction]\nnormal_radius_m = 1.0\n")
    options = ["--terrain", str(folder / "terrain.ply"), "--diameter", "0.4", "--normal-radius", "1"]
    said, typed = folder / "said", folder / "typed"
    assert main(["reconstruct", str(path), "--out", str(said)]) == 0
    assert main(["reconstruct", str(folder / "picks.csv"), *options, "--out", str(typed)]) == 0
    for name in ("impacts.csv", "trajectories.csv"):
        assert (said / name).read_bytes() == (typed / name).read_bytes()
    for source, out in ((path, "of_project"), (said / "impacts.csv", "of_table")):
        assert main(["compare", str(source), "--tables-only", "--out", str(folder / out)]) == 0
    predictions = [rows_of(folder / out / "predictions.csv") for out in ("of_project", "of_table")]
    assert len(predictions[0]) == len(predictions[1]) > 0
    speeds = [numbers(rows, "v2x_mps", "v2y_mps", "v2z_mps") for rows in predictions]
    np.testing.assert_allclose(*speeds, atol=1e-4)
    capsys.readouterr()
    assert main(["reconstruct", str(path), "--diameter", "0.5", "--out", str(folder / "no")]) == 1
    assert "--diameter is what a project says itself" in capsys.readouterr().err

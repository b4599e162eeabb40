# SPDX-License-Identifier: GPL-3.0-or-later
"""`rockfall simulate --screen` and `rockfall design`: the tables and pages that they write, and what they refuse."""

import csv
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from rockfall.core import cli
from rockfall.core.errors import InputError
from rockfall.core.exchange.screens import read_screens
from rockfall.core.georeference import GlobalShift

SITE = Path(__file__).parents[2] / "assets" / "demo"
BARRIERS = """name,x_m,y_m,height_m,capacity_kJ
barrier,988391.6,6375682,3.0,15
barrier,988410,6375660,3.0,15
barrier,988428.4,6375648,3.0,15
road,988375,6375655,,
road,988405,6375630,,
"""


@pytest.fixture
def barriers(tmp_path: Path) -> Path:
    path = tmp_path / "barriers.csv"
    path.write_text(BARRIERS, encoding="utf-8")
    return path


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_screens_have_tables_that_agree(tmp_path: Path, barriers: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    arguments = ["simulate", str(SITE / "project.toml"), "--model", "noel_2017", "--number", "10", "--screen"]
    assert cli.main([*arguments, str(barriers), "--out", str(out)]) == 0
    hits, screens = rows(out / "hits.csv"), rows(out / "screens.csv")
    with_barriers = {(row["screen"], row["quantity"]): row for row in screens if row["barriers"] == "1"}
    for name in ("barrier", "road"):
        own = [row for row in hits if row["structure"] == name]
        told = with_barriers[name, "energy"]
        assert len(own) == int(told["hits"])
        assert len({row["run"] for row in own}) == int(told["reach"])
        hit: dict[str, float] = {}  # of each block its greatest
        for row in own:
            hit[row["run"]] = max(hit.get(row["run"], 0.0), float(row["kinetic_J"]) + float(row["rotational_J"]))
        energy = np.array(list(hit.values())) / 1000
        assert float(told["q95"]) == pytest.approx(np.quantile(energy, 0.95), rel=1e-5)
        assert float(told["greatest"]) == pytest.approx(energy.max(), rel=1e-5)
    held = [row for row in hits if row["structure"] == "barrier" and row["passes"] == "0"]
    assert len(held) == int(with_barriers["barrier", "energy"]["held"]) > 0
    runs = {row["run"] for row in held}
    assert not [row for row in hits if row["structure"] == "road" and row["run"] in runs]
    assert "barrier holds" in capsys.readouterr().out


def test_screens_of_a_project_are_those_of_a_file(tmp_path: Path, barriers: Path) -> None:
    stated = tmp_path / "site" / "project.toml"
    shutil.copytree(SITE, stated.parent, ignore=shutil.ignore_patterns("footage"))
    arguments = ["simulate", str(stated), "--model", "noel_2017", "--number", "5", "--out"]
    assert cli.main([*arguments, str(tmp_path / "file"), "--screen", str(barriers)]) == 0
    more = """
[[simulation.screens]]
name = "barrier"
points_m = [[988391.6, 6375682.0], [988410.0, 6375660.0], [988428.4, 6375648.0]]
height_m = 3.0
capacity_kJ = 15
[[simulation.screens]]
name = "road"
points_m = [[988375.0, 6375655.0], [988405.0, 6375630.0]]
"""
    stated.write_text(stated.read_text(encoding="utf-8") + more, encoding="utf-8")
    assert cli.main([*arguments, str(tmp_path / "stated")]) == 0
    for name in ("hits.csv", "screens.csv"):
        assert (tmp_path / "stated" / name).read_bytes() == (tmp_path / "file" / name).read_bytes()


def test_a_design_sheet_of_the_demo(tmp_path: Path, barriers: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    arguments = [
        "design",
        str(SITE / "project.toml"),
        "--number",
        "20",
        "--no-holdout",
        "--factors",
        "none",
        "--cell",
        "4",
    ]
    assert cli.main([*arguments, "--screen", str(barriers), "--out", str(out)]) == 0
    assert {path.name for path in out.iterdir()} == {"design.html", "design.pdf", "design.json", "screens.csv"}
    said = capsys.readouterr().out
    assert "barrier is not enough for Noël et al. 2017" in said
    told = {(row["barriers"], row["screen"]): row for row in rows(out / "screens.csv")}
    assert (told["1", "barrier"]["verdict"], told["1", "barrier"]["factors"]) == ("not_enough", "No partial factors")
    assert told["0", "barrier"]["verdict"] == told["1", "road"]["verdict"] == ""
    html = (out / "design.html").read_text(encoding="utf-8")
    assert "Evidence: the impacts that were measured on this site" in html
    assert "EPSG:2154" in html
    assert html.count("<img ") == 6  # plan, two maps, profile, two screens


def test_fifteen_blocks_give_no_verdict_and_no_design_value(
    tmp_path: Path, barriers: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    barriers.write_text(BARRIERS.replace("3.0,15", "5.0,100"), encoding="utf-8")
    arguments = ["design", str(SITE / "project.toml"), "--screen", str(barriers), "--no-holdout", "--no-pdf", "--cell"]
    out = tmp_path / "out"
    assert cli.main([*arguments, "0", "--no-until-known", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "Whether barrier is enough is not known yet with Noël et al. 2017: about" in said
    assert "is enough for" not in said
    assert "class" not in said
    found = json.loads((out / "design.json").read_text(encoding="utf-8"))["models"]["noel_2017"]["barrier"]
    assert (found["blocks"], found["verdict"], found["level"]) == (15, "not_known", None)
    assert {row["verdict"] for row in rows(out / "screens.csv") if row["screen"] == "barrier"} == {"", "not_known"}
    assert cli.main([*arguments, "0", "--most", "3000", "--out", str(out)]) == 0
    found = json.loads((out / "design.json").read_text(encoding="utf-8"))["models"]["noel_2017"]["barrier"]
    assert found["verdict"] == "not_enough", "without a word about a number, blocks fall until it is known"
    assert found["blocks"] > 1000
    assert found["needed_height_m"] > 7.5
    assert cli.main([*arguments, "0", "--most", "9", "--number", "9", "--out", str(out)]) == 1
    assert "--most and --number" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("3.0,15", "0,15", "0 m high"),
        ("3.0,15", ",15", "no height"),
        ("3.0,15", "three,15", "three"),
        ("988", "788", "beside the terrain"),
        ("height_m", "hight_m", "height_m"),
    ],
)
def test_screens_that_cannot_be_are_refused(
    tmp_path: Path, barriers: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, says: str
) -> None:
    barriers.write_text(BARRIERS.replace(old, new), encoding="utf-8")
    out = tmp_path / "out"
    arguments = ["simulate", str(SITE / "project.toml"), "--model", "noel_2017", "--screen", str(barriers)]
    assert cli.main([*arguments, "--out", str(out)]) == 1
    said = capsys.readouterr().err
    assert says in said
    assert "?." not in said
    assert not out.exists()


def test_polygons_of_a_map_are_areas(tmp_path: Path) -> None:
    """The same outline as a polygon and as a closed line; a hole, which a line has not, is refused."""
    ring = [[988375.0, 6375655.0], [988405.0, 6375630.0], [988415.0, 6375645.0], [988375.0, 6375655.0]]
    screens = []
    for kind, places in (("Polygon", [ring]), ("LineString", ring), ("Polygon", [ring, ring])):
        geometry = {
            "type": "Feature",
            "properties": {"name": "house"},
            "geometry": {"type": kind, "coordinates": places},
        }
        path = tmp_path / "house.geojson"
        path.write_text(json.dumps({"type": "FeatureCollection", "features": [geometry]}), encoding="utf-8")
        if len(places) == 2:
            with pytest.raises(InputError, match="area of screen 'house' has holes"):
                read_screens(path, GlobalShift())
            continue
        screens += read_screens(path, GlobalShift())
    polygon, line = screens
    assert polygon.closed
    assert line.closed
    np.testing.assert_array_equal(polygon.line, line.line)
    np.testing.assert_array_equal(polygon.line, np.array(ring))


def test_a_design_without_a_screen_or_with_unknown_factors_says_what_to_do(
    tmp_path: Path, barriers: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    project, out = str(SITE / "project.toml"), str(tmp_path / "out")
    assert cli.main(["design", project, "--out", out]) == 1
    assert "--screen is missing" in capsys.readouterr().err
    assert cli.main(["design", project, "--screen", str(barriers), "--factors", "uni", "--out", out]) == 1
    assert "uni_11211_4_literature" in capsys.readouterr().err


def test_it_ends_when_the_values_are_known_and_says_how_many_it_took(
    tmp_path: Path, barriers: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    barriers.write_text("\n".join(BARRIERS.splitlines()[:4]), encoding="utf-8")
    monkeypatch.setattr("rockfall.core.workflow.enough.KNOWN_TO", 0.6)
    monkeypatch.setattr("rockfall.core.workflow.hazard.ROUND", 200)
    arguments = ["simulate", str(SITE / "project.toml"), "--model", "noel_2017", "--number", "60", "--record", "none"]
    out = tmp_path / "out"
    assert cli.main([*arguments, "--screen", str(barriers), "--until-known", "0.5", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    found = len(rows(out / "runs.csv"))
    assert 200 <= found < 900
    assert f"{found} blocks with Noël et al. 2017 are enough" in said
    assert len({row["release"] for row in rows(out / "runs.csv")}) == 15, "of all releases"
    assert cli.main([*arguments, "--until-known", "0.95", "--out", str(out)]) == 1
    assert "known nowhere" in capsys.readouterr().err


def test_screens_without_maps_and_with_them_are_the_same(tmp_path: Path, barriers: Path) -> None:
    arguments = ["simulate", str(SITE / "project.toml"), "--model", "noel_2017", "--number", "4"]
    for name, more in (("plain", []), ("mapped", ["--cell", "5"])):
        assert cli.main([*arguments, "--screen", str(barriers), *more, "--out", str(tmp_path / name)]) == 0
    for table in ("hits.csv", "screens.csv", "runs.csv"):
        assert (tmp_path / "plain" / table).read_bytes() == (tmp_path / "mapped" / table).read_bytes()

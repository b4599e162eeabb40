# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall simulate`` with trees: a table, a forest that is drawn, a project, tables that agree, bad input."""

import csv
import json
import sqlite3
from collections import Counter
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.cli import main
from rockfall.core.exchange.project import read_project, write_project
from rockfall.core.georeference import GlobalShift
from rockfall.core.terrain.surface import Surface
from rockfall.core.terrain.writers import write_ply

EAST, NORTH, SLOPE = 2_600_000.0, 1_200_000.0, 0.7


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A plane of 200 m, and blocks from its upper side."""
    folder = tmp_path_factory.mktemp("forest")
    vertices = np.array([[x, y, -SLOPE * x] for y in (0.0, 200.0) for x in (0.0, 200.0)])
    faces = np.array([[0, 1, 3], [0, 3, 2]], np.int32)
    write_ply(Surface(vertices, faces, GlobalShift(EAST, NORTH, 500.0), "plane"), folder / "terrain.ply")
    rows = [f"{EAST + 5},{NORTH + y},4,0,{-4 * SLOPE}" for y in range(20, 181, 4)]
    (folder / "releases.csv").write_text("x_m,y_m,vx_mps,vy_mps,vz_mps\n" + "\n".join(rows) + "\n", encoding="utf-8")
    trees = [f"T{y},{EAST + 20},{NORTH + y},{300 + y},20" for y in range(20, 181, 4)]
    trees.append(f"far,{EAST - 50},{NORTH + 3},300,20")
    (folder / "trees.csv").write_text("tree,x_m,y_m,dbh_mm,height_m\n" + "\n".join(trees) + "\n", encoding="utf-8")
    corners = [(0, 0), (200, 0), (200, 100), (0, 100), (0, 0)]
    ring = [[EAST + x, NORTH + y] for x, y in corners]
    forest = {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [ring]}}
    (folder / "forest.geojson").write_text(
        json.dumps({"type": "FeatureCollection", "features": [forest]}), encoding="utf-8"
    )
    return folder


def options(site: Path, out: Path, *more: str) -> list[str]:
    start = ["simulate", str(site / "releases.csv"), "--terrain", str(site / "terrain.ply"), "--diameter", "0.6"]
    return [*start, "--model", "noel_2017", "--out", str(out), *more]


def test_tables_tell_the_hits_of_trees(site: Path, tmp_path: Path, capsys) -> None:
    assert main(options(site, tmp_path / "out", "--trees", str(site / "trees.csv"))) == 0
    said = capsys.readouterr().out
    assert "1 of 42 trees stand beside the terrain and are left out: far" in said
    assert "Not known to it" in said
    runs, hits = rows_of(tmp_path / "out" / "runs.csv"), rows_of(tmp_path / "out" / "tree_hits.csv")
    assert sum(int(row["tree_hits"]) for row in runs) == len(hits) > 20
    mass = {row["run"]: float(row["mass_kg"]) for row in runs}
    for row in hits:
        number = {name: float(row[name]) for name in row if name not in ("tree", "model", "deviation_deg")}
        y = float(row["tree"].removeprefix("T"))
        assert number["dbh_cm"] == pytest.approx((300 + y) / 10)
        away = np.hypot(number["x_m"] - EAST - 20, number["y_m"] - NORTH - y)
        assert away == pytest.approx(0.3 + number["dbh_cm"] / 200, abs=2e-3)
        most = 0.93 * 38.7 * number["dbh_cm"] ** 2.31
        assert number["loss_max_J"] == pytest.approx(most, rel=1e-6)
        part = max(-0.046 + 1.026 / (1 + 10 ** ((0.58 - number["offset"]) * -8.007)), 0.0)
        energy = 0.5 * mass[row["run"]] * number["v1_mps"] ** 2
        assert number["kinetic1_J"] == pytest.approx(energy, rel=1e-4, abs=1e-3)
        assert number["kinetic2_J"] == pytest.approx(energy - min(part * most, energy), abs=1e-3 * energy + 1e-3)
        assert number["stands"] == 1 or energy > most
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["trees"]["number"] == 41
    assert summary["models"]["noel_2017"]["tree_hits"] == len(hits)
    assert set(summary["inputs"]) == {"releases", "terrain", "trees"}


def test_without_trees_nothing_is_told_of_them(site: Path, tmp_path: Path, capsys) -> None:
    assert main(options(site, tmp_path / "out")) == 0
    assert "hit trees" not in capsys.readouterr().out
    assert "tree_hits" not in rows_of(tmp_path / "out" / "runs.csv")[0]
    assert not (tmp_path / "out" / "tree_hits.csv").exists()
    assert "trees" not in json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))


def test_a_drawn_forest_stands_within_its_polygons_and_is_the_same_in_a_project(site: Path, tmp_path: Path) -> None:
    forest = ["--stems-per-hectare", "900", "--dbh-cm", "35,10", "--trees-within", str(site / "forest.geojson")]
    more = ["--seed", "4", "--tree-height", "15", "--species", "broadleaved"]
    assert main(options(site, tmp_path / "typed", *forest, *more)) == 0
    hits = rows_of(tmp_path / "typed" / "tree_hits.csv")
    assert hits
    assert max(float(row["y_m"]) for row in hits) < NORTH + 101
    typed = json.loads((tmp_path / "typed" / "summary.json").read_text(encoding="utf-8"))
    assert abs(typed["trees"]["number"] - 1800) < 4 * np.sqrt(1800)
    project = site / "project.toml"
    project.write_text(
        'schema = 1\n[terrain]\nfile = "terrain.ply"\n[simulation]\nmodels = ["noel_2017"]\nseed = 4\n'
        '[simulation.releases]\nfrom = "table"\nfile = "releases.csv"\ndiameter_m = 0.6\ndensity_kgpm3 = 2650\n'
        "[simulation.trees]\nstems_per_hectare = 900\ndbh_cm = 35\ndbh_sd_cm = 10\n"
        'within = "forest.geojson"\nheight_m = 15\nspecies = "broadleaved"\n',
        encoding="utf-8",
    )
    write_project(read_project(project), project)
    assert main(["simulate", str(project), "--out", str(tmp_path / "stated")]) == 0
    for table in ("runs.csv", "tree_hits.csv"):
        assert rows_of(tmp_path / "stated" / table) == rows_of(tmp_path / "typed" / table)
    met = tmp_path / "typed" / "trees.csv"
    again = ["--seed", "4", "--trees", str(met)]
    assert main(options(site, tmp_path / "again", *again)) == 0
    assert [row["tree"] for row in rows_of(tmp_path / "again" / "tree_hits.csv")] == [row["tree"] for row in hits]
    assert main(["simulate", str(project), "--trees", str(site / "trees.csv"), "--out", str(tmp_path / "table")]) == 0
    assert rows_of(tmp_path / "table" / "tree_hits.csv")[0]["tree"].startswith("T")


def test_a_geopackage_has_the_trees_and_their_hits(site: Path, tmp_path: Path) -> None:
    more = ["--trees", str(site / "trees.csv"), "--geopackage", "--cell", "10"]
    assert main(options(site, tmp_path / "out", *more)) == 0
    assert b"TREES" in (tmp_path / "out" / "maps" / "Nr_blocks.tif").read_bytes()
    hits = Counter(row["tree"] for row in rows_of(tmp_path / "out" / "tree_hits.csv"))
    with closing(sqlite3.connect(tmp_path / "out" / "simulation.gpkg")) as database:
        found = dict(database.execute("SELECT tree, hits FROM trees").fetchall())
    assert len(found) == 41
    assert {name: count for name, count in found.items() if count} == hits


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("x_m,y_m,dbh_cm\n2600020,1200030,0\n", "Row 2|row 2"),
        ("x_m,y_m,dbh_cm\n2600020,1200030,900\n", "9 m thick"),
        ("x_m,y_m,dbh\n2600020,1200030,30\n", "dbh_cm"),
        ("x_m,y_m,dbh_cm,species\n2600020,1200030,30,palm\n", "no kind of tree 'palm'"),
        ("x_m,y_m,dbh_cm\n20,30,30\n", "No tree stands on the terrain"),
        ("x_m,y_m,dbh_cm\n2600020,1200030,thick\n", "not a number"),
    ],
)
def test_a_bad_table_is_refused_where_it_is_bad(site: Path, tmp_path: Path, capsys, text: str, problem: str) -> None:
    table = tmp_path / "bad.csv"
    table.write_text(text, encoding="utf-8")
    assert main(options(site, tmp_path / "out", "--trees", str(table))) == 1
    said = capsys.readouterr().err
    assert any(one in said for one in problem.split("|"))
    assert "bad.csv" in said
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("more", "problem"),
    [
        (["--stems-per-hectare", "400"], "which needs --dbh-cm"),
        (["--dbh-cm", "30"], "which needs --stems-per-hectare"),
        (["--stems-per-hectare", "400", "--dbh-cm", "thick"], "Write 32, or 32,12"),
        (["--tree-height", "4"], "there are none"),
        (["--trees", "inventory.geojson"], "not from a map of points"),
        (["--stems-per-hectare", "1e9", "--dbh-cm", "30"], "fit"),
        (["--trees", "x.csv", "--dbh-cm", "30"], "Give --trees, or --stems-per-hectare"),
        (["--stems-per-hectare", "400", "--dbh-cm", "30", "--species", "palm"], "no kind of tree"),
    ],
)
def test_options_that_do_not_go_together_are_refused(
    site: Path, tmp_path: Path, capsys, more: list[str], problem: str
) -> None:
    assert main(options(site, tmp_path / "out", *more)) == 1
    assert problem in capsys.readouterr().err

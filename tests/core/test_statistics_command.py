# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall statistics``: its tables against sums over the rows of impacts.csv, its words, figures and refusals."""

import csv
import hashlib
import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
import scipy.stats
from rockfall.core.analysis.graphs import GraphSpec
from rockfall.core.analysis.group_statistics import group_by_text
from rockfall.core.cli import main
from rockfall.core.commands.demo import SITE
from rockfall.core.exchange.project import read_project
from rockfall.core.exchange.selection import rows_of
from rockfall.core.exchange.tables import write_impacts
from rockfall.core.workflow.opening import open_project

TABLES = {"statistics.csv", "angle_classes.csv", "summary.json"}
OF_GROUPS = {"groups.csv", "group_tests.csv", "group_pairs.csv"}


@pytest.fixture(scope="module")
def demo():
    return open_project(read_project(SITE / "project.toml"))[1].impacts


@pytest.fixture(scope="module")
def table(demo, tmp_path_factory):
    """The demo's impacts, with a column of grounds that changes along the trajectories and is empty at some."""
    ground = np.array([("rock", "scree", "grass", "")[i % 4] for i in range(len(demo))])
    path = tmp_path_factory.mktemp("table") / "impacts.csv"
    write_impacts(replace(demo, extra={**demo.extra, "material": ground}), path)
    return path


def read(path):
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def complete(path):
    """The rows that have all coefficients, as numbers."""
    names = ("vt1_mps", "vt2_mps", "rn", "r", "theta1_deg", "theta_dev_deg")
    return [{name: float(row[name]) for name in names} | row for row in read(path) if row["rn"] and row["r"]]


def test_the_numbers_of_the_demo(table, tmp_path, capsys) -> None:
    assert main(["statistics", str(table), "--out", str(tmp_path / "out"), "--tables-only"]) == 0
    printed = capsys.readouterr().out
    assert {path.name for path in (tmp_path / "out").iterdir()} == TABLES
    found = {row["name"]: row["value"] for row in read(tmp_path / "out" / "statistics.csv")}
    rows = complete(table)
    x, y, angle, rn = (np.array([float(row[n]) for row in rows]) for n in ("vt1_mps", "vt2_mps", "theta1_deg", "rn"))
    slope = (x * y).sum() / (x * x).sum()
    rest = ((y - slope * x) ** 2).sum()
    reach = scipy.stats.t.ppf(0.975, x.size - 1) * math.sqrt(rest / (x.size - 1) / (x * x).sum())
    assert float(found["rt_slope"]) == pytest.approx(slope)
    assert float(found["rt_slope_low"]) == pytest.approx(slope - reach)
    assert float(found["rt_slope_r2"]) == pytest.approx(1 - rest / ((y - y.mean()) ** 2).sum())
    exponent = scipy.stats.theilslopes(np.log(rn), np.log(angle)).slope
    assert float(found["rn_angle_exponent"]) == pytest.approx(exponent)
    assert int(found["impacts_used"]) == len(rows) == 83
    assert "R_T = 0.550 (0.509–0.591; " in printed  # as the site's description gives it
    assert "R² 0.546" in printed
    assert float(found["normal_spread_median"]) == pytest.approx(
        np.median([float(row["normal_spread_deg"]) for row in rows])
    )
    for one in read(tmp_path / "out" / "angle_classes.csv"):
        here = (angle >= float(one["theta1_low_deg"])) & (angle < float(one["theta1_high_deg"]))
        assert (int(one["impacts"]), int(one["rn_above_one"])) == (here.sum(), (rn[here] > 1).sum())
    assert re.search(r"10–20° +41 +19 +46 % \(32 %–61 %\)", printed)


def test_groups_and_where_they_differ(table, tmp_path, capsys) -> None:
    out = tmp_path / "out"
    assert main(["statistics", str(table), "--group", "material", "--out", str(out), "--tables-only"]) == 0
    printed = capsys.readouterr().out
    assert {path.name for path in out.iterdir()} == TABLES | OF_GROUPS
    rows, groups = complete(table), read(out / "groups.csv")
    assert [row["group"] for row in groups] == ["rock", "scree", "grass"]
    values = {g: [float(row["rn"]) for row in rows if row["material"] == g] for g in ("rock", "scree", "grass")}
    for row in groups:
        assert int(row["impacts_used"]) == len(values[row["group"]])
        assert float(row["rn_median"]) == pytest.approx(np.median(values[row["group"]]))
    tests = {row["quantity"]: row for row in read(out / "group_tests.csv")}
    reference = scipy.stats.kruskal(*values.values())
    assert float(tests["rn"]["h"]) == pytest.approx(reference.statistic)
    assert float(tests["rn"]["p_independent"]) == pytest.approx(reference.pvalue)
    assert float(tests["rn"]["p"]) == pytest.approx(reference.pvalue, abs=0.15)
    pairs = [row for row in read(out / "group_pairs.csv") if row["quantity"] == "rn"]
    assert [(row["first"], row["second"]) for row in pairs] == [
        ("rock", "scree"),
        ("rock", "grass"),
        ("scree", "grass"),
    ]
    u = scipy.stats.mannwhitneyu(values["scree"], values["rock"]).statistic
    assert float(pairs[0]["cliffs_delta"]) == pytest.approx(2 * u / len(values["rock"]) / len(values["scree"]) - 1)
    assert "26 impacts have no material: they are in no group." in printed
    assert "impacts exchanged their groups within their trajectory, 9999 times" in printed
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert summary["inputs"] == [
        {"file": "impacts.csv", "sha256": hashlib.sha256(table.read_bytes()).hexdigest(), "impacts": 104}
    ]
    assert summary["groups"]["exchanged"] == "within"
    assert summary["statistics"]["impacts_used"] == 83
    assert any(remark["about"] == "rt" for remark in summary["remarks"])


def test_the_same_seed_the_same_tables(table, tmp_path) -> None:
    for name in ("one", "two"):
        argv = ["statistics", str(table), "--group", "normal_spread_deg", "--classes", "3", "--seed", "7"]
        assert main([*argv, "--out", str(tmp_path / name), "--tables-only"]) == 0
    for path in (tmp_path / "one").iterdir():
        assert path.read_bytes() == (tmp_path / "two" / path.name).read_bytes()
    assert len(read(tmp_path / "one" / "groups.csv")) == 3


def test_several_sites_and_what_is_there_twice(demo, table, tmp_path, capsys) -> None:
    first = rows_of(demo, slice(0, 40))
    moved = {"position": first.position + 1000.0, "time_s": first.time_s + 50.0, "v1": first.v1 * 1.01}
    write_impacts(replace(first, site=np.full(40, ""), **moved), tmp_path / "quarry.csv")
    argv = ["statistics", str(table), str(tmp_path / "quarry.csv"), str(table), "--site", "quarry", "--group", "site"]
    assert main([*argv, "--out", str(tmp_path / "out"), "--tables-only"]) == 0
    printed = capsys.readouterr().out
    assert "104 impacts were there twice; they count once." in printed
    groups = {row["group"]: row["impacts"] for row in read(tmp_path / "out" / "groups.csv")}
    assert groups == {"Synthetic gully": "104", "quarry": "40"}


def test_impacts_without_a_flag_are_a_group(table, tmp_path) -> None:
    assert main(["statistics", str(table), "--group", "flags", "--out", str(tmp_path / "out"), "--tables-only"]) == 0
    groups = {row["group"]: int(row["impacts"]) for row in read(tmp_path / "out" / "groups.csv")}
    assert groups["no flag"] == sum(not row["flags"] for row in read(table))
    assert sum(groups.values()) == 104


def test_a_group_of_each_number_is_told_about_classes(table, tmp_path, capsys) -> None:
    assert main(["statistics", str(table), "--group", "time_s", "--out", str(tmp_path / "out"), "--tables-only"]) == 0
    printed = capsys.readouterr().out
    assert "--classes 4" in printed.splitlines()[1]  # after the radius of the normals
    assert "whether groups differ cannot be told" in printed


def test_only_some_rows(table, tmp_path, capsys) -> None:
    argv = ["statistics", str(table), "--where", "theta1_deg<20", "--out", str(tmp_path / "out"), "--tables-only"]
    assert main(argv) == 0
    assert "of 104 impacts meet --where." in capsys.readouterr().out
    found = {row["name"]: row["value"] for row in read(tmp_path / "out" / "statistics.csv")}
    assert int(found["impacts_used"]) == sum(float(row["theta1_deg"]) < 20 for row in complete(table))


@pytest.mark.parametrize("rows", [1, 2])
def test_one_or_two_impacts_have_no_fits(demo, tmp_path, capsys, rows) -> None:
    write_impacts(rows_of(demo, np.flatnonzero(demo.complete)[:rows]), tmp_path / "few.csv")
    argv = ["statistics", str(tmp_path / "few.csv"), "--group", "trajectory", "--out", str(tmp_path / "out")]
    assert main([*argv, "--tables-only"]) == 0
    printed = capsys.readouterr().out
    assert f"{rows} of {rows} impacts have all coefficients: too few for statistics." in printed
    assert "whether groups differ cannot be told" in printed
    found = {row["name"]: row["value"] for row in read(tmp_path / "out" / "statistics.csv")}
    assert found["rt_slope"] == found["rn_angle_exponent"] == ""
    assert "NaN" not in (tmp_path / "out" / "summary.json").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--group", "matreial"], "Did you mean material?"),
        (["--graph", "thet1_deg", "rn"], "Did you mean theta1_deg?"),
        (["--where", "rn>1000"], "No impact is left"),
        (["--classes", "3"], "Add --group COLUMN"),
        (["--group", "material", "--classes", "3"], "holds texts"),
    ],
)
def test_refused_with_nothing_written(table, tmp_path, capsys, arguments, said) -> None:
    assert main(["statistics", str(table), "--out", str(tmp_path / "out"), *arguments]) == 1
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_all_discarded_is_no_result(demo, tmp_path, capsys) -> None:
    every = {name: np.full(len(demo), name == "discarded") for name in demo.flags}
    write_impacts(replace(demo, flags=every), tmp_path / "impacts.csv")
    assert main(["statistics", str(tmp_path / "impacts.csv"), "--out", str(tmp_path / "out")]) == 1
    error = capsys.readouterr().err
    assert (
        "impacts.csv: None of the 104 impacts can be used: 104 are flagged (departing, into_ground, below_terrain, "
        "discarded), 0 have no R_N" in error
    )
    assert not (tmp_path / "out").exists()


def words(path):
    """The text of an SVG; letters of a formula stand one by one."""
    return re.sub(r"\s+", "", re.sub(r"<[^>]+>", "", path.read_text(encoding="utf-8")))


def test_the_figures_of_the_measured_impacts(table, tmp_path) -> None:
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    assert main(["statistics", str(table), "--out", str(tmp_path / "out"), "--format", "svg", "pdf"]) == 0
    figures = tmp_path / "out" / "figures"
    assert {path.name for path in figures.iterdir()} == {"measured.svg", "measured.pdf"}
    text = words(figures / "measured.svg")
    assert text.count("n=83") == 4
    assert "=0.550" in text
    assert "0.509to0.591" in text


def test_the_figures_of_groups(demo, tmp_path) -> None:
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    from rockfall.core.analysis.measured_figures import save_measured_figures

    ground = np.array([("rock", "scree", "grass", "")[i % 4] for i in range(len(demo))])
    spec = GraphSpec("roughness", "normal_spread_deg", "rn")
    written = save_measured_figures(demo, tmp_path, [spec], group_by_text("material", ground), formats=("svg",))
    assert [path.stem for path in written] == ["measured", "roughness", "measured_groups", "roughness_groups"]
    text = words(tmp_path / "measured_groups.svg")
    for name in ("rock", "scree", "grass"):
        assert f"{name}({int((demo.complete & (ground == name)).sum())})" in text
    assert "others" in text  # impacts without a ground
    assert "Roughnessoftheground" in words(tmp_path / "roughness.svg")


def test_a_project_gives_the_numbers_of_its_table(table, tmp_path, capsys) -> None:
    assert main(["statistics", str(table), "--out", str(tmp_path / "table"), "--tables-only"]) == 0
    project = str(SITE / "project.toml")
    assert main(["statistics", project, "--out", str(tmp_path / "project"), "--tables-only"]) == 0
    for name in ("statistics.csv", "angle_classes.csv"):
        assert (tmp_path / "project" / name).read_bytes() == (tmp_path / "table" / name).read_bytes()


def test_a_project_among_tables_is_named(table, tmp_path, capsys) -> None:
    arguments = [str(table), str(SITE / "project.toml"), "--out", str(tmp_path / "out")]
    assert main(["statistics", *arguments]) == 1
    assert "project.toml: This is a TOML file, and a table is needed" in capsys.readouterr().err

# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall compare`` and ``rockfall models``: what they write and say, and how they refuse."""

import csv
import tomllib

import numpy as np
import pytest
from rockfall.core.cli import main
from rockfall.core.exchange.comparison_tables import read_predictions
from rockfall.core.exchange.tables import read_impacts
from rockfall.core.impact_models.registry import COMPARED, MODELS

HEADER = "trajectory,impact,nx,ny,nz,v1x_mps,v1y_mps,v1z_mps,v2x_mps,v2y_mps,v2z_mps,diameter_m,flags"
ROWS = ("a,1,0,0,1,8,0,-6,6,1,3,0.35,", "a,2,0,0,1,6,0,-5,5,0,2,0.35,", "a,3,0,0,1,,,,4,0,2,0.35,")


def table(path, rows=ROWS, header=HEADER):
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


@pytest.fixture
def impacts(tmp_path):
    return table(tmp_path / "impacts.csv")


def test_compare_writes_tables_and_a_summary(impacts, tmp_path, capsys):
    out = tmp_path / "out"
    argv = ["compare", impacts, "--replicates", 4, "--seed", 2, "--set", "azimi_desvarreux_1977.rn=0.5"]
    argv += ["--tables-only", "--out", out]
    assert main([str(word) for word in argv]) == 0
    said = capsys.readouterr().out
    assert "2 of 3 impacts compared: the mean and 4 replicates with seed 2 of 6 models." in said
    assert "Skipped: 1 with no incident velocity." in said
    assert all(name in said for name in COMPARED)
    assert max(map(len, said.splitlines()[:-1])) <= 100
    predictions = read_predictions(out / "predictions.csv", read_impacts(impacts))
    assert predictions.models == COMPARED
    assert predictions.v2.shape == (6, 5, 2, 3)
    np.testing.assert_allclose(predictions.rn[0], 0.5, rtol=1e-9)
    with (out / "scores.csv").open(encoding="utf-8") as stream:
        assert {row["model"] for row in csv.DictReader(stream)} == set(COMPARED)
    settings = tomllib.loads((out / "comparison.toml").read_text(encoding="utf-8"))
    assert (settings["seed"], settings["spin"], settings["models"]["dorren_2015"]["soil_type"]) == (2, "rolling", "5")
    first = (out / "predictions.csv").read_bytes()
    assert main([str(word) for word in argv]) == 0
    assert (out / "predictions.csv").read_bytes() == first


def test_chosen_models_spin_and_radius(impacts, tmp_path):
    out = tmp_path / "out"
    argv = [
        "compare",
        str(impacts),
        "--model",
        "noel_2017",
        "--model",
        "bourrier_hungr",
        "--out",
        str(out),
        "--tables-only",
    ]
    assert main([*argv, "--spin", "zero", "--radius", "0.175"]) == 0
    predictions = read_predictions(out / "predictions.csv", read_impacts(impacts))
    assert predictions.models == ("noel_2017", "bourrier_hungr")
    np.testing.assert_allclose(predictions.v2[0, 0, 0], [3.312, 0, 1.860413], rtol=1e-6)


def test_a_refused_terrain_is_named_and_not_the_impacts(impacts, tmp_path, capsys):
    argv = ["compare", str(impacts), "--tables-only", "--terrain", str(tmp_path / "none.ply")]
    assert main([*argv, "--out", str(tmp_path / "out")]) == 1
    said = capsys.readouterr().err
    assert f"rockfall: {tmp_path / 'none.ply'}: " in said
    assert "impacts.csv: " not in said


def test_speeds_in_km_h_are_not_taken_for_metres_a_second(impacts, tmp_path, capsys):
    """As recorded by many: the same results as from the same speeds in m/s, and no advice to rename a column."""
    speeds = HEADER.replace("_mps", "_kmh")
    rows = []
    for row in ROWS:
        cells = row.split(",")
        cells[5:11] = [repr(3.6 * float(cell)) if cell else "" for cell in cells[5:11]]
        rows.append(",".join(cells))
    other, found = table(tmp_path / "other.csv", rows, speeds), []
    for name, path in (("one", impacts), ("two", other)):
        assert main(["compare", str(path), "--tables-only", "--out", str(tmp_path / name)]) == 0, (
            capsys.readouterr().err
        )
        found.append(read_predictions(tmp_path / name / "predictions.csv", read_impacts(path)))
    np.testing.assert_allclose(read_impacts(other).v1[0], [8, 0, -6], rtol=1e-15)
    np.testing.assert_allclose(found[0].v2, found[1].v2, rtol=1e-12)
    unknown = table(tmp_path / "other.csv", rows, HEADER.replace("v1x_mps", "v1x_knots"))
    assert main(["compare", str(unknown), "--tables-only", "--out", str(tmp_path / "three")]) == 1
    said = capsys.readouterr().err
    assert f"{unknown}, row 1: The column v1x_knots is v1x_mps in a unit that is not known. Convert it to m/s" in said


BAD = {
    "no v1": ([row.replace(",8,0,-6,", ",,,,").replace(",6,0,-5,", ",,,,") for row in ROWS], [], "3 with no incident"),
    "no normals": ([row.replace(",0,0,1,", ",,,,") for row in ROWS], [], "2 with no terrain normal"),
    "zero normal": ([ROWS[0].replace(",0,0,1,", ",0,0,0,")], [], "trajectory a: The normal of impact 1 has the length"),
    "departing": ([row.replace(",0,0,1,", ",0,0,-1,") for row in ROWS], [], "2 with departing from the ground"),
    "flagged": (
        [f"{row}departing" for row in ROWS],
        [],
        "with the flag departing, into_ground, below_terrain or discarded",
    ),
    "nan": ([ROWS[0].replace(",8,", ",nan,")], [], "row 2, trajectory a: 'nan' in column v1x_mps is not finite"),
    "no radius": ([row.replace("0.35", "") for row in ROWS], [], "--radius"),
    "no spin": (ROWS, ["--spin", "table"], "no measured angular velocity"),
    "model": (ROWS, ["--model", "wylie"], "no impact model 'wylie'. Did you mean wyllie_2014?"),
    "parameter": (ROWS, ["--set", "noel_2017.rm_limit=1"], "no parameter 'rm_limit'. Did you mean rn_limit?"),
    "range": (ROWS, ["--set", "noel_2017.rn_limit=-1"], "outside its range 0…10"),
    "idle": (ROWS, ["--set", "bourrier_hungr.rt=1"], "bourrier_hungr, which is not used. Add --model"),
    "too many": (ROWS, ["--replicates", "100000000"], "too many for the memory"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_refused_and_nothing_is_written(tmp_path, capsys, case):
    rows, options, message = BAD[case]
    out = tmp_path / "out"
    path = table(tmp_path / "impacts.csv", rows)
    assert main(["compare", str(path), *options, "--out", str(out)]) == 1
    said = capsys.readouterr()
    assert message in said.err
    assert said.out == ""
    assert [path.name for path in tmp_path.iterdir()] == ["impacts.csv"]


def test_a_table_without_the_columns_is_refused(tmp_path, capsys):
    path = table(tmp_path / "impacts.csv", ["a,1"], "trajectory,impact")
    assert main(["compare", str(path), "--out", str(tmp_path / "out")]) == 1
    assert "nx, ny, nz, v1x_mps" in capsys.readouterr().err


@pytest.mark.parametrize(
    "options", [["--replicates", "-1"], ["--seed", "x"], ["--spin", "fast"], ["--radius", "0"], ["--replicates", "1.5"]]
)
def test_wrong_usage(impacts, tmp_path, capsys, options):
    assert main(["compare", str(impacts), *options, "--out", str(tmp_path / "out")]) == 2
    assert "usage: rockfall compare" in capsys.readouterr().err


def test_models_lists_every_model_and_parameter(capsys):
    assert main(["models"]) == 0
    said = capsys.readouterr().out
    assert max(map(len, said.splitlines())) <= 100
    for name, model in MODELS.items():
        assert f"\n{name}: {model.title} (" in said
    for text in ("soil_type ", "velocity_scale        9.144 m/s   0.1…100", "transfer_basis*       velocity "):
        assert f"\n  {text}" in said


def test_models_of_a_name(capsys):
    assert main(["models", "wyllie_2014"]) == 0
    assert "azimi" not in capsys.readouterr().out
    assert main(["models", "wyllie"]) == 1
    assert "Did you mean wyllie_2014?" in capsys.readouterr().err

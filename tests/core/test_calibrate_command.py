# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall calibrate`` and ``rockfall equivalent``: what they write, what compare makes of it, how they refuse."""

import csv
import tomllib

import numpy as np
import pytest
from rockfall.core.cli import main
from rockfall.core.commands import calibrate as command
from rockfall.core.exchange.calibration_tables import ESTIMATES_COLUMNS
from rockfall.core.exchange.comparison_tables import read_predictions
from rockfall.core.exchange.parameters import read_parameters
from rockfall.core.exchange.tables import read_impacts, write_impacts
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.trajectory import reconstruct

QUICK = ("--resamples", "20", "--replicates", "5")


def cells(path):
    with path.open(encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


@pytest.fixture
def impacts(tmp_path):
    """Six trajectories down a slope of 35°."""
    rng = np.random.default_rng(3)
    step = rng.uniform(0.4, 1.2, 42)
    position = np.cumsum(step[:, None] * [6.0, 0.0, -4.2] + rng.normal(size=(42, 3)) * 0.3, axis=0)
    normal = np.array([0.57, 0, 0.82]) + 0.05 * rng.normal(size=(42, 3))
    names = np.repeat([f"block {k}" for k in range(6)], 7)
    path = tmp_path / "impacts.csv"
    write_impacts(reconstruct(make_picks(names, np.cumsum(step), position, normal=normal)).impacts, path)
    return path


def test_calibrate_writes_what_compare_takes(impacts, tmp_path, capsys):
    out = tmp_path / "out"
    argv = ["calibrate", str(impacts), "--model", "azimi_desvarreux_1977", "--fit", "rn", "azimi_desvarreux_1977.rt"]
    argv += ["--out", str(out), *QUICK]
    assert main(argv) == 0
    said = capsys.readouterr().out
    assert "azimi_desvarreux_1977 fitted to 30 impacts of 6 trajectories." in said
    assert "determined" in said
    assert max(map(len, said.splitlines()[:-1])) <= 110
    estimates = cells(out / "calibration.csv")
    settings = read_parameters(out / "parameters.toml")["azimi_desvarreux_1977"]
    assert {one["model"] for one in estimates} == {"azimi_desvarreux_1977"}
    assert [one["parameter"] for one in estimates] == ["rn", "rt"]
    for one in estimates:
        assert tuple(one) == ESTIMATES_COLUMNS
        assert float(one["low"]) <= float(one["fitted"]) <= float(one["high"])
        assert settings[one["parameter"]] == float(one["fitted"])
        assert one["verdict"].endswith(("lies outside.", f"default {float(one['default']):g}."))
    with (out / "holdout.csv").open(encoding="utf-8") as stream:
        folds = list(csv.DictReader(stream))
    assert sum(int(fold["impacts"]) for fold in folds) == 30
    assert sorted(name for fold in folds for name in fold["trajectories"].split(";")) == [
        f"block {k}" for k in range(6)
    ]

    first = (out / "calibration.csv").read_bytes()
    assert main(argv) == 0
    assert (out / "calibration.csv").read_bytes() == first
    compared = tmp_path / "compared"
    argv = [
        "compare",
        str(impacts),
        "--model",
        "azimi_desvarreux_1977",
        "--parameters",
        str(out / "parameters.toml"),
        "--tables-only",
        "--out",
        str(compared),
    ]
    assert main(argv) == 0
    predictions = read_predictions(compared / "predictions.csv", read_impacts(impacts))
    np.testing.assert_allclose(predictions.rn[0, 0], settings["rn"], rtol=1e-6)


def test_settings_and_no_holdout(impacts, tmp_path):
    out = tmp_path / "out"
    argv = ["calibrate", str(impacts), "--model", "stevens_1998", "--fit", "rotational", "--set", "rn=0.5"]
    assert main([*argv, "stevens_1998.rt=0.6", "--no-holdout", "--out", str(out), *QUICK]) == 0
    settings = read_parameters(out / "parameters.toml")["stevens_1998"]
    assert (settings["rn"], settings["rt"]) == (0.5, 0.6)
    assert not (out / "holdout.csv").exists()
    (one,) = cells(out / "calibration.csv")
    assert one["fitted"] in ("on", "off")
    assert (one["low"], one["high"]) == ("", "")


def test_equivalent_writes_both_models(impacts, tmp_path, capsys):
    out = tmp_path / "out"
    argv = ["equivalent", str(impacts), "--from", "pfeiffer_bowen_1989", "--to", "stevens_1998", "--fit", "rn", "rt"]
    argv += ["--set", "rn=0.4", "stevens_1998.rn_sd=0", "stevens_1998.rt_sd=0", "--out", str(out), *QUICK]
    assert main(argv) == 0
    assert "The two behave the same on these impacts" in capsys.readouterr().out
    both = read_parameters(out / "parameters.toml")
    assert both["pfeiffer_bowen_1989"]["rn"] == 0.4
    assert both["stevens_1998"]["rn"] == pytest.approx(0.4, rel=1e-4)
    assert both["stevens_1998"]["rt"] == pytest.approx(0.85, rel=1e-4)
    assert both["stevens_1998"]["rn_sd"] == 0.0
    assert set(tomllib.loads((out / "parameters.toml").read_text(encoding="utf-8"))) == {"models"}


BAD = {
    "model": (
        ["--model", "azimi_1977", "--fit", "rn"],
        "There is no impact model 'azimi_1977'. Did you mean azimi_desvarreux_1977",
    ),
    "parameter": (["--model", "noel_2017", "--fit", "r_t"], "noel_2017 has no parameter 'r_t'. Did you mean rt"),
    "set": (["--model", "noel_2017", "--fit", "rt", "--set", "rn_limit"], "does not set a parameter"),
    "range": (["--model", "noel_2017", "--fit", "rt", "--set", "rn_limit=99"], "outside its range"),
    "both": (["--model", "noel_2017", "--fit", "rt", "--set", "rt=0.5"], "noel_2017.rt is both fitted and set"),
    "resamples": (["--model", "noel_2017", "--fit", "rt", "--resamples", "2"], "20 resamples or more"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_questions_are_refused(impacts, tmp_path, capsys, case):
    arguments, message = BAD[case]
    assert main(["calibrate", str(impacts), *arguments, "--out", str(tmp_path / "out")]) == 1
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_bad_tables_are_refused_with_their_name(impacts, tmp_path, capsys):
    lines = impacts.read_text(encoding="utf-8").splitlines()
    column = lines[0].split(",").index("flags")
    flagged = [
        ",".join([*row.split(",")[:column], "below_terrain", *row.split(",")[column + 1 :]]) for row in lines[1:]
    ]
    for rows, message in ((lines[1:6], "too few to fit"), (flagged, "No impact can be compared")):
        impacts.write_text("\n".join([lines[0], *rows]) + "\n", encoding="utf-8")
        argv = ["calibrate", str(impacts), "--model", "noel_2017", "--fit", "rt", "--out", str(tmp_path / "out")]
        assert main(argv) == 1
        said = capsys.readouterr().err
        assert message in said
        assert str(impacts) in said


def test_an_interrupted_calibration_leaves_nothing(impacts, tmp_path, monkeypatch, capsys):
    class Interrupted(command.PrintedProgress):
        def __call__(self, text: str, done: int = 0, total: int = 0) -> None:
            if text.startswith("Resampl"):
                raise KeyboardInterrupt

    monkeypatch.setattr(command, "PrintedProgress", Interrupted)
    argv = ["calibrate", str(impacts), "--model", "noel_2017", "--fit", "rt", "--out", str(tmp_path / "out"), *QUICK]
    assert main(argv) == 130
    assert "nothing was written" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["impacts.csv"]

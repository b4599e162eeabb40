# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall back-analyse``: from stops and picks to a posterior that ``simulate`` takes, and bad input."""

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.cli import main
from rockfall.core.exchange.posterior_tables import read_posterior, write_posterior
from rockfall.core.exchange.project import read_project, write_project
from rockfall.core.georeference import GlobalShift
from rockfall.core.simulation.engine import IMPACT, ON_GROUND, Settings, simulate
from rockfall.core.simulation.ground import make_ground
from rockfall.core.simulation.parameter_draws import ParameterDraws
from rockfall.core.simulation.release import make_releases, placed_on
from rockfall.core.terrain.surface import Surface
from rockfall.core.terrain.writers import write_ply

EAST, NORTH = 2_600_000.0, 1_200_000.0
SHIFT = GlobalShift(EAST, NORTH, 0.0)
MODEL = "stevens_1998"
TRUTH = {"rn": 0.6, "rt": 0.8}
RUNS = 6


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A slope that runs out, and blocks that fell down it with known parameters: picks of flights, starts, stops."""
    folder = tmp_path_factory.mktemp("site")
    line = np.arange(0.0, 121.0, 2.0)
    x, y = np.meshgrid(line, line)
    z = 500 - 0.75 * np.minimum(x, 70) + 0.3 * np.sin(x / 2) * np.cos(y / 3)
    vertices = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    i = np.arange(line.size**2).reshape(line.size, -1)
    lower = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:]], axis=-1).reshape(-1, 3)
    upper = np.stack([i[:-1, :-1], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 3)
    surface = Surface(vertices, np.concatenate([lower, upper]).astype(np.int32), SHIFT, "slope")
    write_ply(surface, folder / "slope.ply")
    ground = make_ground(surface)
    place = placed_on(ground, np.column_stack([np.full(RUNS, 6.0), 20.0 + 15 * np.arange(RUNS)]), np.full(RUNS, 0.5))
    releases = make_releases(place, velocity=np.tile([4.0, 0.0, 2.0], (RUNS, 1)), diameter_m=0.5)
    run = simulate(ground, releases, Settings(MODEL, TRUTH, seed=14))
    records = run.records
    picks, stops = ["trajectory,time_s,x_m,y_m,z_m,kind"], ["release,x_m,y_m"]
    for block in range(RUNS):
        rolls = records.time_s[(records.run == block) & (records.what == ON_GROUND)].min(initial=run.time_s[block])
        own = np.flatnonzero((records.run == block) & (records.what == IMPACT) & (records.time_s < rolls))
        marks = [(0.0, place[block] - [0.0, 0.0, 0.25], "release")]
        for row in own.tolist():
            if records.time_s[row] - marks[-1][0] > 0.15:
                marks.append((records.time_s[row], records.position[row] - 0.25 * records.normal[row], "impact"))
        end = run.position[block] - [0.0, 0.0, 0.25]
        for time, where, kind in marks:
            px, py, pz = SHIFT.to_survey(where).tolist()
            picks.append(f"B{block},{time:.4f},{px:.4f},{py:.4f},{pz:.4f},{kind}")
        stops.append(f"B{block},{EAST + end[0]:.3f},{NORTH + end[1]:.3f}")
    starts = [f"B{i},{EAST + 6},{NORTH + 20 + 15 * i},4,0,2" for i in range(RUNS)]
    (folder / "picks.csv").write_text("\n".join(picks) + "\n", encoding="utf-8")
    (folder / "stops.csv").write_text("\n".join(stops) + "\n", encoding="utf-8")
    table = "release,x_m,y_m,vx_mps,vy_mps,vz_mps\n" + "\n".join(starts) + "\n"
    (folder / "releases.csv").write_text(table, encoding="utf-8")
    return folder


def asked(site: Path, out: Path, *more: str, observed: str = "picks.csv") -> list[str]:
    terrain = ["--terrain", str(site / "slope.ply"), "--diameter", "0.5", "--out", str(out)]
    return ["back-analyse", str(site / observed), *terrain, "--model", MODEL, *more]


@pytest.fixture(scope="module")
def analysed(site: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("analysed") / "out"
    assert main(asked(site, out, "--fit", "rn", f"{MODEL}.rt", "--sets", "900", "--rounds", "2")) == 0
    return out


def test_what_is_written_agrees(analysed: Path) -> None:
    content = json.loads((analysed / "back_analysis.json").read_text(encoding="utf-8"))
    model, draws = read_posterior(analysed / "posterior.csv")
    assert model == content["model"] == MODEL
    assert draws.names == ("rn", "rt")
    assert len(draws) == content["draws"]
    assert content["simulated_runs"] == RUNS * (2 * 900 + 1000)
    assert content["observed_runs"] == [f"B{i}" for i in range(RUNS)]
    assert set(content["inputs"]) >= {"observed", "terrain"}
    for one in content["estimates"]:
        assert one["low"] < TRUTH[one["name"]] < one["high"]
        assert draws.mean()[one["name"]] == pytest.approx(one["median"], abs=(one["high"] - one["low"]) / 4)
    assert content["correlation"]["rn"]["rn"] == 1.0
    assert {one["quantity"] for one in content["predictive"]} >= {"speed_mps", "rebound_r", "impacts_per_m"}
    assert "runout_m" not in {one["quantity"] for one in content["predictive"]}  # no stop was seen
    assert sorted(name for fold in content["held_out"] for name in fold["names"]) == content["observed_runs"]
    parameters = (analysed / "parameters.toml").read_text(encoding="utf-8")
    assert f"[models.{MODEL}]" in parameters
    figures = {path.name for path in (analysed / "figures").iterdir()}
    assert figures == {"parameters.png", "pairs.png", "predictive.png"}


def test_stops_alone(site: Path, tmp_path: Path, capsys) -> None:
    out = tmp_path / "out"
    more = ["--stops", str(site / "stops.csv"), "--fit", "rt", "friction", "--prior", "friction=0.3..0.7"]
    argv = asked(site, out, *more, "--sets", "200", "--rounds", "1", "--tables-only", observed="releases.csv")
    assert main(argv) == 0
    said = capsys.readouterr().out
    assert "6 observed runs, 7200 simulated" in said
    assert "even in 0.3…0.7" in said
    content = json.loads((out / "back_analysis.json").read_text(encoding="utf-8"))
    assert {one["quantity"] for one in content["predictive"]} == {"runout_m", "energy_line_deg", "stop_aside_m"}
    assert content["friction_set"] is None
    assert not (out / "figures").exists()
    assert content["completeness"] == "not stated"
    assert "It is not stated whether all falls were recorded" in said
    assert "runs held out, mean CRPS" in said
    run_out = next(one for one in content["held_out_quantities"] if one["quantity"] == "runout_m")
    values = np.array([np.hypot(float(row["x_m"]) - EAST - 6, 0.0) for row in rows_of(site / "stops.csv")])
    alone = np.mean(  # six runs in five parts: by hand, where each is left out alone
        [np.abs(np.delete(values, i) - values[i]).mean() - _half_gini(np.delete(values, i)) for i in range(RUNS)]
    )
    assert run_out["observed_alone"] == pytest.approx(alone, rel=0.25)
    verdict = " ".join(one["text"] for one in content["remarks"] if one["about"] == "fit")
    assert f"run-out {run_out['observed_alone']:.3g} without it, {run_out['fitted']:.3g} m with" in verdict
    assert set(content["better_than_observed_alone"]) == {"gain", "error", "is_clear"}


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def _half_gini(values: np.ndarray) -> float:
    return float(np.abs(values[:, None] - values).mean() / 2)


def test_the_longest_of_all_releases(site: Path, tmp_path: Path, capsys) -> None:
    """Three of the six stops, and the releases of all six."""
    stops = rows_of(site / "stops.csv")
    farthest = sorted(stops, key=lambda row: -float(row["x_m"]))[:3]
    few = tmp_path / "few.csv"
    few.write_text("release,x_m,y_m\n" + "".join(f"{','.join(row.values())}\n" for row in farthest), encoding="utf-8")
    more = ["--stops", str(few), "--fit", "friction", "--sets", "150", "--rounds", "1", "--tables-only"]
    for i, (stated, falls) in enumerate((("longest", 6), ("longest:7", 7))):
        out = tmp_path / f"out{i}"
        argv = asked(site, out, *more, "--completeness", stated, observed="releases.csv")
        assert main(argv) == 0
        content = json.loads((out / "back_analysis.json").read_text(encoding="utf-8"))
        assert (content["completeness"], content["falls"]) == (f"longest:{falls}", falls)
        assert content["observed_runs"] == [row["release"] for row in farthest]
        assert content["simulated_runs"] == falls * (150 + 1000)
        assert f"compared with the longest of {falls} that fall" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    ("more", "problem"),
    [
        (["--fit", "rx"], "has no parameter 'rx'. Did you mean"),
        (["--fit", "rn", "--prior", "rn"], "gives no law. Write"),
        (["--fit", "rn", "--prior", "rn=0.9..2"], "is no part of its range 0…1. Give"),
        (["--fit", "rn", "--set", f"{MODEL}.rn=0.4"], "rn is both fitted and set. Leave"),
        (["--fit", "friction", "--friction", "0.4"], "friction is both fitted and set. Leave"),
        (["--fit", "rn", "--sets", "10"], "are too few. Give"),
        (["--fit", "rn", "--completeness", "all"], "says nothing of whether all falls were recorded. Write complete"),
        (["--fit", "rn", "--completeness", "longest"], "it is not stated of how many falls. Write longest:N"),
        (["--fit", "rn", "--completeness", "longest:9"], "not seen to its stop. Give its stop"),
    ],
)
def test_bad_input(site: Path, tmp_path: Path, capsys, more: list[str], problem: str) -> None:
    assert main(asked(site, tmp_path / "out", *more)) == 1
    assert problem in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_one_flight_says_nothing(site: Path, tmp_path: Path, capsys) -> None:
    lines = (site / "picks.csv").read_text(encoding="utf-8").splitlines()
    picks = tmp_path / "picks.csv"
    picks.write_text("\n".join(lines[:3]) + "\n", encoding="utf-8")
    argv = ["back-analyse", str(picks), "--terrain", str(site / "slope.ply"), "--model", MODEL, "--fit", "rn"]
    assert main([*argv, "--out", str(tmp_path / "out")]) == 1
    assert "No observed run says anything" in capsys.readouterr().err


# --- carried on into a simulation -------------------------------------------------------------------------------------


def simulated(site: Path, out: Path, *more: str) -> list[str]:
    return ["simulate", str(site / "releases.csv"), "--terrain", str(site / "slope.ply"), "--out", str(out), *more]


def run_outs(folder: Path) -> np.ndarray:
    with (folder / "runs.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    return np.array([[float(row["x_m"]), float(row["y_m"])] for row in rows])


def test_blocks_draw_their_parameters_from_the_posterior(site: Path, analysed: Path, tmp_path: Path, capsys) -> None:
    posterior = ["--posterior", str(analysed / "posterior.csv"), "--model", MODEL, "--record", "none"]
    assert main(simulated(site, tmp_path / "all", *posterior, "--number", "20")) == 0
    assert "Each block drew its rn from 0." in capsys.readouterr().out
    summary = json.loads((tmp_path / "all" / "summary.json").read_text(encoding="utf-8"))
    drawn = summary["models"][MODEL]["drawn_parameters"]
    model, draws = read_posterior(analysed / "posterior.csv")
    assert drawn["rn"]["mean"] == pytest.approx(draws.mean()["rn"], abs=1e-6)
    assert drawn["rt"]["low"] < drawn["rt"]["mean"] < drawn["rt"]["high"]
    assert summary["inputs"]["posterior"]["file"] == "posterior.csv"
    everywhere = run_outs(tmp_path / "all")
    with (tmp_path / "all" / "runs.csv").open(encoding="utf-8", newline="") as stream:
        own = np.array([[float(row["drawn_rn"]), float(row["drawn_rt"])] for row in csv.DictReader(stream)])
    away = np.abs(own[:, None] - draws.values[None]).max(axis=2).min(axis=1)
    assert away.max() < 1e-6
    assert len(np.unique(own, axis=0)) > 10
    assert main(simulated(site, tmp_path / "part", *posterior, "--number", "20", "--runs", "61-120")) == 0
    np.testing.assert_array_equal(run_outs(tmp_path / "part"), everywhere[60:])
    one = tmp_path / "one.csv"
    write_posterior(model, ParameterDraws(draws.names, np.array([[0.4, 0.8]]), np.ones(1)), one)
    fixed = ["--model", MODEL, "--set", f"{MODEL}.rn=0.4", f"{MODEL}.rt=0.8", "--record", "none"]
    assert main(simulated(site, tmp_path / "drawn", "--posterior", str(one), *posterior[2:])) == 0
    assert main(simulated(site, tmp_path / "set", *fixed)) == 0
    np.testing.assert_array_equal(run_outs(tmp_path / "drawn"), run_outs(tmp_path / "set"))
    assert "drawn_" not in (tmp_path / "set" / "runs.csv").read_text(encoding="utf-8")


def test_what_speaks_against_a_posterior_goes_with_it(site: Path, analysed: Path, tmp_path: Path, capsys) -> None:
    """From back_analysis.json beside the table into what `simulate` says; what speaks for it does not."""
    content = json.loads((analysed / "back_analysis.json").read_text(encoding="utf-8"))
    doubt = "The other observed runs alone predict the runs held out better."
    content["remarks"] = [
        {"text": doubt, "severity": "warning", "about": "fit"},
        {"text": "All well.", "severity": "note", "about": "fit"},
    ]
    (tmp_path / "back_analysis.json").write_text(json.dumps(content), encoding="utf-8")
    (tmp_path / "posterior.csv").write_bytes((analysed / "posterior.csv").read_bytes())
    assert read_posterior(tmp_path / "posterior.csv")[1].doubts == (doubt,)
    posterior = ["--posterior", str(tmp_path / "posterior.csv"), "--model", MODEL, "--record", "none"]
    assert main(simulated(site, tmp_path / "out", *posterior)) == 0
    assert f"The back-analysis: {doubt}" in " ".join(capsys.readouterr().out.split())
    (tmp_path / "back_analysis.json").unlink()
    assert read_posterior(tmp_path / "posterior.csv")[1].doubts == ()


def test_a_project_names_its_posterior(site: Path, analysed: Path, tmp_path: Path, capsys) -> None:
    text = f"""
schema = 1
[terrain]
file = "{site / "slope.ply"}"
[simulation]
models = ["{MODEL}"]
posterior = "{analysed / "posterior.csv"}"
record = []
[simulation.releases]
from = "table"
file = "{site / "releases.csv"}"
"""
    project = tmp_path / "project.toml"
    project.write_text(text, encoding="utf-8")
    assert main(["simulate", str(project), "--out", str(tmp_path / "out")]) == 0
    assert "Each block drew its rn" in capsys.readouterr().out
    write_project(read_project(project), tmp_path / "again.toml")
    again = read_project(tmp_path / "again.toml").stated_simulation.posterior
    assert again is not None
    assert again.resolve() == (analysed / "posterior.csv").resolve()


@pytest.mark.parametrize(
    ("more", "problem"),
    [
        (["--model", "noel_2017"], "The posterior is of stevens_1998, which is not simulated. Simulate with"),
        (["--model", MODEL, "--set", f"{MODEL}.rn=0.4"], "rn is both drawn from --posterior and set. Leave"),
    ],
)
def test_posteriors_that_do_not_fit(site: Path, analysed: Path, tmp_path: Path, capsys, more, problem) -> None:
    assert main(simulated(site, tmp_path / "out", "--posterior", str(analysed / "posterior.csv"), *more)) == 1
    assert problem in capsys.readouterr().err


# --- tables of a posterior --------------------------------------------------------------------------------------------


def test_a_posterior_is_read_as_it_was_written(tmp_path: Path) -> None:
    draws = ParameterDraws(("rn", "friction"), np.array([[0.25, 0.5], [1 / 3, 0.7]]), np.array([0.9, 0.1]))
    write_posterior(MODEL, draws, tmp_path / "posterior.csv")
    model, again = read_posterior(tmp_path / "posterior.csv")
    assert (model, again.names) == (MODEL, draws.names)
    np.testing.assert_array_equal(again.values, draws.values)
    np.testing.assert_array_equal(again.weight, draws.weight)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("model,weight,rn\nnoel_2018,1,0.3\n", "noel_2017"),
        (f"model,weight\n{MODEL},1\n", "has no parameter"),
        (f"model,weight,rx\n{MODEL},1,0.3\n", "has no parameter 'rx'"),
        (f"model,weight,rn\n{MODEL},-1,0.3\n", "row 2: The weight is -1"),
        (f"model,weight,rn\n{MODEL},1,1.3\n", "outside its range"),
        (f"model,weight,rn\n{MODEL},1,\n", "row 2"),
        (f"model,weight,rn\n{MODEL},1,0.3\nnoel_2017,1,0.3\n", "row 3: The row is of 'noel_2017'"),
        (f"model,weight,rn\n{MODEL},0,0.3\n", "no weights"),
        (f"model,weight,rn\n{MODEL},1e308,0.3\n{MODEL},1e308,0.4\n", "no weights"),
    ],
)
def test_bad_posteriors(tmp_path: Path, text: str, problem: str) -> None:
    from rockfall.core.errors import InputError

    path = tmp_path / "posterior.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=re.escape(problem)):
        read_posterior(path)


def test_filmed_runs_and_stops_of_others_find_the_truth_together(site: Path, tmp_path: Path, capsys) -> None:
    tables = []
    for name in ("releases.csv", "stops.csv"):
        lines = (site / name).read_text(encoding="utf-8").splitlines()
        tables.append(str(tmp_path / name))
        (tmp_path / name).write_text(
            "\n".join([lines[0], *(f"un{line}" for line in lines[1:])]) + "\n", encoding="utf-8"
        )
    out = tmp_path / "out"
    asked_for = asked(site, out, "--fit", "rn", "rt", "--sets", "900", "--rounds", "2", "--tables-only")
    assert main([*asked_for, "--more-stops", *tables]) == 0
    assert f"{2 * RUNS} observed runs" in capsys.readouterr().out
    kept = json.loads((out / "back_analysis.json").read_text(encoding="utf-8"))
    assert {"observed", "more_stops_1"} <= set(kept["inputs"])
    _, draws = read_posterior(out / "posterior.csv")
    for name, truth in TRUTH.items():
        values = draws.values[:, draws.names.index(name)]
        order = np.argsort(values)
        low, high = np.interp([0.005, 0.995], np.cumsum(draws.weight[order]) / draws.weight.sum(), values[order])
        assert low < truth < high

# SPDX-License-Identifier: GPL-3.0-or-later
"""Impacts of several runs of one release, in the commands that are made for measured ones."""

import csv
import json

import numpy as np
import pytest
from rockfall.core.analysis.comparison import compare
from rockfall.core.analysis.courses import find_courses
from rockfall.core.cli import main
from rockfall.core.exchange.comparison_tables import read_predictions, write_predictions
from rockfall.core.exchange.database import merge, read_source
from rockfall.core.exchange.datapackage import read_package, write_package
from rockfall.core.exchange.selection import rows_of
from rockfall.core.exchange.simulated_motion import write_simulated_impacts
from rockfall.core.exchange.tables import read_impacts
from rockfall.core.georeference import GlobalShift
from rockfall.core.simulation.engine import Settings, simulate
from rockfall.core.simulation.ground import make_ground
from rockfall.core.simulation.release import make_releases
from rockfall.core.terrain.surface import Surface

RUNS, MODELS = 4, ("azimi_desvarreux_1977", "noel_2017")
PLANE = Surface(
    np.array([[x, y, -0.6 * x] for y in (0.0, 80.0) for x in (0.0, 80.0)]),
    np.array([[0, 1, 3], [0, 3, 2]], np.int32), GlobalShift(), "plane",
)  # fmt: skip


@pytest.fixture
def table(tmp_path):
    """Two models, four like blocks of one release: their first impacts are one, with the first model all of them."""
    return written(tmp_path / "impacts.csv", seed=3)


def written(path, seed):
    start = np.tile([4.0, 40.0, 3.0], (RUNS, 1))
    releases = make_releases(start, name=np.full(RUNS, "face"), velocity=np.tile([3.0, 1.0, 0.0], (RUNS, 1)))
    ground = make_ground(PLANE)
    runs = [simulate(ground, releases, Settings(name, seed=seed, most_impacts=5)) for name in MODELS]
    write_simulated_impacts(runs, path, "slope")
    return path


def test_each_run_is_compared_as_if_it_were_alone(table) -> None:
    impacts = read_impacts(table)
    assert len(find_courses(impacts).first) == 1 + RUNS * len(MODELS)
    models = ("pfeiffer_bowen_1989", "noel_2017")
    together = compare(impacts, models, replicates=3, seed=7)
    for name in MODELS:
        for run in range(1, RUNS + 1):
            own = (impacts.extra["run"] == str(run)) & (impacts.extra["source"] == name)
            alone = compare(rows_of(impacts, own), models, replicates=3, seed=7)
            rows = np.isin(together.row, np.flatnonzero(own))
            assert rows.sum() == own.sum() == alone.row.size
            np.testing.assert_array_equal(together.v2[:, :, rows], alone.v2)
    first = together.impact == 1
    assert len(np.unique(together.v2[1, 1, first, 0])) == RUNS * len(MODELS)  # a stream of chance for each


def test_predictions_say_which_run_they_are_of_and_are_read_back(table, tmp_path) -> None:
    impacts = read_impacts(table)
    made = compare(impacts, MODELS)
    write_predictions(made, tmp_path / "predictions.csv")
    with (tmp_path / "predictions.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    names = [(row["model"], row["trajectory"], row["run"], row["source"], row["impact"]) for row in rows]
    assert len(set(names)) == len(names) == 2 * len(impacts)
    backwards = rows_of(impacts, np.arange(len(impacts))[::-1])
    again = read_predictions(tmp_path / "predictions.csv", backwards)
    np.testing.assert_array_equal(len(impacts) - 1 - again.row, made.row)
    np.testing.assert_array_equal(again.v2, made.v2)
    for name in ("run", "source", "seed"):
        np.testing.assert_array_equal(again.runs[name], made.runs[name])


def test_the_flights_of_predictions_end_at_the_next_impact_of_their_own_run(table, tmp_path) -> None:
    surface = tmp_path / "plane.obj"
    lines = [f"v {x} {y} {z}" for x, y, z in PLANE.vertices] + ["f 1 2 4", "f 1 4 3"]
    surface.write_text("\n".join(lines) + "\n", encoding="utf-8")
    out = tmp_path / "out"
    command = ["compare", str(table), "--model", "azimi_desvarreux_1977", "--terrain", str(surface), "--tables-only"]
    assert main([*command, "--out", str(out)]) == 0
    with (out / "predicted_flights.csv").open(encoding="utf-8") as stream:
        flights = [row for row in csv.DictReader(stream) if row["replicate"] == "0"]
    impacts = read_impacts(table)
    place = {
        key: impacts.shift.to_survey(impacts.position[i])
        for i, key in enumerate(zip(*impacts.runs.values(), impacts.impact.tolist(), strict=True))
    }
    seen = 0
    for row in flights:
        following = place.get((row["run"], row["source"], row["seed"], int(row["impact"]) + 1))
        if following is not None:
            assert float(row["measured_x_m"]) == pytest.approx(following[0], abs=1e-6)
            seen += 1
    assert seen >= 2 * RUNS * len(MODELS)


def test_no_run_is_taken_for_another_when_tables_are_merged(table, tmp_path) -> None:
    one = read_source(table)
    merged = merge([one])
    assert not len(merged.duplicates)
    assert len(merged.database) == len(one)
    twice = merge([one, read_source(table)])
    assert len(twice.database) == len(one) == len(twice.duplicates)
    np.testing.assert_array_equal(twice.database.impacts.v2, one.impacts.v2)
    out = tmp_path / "package"
    out.mkdir()
    write_package(merged.database, out)
    schema = json.loads((out / "datapackage.json").read_text(encoding="utf-8"))["resources"][0]["schema"]
    assert schema["primaryKey"] == ["site", "trajectory", "run", "simulated_with", "seed", "impact"]
    again = read_package(out).impacts
    assert set(again.runs["simulated_with"]) == set(MODELS)
    np.testing.assert_array_equal(compare(again, MODELS[:1]).v2, compare(one.impacts, MODELS[:1]).v2)


def test_runs_of_another_seed_are_runs_of_their_own(table, tmp_path) -> None:
    """Their first impacts are at one place and time, with the model without chance all of them."""
    one, other = read_source(table), read_source(written(tmp_path / "other.csv", seed=4))
    merged = merge([one, other])
    assert len(merged.database) == len(one) + len(other)
    falls = set(zip(*(column.tolist() for column in merged.database.impacts.falls), strict=True))
    assert len(falls) == 2 * RUNS * len(MODELS)

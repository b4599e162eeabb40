# SPDX-License-Identifier: GPL-3.0-or-later
"""The manual names every column that the tables have, every flag, and every option of `rockfall simulate`."""

import argparse
import csv
import re
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.analysis.comparison import compare
from rockfall.core.analysis.predicted_flights import fly_predictions
from rockfall.core.analysis.scores import scores
from rockfall.core.commands import simulate as command
from rockfall.core.commands.demo import SITE
from rockfall.core.exchange.comparison_tables import write_predictions, write_scores
from rockfall.core.exchange.predicted_flight_tables import write_predicted_flights
from rockfall.core.exchange.project import read_project
from rockfall.core.exchange.simulated_motion import write_simulated_impacts, write_simulated_trajectories
from rockfall.core.exchange.spin_tables import MARKS_KNOWN, write_spins
from rockfall.core.exchange.tables import PICKS_KNOWN, impact_columns, write_impacts, write_trajectories
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.impact import FLAGS
from rockfall.core.reconstruction.sampling import sample_trajectories
from rockfall.core.simulation.engine import Settings, simulate
from rockfall.core.simulation.ground import make_ground
from rockfall.core.simulation.release import make_releases
from rockfall.core.terrain.surface import Surface
from rockfall.core.workflow.opening import open_project

MANUAL = Path(__file__).parents[2] / "docs" / "manual" / "tables.md"
SIMULATED = MANUAL.with_name("simulation_tables.md")


def words_in(text: str) -> set[str]:
    """All words in code marks."""
    return {word for code in re.findall(r"`([^`]+)`", text) for word in re.split(r"[,\s]+", code)}


@pytest.fixture(scope="module")
def sections() -> dict[str, set[str]]:
    """Heading → all words in code marks below it."""
    found: dict[str, set[str]] = {}
    for part in re.split(r"^## ", MANUAL.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]:
        heading, _, body = part.partition("\n")
        found[heading] = words_in(body)
    return found


@pytest.fixture(scope="module")
def opened():
    return open_project(read_project(SITE / "project.toml"))


def header(path: Path) -> set[str]:
    with path.open(encoding="utf-8", newline="") as stream:
        return {name for name in next(csv.reader(stream)) if not name.startswith("sigma_")}


def test_spins(sections, tmp_path) -> None:
    write_spins([], tmp_path / "spin.csv")
    assert header(tmp_path / "spin.csv") <= sections["spin.csv"]
    assert set(MARKS_KNOWN) <= sections["spin_marks.csv"]


def test_picks_and_impacts(sections, opened, tmp_path) -> None:
    assert set(PICKS_KNOWN) <= sections["picks.csv"]
    impacts = opened[1].impacts
    assert set(impact_columns(impacts)) <= sections["impacts.csv"]
    assert set(FLAGS) <= sections["impacts.csv"]
    write_impacts(impacts, tmp_path / "impacts.csv")
    assert header(tmp_path / "impacts.csv") <= sections["impacts.csv"]


def test_what_compare_writes(sections, opened, tmp_path) -> None:
    surface, result = opened
    predictions = compare(result.impacts, ["wyllie_2014"])
    write_predictions(predictions, tmp_path / "predictions.csv")
    write_scores(scores(result.impacts, predictions), tmp_path / "scores.csv")
    write_predicted_flights(fly_predictions(result.impacts, predictions, surface), tmp_path / "predicted_flights.csv")
    assert header(tmp_path / "predictions.csv") <= sections["predictions.csv"]
    assert header(tmp_path / "scores.csv") - {"model"} <= sections["scores.csv"]
    assert header(tmp_path / "predicted_flights.csv") <= sections["predicted_flights.csv"]


def test_trajectories(sections, opened, tmp_path) -> None:
    surface, result = opened
    write_trajectories(sample_trajectories(result, 1.0, surface), tmp_path / "trajectories.csv")
    assert header(tmp_path / "trajectories.csv") <= sections["trajectories.csv"]


def simulated(tmp_path: Path) -> list[Path]:
    plane = np.array([[0.0, 0.0, 0.0], [40.0, 0.0, 0.0], [40.0, 40.0, 0.0], [0.0, 40.0, 0.0]])
    ground = make_ground(Surface(plane, np.array([[0, 1, 2], [0, 2, 3]], np.int32), GlobalShift(), "plane"))
    run = simulate(ground, make_releases(np.array([[15.0, 5.0, 5.0]])), Settings("noel_2017"))
    write_simulated_impacts([run], tmp_path / "impacts.csv")
    write_simulated_trajectories([run], tmp_path / "trajectories.csv")
    return [tmp_path / "impacts.csv", tmp_path / "trajectories.csv"]


def test_simulated_impacts_and_motion(sections, tmp_path) -> None:
    said = words_in(SIMULATED.read_text(encoding="utf-8"))
    for path in simulated(tmp_path):
        assert {"run", "source", "seed"} <= header(path) & said
        assert header(path) <= said | sections[path.name]


def test_every_option_of_simulate_is_in_the_manual() -> None:
    parser = argparse.ArgumentParser(add_help=False)
    command.add_arguments(parser)
    options = {option for action in parser._actions for option in action.option_strings}
    said = words_in((MANUAL.parent / "7_simulation.md").read_text(encoding="utf-8"))
    assert options <= said

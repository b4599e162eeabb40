# SPDX-License-Identifier: GPL-3.0-or-later
"""The manual's page on tables names every column that the tables have, and none of the flags is forgotten."""

import csv
import re
from pathlib import Path

import pytest
from rockfall.core.analysis.comparison import compare
from rockfall.core.analysis.predicted_flights import fly_predictions
from rockfall.core.analysis.scores import scores
from rockfall.core.commands.demo import SITE
from rockfall.core.exchange.comparison_tables import write_predictions, write_scores
from rockfall.core.exchange.opening import open_project
from rockfall.core.exchange.predicted_flight_tables import write_predicted_flights
from rockfall.core.exchange.project import read_project
from rockfall.core.exchange.tables import PICKS_KNOWN, impact_columns, write_impacts, write_trajectories
from rockfall.core.reconstruction.impact import FLAGS
from rockfall.core.reconstruction.sampling import sample_trajectories

MANUAL = Path(__file__).parents[2] / "docs" / "manual" / "tables.md"


@pytest.fixture(scope="module")
def sections() -> dict[str, set[str]]:
    """Heading → all words in code marks below it."""
    found: dict[str, set[str]] = {}
    for part in re.split(r"^## ", MANUAL.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]:
        heading, _, body = part.partition("\n")
        found[heading] = {word for code in re.findall(r"`([^`]+)`", body) for word in re.split(r"[,\s]+", code)}
    return found


@pytest.fixture(scope="module")
def opened():
    return open_project(read_project(SITE / "project.toml"))


def header(path: Path) -> set[str]:
    with path.open(encoding="utf-8", newline="") as stream:
        return {name for name in next(csv.reader(stream)) if not name.startswith("sigma_")}


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

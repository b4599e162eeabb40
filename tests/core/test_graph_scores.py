# SPDX-License-Identifier: GPL-3.0-or-later
"""Scores beside a graph: against numbers by hand, the scores of the table, and how often the interval holds."""

from dataclasses import replace

import numpy as np
import pytest
from rockfall.core.analysis.comparison import compare
from rockfall.core.analysis.graph_scores import graph_scores
from rockfall.core.analysis.graphs import PAPER_GRAPHS, GraphSpec, make_graph
from rockfall.core.analysis.scores import scores
from rockfall.core.reconstruction.impact import fall_numbers
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.trajectory import reconstruct


@pytest.fixture(scope="module")
def impacts():
    """Impacts of four blocks down a slope of 35°."""
    rng = np.random.default_rng(5)
    step = rng.uniform(0.4, 1.2, 32)
    position = np.cumsum(step[:, None] * [6.0, 0.0, -4.2] + rng.normal(size=(32, 3)) * 0.3, axis=0)
    picks = make_picks(np.repeat(list("abcd"), 8), np.cumsum(step), position, normal=np.tile([0.57, 0, 0.82], (32, 1)))
    return reconstruct(picks).impacts


@pytest.fixture(scope="module")
def predictions(impacts):
    return compare(impacts, ["noel_2017", "wyllie_2014"])


def test_the_ordinate_has_the_scores_of_the_table(impacts, predictions) -> None:
    table = {(score.model, score.quantity): score for score in scores(impacts, predictions)}
    for model in predictions.models:
        for spec in PAPER_GRAPHS:
            found = graph_scores(make_graph(impacts, spec, predictions, model), fall_numbers(impacts))
            assert [one.variable for one in found] == ([spec.y, spec.x] if spec.name == "r_theta_dev" else [spec.y])
            for one in found:
                truth = table[model, one.variable]
                numbers = (one.n, one.bias, one.rmse, one.median_error)
                assert numbers == pytest.approx((truth.n, truth.bias, truth.rmse, truth.median_error))
                assert one.falls == 4
                assert one.rmse_low < one.rmse < one.rmse_high


def test_what_no_model_has_a_say_in(impacts, predictions) -> None:
    falls = fall_numbers(impacts)
    assert graph_scores(make_graph(impacts, PAPER_GRAPHS[0]), falls) == ()
    (same,) = graph_scores(make_graph(impacts, GraphSpec("any", "rn", "vn1_mps"), predictions, "noel_2017"), falls)[:1]
    assert (same.bias, same.rmse, same.median_error) == (0.0, 0.0, 0.0)
    graph = make_graph(impacts, PAPER_GRAPHS[0], predictions, "noel_2017")
    (none,) = graph_scores(replace(graph, measured=np.full_like(graph.measured, np.nan)), falls)
    assert (none.n, none.text()) == (0, "no impact has both points")


def test_falls_are_told_apart_by_site_and_run(impacts) -> None:
    assert fall_numbers(impacts).tolist() == np.repeat(np.arange(4), 8).tolist()
    site = np.where(np.arange(32) % 2 == 0, "north", "south")
    assert len(set(fall_numbers(replace(impacts, site=site)).tolist())) == 8


def test_one_fall_has_no_interval_and_says_none(impacts, predictions) -> None:
    graph = make_graph(impacts, PAPER_GRAPHS[2], predictions, "noel_2017")
    (one,) = graph_scores(graph, np.zeros(len(impacts), dtype=np.intp))
    assert np.isnan(one.rmse_low)
    assert "(" not in one.text()
    (four,) = graph_scores(graph, fall_numbers(impacts))
    assert "(" in four.text()
    assert four.text().endswith(f"m/s, n = {four.n}")


def test_the_interval_holds_as_often_as_it_says(impacts, predictions) -> None:
    """Errors of standard deviation √2, half of it common to a fall; 12 falls of 2 to 9 impacts, 400 tables."""
    rng = np.random.default_rng(1)
    held = 0
    for _ in range(400):
        fall = np.repeat(np.arange(12), rng.integers(2, 10, 12))
        error = rng.normal(size=12)[fall] + rng.normal(size=fall.size)
        graph = make_graph(impacts, PAPER_GRAPHS[2], predictions, "noel_2017")
        points = np.zeros((fall.size, 2))
        graph = replace(
            graph, row=np.arange(fall.size), measured=points, modelled=np.stack([points[:, 0], error], axis=1)
        )
        (score,) = graph_scores(graph, fall)
        held += score.rmse_low <= np.sqrt(2) <= score.rmse_high
    assert 0.88 <= held / 400 <= 0.98

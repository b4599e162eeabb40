# SPDX-License-Identifier: GPL-3.0-or-later
"""The 80 runs of Tschamut 2014 on the proxy terrain: what the table says, and that simulated stops are not absurd."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

SCRIPT = Path(__file__).parents[2] / "scripts" / "comparisons" / "tschamut.py"


@pytest.fixture(scope="module")
def tschamut():
    spec = importlib.util.spec_from_file_location("tschamut", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def test_the_table_says_98_4_m(tschamut) -> None:
    """Mean run-out of the 80 runs as published; the column of run-outs is the distance in plan."""
    stops = tschamut.columns("stops")
    flat = np.hypot(*(tschamut.vectors(stops, "x_m", "y_m") - tschamut.vectors(stops, "release_x_m", "release_y_m")).T)
    assert flat.size == 80
    assert flat.mean() == pytest.approx(98.4, abs=0.05)
    assert flat == pytest.approx(tschamut.vectors(stops, "observed_runout_m")[:, 0], abs=1e-4)
    assert set(stops["block_id"]) == {"1", "2", "4"}


def test_models_stop_in_the_order_of_magnitude(tschamut) -> None:
    """Between a third of what was observed and its double: the proxy terrain and the defaults allow no more."""
    done = tschamut.compare(2, ("noel_2017", "pfeiffer_bowen_1989"))
    for simulation in done.simulations:
        assert len(simulation) == simulation.wanted == 160
        assert np.bincount(simulation.end).sum() == 160
        assert simulation.at_rest.all()
        one = done.comparison.find(simulation.settings.model, "", "runout_m")
        assert one.n == 80
        assert one.observed.mean() == pytest.approx(98.4, abs=0.05)
        assert 33 < one.simulated.mean() < 200
        assert np.isnan(one.p)  # two of each release are too few to rank among
        assert "too few with enough simulated" in one.verdict

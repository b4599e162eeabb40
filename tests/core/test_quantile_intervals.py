# SPDX-License-Identifier: GPL-3.0-or-later
"""Intervals of quantiles: what they take, and that they hold the truth where values of one cluster are alike."""

from math import inf, isnan

import numpy as np
import pytest
from rockfall.core.simulation.convergence import Quantile, convergence, fewest, quantile, values_needed
from scipy import stats


def test_an_upper_bound_takes_as_many_values_as_leave_its_chance_below_the_half_of_five_percent() -> None:
    for share in (0.9, 0.95, 0.99):
        n = fewest(share)
        assert share**n <= 0.025 < share ** (n - 1)
        assert isnan(quantile(np.arange(n - 1.0), share).high)
        assert quantile(np.arange(float(n)), share).high == n - 1
    assert fewest(0.95) == 72


def test_values_that_are_each_a_cluster_are_independent() -> None:
    values = np.random.default_rng(1).exponential(size=300)
    plain, own, one = (quantile(values, 0.95, cluster) for cluster in (None, np.arange(300), np.zeros(300, np.intp)))
    assert plain == own == one
    assert plain.effective == 300


def test_copies_tell_as_much_as_what_they_are_copies_of() -> None:
    """Forty places, each value twenty times: 39 degrees of freedom, paid for with Student's t."""
    values, cluster = np.random.default_rng(2).normal(size=40), np.repeat(np.arange(40), 20)
    found = quantile(np.repeat(values, 20), 0.8, cluster)
    paid = (stats.t.ppf(0.975, 799) / stats.t.ppf(0.975, 39)) ** 2
    assert found.effective == pytest.approx(39 * paid, rel=1e-9)
    assert found.most_effective == pytest.approx(found.effective, rel=0.03)
    assert values_needed(found, 2.0) == inf, "more copies tell nothing"


@pytest.mark.parametrize(("places", "each", "alike"), [(15, 60, 0.1), (60, 10, 0.3), (100, 20, 0.6)])
def test_the_interval_holds_the_true_quantile_though_blocks_of_one_place_are_alike(
    places: int, each: int, alike: float
) -> None:
    """Normal effects of the places: all values together are standard normal, whose 95 % value is 1.645."""
    rng, truth = np.random.default_rng(3), stats.norm.ppf(0.95)
    held, upper, plainly = 0, 0, 0
    for _ in range(400):
        own = np.repeat(np.arange(places), rng.poisson(each, places))
        effect = np.sqrt(alike) * rng.normal(size=places)
        values = effect[own] + np.sqrt(1 - alike) * rng.normal(size=own.size)
        known, plain = quantile(values, 0.95, own), quantile(values, 0.95)
        upper += not known.high < truth
        held += not known.high < truth and not known.low > truth
        plainly += plain.low <= truth <= plain.high
    assert upper / 400 > 0.955, "the upper end is too low in 2.5 % of all cases"
    assert 0.925 < held / 400 <= 1.0
    assert plainly / 400 < 0.89, "as if all blocks were independent it is too narrow"


def test_how_many_more_values_it_takes_follows_from_how_alike_they_are() -> None:
    """k clusters of m values with correlation ρ know as much as k·m/(1 + (m − 1)ρ) independent ones (Kish 1965)."""
    k, m, rho = 50, 8, 0.2

    def effective(size: float) -> float:
        return k * size / (1 + (size - 1) * rho)

    known = Quantile(0.95, 1.0, 0.9, 1.1, k * m, effective(m), k / rho)
    for times in (1.2, 1.5):
        assert effective(m * values_needed(known, times)) == pytest.approx(times * effective(m))
    assert values_needed(known, 1.01 * k / rho / effective(m)) == inf
    assert values_needed(Quantile(0.95, 1.0, 0.9, 1.1, 100, 100.0), 3.0) == 3.0


def test_the_error_of_a_mean_is_that_of_the_means_of_equal_clusters() -> None:
    """With clusters of one size it is the standard error of their means; copies tell nothing."""
    rng = np.random.default_rng(6)
    values, cluster = rng.normal(size=(30, 12)) + rng.normal(size=(30, 1)), np.repeat(np.arange(30), 12)
    found = convergence(values.ravel(), cluster)
    assert found.standard_error == pytest.approx(values.mean(axis=1).std(ddof=1) / np.sqrt(30))
    assert found.standard_error > 2 * convergence(values.ravel()).standard_error
    of_one = convergence(values[0], np.zeros(12, np.intp))
    assert of_one.standard_error == pytest.approx(convergence(values[0]).standard_error)

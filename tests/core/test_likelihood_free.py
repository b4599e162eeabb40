# SPDX-License-Identifier: GPL-3.0-or-later
"""Posteriors without a likelihood, against posteriors in closed form and against the truth of simulated data."""

import numpy as np
import pytest
from rockfall.core.analysis import projection
from rockfall.core.analysis.likelihood_free import (
    Mixture,
    SimulatedSets,
    around,
    find_posterior,
    places_of_truth,
    sample_posterior,
    weighted_quantiles,
)
from rockfall.core.analysis.projection import project
from rockfall.core.errors import InputError
from scipy.stats import kstest, norm, truncnorm

SIGMA, N = 0.6, 8
"""Of the values whose mean is asked for, and how many there are."""


def gaussian(seed: int):
    """Values with a mean between −2 and 2; the statistics are their mean, two that say the same, and pure noise."""
    rng = np.random.default_rng(seed)

    def simulate(place: np.ndarray, first: int) -> np.ndarray:
        mean = 4 * place[:, 0] - 2
        values = mean[:, None] + SIGMA * rng.standard_normal((len(place), N))
        return np.column_stack(
            [values.mean(axis=1), np.median(values, axis=1), np.tanh(values).mean(axis=1), rng.random(len(place))]
        )

    return simulate


@pytest.mark.parametrize("seen", [0.3, -1.95])
def test_the_mean_of_a_normal_law_has_the_posterior_of_the_closed_form(seen: float) -> None:
    """With an even prior it is normal around the observed mean with σ/√n, cut off at the ends of the range."""
    error = SIGMA / np.sqrt(N)
    expected = truncnorm((-2 - seen) / error, (2 - seen) / error, seen, error)
    told = []
    for seed in range(8):
        simulate = gaussian(seed)
        table, found = sample_posterior(
            lambda place, first, of=simulate: of(place, first)[:, :1], lambda: np.array([seen]), 1, 3000, 3, seed
        )
        mean = found.weight @ (4 * found.place[:, 0] - 2)
        spread = np.sqrt(found.weight @ (4 * found.place[:, 0] - 2 - mean) ** 2)
        told.append([mean, spread, *(4 * found.quantiles(np.array([0.025, 0.975]))[:, 0] - 2)])
        assert found.effective > 200
        assert len(table) == 9000
    mean, spread, low, high = np.mean(told, axis=0)
    assert mean == pytest.approx(expected.mean(), abs=0.05 * error)
    assert spread == pytest.approx(expected.std(), rel=0.05)
    assert [low, high] == pytest.approx(expected.ppf([0.025, 0.975]), abs=0.15 * error)


def test_statistics_that_say_nothing_leave_the_prior() -> None:
    rng = np.random.default_rng(2)
    _, found = sample_posterior(lambda place, _: rng.random((len(place), 6)), lambda: np.full(6, 0.4), 2, 6000, 2, 2)
    parts = np.array([0.025, 0.25, 0.5, 0.75, 0.975])
    assert found.quantiles(parts) == pytest.approx(np.column_stack([parts, parts]), abs=0.06)


def test_mean_and_spread_together_have_their_posterior() -> None:
    """Against the product of likelihood and prior on a grid."""
    values = norm.ppf((np.arange(12) + 0.5) / 12, 0.4, 0.7)
    rng = np.random.default_rng(3)

    def simulate(place: np.ndarray, first: int) -> np.ndarray:
        drawn = 4 * place[:, :1] - 2 + (0.1 + 1.9 * place[:, 1:]) * rng.standard_normal((len(place), 12))
        return np.column_stack([drawn.mean(axis=1), np.log(drawn.std(axis=1)), drawn.max(axis=1)])

    observed = np.array([values.mean(), np.log(values.std()), values.max()])
    _, found = sample_posterior(lambda *a: simulate(*a)[:, :2], lambda: observed[:2], 2, 6000, 3, 3)
    mean, spread = np.meshgrid(np.linspace(-2, 2, 801), np.linspace(0.1, 2.0, 801), indexing="ij")
    log = norm.logpdf(values[:, None, None], mean, spread).sum(axis=0)
    weight = np.exp(log - log.max())
    for axis, (grid, low, width) in enumerate(((mean, -2, 4), (spread, 0.1, 1.9))):
        average = (weight * grid).sum() / weight.sum()
        sd = np.sqrt((weight * (grid - average) ** 2).sum() / weight.sum())
        drawn = low + width * found.place[:, axis]
        assert found.weight @ drawn == pytest.approx(average, abs=0.15 * sd)
        assert np.sqrt(found.weight @ (drawn - found.weight @ drawn) ** 2) == pytest.approx(sd, rel=0.15)


def test_truths_lie_evenly_in_their_posteriors() -> None:
    """Simulation-based calibration (Talts et al. 2018): parameters from the prior, data from them, their posterior."""
    places, rng = [], np.random.default_rng(4)
    for repeat in range(60):
        truth = rng.random((1, 1))
        simulate = gaussian(100 + repeat)
        observed = simulate(truth, 0)[0]
        _, found = sample_posterior(simulate, lambda seen=observed: seen, 1, 1000, 2, repeat)
        places.append(float(found.weight @ (found.place[:, 0] < truth[0, 0])))
    assert kstest(places, "uniform").pvalue > 0.01
    inside = np.mean([(0.025 < place < 0.975) for place in places])
    assert inside >= 0.87  # 52 of 60; fewer have a probability of 0.3 % at 95 %
    assert 0.3 < np.mean([0.25 < place < 0.75 for place in places]) < 0.7


def test_known_parameters_near_the_observed_ones_lie_evenly_too() -> None:
    simulate = gaussian(5)
    observed = np.array([0.3, 0.3, 0.27, 0.5])
    table, found = sample_posterior(simulate, lambda: observed, 1, 2000, 2, 5)
    assert kstest(places_of_truth(table, found, 100, 5)[:, 0], "uniform").pvalue > 0.01


def test_estimates_are_those_of_the_regression_without_the_set(monkeypatch: pytest.MonkeyPatch) -> None:
    """Against least squares fitted anew without one set, or two, where many statistics say nothing."""
    monkeypatch.setattr(projection, "RIDGES", (1e-9,))
    rng = np.random.default_rng(10)
    statistics, weight = rng.uniform(-1.7, 1.7, (60, 12)), rng.uniform(0.5, 2.0, 60)
    wanted = statistics[:, :1] + rng.standard_normal((60, 1))
    weight[7] = 0.0
    fitted = project(statistics, wanted, weight, squares=False)
    observed = np.full(12, 0.2)

    def estimate(left_out: list[int], at: np.ndarray) -> float:
        some = np.setdiff1d(np.flatnonzero(weight), left_out)
        root = np.sqrt(weight[some])[:, None]
        design = np.column_stack([np.ones(some.size), statistics[some]])
        slope = np.linalg.lstsq(root * design, root[:, 0] * wanted[some, 0], rcond=None)[0]
        return float(slope[0] + at @ slope[1:])

    sets = np.delete(np.arange(60), 40)
    alone = [estimate([i], statistics[i]) - estimate([i], observed) for i in sets]
    plain = [estimate([], statistics[i]) - estimate([], observed) for i in sets]
    found = fitted.differences(statistics, sets, observed)[:, 0]
    np.testing.assert_allclose(found, alone, atol=0.03)
    assert np.abs(np.array(alone) - plain).max() > 0.1
    both = [estimate([i, 40], statistics[i]) - estimate([i, 40], statistics[40]) for i in sets]
    found = fitted.differences(statistics, sets, statistics[40], without=40)[:, 0]
    np.testing.assert_allclose(found, both, atol=0.03)


def test_intervals_hold_the_truth_when_sets_are_few_and_statistics_many() -> None:
    """A set that the regression was fitted to looks too near to its parameters: without care 0.86 hold the truth."""
    rng = np.random.default_rng(11)

    def simulate(place: np.ndarray) -> np.ndarray:
        return place[:, :1] * 3 + rng.standard_normal((len(place), 60)) * np.linspace(0.5, 6, 60)

    held = []
    for _ in range(8):
        place = rng.random((600, 1))
        table = SimulatedSets(place, np.ones(600), simulate(place))
        truth = rng.uniform(0.1, 0.9, (40, 1))
        for known, seen in zip(truth[:, 0], simulate(truth), strict=True):
            low, high = find_posterior(table, seen).quantiles(np.array([0.025, 0.975]))[:, 0]
            held.append(low <= known <= high)
    assert 0.92 < np.mean(held) < 0.985


def test_weights_make_up_for_what_was_proposed() -> None:
    """The density integrates to one over the cube, and weighted proposals are even there again."""
    simulate = gaussian(6)

    def with_another(place: np.ndarray, first: int) -> np.ndarray:
        return np.column_stack([simulate(place, first), place[:, 1]])

    _, found = sample_posterior(with_another, lambda: np.array([1.9, 1.9, 0.95, 0.5, 0.02]), 2, 1000, 1, 6)
    proposal = around(found, np.random.default_rng(6))
    line = (np.arange(300) + 0.5) / 300
    grid = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    assert Mixture((proposal,), 2).density(grid).mean() == pytest.approx(1.0, abs=0.02)
    drawn = proposal.draw(np.random.default_rng(7), 20_000)
    weight = 1.0 / proposal.density(drawn)
    assert weight.max() <= 5.0 + 1e-9
    for axis in range(2):
        assert np.average(drawn[:, axis], weights=weight) == pytest.approx(0.5, abs=0.02)
        assert np.average(drawn[:, axis] < 0.1, weights=weight) == pytest.approx(0.1, abs=0.02)


def test_quantiles_with_weights() -> None:
    values, parts = np.array([3.0, 1.0, 2.0]), np.array([0.5])
    assert weighted_quantiles(values, np.ones(3), parts) == pytest.approx([2.0])
    assert weighted_quantiles(values, np.array([1.0, 0.0, 0.0]) + 1e-12, parts) == pytest.approx([3.0], abs=1e-6)


def test_too_few_sets_are_refused() -> None:
    with pytest.raises(InputError, match="too few"):
        sample_posterior(gaussian(0), lambda: np.zeros(4), 1, 20, 2, 0)


def test_the_posterior_does_not_depend_on_the_order_of_the_sets() -> None:
    table, found = sample_posterior(gaussian(8), lambda: np.array([0.1, 0.1, 0.1, 0.5]), 1, 1000, 1, 8)
    order = np.random.default_rng(8).permutation(len(table))
    other = find_posterior(
        type(table)(table.place[order], table.weight[order], table.statistics[order]), np.array([0.1, 0.1, 0.1, 0.5])
    )
    parts = np.array([0.1, 0.5, 0.9])
    assert other.quantiles(parts) == pytest.approx(found.quantiles(parts), abs=1e-9)

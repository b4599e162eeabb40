# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether observed values can come from simulated ones, each from a simulation of its own.

An observed value that comes from its simulation has any rank among the simulated values with the same probability. The
ranks of all observed values together are tested for that with the statistic of Anderson & Darling 1952; its
distribution under the hypothesis is found by letting each observed value change places with any of its simulated ones,
so the probability is exact for any number of values, for ties and for simulations of different sizes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..vectors import Array, Mask

FEWEST = 5
"""With fewer observed values nothing can be told."""
FEWEST_SIMULATED = 19
"""So that the lowest and the highest rank are each no more probable than 5 %."""
EXCHANGES = 9999


@dataclass(frozen=True, eq=False)
class RankTest:
    """Do n observed values come from the simulated ones?

    Attributes
    ----------
    place : (n,) of each observed value among its simulated ones, from 0 (below all) to 1; NaN where there are too few.
    n : how many values were ranked.
    statistic, p : A² and its probability to be as large by chance; NaN with fewer than `FEWEST` values.
    """

    place: Array
    n: int
    statistic: float
    p: float


def rank_test(observed: Array, simulated: Sequence[Array], seed: int = 0) -> RankTest:
    """Test n observed values (n,) against the simulated values of each.

    Parameters
    ----------
    simulated : n arrays of any lengths; NaN are left out.
    seed : of the exchanges.
    """
    rng = np.random.default_rng(seed)
    place = np.full(observed.size, np.nan)
    drawn = []
    for i, (value, others) in enumerate(zip(observed.tolist(), simulated, strict=True)):
        values = np.r_[value, others[np.isfinite(others)]]
        if not np.isfinite(value) or values.size <= FEWEST_SIMULATED:
            continue
        places = _mid_ranks(values)
        place[i] = places[0]
        drawn.append(places[rng.integers(places.size, size=EXCHANGES)])
    n = len(drawn)
    if n < FEWEST:
        return RankTest(place, n, np.nan, np.nan)
    found = float(_anderson_darling(place[np.isfinite(place)][None])[0])
    by_chance = _anderson_darling(np.stack(drawn, axis=1))
    as_large = int((by_chance >= found * (1 - 1e-12)).sum())
    return RankTest(place, n, found, (1 + as_large) / (1 + EXCHANGES))


def reach_test(reached: Mask, stayed: Mask, share: Array) -> float:
    """The probability of so many or so few of n blocks that reach a place, two-sided.

    Parameters
    ----------
    reached, stayed : (n,) blocks that were seen to reach it, and seen to stop before; others are not known.
    share : (n,) of the simulated blocks of each that reach it.

    Notes
    -----
    The number that reach it is a sum of independent events of probabilities `share`. Those that are not known may have
    done either, so that both tails are bounds, and the test errs on the side of the simulation.
    """
    number = np.ones(1)
    for part in share.tolist():
        number = np.convolve(number, [1 - part, part])
    at_least = float(number[int(reached.sum()) :].sum())
    at_most = float(number[: share.size - int(stayed.sum()) + 1].sum())
    return min(1.0, 2 * min(at_least, at_most))


def shared_ranks(values: Array) -> Array:
    """(n,) ranks from 1, n ≥ 1; equal values share the mean of theirs."""
    order = np.argsort(values, kind="stable")
    ordered = values[order]
    first = np.flatnonzero(np.r_[True, ordered[1:] != ordered[:-1]])
    behind = np.r_[first[1:], values.size]
    ranks = np.empty(values.size)
    ranks[order] = np.repeat((first + behind + 1) / 2, behind - first)
    return ranks


def holm(p: Array) -> Array:
    """(n,) probabilities corrected for their number (Holm 1979); NaN where they are, and not counted."""
    known = np.flatnonzero(np.isfinite(p))
    order = known[np.argsort(p[known], kind="stable")]
    result = np.full(p.size, np.nan)
    result[order] = np.minimum(np.maximum.accumulate(p[order] * np.arange(order.size, 0, -1)), 1.0)
    return result


def _mid_ranks(values: Array) -> Array:
    """(m,) places of m values among each other, between 0 and 1; equal ones share theirs."""
    return (shared_ranks(values) - 0.5) / values.size


def _anderson_darling(places: Array) -> Array:
    """(b,) A² of samples (b, n) against the even distribution from 0 to 1."""
    ordered = np.sort(places, axis=1)
    n = places.shape[1]
    weight = 2 * np.arange(1, n + 1) - 1
    return np.asarray(-n - (weight * (np.log(ordered) + np.log1p(-ordered[:, ::-1]))).sum(axis=1) / n)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The Theil–Sen slope and its interval: the median of the slopes between all pairs of points.

For a few points all slopes are listed. For many, the slopes below a number b are counted without listing them: they are
the pairs whose order in y − b·x is not their order in x, found by merge sort in n log n steps (Cole, Salowe, Steiger &
Szemerédi 1989), and b is moved until the wanted number of slopes lies below it.
"""

from collections.abc import Callable

import numpy as np

from ..vectors import Array, Indices

LISTED = 600
"""Up to so many points, the slopes of all pairs are listed, and each point is compared with all others."""
SAMPLED = 20_000
"""Pairs that say where to look."""
NEAR = 1e-6
"""How near the slope is found, in parts of the middle half of all slopes."""


def theil_sen(
    x: Array, y: Array, confidence: float, interval: bool = True, cluster: Indices | None = None
) -> tuple[float, float, float, float]:
    """Slope, intercept (median y − slope · median x), and the interval of the slope (Sen 1968).

    Parameters
    ----------
    x, y : (n,) finite, n ≥ 2, not all x equal. Pairs with equal x have no slope and do not count.
    confidence : of the interval, as 0.95.
    interval : whether it is wanted; it takes twice as long as the slope, and is NaN where it is not.
    cluster : (n,) number of the cluster of each point, from 0, where the points of a cluster may depend on each other;
        None where all are independent. The interval is NaN with fewer than two.
    """
    if x.size <= LISTED:
        return _of_all_pairs(x, y, confidence, interval, cluster)
    order = np.argsort(x, kind="stable")
    if (np.diff(x[order]) == 0.0).any():
        order = np.lexsort((y, x))
    x, y = np.ascontiguousarray(x[order]), np.ascontiguousarray(y[order])
    pairs = x.size * (x.size - 1) // 2 - sum(k * (k - 1) // 2 for k in _repeats(x))
    slope = _slope_of_rank(x, y, pairs / 2, pairs)
    low = high = np.nan
    if interval:
        reach = _reach(x, y, pairs, confidence, slope, None if cluster is None else cluster[order])
        if np.isfinite(reach):
            low, high = (_slope_of_rank(x, y, pairs / 2 + side * reach, pairs) for side in (-1, 1))
    return slope, float(np.median(y) - slope * np.median(x)), low, high


def _of_all_pairs(
    x: Array, y: Array, confidence: float, interval: bool, cluster: Indices | None
) -> tuple[float, float, float, float]:
    one, other = np.triu_indices(x.size, 1)
    run = x[other] - x[one]
    apart = run != 0.0
    slopes = np.sort((y[other] - y[one])[apart] / run[apart])
    slope, low, high = float(np.median(slopes)), np.nan, np.nan
    if interval:
        middle, reach = slopes.size / 2, _reach(x, y, slopes.size, confidence, slope, cluster)
        if np.isfinite(reach):
            low = float(slopes[max(round(middle - reach) - 1, 0)])
            high = float(slopes[min(round(middle + reach), slopes.size - 1)])
    return slope, float(np.median(y) - slope * np.median(x)), low, high


def _reach(x: Array, y: Array, pairs: int, confidence: float, slope: float, cluster: Indices | None) -> float:
    """How many slopes lie between the median and each end of its interval: half a deviate of Kendall's count."""
    from scipy.special import ndtri, stdtrit

    part, widest = 0.5 + confidence / 2, pairs / 2 - 1
    if cluster is None:
        variance, deviate = _variance(np.sort(x), np.sort(y)), float(ndtri(part))
    else:
        clusters = np.unique(cluster).size
        if clusters < 2:
            return float("nan")
        variance = _variance_by_cluster(x, y - slope * x, cluster) * clusters / (clusters - 1)
        deviate = float(stdtrit(clusters - 1, part))
    if variance <= 0.0:  # ties in x and in y, which the formula takes off twice
        return widest
    return min(deviate * variance**0.5 / 2, widest)


def _variance(x: Array, y: Array) -> float:
    """Of Kendall's count of ordered x and y, with its ties."""

    def ties(values: Array) -> float:
        return float(sum(k * (k - 1) * (2 * k + 5) for k in _repeats(values)))

    n = float(x.size)
    return (n * (n - 1) * (2 * n + 5) - ties(x) - ties(y)) / 18


def _variance_by_cluster(x: Array, left: Array, cluster: Indices) -> float:
    """Of Kendall's count of x and what a slope leaves of y, when the points of a cluster may depend on each other.

    The count is nearly a sum over points (Hoeffding 1948): each adds how many points agree with it in their order, less
    how many do not. The sums of clusters are independent. A point is compared with `LISTED` others that are even in x.
    """
    others = np.argsort(x, kind="stable")[np.linspace(0, x.size - 1, min(x.size, LISTED)).astype(np.intp)]
    added = np.empty(x.size)
    for start in range(0, x.size, LISTED):
        here = slice(start, start + LISTED)
        agree = np.sign(x[here, None] - x[others]) * np.sign(left[here, None] - left[others])
        added[here] = agree.sum(axis=1)
    added *= x.size / others.size
    return float(np.sum(np.bincount(cluster, added - added.mean()) ** 2))


def _repeats(ordered: Array) -> list[int]:
    """How often each value occurs that does so more than once."""
    ends = np.flatnonzero(np.r_[True, ordered[1:] != ordered[:-1], True])
    often = np.diff(ends)
    repeated: list[int] = often[often > 1].tolist()
    return repeated


def _slope_of_rank(x: Array, y: Array, rank: float, pairs: int) -> float:
    """The slope that `rank` of all slopes lie below; x is ordered, and y where x is equal."""
    from scipy.optimize import brentq

    from .robust_slope_kernels import count_inversions

    turned, room = np.empty_like(y), np.empty_like(y)

    def above(slope: float) -> float:
        np.multiply(x, -slope, out=turned)
        np.add(turned, y, out=turned)
        return float(count_inversions(turned, room) - rank)

    low, high, scale = _bracket(x, y, rank / pairs, above)
    return low if low == high else float(brentq(above, low, high, xtol=max(NEAR * scale, 1e-300), rtol=1e-14))


def _bracket(x: Array, y: Array, part: float, above: Callable[[float], float]) -> tuple[float, float, float]:
    """Slopes below and above the wanted one, and the middle half of all slopes, from some of the pairs."""
    rng = np.random.default_rng(0)
    one, other = rng.integers(x.size, size=(2, SAMPLED))
    apart = x[one] != x[other]
    slopes = (y[one] - y[other])[apart] / (x[one] - x[other])[apart]
    first, third = np.quantile(slopes, [0.25, 0.75])
    margin = 3 / slopes.size**0.5
    for _ in range(20):
        low, high = (float(v) for v in np.quantile(slopes, [max(part - margin, 0.0), min(part + margin, 1.0)]))
        low, high = low - NEAR * (third - first), high + NEAR * (third - first)
        if low == high or above(low) <= 0.0 < above(high):
            return low, high, float(third - first)
        if margin > 1.0:
            break
        margin *= 2
    width = (third - first) or max(abs(low), abs(high), 1.0)
    while above(low) > 0.0:
        low, width = low - width, 2 * width
    while above(high) <= 0.0:
        high, width = high + width, 2 * width
    return low, high, float(third - first)

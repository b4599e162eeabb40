# SPDX-License-Identifier: GPL-3.0-or-later
"""Fitting numbers within their ranges: a scan of the whole range, several starts, and resampled intervals.

The sums of the scores over each trajectory are kept for all points of the scan. A resample of the trajectories is a
weighted sum of them, so that every resample can look at the whole range before it descends: in a flat valley the
resamples end all over the valley, as they should.
"""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from math import asinh, sinh

import numpy as np

from ..impact_models.machinery.parameters import ParameterSpec
from ..progress import Progress
from ..vectors import Array

Sums = Callable[[Array], Array]
"""Place (k,) in the unit cube → (clusters,) sums of scores."""

SCAN_PER_PARAMETER = 64
MOST_SCANNED = 512
WIDE = 20.0
"""A range that is this many times the default is scanned finely near its low end."""
FINE, COARSE = 1e-6, 2e-3
"""How near the descent goes to the minimum, in the unit cube: for the fit, for a resample."""
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Axis:
    """One parameter on 0…1: linear, or by an inverse hyperbolic sine when the range is wide.

    Attributes
    ----------
    bend : [unit of the parameter] where the axis turns from linear to logarithmic; 0 for a linear one.
    """

    low: float
    high: float
    bend: float = 0.0

    @classmethod
    def of(cls, spec: ParameterSpec) -> "Axis":
        """That of a parameter."""
        width = spec.maximum - spec.minimum
        reach = float(spec.default) - spec.minimum
        bend = reach if reach > 0 else width / 100
        return cls(spec.minimum, spec.maximum, bend if width >= WIDE * bend else 0.0)

    def value(self, place: float) -> float:
        """0…1 → value."""
        width = self.high - self.low
        if self.bend:
            return min(self.high, self.low + self.bend * sinh(place * asinh(width / self.bend)))
        return self.low + place * width

    def place(self, value: float) -> float:
        """Value → 0…1."""
        width, above = self.high - self.low, value - self.low
        if not width:
            return 0.0
        return asinh(above / self.bend) / asinh(width / self.bend) if self.bend else above / width


@dataclass(frozen=True, eq=False)
class Fit:
    """The place with the least score.

    Attributes
    ----------
    place : (k,) in the unit cube.
    sums : (clusters,) at this place.
    scanned, scanned_sums : (P, k), (P, clusters) the scan.
    """

    place: Array
    sums: Array
    scanned: Array
    scanned_sums: Array


def fit(sums: Sums, counts: Array, default: Array, starts: int, seed: int) -> Fit:
    """The least weighted score: scan the cube, descend from the best `starts` places, and once more from the best."""
    places = scan_places(default, seed)
    scanned = np.array([sums(place) for place in places])
    place = descend_from_best(sums, counts, np.ones_like(counts), places, scanned, starts)
    return Fit(place, sums(place), places, scanned)


def descend_from_best(
    sums: Sums, counts: Array, weights: Array, places: Array, scanned: Array, starts: int, near: float = FINE
) -> Array:
    """The least score with weights (clusters,), from the best scanned places, to `near` of its place."""
    if not places.shape[1]:
        return places[0]
    objective = _weighted(sums, counts, weights)
    order = np.argsort(_means(scanned, counts, weights), kind="stable")[:starts]
    ends = [_descend(objective, places[i], 0.1, COARSE) for i in order]
    best = min(ends, key=objective)
    for step in (0.02, 0.002) if near < COARSE else ():
        best = _descend(objective, best, step, near)
    return best


def resample(sums: Sums, counts: Array, found: Fit, resamples: int, seed: int, progress: Progress) -> Array:
    """(resamples, k) places that fit when the clusters are drawn anew, with replacement."""
    n = counts.size
    draws = np.random.default_rng([seed, 1]).multinomial(n, np.full(n, 1 / n), size=resamples).astype(np.float64)
    places, scanned = np.vstack([found.place, found.scanned]), np.vstack([found.sums, found.scanned_sums])

    def one(b: int) -> Array:
        start = places[np.argmin(_means(scanned, counts, draws[b]))]
        here = watched(sums, partial(progress, "Resampling the trajectories", b, resamples))
        return _descend(_weighted(here, counts, draws[b]), start, 0.05, COARSE)

    if not found.place.size:
        return np.empty((resamples, 0))
    with ThreadPoolExecutor(max_workers=os.process_cpu_count()) as pool:
        jobs = [pool.submit(one, b) for b in range(resamples)]
        try:
            return np.array([job.result() for job in jobs])
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise


def interval(values: Array, clusters: int) -> tuple[float, float]:
    """95 % interval from resampled values: percentiles, expanded for few clusters (Hesterberg 2015, § 4.3)."""
    from scipy.special import ndtr, stdtrit

    if clusters < 2:
        return float(values.min()), float(values.max())
    tail = ndtr(-np.sqrt(clusters / (clusters - 1)) * stdtrit(clusters - 1, (1 + CONFIDENCE) / 2))
    low, high = np.quantile(values, [tail, 1 - tail])
    return float(low), float(high)


def scan_places(default: Array, seed: int) -> Array:
    """(P, k) the default, and points that fill the unit cube evenly (Sobol)."""
    from scipy.stats.qmc import Sobol

    k = default.size
    if not k:
        return np.empty((1, 0))
    number = min(SCAN_PER_PARAMETER * k, MOST_SCANNED)
    number = 1 << (number - 1).bit_length()
    return np.vstack([default, Sobol(k, rng=np.random.default_rng([seed, 0])).random(number)])


def watched(sums: Sums, say: Callable[[], None]) -> Sums:
    """The same, with a word before each evaluation, in which the work can be stopped."""

    def saying(place: Array) -> Array:
        say()
        return sums(place)

    return saying


def _weighted(sums: Sums, counts: Array, weights: Array) -> Callable[[Array], float]:
    total = float(weights @ counts)
    return lambda place: float(weights @ sums(place)) / total


def _means(scanned: Array, counts: Array, weights: Array) -> Array:
    taken = weights > 0
    means: Array = (scanned[:, taken] @ weights[taken]) / float(weights @ counts)
    return means


def _descend(objective: Callable[[Array], float], start: Array, step: float, near: float) -> Array:
    """Nelder & Mead within the cube, from a simplex whose edges point inward."""
    from scipy.optimize import minimize

    k = start.size
    simplex = np.tile(np.clip(start, 0.0, 1.0), (k + 1, 1))
    for axis in range(k):
        simplex[axis + 1, axis] += step if simplex[0, axis] + step <= 1.0 else -step
    result = minimize(
        objective,
        simplex[0],
        method="Nelder-Mead",
        bounds=[(0.0, 1.0)] * k,
        options={"initial_simplex": simplex, "xatol": near, "fatol": near * 0.1, "maxfev": 250 * k},
    )
    return np.asarray(result.x, dtype=np.float64)

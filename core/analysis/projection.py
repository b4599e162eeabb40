# SPDX-License-Identifier: GPL-3.0-or-later
"""Many statistics → one estimate for each parameter, by a regression over simulated sets (Fearnhead & Prangle 2012).

A set that a regression was fitted to looks nearer to its own parameters than new data can be, the more so the more
statistics there are for few sets. Intervals from such residuals are too narrow. So each set is estimated by the
regression without it, which a ridge regression gives in closed form (Hastie, Tibshirani & Friedman 2009, 7.10).
"""

from dataclasses import dataclass

import numpy as np

from ..vectors import Array, Indices

RIDGES = (1e-4, 1e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0, 3.0, 10.0)
"""That are tried, beside the variance 1 of each statistic."""
IDLE = 1e-9
"""A statistic that spreads less, beside its size, is always the same."""
LEAST_LEFT = 0.1
"""Of a set that its own regression follows to the point, its estimate without it is not told by the closed form."""


@dataclass(frozen=True, eq=False)
class Projection:
    """D statistics → k estimates of wanted values, scaled to an even spread.

    Attributes
    ----------
    centre, spread : (D,) of the statistics; infinite for one that is always the same.
    low, high : (D,) beyond which they say no more.
    squares : whether those of the statistics count too: F = 2 D features, else F = D.
    mean : (F,) of the features. slope : (F, k).
    axes : (F, F) principal ones of the features. shrunk : (k, F) inverse of their squares and the ridge.
    row : (N,) of each set in the arrays that follow, −1 for one that the regression has nothing from.
    along : (m, F) features along the axes. weight : (m,) their sum is 1.
    own : (m, k) how far an estimate follows the set's own wanted value. left : (m, k) wanted less its estimate.
    """

    centre: Array
    spread: Array
    low: Array
    high: Array
    squares: bool
    mean: Array
    slope: Array
    axes: Array
    shrunk: Array
    row: Indices
    along: Array
    weight: Array
    own: Array
    left: Array

    def features(self, statistics: Array) -> Array:
        """(..., D) → (..., F), their mean over the sets 0."""
        scaled = (np.clip(statistics, self.low, self.high) - self.centre) / self.spread
        return np.asarray(_features(scaled, self.squares) - self.mean)

    def differences(self, statistics: Array, sets: Indices, observed: Array, without: int = -1) -> Array:
        """Estimates of some sets less that of the observed statistics, each by the regression without the set.

        Parameters
        ----------
        statistics : (N, D) of all sets. sets : (n,) of them.
        observed : (D,).
        without : a set that the observed statistics are those of, −1 for none: the regression is without it, too.

        Returns
        -------
        (n, k)
        """
        features, aim = self.features(statistics[sets]), self.features(observed)
        result = (features - aim) @ self.slope
        row = self.row[sets]
        inside = np.flatnonzero(row >= 0)
        row = row[inside]
        one = int(self.row[without]) if without >= 0 else -1
        own, left = self.own[row], self.left[row]
        on_aim = self.weight[row, None] * (1.0 + (self.along[row] * (aim @ self.axes)) @ self.shrunk.T)
        if one < 0:
            result[inside] -= (own - on_aim) * left / np.maximum(1.0 - own, LEAST_LEFT)
            return np.asarray(result)
        # both are left out at once: their residuals solve a system of two
        on_sets = self.weight[one] * (1.0 + ((features @ self.axes) * self.along[one]) @ self.shrunk.T)
        its, its_left, crossed = self.own[one], self.left[one], on_sets[inside]
        scale = np.maximum((1.0 - own) * (1.0 - its) - crossed * on_aim, LEAST_LEFT**2)
        of_set = ((1.0 - its) * left + crossed * its_left) / scale
        of_one = np.broadcast_to(its_left / np.maximum(1.0 - its, LEAST_LEFT), result.shape).copy()
        of_one[inside] = ((1.0 - own) * its_left + on_aim * left) / scale
        result += (its - on_sets) * of_one
        result[inside] -= (own - on_aim) * of_set
        return np.asarray(result)


def project(statistics: Array, wanted: Array, weight: Array, *, squares: bool) -> Projection:
    """The ridge regression of wanted values on statistics.

    Parameters
    ----------
    statistics : (N, D). wanted : (N, k). weight : (N,) of the sets, 0 for one that does not count.
    squares : whether on the squares of the statistics too, which bends; beyond the sets that count it is wrong soon.

    Notes
    -----
    The ridge of each parameter is that with the least error by generalised cross-validation (Golub et al. 1979).
    """
    some = np.flatnonzero(weight > 0)
    statistics, wanted, w = statistics[some], wanted[some], weight[some] / weight[some].sum()
    low, high = np.quantile(statistics, [0.001, 0.999], axis=0)
    clipped = np.clip(statistics, low, high)
    centre = w @ clipped
    spread = np.sqrt(w @ (clipped - centre) ** 2)
    spread = np.where(spread > IDLE * np.maximum(np.abs(centre), 1.0), spread, np.inf)
    features = _features((clipped - centre) / spread, squares)
    mean = w @ features
    features = features - mean
    centred = wanted - w @ wanted
    square, axes = np.linalg.eigh(features.T @ (w[:, None] * features))
    square = np.maximum(square, 0.0)
    aim = axes.T @ (features.T @ (w[:, None] * centred))
    total = w @ centred**2
    number = 1.0 / float(w @ w)
    shrunk = np.stack([1.0 / (square + _ridge(square, aim[:, j], total[j], number)) for j in range(wanted.shape[1])])
    along = features @ axes
    own = np.stack([w * (1.0 + (along**2) @ one) for one in shrunk], axis=1)
    slope = axes @ (aim * shrunk.T)
    row = np.full(weight.size, -1)
    row[some] = np.arange(some.size)
    left = centred - features @ slope
    return Projection(centre, spread, low, high, squares, mean, slope, axes, shrunk, row, along, w, own, left)


def _ridge(square: Array, aim: Array, total: float, number: float) -> float:
    errors = []
    for ridge in RIDGES:
        rest = float(total - ((square + 2 * ridge) / (square + ridge) ** 2) @ aim**2)
        free = float((square / (square + ridge)).sum())
        errors.append(rest / max(1.0 - free / number, 1e-6) ** 2)
    return RIDGES[int(np.argmin(errors))]


def _features(scaled: Array, squares: bool) -> Array:
    return np.concatenate([scaled, scaled**2], axis=-1) if squares else scaled

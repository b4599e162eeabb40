# SPDX-License-Identifier: GPL-3.0-or-later
"""How near a model comes to the measured impacts: on average, in its scatter, and cloud against cloud."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..reconstruction.impact import Impacts, fall_numbers
from ..vectors import Array, Indices, Mask
from .comparison import Predictions
from .line_fits import student

ABSCISSA = {
    "vn2_mps": "vn1_mps",
    "vt2_mps": "vt1_mps",
    "rn": "theta1_deg",
    "rt": "theta1_deg",
    "r": "theta_dev_deg",
    "theta_dev_deg": "theta1_deg",
}
"""Quantity that is scored → what it is plotted against."""
HALF, MOST = (0.25, 0.75), (0.05, 0.95)
CLOUD_POINTS = 1000
"""Of a larger cloud, this many evenly spaced points enter the energy distance, whose cost grows with the square."""

SEVERAL = 2
"""Fewer draws have neither a mean nor a range of their own."""


@dataclass(frozen=True)
class Score:
    """One model and one quantity, over the impacts where it is measured.

    Attributes
    ----------
    model, quantity : the latter as a column of predictions.csv, which names its unit.
    n : impacts.
    bias, rmse : mean and root mean square of predicted − measured; predicted is the mean of the replicates, or the
        model's mean run when there are fewer than two.
    rmse_low, rmse_high : 95 % interval of the latter, by falls; NaN with fewer than two.
    median_error : median of |predicted − measured|, which a few outliers do not move.
    coverage50, coverage90 : share of the measured values between the 25 and 75 %, the 5 and 95 % quantiles of their
        replicates; NaN with fewer than two. 0.5 and 0.9 would be right; a model without chance has 0.
    wasserstein : between the measured and the predicted values, replicates pooled, in the quantity's unit.
    energy_distance : between the two clouds in the plane of the graph (`ABSCISSA`), axes divided by the interquartile
        range of the measured values; 0 for the same cloud.
    """

    model: str
    quantity: str
    n: int
    bias: float
    rmse: float
    rmse_low: float
    rmse_high: float
    median_error: float
    coverage50: float
    coverage90: float
    wasserstein: float
    energy_distance: float


def scores(
    impacts: Impacts,
    predictions: Predictions,
    quantities: Iterable[str] = tuple(ABSCISSA),
    kept: Mask | None = None,
    *,
    distances: bool = True,
) -> tuple[Score, ...]:
    """All models and some quantities, by default all of `ABSCISSA`; of the impacts (n,) that are kept, None for all.

    distances : whether those between distributions and clouds are wanted, which take longest; NaN where they are not.
    """
    row, quantities, fall = predictions.row, tuple(quantities), fall_numbers(impacts)
    return tuple(
        _score(model, i, quantity, impacts, predictions, kept, fall, distances)
        for i, model in enumerate(predictions.models)
        for quantity in quantities
        if row.size
    )


def measured(impacts: Impacts, row: Indices, name: str) -> Array:
    """(m,) a column of impacts.csv by its name, with the unit of that name."""
    values: Array = getattr(impacts, name.removesuffix("_mps").removesuffix("_deg"))[row]
    return np.degrees(values) if name.endswith("_deg") else values


def predicted(predictions: Predictions, model: int, name: str) -> Array:
    """(1 + R, m) a column of predictions.csv by its name, with the unit of that name."""
    values: Array = getattr(predictions, name.removesuffix("_mps").removesuffix("_deg"))[model]
    return np.degrees(values) if name.endswith("_deg") else values


def rmse(impacts: Impacts, predictions: Predictions, model: int, quantity: str, kept: Mask | None = None) -> float:
    """That of a `Score` alone, at once; NaN where nothing is measured. `model` is its place in the predictions."""
    y, runs, _, _, _ = _pairs(model, quantity, impacts, predictions, kept)
    return float(np.sqrt(np.mean((_expected(runs) - y) ** 2))) if y.size else np.nan


def _pairs(
    i: int, quantity: str, impacts: Impacts, predictions: Predictions, kept: Mask | None
) -> tuple[Array, Array, Array, Array, Indices]:
    """Of the impacts where both are known: measured (n,), predicted (1 + R, n), the same of the abscissa, and rows."""
    against = ABSCISSA[quantity]
    y, runs = measured(impacts, predictions.row, quantity), predicted(predictions, i, quantity)
    x = measured(impacts, predictions.row, against)
    x_runs = predicted(predictions, i, against) if against in ABSCISSA else np.broadcast_to(x, runs.shape)
    known = np.isfinite(y) & np.isfinite(x) & np.isfinite(runs).all(axis=0) & np.isfinite(x_runs).all(axis=0)
    if kept is not None:
        known &= kept[predictions.row]
    return y[known], runs[:, known], x[known], x_runs[:, known], predictions.row[known]


def rmse_interval(squared: Array, fall: Indices) -> tuple[float, float, int]:
    """Ends of the 95 % interval of √mean as parts of it, and the number of falls; NaN with fewer than two of these.

    Parameters
    ----------
    squared : (n,) squares of errors, n ≥ 1.
    fall : (n,) number of the fall of each.

    Notes
    -----
    Errors of one fall's impacts are alike, so falls count as wholes: the mean square is a ratio of two sums over falls,
    its variance that of a ratio (Cochran 1977, § 2.11), and the interval Student's on its logarithm.
    """
    counts = np.bincount(fall)
    there = counts > 0
    counts, sums = counts[there], np.bincount(fall, squared)[there]
    mean = float(squared.mean())
    if counts.size < 2 or mean == 0.0:
        return float("nan"), float("nan"), counts.size
    spread = np.sum((sums - mean * counts) ** 2) * counts.size / (counts.size - 1)
    error = float(np.sqrt(spread)) / squared.size / mean
    reach = student(counts.size - 1) * error / 2
    return float(np.exp(-reach)), float(np.exp(reach)), counts.size


def _drawn(runs: Array) -> Array:
    """The replicates, or the model's mean when there are none."""
    return runs[1:] if len(runs) > 1 else runs


def _expected(runs: Array) -> Array:
    """The mean of the replicates, or the model's mean when they are fewer than `SEVERAL`."""
    return np.asarray(runs[1:].mean(axis=0) if len(runs) > SEVERAL else runs[0])


def _score(
    model: str,
    i: int,
    quantity: str,
    impacts: Impacts,
    predictions: Predictions,
    kept: Mask | None,
    fall: Indices,
    distances: bool,
) -> Score:
    y, runs, x, x_runs, row = _pairs(i, quantity, impacts, predictions, kept)
    n = y.size
    if not n:
        return Score(model, quantity, 0, *[np.nan] * 9)
    draws, x_draws = _drawn(runs), _drawn(x_runs)
    error = _expected(runs) - y
    whole = float(np.sqrt(np.mean(error**2)))
    low, high, _ = rmse_interval(error**2, fall[row])
    return Score(
        model,
        quantity,
        n,
        float(error.mean()),
        whole,
        whole * low,
        whole * high,
        float(np.median(np.abs(error))),
        _coverage(y, draws, *HALF) if predictions.replicates >= SEVERAL else np.nan,
        _coverage(y, draws, *MOST) if predictions.replicates >= SEVERAL else np.nan,
        wasserstein_distance(y, draws) if distances else np.nan,
        energy_distance(np.stack([x, y], axis=1), np.stack([x_draws.ravel(), draws.ravel()], axis=1))
        if distances
        else np.nan,
    )


def _coverage(y: Array, draws: Array, low: float, high: float) -> float:
    least, greatest = np.quantile(draws, [low, high], axis=0)
    return float(np.mean((least <= y) & (y <= greatest)))


def wasserstein_distance(y: Array, draws: Array) -> float:
    """The area between the distributions of (n,) values and of k draws of each, (k, n).

    Every quantile of the former is met by k of the latter, so it is the mean distance of both in their order.
    """
    return float(np.abs(np.repeat(np.sort(y), len(draws)) - np.sort(draws, axis=None)).mean())


def energy_distance(one: Array, other: Array) -> float:
    """√(2E|X−Y| − E|X−X′| − E|Y−Y′|) of two clouds (n, d) and (k, d) (Székely & Rizzo 2013), axes scaled.

    Each axis is divided by the interquartile range of `one`, where that is above zero.
    """
    from scipy.spatial.distance import cdist

    first, third = np.quantile(one, [0.25, 0.75], axis=0)
    scale = np.where(third > first, third - first, 1.0)
    a, b = (_thinned(cloud) / scale for cloud in (one, other))
    squared = 2 * cdist(a, b).mean() - cdist(a, a).mean() - cdist(b, b).mean()
    return float(np.sqrt(max(squared, 0.0)))


def _thinned(cloud: Array) -> Array:
    if len(cloud) <= CLOUD_POINTS:
        return cloud
    return cloud[np.linspace(0, len(cloud) - 1, CLOUD_POINTS).round().astype(np.intp)]

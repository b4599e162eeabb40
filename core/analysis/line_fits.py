# SPDX-License-Identifier: GPL-3.0-or-later
"""Straight lines through points, and power laws as straight lines of logarithms, with intervals of their slopes."""

from dataclasses import dataclass

import numpy as np

from ..vectors import Array, Indices
from .robust_slope import theil_sen

CONFIDENCE = 0.95
FEWEST = 3
"""With fewer points no line is fitted."""
ROUNDING = 1e-12
"""Values that differ by less than this part of themselves are one value."""


@dataclass(frozen=True)
class LineFit:
    """A fitted line y = intercept + slope · x.

    Attributes
    ----------
    slope, low, high : the slope, and its confidence interval (95 %).
    intercept : 0 for a line through the origin.
    r2 : 1 − Σ(y − fit)²/Σ(y − mean)², for every kind of line; below zero for a line that is worse than the mean.
    n : number of points.
    """

    slope: float
    low: float
    high: float
    intercept: float
    r2: float
    n: int


def is_constant(values: Array) -> bool:
    """Whether (n,) values, n ≥ 1, are all the same but for rounding."""
    return bool(np.ptp(values) <= ROUNDING * np.abs(values).max())


def line_through_origin(x: Array, y: Array) -> LineFit:
    """Least squares y = slope · x, (n,) each; the interval is Student's with n − 1 degrees of freedom."""
    if x.size < FEWEST or not np.any(x):
        return _no_line(x.size)
    squares = np.sum(x * x)
    slope = float(np.sum(x * y) / squares)
    error = np.sqrt(np.sum((y - slope * x) ** 2) / (x.size - 1) / squares)
    reach = student(x.size - 1) * float(error)
    return LineFit(slope, slope - reach, slope + reach, 0.0, _r2(y, slope * x), x.size)


def line(x: Array, y: Array) -> LineFit:
    """Least squares y = intercept + slope · x, (n,) each; the interval is Student's with n − 2 degrees of freedom."""
    if x.size < FEWEST or is_constant(x):
        return _no_line(x.size)
    centred = x - x.mean()
    squares = np.sum(centred**2)
    slope = float(np.sum(centred * (y - y.mean())) / squares)
    intercept = float(y.mean() - slope * x.mean())
    fitted = intercept + slope * x
    error = np.sqrt(np.sum((y - fitted) ** 2) / (x.size - 2) / squares)
    reach = student(x.size - 2) * float(error)
    return LineFit(slope, slope - reach, slope + reach, intercept, _r2(y, fitted), x.size)


def power_law(x: Array, y: Array, interval: bool = True) -> LineFit:
    """y = exp(intercept) · x^slope for positive values: Theil–Sen on logarithms, which a few outliers do not move.

    Without `interval`, which takes twice as long as the rest, its ends are NaN.

    R_N at grazing incidence is the quotient of two small numbers, so its outliers are large (the paper has 24, 8, 5).
    """
    positive = (x > 0.0) & (y > 0.0)
    log_x, log_y = np.log(x[positive]), np.log(y[positive])
    if log_x.size < FEWEST or is_constant(x[positive]):
        return _no_line(log_x.size)
    slope, intercept, low, high = theil_sen(log_x, log_y, CONFIDENCE, interval)
    return LineFit(slope, low, high, intercept, _r2(log_y, intercept + slope * log_x), log_x.size)


def interval_by_cluster(x: Array, y: Array, cluster: Indices, *, origin: bool) -> tuple[float, float]:
    """The interval (95 %) of a fitted slope when the points of a cluster may depend on each other.

    Parameters
    ----------
    x, y : (n,) points.
    cluster : (n,) number of the cluster of each, from 0: its trajectory, for impacts.
    origin : whether the line goes through the origin.

    Notes
    -----
    Jackknife: the line is fitted without each cluster in turn (Cameron & Miller 2015, § VI.B, their CV3). Student's
    factor has as many degrees of freedom as there are clusters, less one. NaN with fewer than two clusters, or where
    the others have no slope.
    """
    nan = float("nan")
    if x.size < FEWEST:
        return nan, nan
    if not origin:  # about the means, so that large x lose no digits
        x, y = x - x.mean(), y - y.mean()
    sums = np.stack([np.bincount(cluster, weights) for weights in (np.ones(x.size), x, y, x * x, x * y)])
    sums = sums[:, sums[0] > 0]
    clusters = sums.shape[1]
    total = sums.sum(axis=1, keepdims=True)
    n, sx, sy, sxx, sxy = np.hstack([total, total - sums])
    if not origin:
        with np.errstate(divide="ignore", invalid="ignore"):
            sxx, sxy = sxx - sx * sx / n, sxy - sx * sy / n
    if clusters < 2 or (sxx <= 1e-12 * sxx[0]).any() or not np.isfinite(sxx).all():
        return nan, nan
    slope = sxy / sxx
    error = np.sqrt((clusters - 1) / clusters * np.sum((slope[1:] - slope[0]) ** 2))
    reach = student(clusters - 1) * float(error)
    return float(slope[0]) - reach, float(slope[0]) + reach


def power_interval_by_cluster(x: Array, y: Array, cluster: Indices) -> tuple[float, float]:
    """The interval (95 %) of a power law's exponent when the points of a cluster may depend on each other.

    Parameters
    ----------
    x, y : (n,) points, of which the positive ones count.
    cluster : (n,) number of the cluster of each, from 0.

    Notes
    -----
    As the interval of `power_law`, with the variance of Kendall's count from its sums over clusters, and Student's
    factor with as many degrees of freedom as there are clusters, less one. NaN with fewer than two clusters.
    """
    positive = (x > 0.0) & (y > 0.0)
    if positive.sum() < FEWEST or is_constant(x[positive]):
        return float("nan"), float("nan")
    _, _, low, high = theil_sen(np.log(x[positive]), np.log(y[positive]), CONFIDENCE, True, cluster[positive])
    return low, high


def student(freedom: int) -> float:
    """The factor of a standard error that gives the interval (95 %)."""
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.5 + CONFIDENCE / 2))


def _no_line(n: int) -> LineFit:
    nan = float("nan")
    return LineFit(nan, nan, nan, nan, nan, n)


def _r2(y: Array, fitted: Array) -> float:
    """NaN for values that are all the same, of which nothing is to be explained."""
    if is_constant(y):
        return float("nan")
    return 1.0 - float(np.sum((y - fitted) ** 2) / np.sum((y - y.mean()) ** 2))

# SPDX-License-Identifier: GPL-3.0-or-later
"""The trend of a graph's points as a curve that can be drawn, with its numbers."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..vectors import Array, Mask
from .line_fits import LineFit, is_constant, line, line_through_origin, power_law
from .ranks import shared_ranks

Trend = Literal["auto", "none", "origin", "line", "power", "exponential", "logarithm"]
"""That of the pair of variables (`trend_of`), no curve, y = a·x, a + b·x, a·x^b, a·e^(b·x), a + b·ln x."""
POINTS = 60
DIGITS = 3
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

PAIRS: dict[tuple[str, str], Trend] = {
    ("theta1_deg", "rn"): "power",
    ("vn1_mps", "rn"): "power",
    ("vt1_mps", "vt2_mps"): "origin",
    ("theta_dev_deg", "r"): "line",
}
"""Variables on the axes (x, y) → the trend that Noël et al. 2018 see, on axes of any kind."""


def trend_of(x: str, y: str, x_log: bool = False, y_log: bool = False) -> Trend:
    """The trend that suits two variables: of the paper's pairs theirs, of others the one that is straight as drawn."""
    straight: dict[tuple[bool, bool], Trend] = {
        (False, False): "line",
        (True, True): "power",
        (False, True): "exponential",
        (True, False): "logarithm",
    }
    return PAIRS.get((x, y)) or straight[x_log, y_log]


@dataclass(frozen=True, eq=False)
class Curve:
    """A fitted trend.

    Attributes
    ----------
    trend : its kind.
    fit : its numbers: of y on x, of ln y for an exponential, on ln x for a logarithm, of both for a power law, whose
        slope is robust (Theil–Sen). NaN where nothing can be fitted: `text` says why.
    rank : Spearman's rank correlation of all points; NaN with fewer than three, or where one variable is constant.
    n : points, of which `fit.n` have a place on the trend's axes.
    x, y : (k,) points along it, within the axes; empty where there is no fit.
    """

    trend: Trend
    fit: LineFit
    rank: float
    n: int
    x: Array
    y: Array

    @property
    def is_fitted(self) -> bool:
        """Whether there is a curve to draw."""
        return bool(np.isfinite(self.fit.slope))

    def text(self, y: str, x: str, slope: str = "", power: str = "^{}", full: bool = True) -> str:
        """Its equation and R² for people; if `full` with rank correlation and number of points.

        Parameters
        ----------
        y, x : symbols of the variables.
        slope : symbol of the slope through the origin, when it has one.
        power : how an exponent is written.
        """
        more = f", ρ = {_signed(self.rank)}" if np.isfinite(self.rank) else ""
        more += f", n = {self.fit.n if self.is_fitted else self.n}"
        if not self.is_fitted:
            return f"{self._why_not()}{more}" if full else self._why_not()
        explained = np.isfinite(self.fit.r2) and self.fit.slope != 0.0
        r2 = f", R² = {_signed(self.fit.r2)}" if explained else ""
        return f"{self._equation(y, x, slope, power)}{r2}{more if full else ''}"

    def _equation(self, y: str, x: str, slope: str, power: str) -> str:
        fit = self.fit
        exponent = number(fit.slope)
        if fit.slope == 0.0 and self.trend != "origin":
            return f"{y} = {number(float(self.y[0]))}" if self.y.size else f"{y} is constant"
        if self.trend == "origin":
            return f"{slope} = {number(fit.slope)}" if slope else f"{y} = {number(fit.slope)} {x}"
        if self.trend == "power":
            return f"{y} = {number(float(np.exp(fit.intercept)))} {x}{power.format(exponent)}"
        if self.trend == "exponential":
            return f"{y} = {number(float(np.exp(fit.intercept)))} exp({exponent} {x})"
        of = f"ln {x}" if self.trend == "logarithm" else x
        return f"{y} = {number(fit.intercept)} {'−' if fit.slope < 0 else '+'} {number(abs(fit.slope))} {of}"

    def _why_not(self) -> str:
        few = "too few points for a fit"
        if self.fit.n < self.n:
            return f"{few} above zero"
        return few if self.n < 3 else "no fit: all points have one abscissa"


def number(value: float) -> str:
    """Three digits for people: 0.550, −1.03, 1.20·10⁵."""
    if not np.isfinite(value):
        return "–"
    text = f"{value:#.{DIGITS}g}"
    mantissa, _, exponent = text.partition("e")
    if exponent:
        mantissa += "·10" + str(int(exponent)).translate(SUPERSCRIPT)
    return mantissa.removesuffix(".").replace("-", "−")


def fit_curve(
    trend: Trend,
    points: Array,
    x_limits: tuple[float, float],
    y_limits: tuple[float, float],
    *,
    interval: bool = True,
) -> Curve | None:
    """The trend of finite (m, 2) points; None for "none", or when there are no points.

    Parameters
    ----------
    trend : not "auto": `trend_of` says which that is.
    x_limits, y_limits : of the axes, which the curve does not leave. It does not go beyond the points either, but a
        line through the origin begins there.
    interval : whether the interval of a power law's slope is wanted, which takes longer than all the rest.
    """
    if trend == "none" or not len(points):
        return None
    x, y = np.ascontiguousarray(points[:, 0]), np.ascontiguousarray(points[:, 1])
    placed = _placed(trend, x, y)
    if is_constant(y):
        y = np.full_like(y, y[0])
    fit, rank = _fit(trend, x[placed], y[placed], interval), rank_correlation(x, y)
    if not np.isfinite(fit.slope):
        return Curve(trend, fit, rank, x.size, np.empty(0), np.empty(0))
    low = max(x_limits[0], 0.0 if trend == "origin" else float(x[placed].min()))
    high = min(x_limits[1], float(x[placed].max()))
    along = _along(trend, low, high)
    with np.errstate(over="ignore"):
        value = fit.intercept + fit.slope * (np.log(along) if trend in ("power", "logarithm") else along)
        value = np.exp(value) if trend in ("power", "exponential") else value
    seen = (value >= y_limits[0]) & (value <= y_limits[1])
    return Curve(trend, fit, rank, x.size, along[seen], value[seen])


def rank_correlation(x: Array, y: Array) -> float:
    """Spearman's ρ of (n,) values each, ties sharing their ranks; NaN with fewer than three, or of a constant."""
    if x.size < 3 or is_constant(x) or is_constant(y):
        return float("nan")
    one, other = (shared_ranks(values) - (x.size + 1) / 2 for values in (x, y))
    return float(np.sum(one * other) / np.sqrt(np.sum(one**2) * np.sum(other**2)))


def _placed(trend: Trend, x: Array, y: Array) -> Mask:
    """(m,) points that have a place on the trend's axes."""
    placed = np.ones(x.size, dtype=np.bool_)
    if trend in ("power", "logarithm"):
        placed &= x > 0.0
    if trend in ("power", "exponential"):
        placed &= y > 0.0
    return placed


def _fit(trend: Trend, x: Array, y: Array, interval: bool) -> LineFit:
    if trend == "power":
        return power_law(x, y, interval)
    if trend == "exponential":
        return line(x, np.log(y))
    if trend == "logarithm":
        return line(np.log(x), y)
    return line_through_origin(x, y) if trend == "origin" else line(x, y)


def _along(trend: Trend, low: float, high: float) -> Array:
    """(k,) abscissae, close enough for a smooth curve on linear and on logarithmic axes."""
    if low > high:
        return np.empty(0)
    if low > 0.0 and trend != "exponential":
        return np.geomspace(low, high, POINTS)
    return np.linspace(low, high, POINTS)


def _signed(value: float) -> str:
    return f"{value:.2f}".replace("-", "−")

# SPDX-License-Identifier: GPL-3.0-or-later
"""The trend of a graph's points as a curve that can be drawn, with its numbers."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..vectors import Array
from .statistics import LineFit, line, line_through_origin, power_law

Trend = Literal["none", "origin", "line", "power"]
"""No curve, y = a·x, y = a + b·x, y = a·x^b."""
POINTS = 60


@dataclass(frozen=True, eq=False)
class Curve:
    """A fitted trend.

    Attributes
    ----------
    trend : its kind.
    fit : its numbers.
    x, y : (k,) points along it, within the axes.
    """

    trend: Trend
    fit: LineFit
    x: Array
    y: Array

    def text(self, y: str, x: str, slope: str = "", power: str = "^{}") -> str:
        """Its equation and R² for people.

        Parameters
        ----------
        y, x : symbols of the variables.
        slope : symbol of the slope through the origin, when it has one.
        power : how an exponent is written.
        """
        fit = self.fit
        if self.trend == "origin":
            equation = f"{slope} = {fit.slope:.2f}" if slope else f"{y} = {fit.slope:.2f} {x}"
        elif self.trend == "line":
            equation = f"{y} = {fit.intercept:.2f} {'−' if fit.slope < 0 else '+'} {abs(fit.slope):.4f} {x}"
        else:
            exponent = f"{fit.slope:.2f}".replace("-", "−")
            equation = f"{y} = {np.exp(fit.intercept):.1f} {x}{power.format(exponent)}"
        return f"{equation}, R² = {fit.r2:.2f}".replace("= -", "= −")


def fit_curve(
    trend: Trend, points: Array, x_limits: tuple[float, float], y_limits: tuple[float, float]
) -> Curve | None:
    """The trend of (m, 2) points; None for "none", or when there are too few."""
    if trend == "none":
        return None
    fit = {"origin": line_through_origin, "line": line, "power": power_law}[trend](points[:, 0], points[:, 1])
    if not np.isfinite(fit.slope):
        return None
    low = max(x_limits[0], 0.0) if trend == "origin" else max(x_limits[0], float(points[:, 0].min()))
    high = min(x_limits[1], float(points[:, 0].max()))
    x = np.linspace(max(low, 1e-9) if trend == "power" else low, high, POINTS)
    y = np.exp(fit.intercept) * x**fit.slope if trend == "power" else fit.intercept + fit.slope * x
    seen = (y >= y_limits[0]) & (y <= y_limits[1])
    return Curve(trend, fit, x[seen], y[seen])

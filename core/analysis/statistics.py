# SPDX-License-Identifier: GPL-3.0-or-later
"""The statistics of a table of impacts that Noël et al. 2018 print, and their published values beside them."""

from dataclasses import dataclass, fields

import numpy as np

from ..errors import InputError
from ..reconstruction.impact import Impacts
from ..remarks import Remark
from ..vectors import Array, Mask, norm
from .robust_slope import theil_sen

PUBLISHED_RT_SLOPE = 0.66
PUBLISHED_RT_R2 = 0.31
"""Noël et al. 2018, Fig. 6: linear fit of |v_T2| on |v_T1|; that it goes through the origin is likely, not stated."""

PUBLISHED_RN_ANGLE_DEG = 20.0
"""Noël et al. 2018: R_N exceeds 1 where the incident angle is below about 20°."""

CONFIDENCE = 0.95
FEWEST = 3
"""With fewer impacts no line is fitted."""

Row = tuple[str, float, str, str]
"""Name, value, unit and note: a row of statistics.csv."""


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


@dataclass(frozen=True)
class Spread:
    """Quantiles of one quantity: the least, 10 %, the median, 90 %, and the greatest."""

    least: float
    low: float
    median: float
    high: float
    greatest: float


@dataclass(frozen=True)
class ImpactStatistics:
    """What a table of impacts says as a whole.

    Attributes
    ----------
    impacts : number of impacts in the table.
    used : how many of them have R_N, R_T, R, θ1 and θ_dev, and enter here.
    rt : |v_T2| on |v_T1| through the origin: the slope is the table's R_T.
    rt_free : the same with a free intercept [m/s].
    r_deviation : R on θ_dev, per degree; its intercept is R of an undeflected block.
    rn_angle : ln R_N on ln θ1 [°] by Theil–Sen, so R_N = a·θ1^b with b the slope and a = exp(intercept).
    rn_above_one, rn_above_one_grazing : impacts with R_N > 1, and those of them with θ1 below 20°.
    grazing : impacts with θ1 below 20°.
    spreads : by name and unit, (name, unit) → quantiles.
    """

    impacts: int
    used: int
    rt: LineFit
    rt_free: LineFit
    r_deviation: LineFit
    rn_angle: LineFit
    rn_above_one: int
    rn_above_one_grazing: int
    grazing: int
    spreads: dict[tuple[str, str], Spread]

    @property
    def rn_factor(self) -> float:
        """a of R_N = a·θ1^b, θ1 in degrees."""
        return float(np.exp(self.rn_angle.intercept))

    def as_rows(self) -> list[Row]:
        """The rows of statistics.csv."""
        rows: list[Row] = [
            ("impacts", self.impacts, "", "in the table"),
            ("impacts_used", self.used, "", "with all coefficients defined"),
        ]
        published = f"Noël et al. 2018: {PUBLISHED_RT_SLOPE}, R² {PUBLISHED_RT_R2}"
        rows += _line_rows("rt_slope", self.rt, "", f"|v_T2| on |v_T1| through the origin; {published}", False)
        rows += _line_rows("rt_slope_free", self.rt_free, "", "|v_T2| on |v_T1| with an intercept", True, "m/s")
        rows += _line_rows("r_deviation_slope", self.r_deviation, "1/deg", "R on θ_dev; intercept is R at 0°", True)
        rows += [
            ("rn_angle_factor", self.rn_factor, "", "a of R_N = a·θ1^b, θ1 in degrees, Theil–Sen on logarithms"),
            ("rn_angle_exponent", self.rn_angle.slope, "", "b of R_N = a·θ1^b"),
            ("rn_angle_exponent_low", self.rn_angle.low, "", "95 % confidence"),
            ("rn_angle_exponent_high", self.rn_angle.high, "", "95 % confidence"),
            ("rn_angle_r2", self.rn_angle.r2, "", "of ln R_N; 1 − SSE/SST about the mean"),
            ("rn_above_one", self.rn_above_one, "", "impacts with R_N > 1"),
            ("rn_above_one_below_20_deg", self.rn_above_one_grazing, "", "of these, with θ1 < 20°"),
            ("impacts_below_20_deg", self.grazing, "", "impacts with θ1 < 20°"),
        ]
        for (name, unit), spread in self.spreads.items():
            for part in ("least", "low", "median", "high", "greatest"):
                note = {"low": "10 % quantile", "high": "90 % quantile"}.get(part, "")
                rows.append((f"{name}_{part}", getattr(spread, part), unit, note))
        return rows

    def remarks(self) -> list[Remark]:
        """The same for people, with the published values beside."""
        if self.used < FEWEST:
            text = f"{self.used} of {self.impacts} impacts have all coefficients: too few for statistics."
            return [Remark(text, "problem", "impacts")]
        rt, trend, spreads = self.rt, self.r_deviation, self.spreads
        before, angle = spreads["v1", "m/s"], spreads["theta1", "deg"]
        texts = {
            "impacts": f"{self.used} of {self.impacts} impacts have all coefficients "
            f"(incident speed {before.median:.1f} m/s in the median, {before.greatest:.1f} at most; "
            f"incident angle {angle.median:.0f}°, {angle.low:.0f}–{angle.high:.0f}° for the middle 80 %).",
            "rt": f"R_T = {rt.slope:.2f} ({rt.low:.2f}–{rt.high:.2f}), R² {rt.r2:.2f}: slope of |v_T2| on |v_T1| "
            f"through the origin. Published: {PUBLISHED_RT_SLOPE:.2f}, R² {PUBLISHED_RT_R2:.2f}.",
            "rn": f"R_N = {self.rn_factor:.1f}·θ1^{self.rn_angle.slope:.2f} (θ1 in degrees): hyperbolic, as published. "
            f"R_N > 1 at {self.rn_above_one} impacts, {self.rn_above_one_grazing} of them below "
            f"{PUBLISHED_RN_ANGLE_DEG:.0f}° (published: below about {PUBLISHED_RN_ANGLE_DEG:.0f}°)."
            if self.rn_angle.high < 0
            else f"R_N shows no clear fall with the incident angle (exponent {self.rn_angle.slope:.2f}, "
            f"{self.rn_angle.low:.2f} to {self.rn_angle.high:.2f}). R_N > 1 at {self.rn_above_one} impacts.",
            "r": f"R {'falls' if trend.slope < 0 else 'rises'} by {abs(trend.slope) * 10:.3f} per 10° of deviation, "
            f"from {trend.intercept:.2f} at 0° (R² {trend.r2:.2f}). Published: falls about linearly from 1.",
        }
        return [Remark(text, "note", about) for about, text in texts.items()]


def impact_statistics(impacts: Impacts, among: Mask | None = None) -> ImpactStatistics:
    """The statistics of all impacts whose coefficients are defined.

    Parameters
    ----------
    among : (n,) which impacts to take; None for all.

    Notes
    -----
    First, last and departing impacts have no coefficients and drop out by themselves. Doubtful picks count like the
    others. Angles enter the fits in degrees, as in the paper's figures.
    """
    among = np.ones(len(impacts), dtype=np.bool_) if among is None else among
    used = among & impacts.complete & np.isfinite(impacts.theta1) & np.isfinite(impacts.theta_dev)
    vt1, vt2 = impacts.vt1[used], impacts.vt2[used]
    rn, r = impacts.rn[used], impacts.r[used]
    theta1_deg, deviation_deg = np.degrees(impacts.theta1[used]), np.degrees(impacts.theta_dev[used])
    grazing = theta1_deg < PUBLISHED_RN_ANGLE_DEG
    quantities = {
        ("v1", "m/s"): norm(impacts.v1[used]),
        ("v2", "m/s"): norm(impacts.v2[used]),
        ("rn", ""): rn,
        ("rt", ""): impacts.rt[used],
        ("r", ""): r,
        ("theta1", "deg"): theta1_deg,
        ("theta_dev", "deg"): deviation_deg,
    }
    return ImpactStatistics(
        impacts=int(among.sum()),
        used=int(used.sum()),
        rt=line_through_origin(vt1, vt2),
        rt_free=line(vt1, vt2),
        r_deviation=line(deviation_deg, r),
        rn_angle=power_law(theta1_deg, rn),
        rn_above_one=int((rn > 1.0).sum()),
        rn_above_one_grazing=int(((rn > 1.0) & grazing).sum()),
        grazing=int(grazing.sum()),
        spreads={key: _spread(values) for key, values in quantities.items()},
    )


def group_statistics(impacts: Impacts, column: str) -> dict[str, ImpactStatistics]:
    """The statistics of each group of impacts, by the text in a column.

    Parameters
    ----------
    column : "site", "trajectory", a number of the table ("diameter_m", "impact", …), a flag ("doubtful": the groups
        are "yes" and "no"), or one of the further columns of the table that was read.

    Raises
    ------
    InputError : there is no such column; those that there are, are named.
    """
    plain = {one.name: getattr(impacts, one.name) for one in fields(Impacts)}
    groups = {name: values for name, values in plain.items() if np.ndim(values) == 1}
    groups |= {name: np.where(marked, "yes", "no") for name, marked in impacts.flags.items()}
    groups |= dict(impacts.extra)
    if column not in groups:
        raise InputError(f"There is no column {column!r} to group by", advice=f"There are {', '.join(groups)}")
    texts = np.array([f"{value:g}" if isinstance(value, float) else str(value) for value in groups[column].tolist()])
    return {str(text): impact_statistics(impacts, texts == text) for text in dict.fromkeys(texts.tolist())}


def line_through_origin(x: Array, y: Array) -> LineFit:
    """Least squares y = slope · x, (n,) each; the interval is Student's with n − 1 degrees of freedom."""
    from scipy.stats import t

    if x.size < FEWEST or not np.any(x):
        return _no_line(x.size)
    slope = float(x @ y / (x @ x))
    error = np.sqrt(np.sum((y - slope * x) ** 2) / (x.size - 1) / (x @ x))
    reach = float(t.ppf(0.5 + CONFIDENCE / 2, x.size - 1) * error)
    return LineFit(slope, slope - reach, slope + reach, 0.0, _r2(y, slope * x), x.size)


def line(x: Array, y: Array) -> LineFit:
    """Least squares y = intercept + slope · x, (n,) each; the interval is Student's with n − 2 degrees of freedom."""
    from scipy.stats import t

    if x.size < FEWEST or np.ptp(x) == 0.0:
        return _no_line(x.size)
    centred = x - x.mean()
    slope = float(centred @ (y - y.mean()) / (centred @ centred))
    intercept = float(y.mean() - slope * x.mean())
    fitted = intercept + slope * x
    error = np.sqrt(np.sum((y - fitted) ** 2) / (x.size - 2) / (centred @ centred))
    reach = float(t.ppf(0.5 + CONFIDENCE / 2, x.size - 2) * error)
    return LineFit(slope, slope - reach, slope + reach, intercept, _r2(y, fitted), x.size)


def power_law(x: Array, y: Array, interval: bool = True) -> LineFit:
    """y = exp(intercept) · x^slope for positive values: Theil–Sen on logarithms, which a few outliers do not move.

    Without `interval`, which takes twice as long as the rest, its ends are NaN.

    R_N at grazing incidence is the quotient of two small numbers, so its outliers are large (the paper has 24, 8, 5).
    """
    positive = (x > 0.0) & (y > 0.0)
    log_x, log_y = np.log(x[positive]), np.log(y[positive])
    if log_x.size < FEWEST or np.ptp(log_x) == 0.0:
        return _no_line(log_x.size)
    slope, intercept, low, high = theil_sen(log_x, log_y, CONFIDENCE, interval)
    return LineFit(slope, low, high, intercept, _r2(log_y, intercept + slope * log_x), log_x.size)


def _no_line(n: int) -> LineFit:
    nan = float("nan")
    return LineFit(nan, nan, nan, nan, nan, n)


def _r2(y: Array, fitted: Array) -> float:
    total = float(np.sum((y - y.mean()) ** 2))
    return 1.0 - float(np.sum((y - fitted) ** 2)) / total if total > 0.0 else float("nan")


def _spread(values: Array) -> Spread:
    if not values.size:
        return Spread(*[float("nan")] * 5)
    return Spread(*np.quantile(values, [0.0, 0.1, 0.5, 0.9, 1.0]).tolist())


def _line_rows(name: str, fit: LineFit, unit: str, note: str, free: bool, intercept_unit: str = "") -> list[Row]:
    rows: list[Row] = [
        (name, fit.slope, unit, note),
        (f"{name}_low", fit.low, unit, "95 % confidence"),
        (f"{name}_high", fit.high, unit, "95 % confidence"),
        (f"{name}_r2", fit.r2, "", "1 − SSE/SST about the mean"),
    ]
    if free:
        rows.append((f"{name}_intercept", fit.intercept, intercept_unit, ""))
    return rows

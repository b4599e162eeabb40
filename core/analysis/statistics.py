# SPDX-License-Identifier: GPL-3.0-or-later
"""The statistics of measured impacts, of a table and of its groups, with the values of Noël et al. 2018 beside."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..progress import Progress, silent
from ..reconstruction.impact import REFUSED, Impacts, fall_numbers
from ..remarks import Remark
from ..vectors import Array, Indices, Mask
from .line_fits import (
    FEWEST,
    LineFit,
    interval_by_cluster,
    line,
    line_through_origin,
    power_interval_by_cluster,
    power_law,
)
from .variables import APPARENT, VARIABLES, known_variables, measured_values

PUBLISHED_RT_SLOPE = 0.66
PUBLISHED_RT_R2 = 0.31
"""Noël et al. 2018, Fig. 6: linear fit of |v_T2| on |v_T1|; that it goes through the origin is likely, not stated."""

PUBLISHED_RN_ANGLE_DEG = 20.0
"""Noël et al. 2018: R_N exceeds 1 where the incident angle is below about 20°."""

FEWEST_FOR_LAW = 10
"""With fewer impacts a group's trends are not shown: a power law through a few points is anything."""
HYPERBOLIC = (0.7, 1.3)
"""Exponents of 1/θ1 that are called hyperbolic; Noël et al. 2017 have 1.08, Wyllie 1.03."""

CLASS_DEG = 10.0
CLASSES = 9
"""Classes of the incident angle, from 0 to 90°; the last holds 90°, too."""
COUNTERS = ("time_s", "impact")
"""Variables whose spread says nothing."""
DOUBTS = ("contact", "shattered", "doubtful")
"""Flags of impacts that enter and deserve a look, the gravest first."""

Row = tuple[str, float, str, str]
"""Name, value, unit and note: a row of statistics.csv."""


@dataclass(frozen=True)
class Spread:
    """How one quantity is spread: how many values, the least, 10 %, the median, 90 %, and the greatest."""

    n: int
    least: float
    low: float
    median: float
    high: float
    greatest: float


PARTS = (0.0, 0.1, 0.5, 0.9, 1.0)
"""The quantiles of a `Spread`."""


@dataclass(frozen=True)
class AngleClass:
    """Impacts with an incident angle from `low_deg` to below `high_deg`, and those of them with R_N > 1."""

    low_deg: float
    high_deg: float
    n: int
    above_one: int

    @property
    def share(self) -> float:
        """Part with R_N > 1; NaN without impacts."""
        return self.above_one / self.n if self.n else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """That part's 95 % interval (Wilson 1927), for impacts that are independent; NaN without impacts."""
        if not self.n:
            return float("nan"), float("nan")
        z = 1.959963984540054
        middle = self.share + z**2 / (2 * self.n)
        reach = z * (self.share * (1 - self.share) / self.n + z**2 / (4 * self.n**2)) ** 0.5
        low, high = ((middle + side * reach) / (1 + z**2 / self.n) for side in (-1, 1))
        return low if self.above_one else 0.0, high if self.above_one < self.n else 1.0


@dataclass(frozen=True)
class ImpactStatistics:
    """What a table of impacts, or a group of them, says as a whole.

    Attributes
    ----------
    impacts : number of impacts.
    used : how many of them have R_N, R_T, R, θ1 and θ_dev and are not refused, and enter here.
    trajectories : how many falls these are of.
    doubts : flag → how many of those that enter have it.
    rt : |v_T2| on |v_T1| through the origin: the slope is the table's R_T.
    rt_by_trajectory : 95 % interval of that slope when the impacts of a trajectory may depend on each other.
    rt_free : the same line with a free intercept [m/s].
    r_deviation : R on θ_dev, per degree; its intercept is R of an undeflected block.
    r_deviation_by_trajectory : 95 % interval of that slope when the impacts of a trajectory may depend on each other.
    rn_angle : ln R_N on ln θ1 [°] by Theil–Sen, so R_N = a·θ1^b with b the slope and a = exp(intercept).
    rn_angle_by_trajectory : 95 % interval of that b when the impacts of a trajectory may depend on each other.
    classes : R_N > 1 by incident angle.
    spreads : variable → how its values are spread, for the variables that the table has anything of.
    """

    impacts: int
    used: int
    trajectories: int
    doubts: dict[str, int]
    rt: LineFit
    rt_by_trajectory: tuple[float, float]
    rt_free: LineFit
    r_deviation: LineFit
    r_deviation_by_trajectory: tuple[float, float]
    rn_angle: LineFit
    rn_angle_by_trajectory: tuple[float, float]
    classes: tuple[AngleClass, ...]
    spreads: dict[str, Spread]

    @property
    def rn_factor(self) -> float:
        """a of R_N = a·θ1^b, θ1 in degrees."""
        return float(np.exp(self.rn_angle.intercept))

    @property
    def rn_above_one(self) -> int:
        """Impacts with R_N > 1."""
        return sum(one.above_one for one in self.classes)

    @property
    def grazing(self) -> int:
        """Impacts with θ1 below 20°."""
        return sum(one.n for one in self._grazing)

    @property
    def rn_above_one_grazing(self) -> int:
        """Impacts with θ1 below 20° and R_N > 1."""
        return sum(one.above_one for one in self._grazing)

    @property
    def _grazing(self) -> tuple[AngleClass, ...]:
        return tuple(one for one in self.classes if one.high_deg <= PUBLISHED_RN_ANGLE_DEG)

    def as_rows(self) -> list[Row]:
        """The rows of statistics.csv."""
        rows: list[Row] = [
            ("impacts", self.impacts, "", "in the table"),
            ("impacts_used", self.used, "", f"with all coefficients, without {', '.join(REFUSED)}"),
            ("trajectories", self.trajectories, "", "that these are of"),
        ]
        rows += [(f"impacts_{flag}", number, "", "of those used") for flag, number in self.doubts.items()]
        published = f"Noël et al. 2018: {PUBLISHED_RT_SLOPE}, R² {PUBLISHED_RT_R2}"
        rows += _line_rows("rt_slope", self.rt, "", f"|v_T2| on |v_T1| through the origin; {published}", False)
        rows += _cluster_rows("rt_slope", self.rt_by_trajectory, "")
        rows += _line_rows("rt_slope_free", self.rt_free, "", "|v_T2| on |v_T1| with an intercept", True, "m/s")
        rows += _line_rows("r_deviation_slope", self.r_deviation, "1/deg", "R on θ_dev; intercept is R at 0°", True)
        rows += _cluster_rows("r_deviation_slope", self.r_deviation_by_trajectory, "1/deg")
        rows += [
            ("rn_angle_factor", self.rn_factor, "", "a of R_N = a·θ1^b, θ1 in degrees, Theil–Sen on logarithms"),
            ("rn_angle_exponent", self.rn_angle.slope, "", "b of R_N = a·θ1^b"),
            ("rn_angle_exponent_low", self.rn_angle.low, "", "95 % confidence"),
            ("rn_angle_exponent_high", self.rn_angle.high, "", "95 % confidence"),
            *_cluster_rows("rn_angle_exponent", self.rn_angle_by_trajectory, "", "ranks"),
            ("rn_angle_r2", self.rn_angle.r2, "", "of ln R_N; 1 − SSE/SST about the mean"),
            ("rn_above_one", self.rn_above_one, "", "impacts with R_N > 1"),
            ("rn_above_one_below_20_deg", self.rn_above_one_grazing, "", "of these, with θ1 < 20°"),
            ("impacts_below_20_deg", self.grazing, "", "impacts with θ1 < 20°"),
        ]
        for name, spread in self.spreads.items():
            unit = VARIABLES[name].unit.replace("°", "deg")
            for part in ("least", "low", "median", "high", "greatest"):
                note = {"low": "10 % quantile", "high": "90 % quantile"}.get(part, "")
                rows.append((f"{stem(name)}_{part}", getattr(spread, part), unit, note))
        return rows

    def remarks(self) -> list[Remark]:
        """The same for people, with the published values beside; what is doubtful first."""
        if self.used < FEWEST:
            text = f"{self.used} of {self.impacts} impacts have all coefficients: too few for statistics."
            return [Remark(text, "problem", "impacts")]
        rt, trend, spreads = self.rt, self.r_deviation, self.spreads
        before, angle = spreads["v1_mps"], spreads["theta1_deg"]
        slope, exponent = f"{trend.slope * 10:.3f}", f"{self.rn_angle.slope:.2f}".replace("-", "−")
        falls = slope.startswith("-")
        if not self.rn_angle.high < 0:
            shape = "no clear fall with the incident angle"
        elif -HYPERBOLIC[1] <= self.rn_angle.slope <= -HYPERBOLIC[0]:
            shape = "hyperbolic, as published"
        else:
            slower = self.rn_angle.slope > -HYPERBOLIC[0]
            shape = f"it falls {'more slowly' if slower else 'more steeply'} than the published hyperbola"
        turn = (
            f"R {'falls' if falls else 'rises'} by {slope.removeprefix('-')} per 10° of deviation"
            if trend.low > 0 or trend.high < 0
            else f"R shows no clear trend with the deviation: {slope.replace('-', '−')} per 10°"
        )
        texts = [
            (
                "impacts",
                before.median,
                f"{self.used} of {self.impacts} impacts have all coefficients "
                f"(incident speed {before.median:.1f} m/s in the median, {before.greatest:.1f} at most; "
                f"incident angle {angle.median:.0f}°, {angle.low:.0f}–{angle.high:.0f}° for the middle 80 %).",
            ),
            (
                "rt",
                rt.slope,
                f"R_T = {rt.slope:.3f} ({rt.low:.3f}–{rt.high:.3f}{_together(self.rt_by_trajectory, 3, '–')}), "
                f"{_explained(rt, 3)}: slope of |v_T2| on |v_T1| through the origin. "
                f"Published: {PUBLISHED_RT_SLOPE:.2f}, R² {PUBLISHED_RT_R2:.2f}.",
            ),
            (
                "rn",
                self.rn_angle.slope,
                f"R_N = {self.rn_factor:.1f}·θ1^{exponent} (θ1 in degrees; exponent {_span(self.rn_angle)}"
                f"{_together(self.rn_angle_by_trajectory, 2, ' to ')}): {shape}. "
                f"R_N > 1 at {self.rn_above_one} impacts, {self.rn_above_one_grazing} of them "
                f"below {PUBLISHED_RN_ANGLE_DEG:.0f}° (published: below about {PUBLISHED_RN_ANGLE_DEG:.0f}°).",
            ),
            (
                "r",
                trend.slope,
                f"{turn} ({_span(trend, 10)}), from {trend.intercept:.2f} at 0° ({_explained(trend, 2)}). "
                "Published: it falls about linearly; no numbers are printed.",
            ),
        ]
        return [*self._doubtful(), *(Remark(text, "note", about) for about, known, text in texts if known == known)]

    def _doubtful(self) -> list[Remark]:
        if not self.doubts:
            return []
        flags = ", ".join(f"{flag} {number}" for flag, number in self.doubts.items())
        return [Remark(f"Flagged among the {self.used} impacts used: {flags}.", "warning", "flags")]


def usable(impacts: Impacts) -> Mask:
    """(n,) impacts that enter: R_N, R_T, R, θ1 and θ_dev are defined, and they have no flag of `REFUSED`.

    First and last impacts have no coefficients and drop out by themselves. Doubtful picks count like the others.
    """
    known = impacts.complete & np.isfinite(impacts.theta1) & np.isfinite(impacts.theta_dev)
    return known & ~impacts.refused


def impact_statistics(impacts: Impacts, among: Mask | None = None) -> ImpactStatistics:
    """The statistics of all impacts that are `usable`.

    Parameters
    ----------
    among : (n,) which impacts to take; None for all.

    Notes
    -----
    Angles enter the fits in degrees, as in the paper's figures.
    """
    number = np.zeros(len(impacts), dtype=np.intp) if among is None else np.where(among, 0, -1)
    return statistics_by_number(impacts, number, 1)[0]


def statistics_by_number(
    impacts: Impacts, number: Indices, groups: int, progress: Progress = silent
) -> tuple[ImpactStatistics, ...]:
    """The statistics of each group.

    Parameters
    ----------
    number : (n,) of each impact's group, from 0; −1 for none.
    groups : how many there are.
    """
    total = np.bincount(number[number >= 0], minlength=groups).tolist()
    row = np.flatnonzero(usable(impacts) & (number >= 0))
    row = row[np.argsort(number[row], kind="stable")]
    of = number[row]
    ends = np.searchsorted(of, np.arange(groups + 1)).tolist()
    values = {name: measured_values(impacts, row, name) for name in known_variables(impacts)}
    spreads = {name: _spreads(column, of, groups) for name, column in values.items() if name not in COUNTERS}
    fall = fall_numbers(impacts)[row]
    theta1, deviation, vt1, vt2, rn, r = (
        values[name] for name in ("theta1_deg", "theta_dev_deg", "vt1_mps", "vt2_mps", "rn", "r")
    )
    cell = of * CLASSES + np.minimum(theta1 / CLASS_DEG, CLASSES - 1).astype(np.intp)
    counts, above = (np.bincount(one, minlength=groups * CLASSES).reshape(groups, -1) for one in (cell, cell[rn > 1.0]))
    flags = {flag: np.bincount(of[impacts.flags[flag][row]], minlength=groups) for flag in DOUBTS}
    found = []
    for i in range(groups):
        progress("Fitting", i, groups)
        here = slice(ends[i], ends[i + 1])
        falls, cluster = np.unique(fall[here], return_inverse=True)
        found.append(
            ImpactStatistics(
                impacts=total[i],
                used=ends[i + 1] - ends[i],
                trajectories=falls.size,
                doubts={flag: int(one[i]) for flag, one in flags.items() if one[i]},
                rt=line_through_origin(vt1[here], vt2[here]),
                rt_by_trajectory=interval_by_cluster(vt1[here], vt2[here], cluster, origin=True),
                rt_free=line(vt1[here], vt2[here]),
                r_deviation=line(deviation[here], r[here]),
                r_deviation_by_trajectory=interval_by_cluster(deviation[here], r[here], cluster, origin=False),
                rn_angle=power_law(theta1[here], rn[here]),
                rn_angle_by_trajectory=power_interval_by_cluster(theta1[here], rn[here], cluster),
                classes=_classes(counts[i], above[i]),
                spreads={name: columns[i] for name, columns in spreads.items() if columns[i].n or name in APPARENT},
            )
        )
    return tuple(found)


def stem(variable: str) -> str:
    """A variable's name without its unit: theta1, kinetic_n1."""
    return variable if variable in ("rn", "rt", "r", "impact") else variable.rpartition("_")[0]


def _classes(counts: Indices, above: Indices) -> tuple[AngleClass, ...]:
    return tuple(
        AngleClass(i * CLASS_DEG, (i + 1) * CLASS_DEG, n, more)
        for i, (n, more) in enumerate(zip(counts.tolist(), above.tolist(), strict=True))
    )


def _spreads(values: Array, of: Indices, groups: int) -> list[Spread]:
    """How the defined values (n,) of each group are spread; quantiles between two values are on the line between."""
    known = np.isfinite(values)
    values, of = values[known], of[known]
    counts = np.bincount(of, minlength=groups)
    quantiles = np.full((groups, len(PARTS)), np.nan)
    some = np.flatnonzero(counts)
    if some.size:
        ordered, first = values[np.lexsort((values, of))], (np.cumsum(counts) - counts)[some, None]
        place = np.array(PARTS) * (counts[some, None] - 1)
        below = np.floor(place).astype(np.intp)
        low, high = ordered[first + below], ordered[first + np.ceil(place).astype(np.intp)]
        quantiles[some] = low + (high - low) * (place - below)
    return [Spread(n, *parts) for n, parts in zip(counts.tolist(), quantiles.tolist(), strict=True)]


def _signed(value: float, digits: int) -> str:
    return f"{value:.{digits}f}".replace("-", "−")


def _explained(fit: LineFit, digits: int) -> str:
    return f"R² {_signed(fit.r2, digits)}" if np.isfinite(fit.r2) else "no R², all values are the same"


def _span(fit: LineFit, times: float = 1.0) -> str:
    return f"{times * fit.low:.2f} to {times * fit.high:.2f}".replace("-", "−")


def _together(interval: tuple[float, float], digits: int, to: str) -> str:
    low, high = (_signed(value, digits) for value in interval)
    return f"; {low}{to}{high} if the impacts of a trajectory depend on each other" if np.isfinite(interval[0]) else ""


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


def _cluster_rows(name: str, interval: Sequence[float], unit: str, by: str = "jackknife") -> list[Row]:
    note = f"95 % confidence when the impacts of a trajectory may depend on each other ({by})"
    return [
        (f"{name}_{end}_by_trajectory", value, unit, note) for end, value in zip(("low", "high"), interval, strict=True)
    ]

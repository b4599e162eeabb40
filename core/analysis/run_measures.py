# SPDX-License-Identifier: GPL-3.0-or-later
"""What is read off whole runs, observed and simulated ones alike, and how sure the observed values are."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..simulation.ground import Ground
from ..vectors import Array, Indices, Mask, dot, norm
from .observed_runs import Observed
from .paths import Paths
from .sections import Axis, Section, crossings, extremes, heights_at, impacts_apart, impacts_per_metre

SHORTEST_S = 0.2
"""Between two impacts that a person tells apart, where no observed ones say."""


@dataclass(frozen=True)
class Quantity:
    """What is compared.

    Attributes
    ----------
    name : in tables. title, unit : in figures and sentences. tested : else it says the same as another.
    """

    name: str
    title: str
    unit: str
    tested: bool = True


AT_SECTIONS = (
    Quantity("time_s", "time since the start", "s"),
    Quantity("along_m", "place along the section", "m"),
    Quantity("speed_mps", "speed", "m/s"),
    Quantity("height_m", "height", "m"),
    Quantity("kinetic_J", "kinetic energy", "J", tested=False),
)
OF_RUNS = (
    Quantity("impacts_per_m", "impacts per metre", "1/m"),
    Quantity("v_max_mps", "greatest speed", "m/s"),
    Quantity("height_max_m", "greatest height", "m"),
    Quantity("runout_m", "run-out", "m"),
    Quantity("energy_line_deg", "energy line", "°"),
    Quantity("stop_aside_m", "stop, left of the mean way", "m"),
)
OF_REBOUNDS = (
    Quantity("rebound_r", "speed after the rebound over that before", ""),
    Quantity("rebound_rise", "vertical velocity after the rebound over the speed before", ""),
    Quantity("rebound_turn_deg", "turn in plan at the rebound", "°"),
)
REACH = Quantity("reach", "blocks that reach it", "")
QUANTITIES = {one.name: one for one in (*AT_SECTIONS, *OF_RUNS, *OF_REBOUNDS, REACH)}


@dataclass(frozen=True, eq=False)
class Limits:
    """(n,) impacts and metres in plan up to which runs were observed."""

    impacts: Indices
    length_m: Array
    shortest_s: float
    """Impacts nearer than this in time are one."""

    @classmethod
    def of(cls, paths: Paths) -> "Limits":
        """Those of observed runs."""
        impacts = np.bincount(paths.run[paths.impact_piece], minlength=len(paths))
        return cls(impacts, paths.length_m, shortest_between(paths))

    def take(self, rows: Indices) -> "Limits":
        """Of the runs at these places."""
        return Limits(self.impacts[rows], self.length_m[rows], self.shortest_s)


def measure_runs(
    paths: Paths, sections: Sequence[Section], axis: Axis, ground: Ground, limits: Limits
) -> dict[tuple[str, str], Array]:
    """Everything that is compared: (section, quantity) → (n,), NaN where there is none."""
    crossed = [crossings(paths, section, axis) for section in sections]
    heights = heights_at(ground, [one.position for one in crossed])
    values: dict[tuple[str, str], Array] = {}
    for section, one, height in zip(sections, crossed, heights, strict=True):
        square = dot(one.velocity, one.velocity)
        columns = (one.time_s, one.along_m, np.sqrt(square), height, 0.5 * paths.mass_kg * square)
        for quantity, column in zip(AT_SECTIONS, columns, strict=True):
            values[section.name, quantity.name] = column
    greatest = extremes(paths, limits.length_m, ground)
    seen: Mask = limits.impacts > 0
    way = paths.stop - paths.start[paths.first_piece[:-1]]
    flat = np.hypot(*way[:, :2].T)
    aside = np.where(paths.beyond, np.nan, axis.aside(paths.stop))
    columns_of_runs = (
        impacts_per_metre(paths, limits.impacts, limits.shortest_s),
        np.where(seen, greatest.v_max_mps, np.nan),
        np.where(seen, greatest.height_max_m, np.nan),
        flat,
        np.where(flat > 0, np.degrees(np.arctan2(-way[:, 2], flat)), np.nan),
        aside,
    )
    for quantity, column in zip(OF_RUNS, columns_of_runs, strict=True):
        values["", quantity.name] = column
    return values


Measure = Callable[[Paths], dict[tuple[str, str], Array]]
"""Runs → what is read off them."""


def errors_of(
    observed: Observed, values: Mapping[tuple[str, str], Array], measure: Measure
) -> dict[tuple[str, str], Array]:
    """(n,) standard deviations of the observed values, NaN where less than half of the moved runs have one."""
    if not observed.moved:
        return {key: np.full(column.size, np.nan) for key, column in values.items()}
    draws = [measure(paths) for paths in observed.moved]
    sigma = {}
    for key, column in values.items():
        drawn = np.stack([draw[key] for draw in draws])
        enough = np.isfinite(column) & (2 * np.isfinite(drawn).sum(axis=0) >= len(draws))
        sigma[key] = np.full(column.size, np.nan)
        if observed.errors_known is not None:
            enough &= observed.errors_known
        sigma[key][enough] = np.nanstd(drawn[:, enough], axis=0, ddof=1)
    return sigma


def shortest_between(paths: Paths) -> float:
    """The shortest time between impacts that were told apart [s]."""
    piece = paths.impact_piece
    apart = impacts_apart(paths, 0.0)
    run, time = paths.run[piece][apart], (paths.time_s + paths.duration_s)[piece][apart]
    gaps = np.diff(time)[run[1:] == run[:-1]]
    return float(gaps.min()) if gaps.size else SHORTEST_S


def measure_rebounds(paths: Paths, limits: Limits) -> dict[tuple[str, str], Array]:
    """The mean rebound of each run between its first impacts, as many as were observed: ("", quantity) → (n,).

    Velocities are those of parabolas from one impact to the next that a person tells apart, on both sides: where blocks
    skip between two of them, so they do in what was observed. All three quantities are without the normal of the
    terrain, which is not known in the same way on both sides.
    """
    n, piece = len(paths), paths.impact_piece[impacts_apart(paths, limits.shortest_s)]
    run = paths.run[piece]
    order = np.arange(piece.size) - np.searchsorted(run, run)
    piece = piece[order < limits.impacts[run]]
    run = paths.run[piece]
    first = paths.first_piece[:-1]
    before = np.r_[True, run[1:] != run[:-1]][: piece.size]
    time, place = (paths.time_s + paths.duration_s)[piece], paths.end[piece]
    last = np.where(before, first[run] - 1, np.roll(piece, 1))  # the piece with which the one before ends
    since = np.where(before, 0.0, np.roll(time, 1))
    origin = np.where(before[:, None], paths.start[first[run]], np.roll(place, 1, axis=0))
    grounded = np.r_[0, np.cumsum(~paths.flies)]
    flew = (grounded[piece + 1] == grounded[last + 1]) & (time > since)
    lasted = np.where(flew, time - since, np.nan)[:, None]
    mean, fall = (place - origin) / lasted, 0.5 * paths.gravity_mps2 * lasted * [0.0, 0.0, 1.0]
    here = np.flatnonzero(~before[1:])  # rows that are followed by one of the same run
    v1, v2 = (mean - fall)[here], (mean + fall)[here + 1]
    speed = norm(v1)
    known = np.isfinite(v2[:, 0]) & (speed > 0)
    own, v1, v2, speed = run[here][known], v1[known], v2[known], speed[known]
    cross = v1[:, 0] * v2[:, 1] - v1[:, 1] * v2[:, 0]
    turn = np.degrees(np.abs(np.arctan2(cross, (v1[:, :2] * v2[:, :2]).sum(axis=1))))
    count = np.bincount(own, minlength=n)
    columns = (norm(v2) / speed, v2[:, 2] / speed, turn)
    return {
        ("", quantity.name): np.divide(
            np.bincount(own, column, minlength=n), count, out=np.full(n, np.nan), where=count > 0
        )
        for quantity, column in zip(OF_REBOUNDS, columns, strict=True)
    }

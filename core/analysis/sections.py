# SPDX-License-Identifier: GPL-3.0-or-later
"""Where runs cross sections: levels of height, drops below the start, and lines in plan with a vertical screen."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..errors import InputError
from ..simulation.ground import Ground
from ..vectors import Array, Indices, Mask, norm
from .paths import HIGHEST_FLIGHTS, MOMENTS, Paths

DEFAULT_PARTS = (0.25, 0.5, 0.75)


@dataclass(frozen=True, eq=False)
class Axis:
    """The straight line in plan from the mean start of runs to the mean of their stops, or of what is seen last.

    Attributes
    ----------
    origin, direction : (2,) local [m], unit.
    """

    origin: Array
    direction: Array

    def along(self, position: Array) -> Array:
        """(...,) metres along the axis, of places (..., 3)."""
        return np.asarray((position[..., :2] - self.origin) @ self.direction)

    def aside(self, position: Array) -> Array:
        """(...,) metres to the left of the axis, seen downhill."""
        across = np.array([-self.direction[1], self.direction[0]])
        return np.asarray((position[..., :2] - self.origin) @ across)


@dataclass(frozen=True, eq=False)
class Section:
    """A level of height, a drop, or a vertical screen: one of the three is given.

    Attributes
    ----------
    name : for tables and legends.
    level_m : a block crosses where its underside falls below this height, local [m].
    drop_m : a block crosses where its underside falls so far below its own start [m].
    line : (p, 2) the screen's line in plan, local [m]; crossed from either side.
    """

    name: str
    level_m: float | None = None
    drop_m: float | None = None
    line: Array | None = None


@dataclass(frozen=True, eq=False)
class Crossings:
    """The first crossing of a section by each of n runs; NaN for a run that does not cross it.

    Attributes
    ----------
    crosses : (n,) whether the run does, after its first impact.
    given : (n,) the run starts below the level, or crosses before its first impact.
    time_s : (n,) since the start of the run.
    position, velocity : (n, 3) of the block's underside then.
    along_m : (n,) place along the section: along its line, else to the left of the axis of the runs.
    passages : (n,) how often the run crosses: at a level, how often it falls below.
    """

    crosses: Mask
    given: Mask
    time_s: Array
    position: Array
    velocity: Array
    along_m: Array
    passages: Indices


def axis_of(paths: Paths) -> Axis:
    """The axis of runs.

    Raises
    ------
    InputError : the runs end where they start, in plan.
    """
    first = paths.first_piece
    start = paths.start[first[:-1]].mean(axis=0)
    end = np.where(np.isnan(paths.stop), paths.end[first[1:] - 1], paths.stop).mean(axis=0)
    way = (end - start)[:2]
    if not (length := float(np.hypot(*way))) > 0:
        raise InputError("The observed runs go nowhere, in plan", advice="Give picks of blocks that move")
    return Axis(start[:2], way / length)


def default_sections(paths: Paths, fewest: int, up_m: float = 0.0) -> tuple[Section, ...]:
    """Three sections that observed runs cross.

    Levels at the quarters between the mean height of the starts and the lowest end, named by their height + `up_m`.
    Where less than `fewest` runs cross any of them, as when each is seen on a part of the slope, drops below each
    run's own start: the quarters of the median drop.
    """
    first = paths.first_piece
    starts, ends = paths.start[first[:-1], 2], paths.end[first[1:] - 1, 2]
    top, bottom = float(starts.mean()), float(ends.min())
    heights = [top + part * (bottom - top) for part in DEFAULT_PARTS]
    levels = tuple(Section(f"{height + up_m:.0f} m", level_m=height) for height in heights)
    axis = axis_of(paths)
    if max(int(crossings(paths, level, axis).crosses.sum()) for level in levels) >= fewest:
        return levels
    drops = [part * float(np.median(starts - ends)) for part in DEFAULT_PARTS]
    return tuple(Section(f"{drop:.1f} m below the start", drop_m=drop) for drop in drops)


def crossings(paths: Paths, section: Section, axis: Axis) -> Crossings:
    """The first crossing of each run, exact on its flights.

    A run that starts below a level does not cross it. Else its first crossing is where it ends below it for the first
    time, since a flight that has both ends above a level has no part below. A crossing before the first impact says
    nothing of a model, since the first flight is given: it does not count, and neither do later ones of that run.
    """
    n, starts = len(paths), paths.start[paths.first_piece[:-1], 2]
    given = np.zeros(n, dtype=np.bool_)
    level, share, place = np.zeros(n), np.zeros(0), np.zeros(0)
    if section.line is not None:
        piece, share, place = _across(paths, section.line)
        passages = np.bincount(paths.run[piece], minlength=n)
    else:
        level = np.full(n, section.level_m) if section.level_m is not None else starts - (section.drop_m or 0.0)
        given = starts < level
        z, speed = level[paths.run], paths.start_velocity[:, 2]
        rise = np.where(paths.flies & (speed > 0), speed**2 / (2 * paths.gravity_mps2), 0.0)
        below = paths.end[:, 2] < z
        piece = np.flatnonzero(below & ~given[paths.run])
        passages = np.bincount(paths.run[below & (paths.start[:, 2] + rise >= z)], minlength=n)
    runs, nearest = np.unique(paths.run[piece], return_index=True)
    piece = piece[nearest]
    counts = piece > paths.struck_piece[runs]
    given[runs[~counts]] = True
    crosses = np.zeros(n, dtype=np.bool_)
    crosses[runs[counts]] = True
    time, along = np.full(n, np.nan), np.full(n, np.nan)
    position, velocity = np.full((n, 3), np.nan), np.full((n, 3), np.nan)
    runs, piece = runs[counts], piece[counts]
    if section.line is None:
        elapsed = paths.when_below(piece, level[runs])
    else:
        elapsed = paths.when_across(piece, share[nearest][counts])
    time[runs] = paths.time_s[piece] + elapsed
    position[runs], velocity[runs] = paths.states(piece, elapsed)
    along[runs] = axis.aside(position[runs]) if section.line is None else place[nearest][counts]
    return Crossings(crosses, given, time, position, velocity, along, np.where(crosses, passages, 0))


def _across(paths: Paths, line: Array) -> tuple[Indices, Array, Array]:
    """Pieces that cross a line in plan, in order: which, at which share of their length, and where along the line."""
    start, way = paths.start[:, :2], (paths.end - paths.start)[:, :2]
    found: list[tuple[Indices, Array, Array]] = []
    before = np.r_[0.0, np.cumsum(norm(np.diff(line, axis=0)))]
    for i, (a, b) in enumerate(pairwise(line)):
        side = b - a
        away = a - start
        area = way[:, 0] * side[1] - way[:, 1] * side[0]
        crossing = np.flatnonzero(area != 0)
        share = (away[:, 0] * side[1] - away[:, 1] * side[0])[crossing] / area[crossing]
        part = (away[:, 0] * way[:, 1] - away[:, 1] * way[:, 0])[crossing] / area[crossing]
        last = 1.0 if i == len(line) - 2 else np.nextafter(1.0, 0.0)
        inside = (share >= 0) & (share < 1) & (part >= 0) & (part <= last)
        found.append((crossing[inside], share[inside], before[i] + part[inside] * (before[i + 1] - before[i])))
    piece, share, place = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.lexsort((share, piece))
    return piece[order], share[order], place[order]


def heights_at(ground: Ground, places: Sequence[Array]) -> list[Array]:
    """Heights above the terrain of several arrays of places (n, 3), in one look-up; NaN where a place is."""
    if not places:
        return []
    together = np.concatenate(places)
    known = np.isfinite(together).all(axis=1)
    heights = np.full(len(together), np.nan)
    heights[known] = ground.heights_above(together[known])
    return np.split(heights, np.cumsum([len(part) for part in places])[:-1])


@dataclass(frozen=True, eq=False)
class Extremes:
    """Of n runs, on the first metres of each, from its first impact on.

    Attributes
    ----------
    v_max_mps, height_max_m : (n,) greatest speed, and greatest height of the underside above the terrain; NaN for a run
        without an impact there, and for the latter without a flight over the terrain.
    """

    v_max_mps: Array
    height_max_m: Array


def extremes(paths: Paths, length_m: Array, ground: Ground) -> Extremes:
    """The greatest speed and height of each run on its first (n,) metres in plan, without the flight that is given."""
    n, plan, travelled = len(paths), paths.plan_m, paths.travelled_m
    reach = length_m[paths.run]
    inside = np.flatnonzero((travelled < reach) & (np.arange(paths.run.size) > paths.struck_piece[paths.run]))
    share = np.clip((reach - travelled)[inside] / np.where(plan > 0, plan, np.inf)[inside], 0.0, 1.0)
    share[plan[inside] == 0] = 1.0
    until = paths.when_across(inside, share)
    _, last = paths.states(inside, until)
    v_max = np.full(n, -np.inf)
    np.maximum.at(v_max, paths.run[inside], np.maximum(norm(paths.start_velocity[inside]), norm(last)))
    flying = paths.flies[inside] & (until > 0)
    rows, lasts = inside[flying], until[flying]
    run = paths.run[rows]
    order = np.lexsort((-lasts, run))
    rank = np.arange(order.size) - np.searchsorted(run[order], run[order])
    longest = order[rank < HIGHEST_FLIGHTS]
    parts = np.tile(np.linspace(0.0, 1.0, MOMENTS), longest.size)
    piece = np.repeat(rows[longest], MOMENTS)
    place, _ = paths.states(piece, parts * np.repeat(lasts[longest], MOMENTS))
    (above,) = heights_at(ground, [place])
    height = np.full(n, -np.inf)
    np.maximum.at(height, paths.run[piece], np.where(np.isnan(above), -np.inf, above))
    return Extremes(*(np.where(np.isfinite(each), each, np.nan) for each in (v_max, height)))


def impacts_apart(paths: Paths, shortest_s: float) -> Indices:
    """The impacts that a person tells apart, as places in `Paths.impact_piece`.

    An impact that follows another, or the start, within `shortest_s` is one with it.
    """
    piece = paths.impact_piece
    run, time = paths.run[piece], paths.time_s[piece] + paths.duration_s[piece]
    begins = np.r_[True, run[1:] != run[:-1]][: piece.size]
    gap = np.where(begins, time, np.diff(time, prepend=0.0))
    return np.flatnonzero(gap >= shortest_s)


def impacts_per_metre(paths: Paths, number: Indices, shortest_s: float) -> Array:
    """(n,) impacts per metre of the way in plan from the start to the `number`-th (n,) impact, or to the last if fewer.

    NaN for a run without an impact, or of no length. See `impacts_apart`.
    """
    piece = paths.impact_piece[impacts_apart(paths, shortest_s)]
    run, way = paths.run[piece], (paths.travelled_m + paths.plan_m)[piece]
    first = np.searchsorted(run, np.arange(len(paths)))
    count = np.minimum(np.bincount(run, minlength=len(paths)), number)
    result = np.full(len(paths), np.nan)
    some = np.flatnonzero(count > 0)
    length = way[first[some] + count[some] - 1]
    result[some] = np.divide(count[some], length, out=np.full(some.size, np.nan), where=length > 0)
    return result

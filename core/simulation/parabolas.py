# SPDX-License-Identifier: GPL-3.0-or-later
"""A simulation's motion as parabolas: a row for each flight, and for legs on the ground as few as follow them."""

from dataclasses import dataclass

import numpy as np

from ..reconstruction.free_flight import fly
from ..vectors import Array, Indices, Mask, norm
from .engine import ENDED, FLIES_OFF, IMPACT, ON_GROUND, RELEASED, TREE, Simulation

TOLERANCE_M = 0.01
"""A leg on the ground, or a flight with drag, is followed as near as this."""
DRAG_STEP_S = 0.1
"""A flight with drag is known at moments so far apart."""


@dataclass(frozen=True, eq=False)
class Parabolas:
    """k pieces p + v τ + ½ a τ² of the motion of n blocks' centres, in the order of the runs and of time.

    Attributes
    ----------
    run : (k,) number of the run, from 0.
    start_s, duration_s : (k,) since the release; the last piece of a block that has stopped never ends.
    position, velocity, acceleration : (k, 3) at its start [m], [m/s], [m/s²].
    spin : (k, 3) [rad/s].
    """

    run: Indices
    start_s: Array
    duration_s: Array
    position: Array
    velocity: Array
    acceleration: Array
    spin: Array

    def __len__(self) -> int:
        return self.run.size

    def states(self, pieces: Indices, elapsed_s: Array) -> tuple[Array, Array]:
        """Positions and velocities (q, 3) on some pieces, so long after their starts."""
        t, a = elapsed_s[:, None], self.acceleration[pieces]
        velocity = self.velocity[pieces]
        return self.position[pieces] + (velocity + 0.5 * a * t) * t, velocity + a * t


@dataclass(frozen=True, eq=False)
class Polylines:
    """The paths of n blocks as points, in the order of the runs and of time.

    Attributes
    ----------
    run : (m,) number of the run, from 0.
    time_s : (m,) since the release.
    position : (m, 3) of the centre [m].
    speed_mps : (m,) at an impact that after it.
    """

    run: Indices
    time_s: Array
    position: Array
    speed_mps: Array


def parabolas_of(simulation: Simulation, tolerance_m: float = TOLERANCE_M) -> Parabolas:
    """The motion of all runs; exact where they fly through nothing.

    Notes
    -----
    A block that has left the terrain, or reached a limit, has no last piece: it vanishes there.
    """
    records, settings = simulation.records, simulation.settings
    drag = simulation.releases.drag_per_m(settings.drag)[records.run]
    begin = np.flatnonzero((records.run[:-1] == records.run[1:]) & (np.diff(records.time_s) > 0))
    duration = records.time_s[begin + 1] - records.time_s[begin]
    flies = np.isin(records.what[begin], (RELEASED, IMPACT, FLIES_OFF, TREE)) & (records.what[begin + 1] != ON_GROUND)
    arrival, _ = fly(records.position[begin], records.v2[begin], duration, settings.gravity_mps2, drag[begin])
    flies &= norm(arrival - records.position[begin + 1]) <= tolerance_m
    free = flies & (drag[begin] == 0)
    rest = np.flatnonzero((records.what == ENDED) & simulation.at_rest[records.run])
    zero, still = np.zeros(3), np.zeros((rest.size, 3))
    leg, ends = _joined(*_moments(simulation, begin[~free], duration[~free], flies[~free], drag), tolerance_m)
    row = np.concatenate([begin[free], ends.row, rest])
    start = np.concatenate([records.time_s[begin[free]], ends.time_s, records.time_s[rest]])
    order = np.lexsort((start, records.run[row]))
    weight = np.broadcast_to(zero - [0.0, 0.0, settings.gravity_mps2], (int(free.sum()), 3))
    return Parabolas(
        run=records.run[row][order],
        start_s=start[order],
        duration_s=np.concatenate([duration[free], leg.duration_s, np.full(rest.size, np.inf)])[order],
        position=np.concatenate([records.position[begin[free]], ends.position, records.position[rest]])[order],
        velocity=np.concatenate([records.v2[begin[free]], leg.velocity, still])[order],
        acceleration=np.concatenate([weight, leg.acceleration, still])[order],
        spin=np.concatenate([records.omega2[row[: row.size - rest.size]], still])[order],
    )


def polylines_of(parabolas: Parabolas, tolerance_m: float) -> Polylines:
    """Points on the paths, so many that the lines between them are nowhere farther away than the tolerance."""
    moving = np.flatnonzero(np.isfinite(parabolas.duration_s))
    bend = norm(parabolas.acceleration[moving])
    duration = parabolas.duration_s[moving]
    count = np.maximum(np.ceil(duration * np.sqrt(bend / (8 * tolerance_m))), 1).astype(np.intp)
    run = parabolas.run[moving]
    last = np.append(run[1:] != run[:-1], True) if run.size else np.zeros(0, np.bool_)
    points = count + last  # the end of a piece is the start of the next
    which = np.repeat(np.arange(moving.size), points)
    within = np.arange(which.size) - np.repeat(np.cumsum(points) - points, points)
    elapsed = duration[which] * within / count[which]
    position, velocity = parabolas.states(moving[which], elapsed)
    return Polylines(run[which], parabolas.start_s[moving[which]] + elapsed, position, norm(velocity))


@dataclass(frozen=True, eq=False)
class _Moments:
    """Known places of chains of moments: the record that each follows, its time since the release, its place."""

    row: Indices
    time_s: Array
    position: Array


@dataclass(frozen=True, eq=False)
class _Legs:
    duration_s: Array
    velocity: Array
    acceleration: Array


def _moments(
    simulation: Simulation, begin: Indices, duration: Array, flies: Mask, drag: Array
) -> tuple[_Moments, Indices]:
    """Moments of what is no exact parabola, and the first moment of each chain, with the count at its end.

    A flight with drag is a chain; steps on the ground that follow each other are one. On each of them the acceleration
    is constant: the middle of a long one is a moment too.
    """
    records = simulation.records
    joins = np.zeros(begin.size, np.bool_)
    joins[1:] = ~flies[1:] & ~flies[:-1] & (begin[1:] == begin[:-1] + 1)
    ends = np.append(~joins[1:], True) if begin.size else joins
    change = records.v1[begin + 1] - records.v2[begin]
    bent = norm(change) * duration / 8 > 0.1 * TOLERANCE_M
    inner = np.where(flies, np.ceil(duration / DRAG_STEP_S).astype(np.intp) - 1, bent.astype(np.intp))
    parts = 1 + inner + ends
    which = np.repeat(np.arange(begin.size), parts)
    within = np.arange(which.size) - np.repeat(np.cumsum(parts) - parts, parts)
    elapsed = duration[which] * within / (inner[which] + 1)
    row = begin[which]
    place = records.position[row].copy()
    between = (within > 0) & (within <= inner[which])
    aloft, middle = between & flies[which], between & ~flies[which]
    place[aloft], _ = fly(
        records.position[row[aloft]], records.v2[row[aloft]], elapsed[aloft],
        simulation.settings.gravity_mps2, drag[row[aloft]],
    )  # fmt: skip
    sag = change[which[middle]] * duration[which[middle], None] / 8
    place[middle] = 0.5 * (place[middle] + records.position[row[middle] + 1]) - sag
    last = (within > 0) & ~between
    place[last] = records.position[row[last] + 1]
    firsts = (np.cumsum(parts) - parts)[~joins]
    return _Moments(row, records.time_s[row] + elapsed, place), np.append(firsts, which.size)


def _joined(moments: _Moments, chains: Indices, tolerance_m: float) -> tuple[_Legs, _Moments]:
    """As few parabolas as halving a chain again and again gives, each through its first, middle and last moment."""
    low, high = chains[:-1], chains[1:] - 1
    done: list[tuple[Indices, Indices]] = []
    while low.size:
        inner = high - low - 1
        which = np.repeat(np.arange(low.size), inner)
        place = low[which] + 1 + np.arange(which.size) - np.repeat(np.cumsum(inner) - inner, inner)
        legs = _through(moments, low, high)
        t = moments.time_s[place] - moments.time_s[low[which]]
        there = (
            moments.position[low[which]]
            + (legs.velocity[which] + 0.5 * legs.acceleration[which] * t[:, None]) * (t[:, None])
        )
        away = np.zeros(low.size)
        np.maximum.at(away, which, norm(there - moments.position[place]))
        good = away <= tolerance_m
        done.append((low[good], high[good]))
        low, high = low[~good], high[~good]
        middle = (low + high) // 2
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    empty = np.zeros(0, np.intp)
    low, high = (np.concatenate([empty, *part]) for part in (zip(*done, strict=True) if done else ((), ())))
    return _through(moments, low, high), _Moments(moments.row[low], moments.time_s[low], moments.position[low])


def _through(moments: _Moments, low: Indices, high: Indices) -> _Legs:
    """Parabolas through the first, middle and last of moments; straight ones where there is none between."""
    middle = (low + high) // 2
    whole, part = moments.time_s[high] - moments.time_s[low], moments.time_s[middle] - moments.time_s[low]
    way, first = moments.position[high] - moments.position[low], moments.position[middle] - moments.position[low]
    mean = way / whole[:, None]
    bent = (part > 0) & (part < whole)
    acceleration = np.zeros_like(way)
    slope = first[bent] / part[bent, None]
    acceleration[bent] = 2 * (mean[bent] - slope) / (whole - part)[bent, None]
    return _Legs(whole, mean - 0.5 * acceleration * whole[:, None], acceleration)

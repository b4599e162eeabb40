# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertical screens across the slope: where, how high and how fast blocks pass, and what a barrier there would hold.

A screen measures and changes nothing. A barrier is a screen with a height and a capacity: a flexible net that holds
what it catches. Since it gives nothing back, what happens with it follows from the runs without it: those that it
holds end there. Both are told from the same runs.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import inf, isfinite

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..remarks import Remark
from ..simulation.engine import ENDS, LIMIT, Records, Simulation
from ..simulation.ground import Ground
from ..simulation.parabolas import Parabolas, parabolas_of
from ..vectors import Array, Indices, Mask, dot, norm

PASSES, HELD, OVER, THROUGH = range(4)
OUTCOMES = ("passes", "held", "over", "through")
"""What becomes of a block at a screen without a capacity, and at a barrier."""
SAME_M, SAME_S = 1e-9, 1e-6
"""A path through a corner of a screen crosses it once."""


@dataclass(frozen=True, eq=False)
class Screen:
    """A vertical screen along a line in plan.

    Attributes
    ----------
    name : in tables and figures.
    line : (p, 2) in plan, local [m].
    height_m : of a barrier, vertically above the terrain [m].
    capacity_j : the kinetic energy up to which a barrier holds a block [J]; None for a screen that only measures.
    remarks : what a user should know of how its file was read.

    Raises
    ------
    InputError : fewer than two different points, a height or capacity that is not above zero.
    """

    name: str
    line: Array
    height_m: float = inf
    capacity_j: float | None = None
    remarks: tuple[Remark, ...] = ()

    def __post_init__(self) -> None:
        if self.line.ndim != 2 or len(self.line) < 2 or not np.isfinite(self.line).all() or not self.length_m > 0:
            raise InputError(
                f"Screen {self.name!r} is no line in plan", advice="Draw it through two or more different points"
            )
        if not self.height_m > 0:
            raise InputError(
                f"Screen {self.name!r} is {self.height_m:g} m high",
                advice="Give a height above zero, or none to measure",
            )
        if self.capacity_j is not None and not (isfinite(self.capacity_j) and self.capacity_j > 0):
            raise InputError(
                f"The capacity of barrier {self.name!r} is {self.capacity_j / 1000:g} kJ", advice="Give kJ above zero"
            )

    @property
    def length_m(self) -> float:
        """Of the line in plan [m]."""
        return float(norm(np.diff(self.line, axis=0)).sum())

    @property
    def holds(self) -> bool:
        """Whether it is a barrier."""
        return self.capacity_j is not None

    @property
    def closed(self) -> bool:
        """Whether it is the outline of an area: what counts is that a block enters."""
        return len(self.line) > 3 and bool(np.array_equal(self.line[0], self.line[-1]))


@dataclass(frozen=True, eq=False)
class ScreenHits:
    """h crossings of screens by the centres of blocks, in the order of the runs and of time.

    Attributes
    ----------
    screen : (h,) place among the screens.
    number : (h,) of the run, from 1.
    time_s : (h,) since the release.
    position, velocity : (h, 3) of the centre, local [m], [m/s].
    along_m : (h,) along the line, from its first point.
    up_m : (h,) of the centre, vertically above the terrain; NaN where there is no terrain.
    radius_m : (h,) of the block.
    angle : (h,) between the velocity and the screen's normal [rad]: 0 is head-on.
    kinetic_j, rotational_j : (h,) of translation and of rotation [J].
    outcome : (h,) place in `OUTCOMES`: at a barrier, whether it holds the block.
    reaches : (h,) whether the block gets there where the barriers hold others before.
    place : (h,) where the block was released, see `Releases`.
    """

    screen: NDArray[np.int16]
    number: NDArray[np.int64]
    time_s: Array
    position: Array
    velocity: Array
    along_m: Array
    up_m: Array
    radius_m: Array
    angle: Array
    kinetic_j: Array
    rotational_j: Array
    outcome: NDArray[np.int8]
    reaches: Mask
    place: Indices

    def __len__(self) -> int:
        return self.screen.size

    @property
    def energy_j(self) -> Array:
        """(h,) of translation and rotation [J]."""
        return self.kinetic_j + self.rotational_j

    def take(self, which: Indices | Mask) -> "ScreenHits":
        """Some of them."""
        return ScreenHits(**{name: getattr(self, name)[which] for name in ScreenHits.__dataclass_fields__})


@dataclass(frozen=True, eq=False)
class BlocksAt:
    """The n blocks that come to one screen, in the order of their runs: a block that passes again is still one.

    Attributes
    ----------
    number, place : (n,) of the run, from 1; where it was released, see `Releases`.
    speed_mps, energy_j, kinetic_j, up_m, radius_m : (n,) the greatest of the block's hits: the energy of translation
        and rotation, then of translation alone; the height is NaN where there is no terrain at any of them.
    """

    number: NDArray[np.int64]
    place: Indices
    speed_mps: Array
    energy_j: Array
    kinetic_j: Array
    up_m: Array
    radius_m: Array

    def __len__(self) -> int:
        return self.number.size


def blocks_at(hits: ScreenHits) -> BlocksAt:
    """The blocks of the hits of one screen."""
    number, first = np.unique(hits.number, return_index=True)
    if not number.size:
        none = np.zeros(0)
        return BlocksAt(number, hits.place[first], none, none, none, none, none)
    columns = (norm(hits.velocity), hits.energy_j, hits.kinetic_j, hits.up_m, hits.radius_m)
    greatest = [np.fmax.reduceat(one, first) for one in columns]
    return BlocksAt(number, hits.place[first], *greatest)


def check_screens(screens: Sequence[Screen], ground: Ground) -> None:
    """Refuse what cannot be on this terrain.

    Raises
    ------
    InputError : two screens of one name, one without any part above or below the terrain.
    """
    names = [screen.name for screen in screens]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"There are two screens {name!r}", advice="Give each a name of its own")
    for screen in screens:
        places = points_along(screen, screen.length_m / 200)
        tops = np.full(len(places), ground.terrain.bounds[1][2] + 1.0)
        if np.isnan(ground.heights_above(np.column_stack([places, tops]))).all():
            raise InputError(
                f"Screen {screen.name!r} is beside the terrain",
                advice="Draw it across the slope; are its coordinates in the terrain's system?",
            )


def points_along(screen: Screen, spacing_m: float) -> Array:
    """(q, 2) points of a screen's line: its corners, and others at most so far apart."""
    parts = [screen.line[:1]]
    for a, b in pairwise(screen.line):
        count = max(int(np.ceil(np.hypot(*(b - a)) / spacing_m)), 1)
        parts.append(a + (b - a) * (np.arange(1, count + 1) / count)[:, None])
    return np.vstack(parts)


def hits_at(simulation: Simulation, screens: Sequence[Screen]) -> ScreenHits:
    """All crossings of screens, on the exact paths of runs all of whose moments were recorded.

    Of a closed screen, the outline of an area, only the first time that a block comes in is a hit.
    """
    ways = _near(simulation, screens)
    pieces = parabolas_of(_only(simulation, ways))
    ends = _ends(pieces, simulation.records.position[ways + 1])
    found = [_crossings(pieces, ends, place, screen) for place, screen in enumerate(screens)]
    piece, elapsed, place, along, angle_normal = (np.concatenate(part) for part in zip(*found, strict=True))
    run = simulation.records.run[ways[pieces.run[piece]]]
    time = pieces.start_s[piece] + elapsed
    order = np.lexsort((place, time, run))
    again = np.zeros(order.size, np.bool_)
    for step in range(1, min(len(order), 3)):
        a, b = order[:-step], order[step:]
        again[step:] |= (run[a] == run[b]) & (place[a] == place[b]) & (time[b] - time[a] < SAME_S)
    order = order[~again]
    piece, elapsed, place, along, normal, run, time = (
        part[order] for part in (piece, elapsed, place, along, angle_normal, run, time)
    )
    position, velocity = pieces.states(piece, elapsed)
    counted = _first_entries(screens, place, run, dot(velocity[:, :2], normal))
    piece, place, along, normal, run, time, position, velocity = (
        part[counted] for part in (piece, place, along, normal, run, time, position, velocity)
    )
    releases = simulation.releases
    radius, mass = releases.radius_m[run], releases.mass_kg[run]
    speed, spin = norm(velocity), pieces.spin[piece]
    head_on = np.abs(velocity[:, 0] * normal[:, 0] + velocity[:, 1] * normal[:, 1])
    hits = ScreenHits(
        screen=place.astype(np.int16),
        number=simulation.number[run],
        time_s=time,
        position=position,
        velocity=velocity,
        along_m=along,
        up_m=simulation.ground.heights_above(position),
        radius_m=radius,
        angle=np.arccos(np.clip(np.divide(head_on, speed, out=np.ones_like(speed), where=speed > 0), 0.0, 1.0)),
        kinetic_j=0.5 * mass * speed**2,
        rotational_j=0.5 * releases.inertia[run] * mass * radius**2 * dot(spin, spin),
        outcome=np.zeros(run.size, np.int8),
        reaches=np.ones(run.size, np.bool_),
        place=releases.place[run],
    )
    return _with_outcomes(hits, screens)


def _first_entries(screens: Sequence[Screen], place: NDArray[np.int16], run: Indices, across: Array) -> Mask:
    """(h,) which crossings count: all of an open screen; of a closed one the first of each run that leads inward.

    Parameters
    ----------
    place, run, across : (h,) screen, run, and speed along the screen's normal, in the order of the runs and of time.
    """
    counted = np.ones(run.size, np.bool_)
    for number, screen in enumerate(screens):
        if screen.closed:
            inward = np.flatnonzero((place == number) & (across * _turn(screen.line) > 0))
            counted[place == number] = False
            counted[inward[np.unique(run[inward], return_index=True)[1]]] = True
    return counted


def _turn(line: Array) -> float:
    """Above zero where a closed line goes round its area to the left, so that its normals point into it."""
    a, b = line[:-1] - line[0], line[1:] - line[0]
    return float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum())


def _with_outcomes(hits: ScreenHits, screens: Sequence[Screen]) -> ScreenHits:
    """What barriers do, one after the other as each block comes to them.

    A barrier catches what passes with all of the block below its top, and holds it up to its capacity. What it does
    not hold goes on as it came: that a torn net takes energy from a block is not counted on.
    """
    height = np.array([screen.height_m for screen in screens])[hits.screen]
    capacity = np.array([np.nan if screen.capacity_j is None else screen.capacity_j for screen in screens])[hits.screen]
    barrier = ~np.isnan(capacity)
    outcome = np.where(hits.up_m + hits.radius_m > height, OVER, np.where(hits.energy_j > capacity, THROUGH, HELD))
    outcome = np.where(barrier, outcome, PASSES).astype(np.int8)
    held = np.cumsum(outcome == HELD)
    before = held - (outcome == HELD)
    first = np.searchsorted(hits.number, hits.number)  # of each hit's run: the hits are in the order of the runs
    return replace(hits, outcome=outcome, reaches=before == before[first])


def _near(simulation: Simulation, screens: Sequence[Screen]) -> Indices:
    """Records from which a way leads that may cross a screen: in plan it is nearly straight to the next."""
    from .screen_kernels import near_boxes

    ends = [np.stack([screen.line[:-1], screen.line[1:]], axis=1) for screen in screens]
    boxes = np.vstack([np.column_stack([part.min(axis=1), part.max(axis=1)]) for part in ends])
    found = np.empty(len(simulation.records), np.intp)
    return found[: near_boxes(simulation.records.run, simulation.records.position, boxes, found)]


def _only(simulation: Simulation, ways: Indices) -> Simulation:
    """Some ways between two records, each as if it were a run; only good for its motion."""
    rows, run = np.column_stack([ways, ways + 1]).ravel(), simulation.records.run[ways]
    columns = {name: getattr(simulation.records, name)[rows] for name in Records.__dataclass_fields__}
    own = {name: getattr(simulation, name)[run] for name in ("time_s", "length_m", "v_max_mps", "impacts")}
    return replace(
        simulation,
        **own,
        end=np.full(ways.size, ENDS.index(LIMIT)),  # none of them rests
        position=simulation.position[run],
        releases=simulation.releases.take(run),
        records=Records(**columns | {"run": np.repeat(np.arange(ways.size), 2)}),
        wanted=ways.size,
        number=np.arange(1, ways.size + 1),
    )


def _ends(pieces: Parabolas, last: Array) -> Array:
    """(k, 2) where pieces end: where the next begins, or the way does; never what rounding makes of it.

    So none is lost or counted twice that begins or ends on a screen.
    """
    ends = np.array(last[pieces.run, :2])
    joined = np.flatnonzero(pieces.run[1:] == pieces.run[:-1])
    ends[joined] = pieces.position[joined + 1, :2]
    return ends


def _crossings(
    pieces: Parabolas, end: Array, place: int, screen: Screen
) -> tuple[Indices, Array, NDArray[np.int16], Array, Array]:
    """Pieces that cross a screen: which, how long after their start, the screen, where along it, its normal (h, 2).

    A piece crosses a straight part once; `end` (k, 2) is where it ends.
    """
    start, duration = pieces.position[:, :2], pieces.duration_s
    found: list[tuple[Indices, Array, Array, Array]] = []
    before = 0.0
    for a, b in pairwise(screen.line):
        length = float(np.hypot(*(b - a)))
        if length == 0:
            continue
        towards = (b - a) / length
        normal = np.array([-towards[1], towards[0]])
        d0, d1 = (start - a) @ normal, (end - a) @ normal
        piece = np.flatnonzero((d0 >= 0) != (d1 >= 0))
        elapsed = _first_zero(
            d0[piece], pieces.velocity[piece, :2] @ normal, pieces.acceleration[piece, :2] @ normal, duration[piece],
            d0[piece] / (d0[piece] - d1[piece]),
        )  # fmt: skip
        where, _ = pieces.states(piece, elapsed)
        along = (where[:, :2] - a) @ towards
        on = (along >= -SAME_M) & (along <= length + SAME_M)
        found.append((piece[on], elapsed[on], before + along[on], np.tile(normal, (int(on.sum()), 1))))
        before += length
    piece, elapsed, along, normals = (np.concatenate(part) for part in zip(*found, strict=True))
    return piece, elapsed, np.full(piece.size, place, np.int16), along, normals


def _first_zero(d: Array, v: Array, a: Array, duration: Array, share: Array) -> Array:
    """When d + v t + ½ a t² is zero between 0 and the duration; `share` is where its chord is."""
    t = share * duration
    bent = np.flatnonzero(np.abs(a) * duration > 1e-12 * np.abs(v))
    if bent.size:
        root = np.sqrt(np.maximum(v[bent] ** 2 - 2 * a[bent] * d[bent], 0.0))
        q = -(v[bent] + np.where(v[bent] < 0, -root, root))
        with np.errstate(divide="ignore", invalid="ignore"):
            both = np.column_stack([q / a[bent], 2 * d[bent] / q])
        away = np.abs(both - t[bent, None])
        away[~np.isfinite(both) | (both < -SAME_S) | (both > duration[bent, None] + SAME_S)] = inf
        best = np.argmin(away, axis=1)
        known = np.isfinite(away[np.arange(bent.size), best])
        t[bent[known]] = both[np.arange(bent.size), best][known]
    return np.clip(t, 0.0, duration)

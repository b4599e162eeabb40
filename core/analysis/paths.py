# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole runs as pieces of motion: those that were observed and those that were simulated, in one form.

What is read off both is then read off in one way: exactly, from the flights themselves, without time steps.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from ..reconstruction.block import per_pick
from ..reconstruction.free_flight import fly
from ..vectors import Array, Indices, Mask, Names, norm

if TYPE_CHECKING:
    from ..reconstruction.trajectory import Reconstruction
    from ..simulation.engine import Simulation

BISECTIONS = 60
HIGHEST_FLIGHTS, MOMENTS = 3, 9
"""The highest point of a run is looked for on so many of its longest flights, at so many moments of each."""


@dataclass(frozen=True, eq=False)
class Paths:
    """n runs in k pieces, in the order of the runs and of time.

    Attributes
    ----------
    name : (n,) of the release; runs of one name start alike.
    mass_kg : (n,).
    stop : (n, 3) where the block came to rest, local [m]; NaN where that is not known, as where the footage ends.
    beyond : (n,) the block went on from `stop`, over the edge of the terrain: the stop is farther away than that.
    whole : (n,) the pieces reach to the stop.
    run : (k,) place of the run.
    flies : (k,) the piece is a flight; else on the ground: taken as straight, with an even change of speed.
    time_s, duration_s : (k,) start since the run's own start, and how long [s].
    start, end : (k, 3) of the block's underside, local [m].
    start_velocity, end_velocity : (k, 3) [m/s].
    drag_per_m : (k,) ½ρC_D·A/m [1/m].
    impact_piece : (m,) the piece that ends in an impact, of each impact, in order.
    gravity_mps2 : [m/s²].
    """

    name: Names
    mass_kg: Array
    stop: Array
    beyond: Mask
    whole: Mask
    run: Indices
    flies: Mask
    time_s: Array
    duration_s: Array
    start: Array
    end: Array
    start_velocity: Array
    end_velocity: Array
    drag_per_m: Array
    impact_piece: Indices
    gravity_mps2: float

    def __len__(self) -> int:
        return self.name.size

    @property
    def first_piece(self) -> Indices:
        """(n + 1,) the first piece of each run, and the number of pieces."""
        return np.searchsorted(self.run, np.arange(len(self) + 1))

    @property
    def struck_piece(self) -> Indices:
        """(n,) the piece that ends in the first impact of each run; behind all pieces for a run without one."""
        struck = np.full(len(self), self.run.size)
        struck[self.run[self.impact_piece][::-1]] = self.impact_piece[::-1]
        return struck

    @property
    def plan_m(self) -> Array:
        """(k,) length of each piece in plan [m]."""
        return np.hypot(*(self.end - self.start)[:, :2].T)

    @property
    def travelled_m(self) -> Array:
        """(k,) length in plan from the start of the run to the start of each piece [m]."""
        before = np.r_[0.0, np.cumsum(self.plan_m)]
        return before[:-1] - before[self.first_piece[self.run]]

    @property
    def length_m(self) -> Array:
        """(n,) length in plan [m]."""
        return np.asarray(np.bincount(self.run, self.plan_m, minlength=len(self)), dtype=np.float64)

    def take(self, runs: Indices) -> "Paths":
        """Some of the runs, in this order."""
        first = self.first_piece
        size = np.diff(first)[runs]
        begins = np.cumsum(size) - size
        pieces = np.arange(size.sum()) - np.repeat(begins - first[runs], size)
        struck = np.zeros(self.run.size, dtype=np.bool_)
        struck[self.impact_piece] = True
        return Paths(
            self.name[runs], self.mass_kg[runs], self.stop[runs], self.beyond[runs], self.whole[runs],
            np.repeat(np.arange(len(runs)), size), self.flies[pieces], self.time_s[pieces], self.duration_s[pieces],
            self.start[pieces], self.end[pieces], self.start_velocity[pieces], self.end_velocity[pieces],
            self.drag_per_m[pieces], np.flatnonzero(struck[pieces]), self.gravity_mps2,
        )  # fmt: skip

    @classmethod
    def joined(cls, parts: Sequence["Paths"]) -> "Paths":
        """The runs of all parts, in their order, with the gravity of the first."""
        plain = [one.name for one in fields(cls) if one.name not in ("run", "impact_piece", "gravity_mps2")]
        columns = {name: np.concatenate([getattr(one, name) for one in parts]) for name in plain}
        runs = np.cumsum([0, *(len(one) for one in parts[:-1])])
        pieces = np.cumsum([0, *(one.run.size for one in parts[:-1])])
        return cls(
            **columns,
            run=np.concatenate([one.run + first for one, first in zip(parts, runs, strict=True)]),
            impact_piece=np.concatenate([one.impact_piece + first for one, first in zip(parts, pieces, strict=True)]),
            gravity_mps2=parts[0].gravity_mps2,
        )

    def states(self, piece: Indices, elapsed_s: Array) -> tuple[Array, Array]:
        """Places and velocities (q, 3) on pieces (q,) so long (q,) after their start."""
        place, velocity = fly(
            self.start[piece], self.start_velocity[piece], elapsed_s, self.gravity_mps2, self.drag_per_m[piece]
        )
        grounded = np.flatnonzero(~self.flies[piece])
        if grounded.size:
            on, t = piece[grounded], elapsed_s[grounded]
            v0, v1, whole = norm(self.start_velocity[on]), norm(self.end_velocity[on]), self.duration_s[on]
            way = self.end[on] - self.start[on]
            gone = v0 * t + _quotient(v1 - v0, whole) * t**2 / 2
            share = _quotient(gone, (v0 + v1) * whole / 2)
            length = norm(way)
            speed = v0 + _quotient((v1 - v0) * t, whole)
            place[grounded] = self.start[on] + share[:, None] * way
            velocity[grounded] = _quotient(speed, length)[:, None] * way
        return place, velocity

    def when_across(self, piece: Indices, share: Array) -> Array:
        """(q,) seconds after the start of pieces (q,) at which such shares (q,) of their length in plan are passed."""
        whole = self.duration_s[piece]
        t = share * whole
        straight = ~self.flies[piece]
        t[straight] = self._on_ground(piece[straight], share[straight])
        slowed = np.flatnonzero(self.flies[piece] & (self.drag_per_m[piece] > 0))
        if slowed.size:
            on = piece[slowed]
            wanted = share[slowed] * self.plan_m[on]

            def too_short(seconds: Array) -> Mask:
                here, _ = self.states(on, seconds)
                return np.asarray(np.hypot(*(here - self.start[on])[:, :2].T) < wanted)

            t[slowed] = _bisected(too_short, np.zeros(on.size), whole[slowed])
        return t

    def when_below(self, piece: Indices, z: Array) -> Array:
        """(q,) seconds after the start of pieces (q,) at which they fall below levels (q,), which they end below.

        0 for a piece that is below it from its start on.
        """
        z0, z1 = self.start[piece, 2], self.end[piece, 2]
        t = self._on_ground(piece, np.clip(_quotient(z0 - z, z0 - z1), 0.0, 1.0))
        v, g = self.start_velocity[piece, 2], self.gravity_mps2
        flies, dragged = self.flies[piece], self.drag_per_m[piece] > 0
        root = np.sqrt(np.maximum(v**2 + 2 * g * (z0 - z), 0.0))
        later = np.where(v > 0, (v + root) / g, _quotient(2 * (z0 - z), root - v))
        under = (v**2 + 2 * g * (z0 - z) < 0) | ((v <= 0) & (z0 < z))
        t = np.where(flies & ~dragged, np.where(under, 0.0, later), t)
        slowed = np.flatnonzero(flies & dragged)
        if slowed.size:
            on, whole = piece[slowed], self.duration_s[piece[slowed]]

            def rises(seconds: Array) -> Mask:
                return np.asarray(self.states(on, seconds)[1][:, 2] > 0)

            def above(seconds: Array) -> Mask:
                return np.asarray(self.states(on, seconds)[0][:, 2] >= z[slowed])

            top = np.where(v[slowed] > 0, _bisected(rises, np.zeros(on.size), whole), 0.0)
            t[slowed] = np.where(above(top), _bisected(above, top, whole), 0.0)
        return np.minimum(t, self.duration_s[piece])

    def _on_ground(self, piece: Indices, share: Array) -> Array:
        """When a share of a straight piece is passed: v² is linear in the way."""
        v0, v1 = norm(self.start_velocity[piece]), norm(self.end_velocity[piece])
        here = np.sqrt(np.maximum(v0**2 + (v1**2 - v0**2) * share, 0.0))
        return np.asarray(self.duration_s[piece] * share * _quotient(v0 + v1, v0 + here))


def observed_paths(reconstruction: "Reconstruction") -> Paths:
    """The trajectories that were reconstructed, each from its first flight on to where its chain is cut.

    What follows a gap (a discarded or shattered pick) is left out, except a stop, and trajectories without a flight
    are. Where the flights join contact points, these are the block's underside; where they join centres, the underside
    is one radius below.
    """
    picks, flights = reconstruction.picks, reconstruction.flights
    radius = per_pick(picks, reconstruction.block, lambda one: one.radius_m)
    mass = per_pick(picks, reconstruction.block, lambda one: one.mass_kg)
    begins = first_flights(reconstruction)
    kept = flights.trajectory[begins].tolist()
    chosen = [
        np.flatnonzero((flights.chain == flights.chain[first]) & (np.arange(len(flights)) >= first)) for first in begins
    ]
    rows = np.concatenate(chosen) if chosen else np.zeros(0, dtype=np.intp)
    run = np.repeat(np.arange(len(kept)), [part.size for part in chosen])
    lower = np.zeros((rows.size, 3))
    if reconstruction.ends == "centres":
        lower[:, 2] = radius[flights.first_pick[rows]]
    starts = np.array([flights.start_time_s[part[0]] for part in chosen])
    stop, whole = np.full((len(kept), 3), np.nan), np.zeros(len(kept), dtype=np.bool_)
    for i, name in enumerate(kept):
        own_picks = np.flatnonzero((picks.trajectory == name) & (picks.status != "discarded"))
        last = own_picks[-1]
        if picks.kind[last] == "stop" and not (picks.status[own_picks] == "shattered").any():
            stop[i] = picks.position[last]
            whole[i] = flights.last_pick[chosen[i][-1]] == last
    hits = picks.kind[flights.last_pick[rows]] == "impact"
    return Paths(
        name=np.array(kept, dtype=np.str_),
        mass_kg=np.array([mass[flights.first_pick[part[0]]] for part in chosen]),
        stop=stop,
        beyond=np.zeros(len(kept), dtype=np.bool_),
        whole=whole,
        run=run,
        flies=~flights.is_contact[rows],
        time_s=flights.start_time_s[rows] - starts[run],
        duration_s=flights.duration_s[rows],
        start=flights.start_position[rows] - lower,
        end=flights.end_position[rows] - lower,
        start_velocity=flights.start_velocity[rows],
        end_velocity=flights.end_velocity[rows],
        drag_per_m=flights.drag_per_m[rows],
        impact_piece=np.flatnonzero(hits),
        gravity_mps2=reconstruction.gravity_mps2,
    )


def first_flights(reconstruction: "Reconstruction") -> Indices:
    """The flight with which each trajectory begins: from its release, or from its first impact that it leaves."""
    picks, flights = reconstruction.picks, reconstruction.flights
    sunk = np.flatnonzero(picks.kind == "impact")[reconstruction.impacts.flags["into_ground"]]
    leaves = ~np.isin(flights.first_pick, picks.leaves_at[sunk])
    starts = np.isin(picks.kind[flights.first_pick], ("release", "impact", "takeoff"))
    free = np.flatnonzero(~flights.is_contact & leaves & starts)
    names = flights.trajectory[free]
    return free[np.r_[True, names[1:] != names[:-1]][: free.size]]


def simulated_paths(simulation: "Simulation") -> Paths:
    """The runs of a simulation all of whose moments were recorded.

    The underside is one radius below the centre. A run that leaves the terrain has its stop beyond the edge; one that
    is cut off at a limit has none.
    """
    from ..simulation.engine import ENDS, IMPACT, LEFT_TERRAIN
    from ..simulation.results import flights_of, release_names

    records, releases = simulation.records, simulation.releases
    here = np.flatnonzero(records.run[1:] == records.run[:-1])
    following = here + 1
    run = records.run[here]
    in_flight = np.zeros(len(records), dtype=np.bool_)
    in_flight[flights_of(simulation)[0]] = True
    lower = np.zeros((len(simulation), 3))
    lower[:, 2] = releases.radius_m
    stopped, left = simulation.at_rest, simulation.end == ENDS.index(LEFT_TERRAIN)
    return Paths(
        name=np.asarray(release_names(simulation)),
        mass_kg=releases.mass_kg,
        stop=np.where((stopped | left)[:, None], simulation.position - lower, np.nan),
        beyond=np.asarray(left),
        whole=np.asarray(stopped | left),
        run=run,
        flies=in_flight[here],
        time_s=records.time_s[here],
        duration_s=records.time_s[following] - records.time_s[here],
        start=records.position[here] - lower[run],
        end=records.position[following] - lower[run],
        start_velocity=records.v2[here],
        end_velocity=records.v1[following],
        drag_per_m=releases.drag_per_m(simulation.settings.drag)[run],
        impact_piece=np.flatnonzero(records.what[following] == IMPACT),
        gravity_mps2=simulation.settings.gravity_mps2,
    )


def _quotient(a: Array, b: Array) -> Array:
    """a/b, 0 where b is 0."""
    return np.divide(a, b, out=np.zeros(np.broadcast_shapes(np.shape(a), np.shape(b))), where=np.asarray(b) != 0)


def _bisected(before, low: Array, high: Array) -> Array:  # type: ignore[no-untyped-def]
    """(q,) the times between `low` and `high` up to which `before`(times) → (q,) is true."""
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        early = before(middle)
        low, high = np.where(early, middle, low), np.where(early, high, middle)
    return (low + high) / 2

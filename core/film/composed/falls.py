# SPDX-License-Identifier: GPL-3.0-or-later
"""What a composed film shows of blocks: where each is at every moment, how it is turned, and where it hits."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...analysis.predicted_flights import PredictedFlights
from ...camera.model import rotation_from_vector
from ...reconstruction.block import Block
from ...reconstruction.sampling import TrajectorySamples, sample_trajectories
from ...reconstruction.trajectory import Reconstruction
from ...simulation.engine import IMPACT, Simulation
from ...simulation.results import sample_runs
from ...vectors import Array, Indices, norm
from ...workflow.footage import UNREFINED
from .look import MEASURED, Colour

STEP_S = 1 / 120
SIMULATED_STEP_S = 1 / 30
STILL_S = 1e-3
NEARLY_S, NEARLY_M = 1e-7, 1e-6
"""Between the points of a path: half a pixel where a block of 20 m/s crosses 50 px a metre as straight pieces."""
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Hits:
    """The k impacts of a fall.

    Attributes
    ----------
    number : (k,) as tables count them.
    time_s : (k,) [s].
    position : (k, 3) of the block's centre, or its contact point where the flights join these [m].
    speed1_mps, speed2_mps : (k,) before and after [m/s]; NaN where undefined.
    energy1_j, energy2_j : (k,) translational [J].
    rn : (k,) [-].
    speed1_sigma_mps, speed2_sigma_mps, energy1_sigma_j, energy2_sigma_j : (k,) standard deviations, NaN where unknown.
    rn_ends : (k, 2) 95 % interval, NaN where unknown.
    """

    number: Indices
    time_s: Array
    position: Array
    speed1_mps: Array
    speed2_mps: Array
    energy1_j: Array
    energy2_j: Array
    rn: Array
    speed1_sigma_mps: Array
    speed2_sigma_mps: Array
    energy1_sigma_j: Array
    energy2_sigma_j: Array
    rn_ends: Array


@dataclass(frozen=True, eq=False)
class Fall:
    """One block.

    Attributes
    ----------
    name : of the trajectory, or of the simulated run.
    group : whose blocks have its colour: "" for the measured ones, else the title of a model.
    colour : sRGB.
    time_s : (n,) ascending [s]; an impact has two rows.
    position, velocity : (n, 3) [m], [m/s].
    chain : (n,) number of the stretch that is known without a gap.
    diameters_m : (3,) of the block [m].
    mass_kg : [kg].
    hits : its impacts; None where they are not shown.
    spin : (n, 3) angular velocity from each row to the next [rad/s], NaN where it is not known; None for nowhere.
    """

    name: str
    group: str
    colour: Colour
    time_s: Array
    position: Array
    velocity: Array
    chain: Indices
    diameters_m: Array
    mass_kg: float
    hits: Hits | None = None
    spin: Array | None = None

    @property
    def is_measured(self) -> bool:
        """Whether it is what the video shows."""
        return not self.group

    @property
    def radius_m(self) -> float:
        """Half the mean diameter [m]."""
        return float(self.diameters_m.mean()) / 2

    def state(self, moment_s: float) -> tuple[Array, Array] | None:
        """Position and velocity (3,) at a moment; None before, after and in gaps.

        Notes
        -----
        Between rows by the cubic through both places and velocities, which is the parabola of a free flight.
        """
        after = int(np.searchsorted(self.time_s, moment_s, side="right"))
        if after == 0 or moment_s > self.time_s[-1]:
            return None
        i = after - 1
        if after == self.time_s.size or self.time_s[i] == moment_s:
            return self.position[i], self.velocity[i]
        if self.chain[i] != self.chain[after]:
            return None
        length = self.time_s[after] - self.time_s[i]
        s, (p0, p1), (v0, v1) = (moment_s - self.time_s[i]) / length, self.position[i : i + 2], self.velocity[i : i + 2]
        m0, m1, step = length * v0, length * v1, p1 - p0
        place = p0 + s * (m0 + s * (3 * step - 2 * m0 - m1 + s * (m0 + m1 - 2 * step)))
        return place, v0 + s * (v1 - v0)

    def path(self, until_s: float) -> tuple[Array, Array]:
        """Times (m,) and places (m, 3) up to a moment, which is the last; a NaN row between stretches."""
        known = int(np.searchsorted(self.time_s, until_s, side="right"))
        time, place, chain = self.time_s[:known], self.position[:known], self.chain[:known]
        now = self.state(until_s)
        if now is not None and known and time[-1] < until_s:
            time, place, chain = np.r_[time, until_s], np.vstack([place, now[0]]), np.r_[chain, chain[-1]]
        breaks = np.flatnonzero(np.diff(chain)) + 1
        return np.insert(time, breaks, np.nan), np.insert(place, breaks, np.nan, axis=0)

    def turn(self, moment_s: float) -> Array:
        """(3, 3) from the block's axes to the world: by its spin where that is known, else rolling."""
        i = int(np.clip(np.searchsorted(self.time_s, moment_s, side="right") - 1, 0, self.time_s.size - 1))
        more = (np.clip(moment_s, self.time_s[0], self.time_s[-1]) - self.time_s[i]) * self._turning[i]
        return rotation_from_vector(more) @ self._turns[i]

    @property
    def has_known_spin(self) -> bool:
        """Whether it is known how it turns, at least for a part of its way."""
        return self.spin is not None and bool(np.isfinite(self.spin).all(axis=1).any())

    @cached_property
    def _turning(self) -> Array:
        """(n, 3) [rad/s]; rolling is about the level axis across the velocity."""
        rolling = np.cross(UP, self.velocity) / self.radius_m
        if self.spin is None:
            return rolling
        known = np.asarray(np.isfinite(self.spin).all(axis=1))
        return np.where(known[:, None], self.spin, rolling)

    @cached_property
    def _turns(self) -> Array:
        """(n, 3, 3) at each row."""
        steps = rotation_from_vector(np.diff(self.time_s)[:, None] * self._turning[:-1])
        turns = np.empty((self.time_s.size, 3, 3))
        turns[0] = np.eye(3)
        for i, step in enumerate(steps):
            turns[i + 1] = step @ turns[i]
        return turns

    def moved(self, by_s: float) -> "Fall":
        """The same one, so much later [s]."""
        hits = None if self.hits is None else replace(self.hits, time_s=self.hits.time_s + by_s)
        return replace(self, time_s=self.time_s + by_s, hits=hits)


def measured_falls(result: Reconstruction, trajectories: Sequence[str] | None = None) -> tuple[Fall, ...]:
    """The measured blocks of a reconstruction, or some of them, with their impacts and their measured spin."""
    samples = sample_trajectories(result, STEP_S)
    falls = falls_of(samples, _blocks(result), "", MEASURED)
    wanted = None if trajectories is None else set(trajectories)
    return tuple(
        _with_spin(_with_hits(fall, result), result) for fall in falls if wanted is None or fall.name in wanted
    )


def simulated_falls(
    simulation: Simulation, starts_s: Mapping[str, float], group: str, colour: Colour
) -> tuple[Fall, ...]:
    """The blocks of a simulation, on the clock of the measured ones.

    Parameters
    ----------
    starts_s : release → when it begins [s]; 0 for those that are not named.
    """
    samples, records, releases = sample_runs(simulation, SIMULATED_STEP_S), simulation.records, simulation.releases
    run = np.searchsorted(simulation.number, samples.run)
    ends = np.cumsum(np.bincount(run, minlength=len(releases)))
    falls = []
    for i, (begin, end) in enumerate(zip(np.r_[0, ends[:-1]], ends, strict=True)):
        if end <= begin:
            continue
        own = np.flatnonzero(records.run == i)
        time = samples.time_s[begin:end]
        # A row's spin is that of the last record up to it; of two at one time, the later.
        at = own[np.clip(np.searchsorted(records.time_s[own], time, side="right") - 1, 0, own.size - 1)]
        name = str(samples.trajectory[begin])
        fall = Fall(
            f"{name} {samples.run[begin]}", group, colour, time + starts_s.get(name, 0.0),
            samples.position[begin:end], samples.velocity[begin:end], np.zeros(end - begin, np.intp),
            releases.axes_m[i], float(releases.mass_kg[i]), None, records.omega2[at],
        )  # fmt: skip
        falls.append(_with_incident(fall, simulation))
    return tuple(falls)


def _with_incident(fall: Fall, simulation: Simulation) -> Fall:
    """A simulated fall with the velocity before each impact, too, without which its last part would be bent."""
    records = simulation.records
    run = int(np.searchsorted(simulation.number, int(fall.name.rpartition(" ")[2])))
    first, end = np.searchsorted(records.run, [run, run + 1])
    rows = first + np.flatnonzero(records.what[first:end] == IMPACT)
    since = fall.time_s - fall.time_s[0] + records.time_s[first]
    at = np.searchsorted(since, records.time_s[rows] - NEARLY_S)
    place = fall.position[np.minimum(at, since.size - 1)]
    known = (at > 0) & (at < since.size) & (np.abs(place - records.position[rows]).max(axis=1, initial=0.0) < NEARLY_M)
    at, v1 = at[known], records.v1[rows[known]]
    return replace(
        fall,
        time_s=np.insert(fall.time_s, at, fall.time_s[at]),
        position=np.insert(fall.position, at, fall.position[at], axis=0),
        velocity=np.insert(fall.velocity, at, v1, axis=0),
        chain=np.insert(fall.chain, at, fall.chain[at]),
        spin=None if fall.spin is None else np.insert(fall.spin, at, fall.spin[at], axis=0),
    )


def predicted_falls(
    flights: PredictedFlights,
    rows: Indices,
    blocks: Mapping[str, Block],
    titles: Mapping[str, str],
    colours: Mapping[str, Colour],
) -> tuple[Fall, ...]:
    """Blocks that leave measured impacts as models say, to where they land.

    Parameters
    ----------
    rows : of the flights that are wanted.
    titles, colours : of each model.
    """
    falls = []
    for row in rows.tolist():
        model, duration, block = (
            str(flights.model[row]),
            float(flights.duration_s[row]),
            blocks[str(flights.trajectory[row])],
        )
        since = np.linspace(0.0, duration, max(int(np.ceil(duration / STEP_S)), 1) + 1) if duration > 0 else np.zeros(2)
        start = float(flights.time_s[row])
        place, velocity = flights.states(np.full(since.size, row), start + since)
        time = start + since if duration > 0 else start + np.array([0.0, STILL_S])
        falls.append(
            Fall(
                f"{model} {flights.impact[row]}", titles[model], colours[model], time, place, velocity,
                np.zeros(since.size, np.intp), np.array([block.d1, block.d2, block.d3]), block.mass_kg,
            )
        )  # fmt: skip
    return tuple(falls)


def falls_of(samples: TrajectorySamples, blocks: dict[str, Block], group: str, colour: Colour) -> tuple[Fall, ...]:
    """The blocks of a table of motion: a run is a stretch without gaps of a measured one, or a simulated one."""
    if not samples.time_s.size:
        return ()
    keys = (
        samples.trajectory
        if not group
        else np.char.add(np.char.add(samples.trajectory.astype(str), " "), samples.run.astype(str))
    )
    _, first, which = np.unique(keys, return_index=True, return_inverse=True)
    order = np.argsort(which, kind="stable")
    ends = np.cumsum(np.bincount(which))
    made = []
    for begin, end, row in zip(np.r_[0, ends[:-1]], ends, first, strict=True):
        rows = order[begin:end]
        block = blocks[str(samples.trajectory[row])]
        made.append(
            Fall(
                str(keys[row]), group, colour, samples.time_s[rows], samples.position[rows], samples.velocity[rows],
                samples.run[rows], np.array([block.d1, block.d2, block.d3]), block.mass_kg,
            )
        )  # fmt: skip
    return tuple(made)


def _blocks(result: Reconstruction) -> dict[str, Block]:
    names = dict.fromkeys(result.picks.trajectory.tolist())
    one = result.block
    return {name: one if isinstance(one, Block) else one[name] for name in names}


def _with_spin(fall: Fall, result: Reconstruction) -> Fall:
    own = result.flights.trajectory == fall.name
    spin = result.picks.angular_velocity[result.flights.last_pick[own]]
    if not np.isfinite(spin).any():
        return fall
    middle = np.r_[(fall.time_s[:-1] + fall.time_s[1:]) / 2, fall.time_s[-1]]
    flight = np.clip(np.searchsorted(result.flights.start_time_s[own], middle, side="right") - 1, 0, len(spin) - 1)
    return replace(fall, spin=spin[flight])


def _with_hits(fall: Fall, result: Reconstruction) -> Fall:
    impacts = result.impacts
    rows = np.flatnonzero(impacts.trajectory == fall.name)
    places = [fall.state(float(time)) for time in impacts.time_s[rows]]
    position = np.array([impacts.position[row] if at is None else at[0] for row, at in zip(rows, places, strict=True)])
    before, after = norm(impacts.v1[rows]), norm(impacts.v2[rows])
    unknown, ends = np.full(len(impacts), np.nan), np.full((len(impacts), 2), np.nan)
    refined = all(remark.text != UNREFINED for remark in result.remarks)  # else the errors are those of times alone
    sigma, intervals = (impacts.sigma, impacts.intervals) if refined else ({}, {})
    energy1, energy2 = (sigma.get(name, unknown)[rows] for name in ("kinetic1_j", "kinetic2_j"))
    mass = np.broadcast_to(impacts.mass_kg, unknown.shape)[rows]
    with np.errstate(invalid="ignore", divide="ignore"):  # of ½mv²
        speed1, speed2 = energy1 / (mass * before), energy2 / (mass * after)
    return replace(
        fall,
        hits=Hits(
            impacts.impact[rows], impacts.time_s[rows], position.reshape(-1, 3), before, after,
            impacts.kinetic1_j[rows], impacts.kinetic2_j[rows], impacts.rn[rows],
            speed1, speed2, energy1, energy2,
            intervals.get("rn", ends)[rows],
        ),
    )  # fmt: skip

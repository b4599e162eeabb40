# SPDX-License-Identifier: GPL-3.0-or-later
"""What is read off a simulation: its runs, its impacts, and its motion in time."""

from dataclasses import dataclass

import numpy as np

from ..progress import Progress, silent
from ..reconstruction.free_flight import fly
from ..reconstruction.impact import Impacts, apparent, make_impacts
from ..reconstruction.sampling import STEP_S, TrajectorySamples
from ..vectors import Array, Indices, Mask, Names, dot
from .engine import ENDS, FLIES_OFF, IMPACT, LEFT_TERRAIN, ON_GROUND, RELEASED, Simulation

HIGHEST_FLIGHTS = 3
"""The highest point of a run is looked for on so many of its longest flights, the bounces that can be the highest."""
MOMENTS = 9
"""At so many moments of each."""


@dataclass(frozen=True, eq=False)
class RunFigures:
    """Greatest values and angles of n runs.

    Attributes
    ----------
    kinetic_max_j : (n,) ½mv² at the greatest speed [J].
    height_max_m : (n,) of the centre above the terrain, vertically [m]; NaN for a run without a flight, and
        for all where the moments between were not recorded.
    energy_line : (n,) angle below the horizontal of the line from the release to the end [rad]; NaN where both have one
        place in plan.
    """

    kinetic_max_j: Array
    height_max_m: Array
    energy_line: Array


def run_figures(simulation: Simulation) -> RunFigures:
    """The greatest values of each run."""
    start, end = simulation.releases.position, simulation.position
    flat = np.hypot(*(end - start)[:, :2].T)
    line = np.arctan2(start[:, 2] - end[:, 2], flat)
    return RunFigures(
        0.5 * simulation.releases.mass_kg * simulation.v_max_mps**2,
        _greatest_heights(simulation),
        np.where(flat > 0, line, np.nan),
    )


def fell_through(simulation: Simulation) -> Mask:
    """(n,) runs that left the terrain and ended under it: they fell through a hole, or between points."""
    through = np.zeros(len(simulation), np.bool_)
    left = np.flatnonzero(simulation.end == ENDS.index(LEFT_TERRAIN))
    if left.size:
        through[left] = simulation.ground.heights_above(simulation.position[left]) < 0  # NaN beside the terrain
    return through


def flights_of(simulation: Simulation) -> tuple[Indices, Array]:
    """Rows of the records at which a flight begins, and how long it lasts [s]."""
    records = simulation.records
    begins = np.isin(records.what[:-1], (RELEASED, IMPACT, FLIES_OFF)) & (records.what[1:] != ON_GROUND)
    begins &= records.run[:-1] == records.run[1:]
    rows = np.flatnonzero(begins)
    duration = records.time_s[rows + 1] - records.time_s[rows]
    flies = duration > 0
    return rows[flies], duration[flies]


def impacts_of(simulation: Simulation, site: str = "") -> Impacts:
    """The impacts of all runs, as those that were measured.

    ``run``, ``structure`` and ``source`` (the model) are further columns. The position is that of the contact, the
    normal that from the contact to the centre.
    """
    records, releases, ground = simulation.records, simulation.releases, simulation.ground
    rows = np.flatnonzero(records.what == IMPACT)
    run = records.run[rows]
    v1, v2, normal = records.v1[rows], records.v2[rows], records.normal[rows]
    mass, radius = releases.mass_kg[run], releases.radius_m[run]
    inertia = releases.inertia[run] * mass * radius**2
    first = np.searchsorted(run, run)
    structure = np.array(["", *ground.structures])[ground.owner[records.face[rows]]]
    spin1, spin2 = records.omega1[rows], records.omega2[rows]
    return make_impacts(
        apparent(v1, v2, normal),
        v1,
        v2,
        normal,
        site=site,
        trajectory=release_names(simulation)[run],
        impact=np.arange(rows.size) - first + 1,
        time_s=records.time_s[rows],
        position=records.position[rows] - radius[:, None] * normal,
        diameter_m=2 * radius,
        mass_kg=mass,
        angular_velocity=spin1,
        rotational1_j=0.5 * inertia * dot(spin1, spin1),
        rotational2_j=0.5 * inertia * dot(spin2, spin2),
        extra={
            "run": simulation.number.astype(np.str_)[run],
            "structure": structure,
            "source": np.full(rows.size, simulation.settings.model),
        },
        shift=ground.shift,
    )


def release_names(simulation: Simulation) -> Names:
    """(n,) the release of each run; its number where it has no name."""
    names = simulation.releases.name
    return np.where(names == "", simulation.number.astype(np.str_), names)


def sample_runs(simulation: Simulation, step_s: float = STEP_S, progress: Progress = silent) -> TrajectorySamples:
    """The motion of all runs at the ends of every flight and step, and every `step_s` in flight."""
    records = simulation.records
    rows, duration = flights_of(simulation)
    inner = np.maximum(np.ceil(duration / step_s - 1e-6).astype(np.intp) - 1, 0)
    which = np.repeat(np.arange(rows.size), inner)
    within = np.arange(which.size) - np.repeat(np.cumsum(inner) - inner, inner) + 1
    elapsed = within * step_s
    start = rows[which]
    place, velocity = _on_flight(simulation, start, elapsed)
    time = np.concatenate([records.time_s, records.time_s[start] + elapsed])
    run = np.concatenate([records.run, records.run[start]])
    order = np.lexsort((np.concatenate([np.arange(len(records)), start]), time, run))
    position = np.concatenate([records.position, place])[order]
    speed = np.concatenate([records.v2, velocity])[order]
    run, time = run[order], time[order]
    mass = simulation.releases.mass_kg[run]
    progress("Heights above the terrain", 0, 0)
    return TrajectorySamples(
        source=np.full(time.size, simulation.settings.model),
        trajectory=release_names(simulation)[run],
        run=simulation.number[run],
        time_s=time,
        position=position,
        velocity=speed,
        height_m=simulation.ground.heights_in_flight(position),
        kinetic_j=0.5 * mass * dot(speed, speed),
        shift=simulation.ground.terrain.shift,
    )


def _on_flight(simulation: Simulation, start: Indices, elapsed: Array) -> tuple[Array, Array]:
    """Places and velocities (q, 3) on flights that begin at the records `start`, so long after."""
    records, settings = simulation.records, simulation.settings
    drag = simulation.releases.drag_per_m(settings.drag)[records.run[start]]
    return fly(records.position[start], records.v2[start], elapsed, settings.gravity_mps2, drag)


def _greatest_heights(simulation: Simulation) -> Array:
    if simulation.recorded == "ends":
        return np.full(len(simulation), np.nan)
    rows, duration = flights_of(simulation)
    run = simulation.records.run[rows]
    order = np.lexsort((-duration, run))
    rank = np.arange(order.size) - np.searchsorted(run[order], run[order])
    longest = order[rank < HIGHEST_FLIGHTS]
    heights = np.full(len(simulation), -np.inf)
    if longest.size:
        parts = np.tile(np.linspace(0.0, 1.0, MOMENTS), longest.size)
        start, whole = np.repeat(rows[longest], MOMENTS), np.repeat(duration[longest], MOMENTS)
        place, _ = _on_flight(simulation, start, parts * whole)
        above = simulation.ground.heights_in_flight(place)
        np.maximum.at(heights, simulation.records.run[start], np.where(np.isnan(above), -np.inf, above))
    return np.where(np.isfinite(heights), heights, np.nan)

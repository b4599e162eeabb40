# SPDX-License-Identifier: GPL-3.0-or-later
"""What is read off a simulation: its runs, its impacts, and its motion in time."""

from dataclasses import dataclass

import numpy as np

from ..compiled import as_rows, in_chunks
from ..progress import Progress, silent
from ..reconstruction.free_flight import fly
from ..reconstruction.impact import Impacts, apparent, make_impacts
from ..reconstruction.sampling import STEP_S, TrajectorySamples
from ..terrain.cloud import Cloud
from ..vectors import Array, Indices, Mask, Names, dot
from .engine import ENDS, FLIES_OFF, IMPACT, LEFT_TERRAIN, ON_GROUND, RELEASED, TREE, Simulation
from .holes import within_rims

FIRST_FLIGHTS, MOMENTS = 3, 9
"""So many of the longest flights of a run, at so many moments each, tell about how high it comes."""
RISING, HIGH = 0.1, 0.8
"""Flights that rise less above their chord, and are less high at these moments, as parts of the run's greatest height,
do not have it."""
SPACING_M, MOST_MOMENTS = 0.15, 500
"""How near to each other in plan the others are looked at."""


@dataclass(frozen=True, eq=False)
class RunFigures:
    """Greatest values and angles of n runs.

    Attributes
    ----------
    kinetic_max_j : (n,) ½mv² at the greatest speed [J].
    height_max_m : (n,) of the centre above the terrain, vertically [m], over all flights: exact above triangles,
        sampled above points and with drag; NaN for a run without a flight, and for all where the moments between were
        not recorded.
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
    """(n,) runs that left the terrain and ended under it, or within the rim of a hole: they fell through.

    A cloud's holes have no rims: there a block counts only when it ends under points.
    """
    through = np.zeros(len(simulation), np.bool_)
    left = np.flatnonzero(simulation.end == ENDS.index(LEFT_TERRAIN))
    if left.size:
        places = simulation.position[left]
        height = simulation.ground.heights_above(places)  # NaN beside the terrain
        through[left] = (height < 0) | (np.isnan(height) & within_rims(simulation.ground.rims, places[:, :2]))
    return through


def flights_of(simulation: Simulation) -> tuple[Indices, Array]:
    """Rows of the records at which a flight begins, and how long it lasts [s]."""
    records = simulation.records
    begins = np.isin(records.what[:-1], (RELEASED, IMPACT, FLIES_OFF, TREE)) & (records.what[1:] != ON_GROUND)
    begins &= records.run[:-1] == records.run[1:]
    rows = np.flatnonzero(begins)
    duration = records.time_s[rows + 1] - records.time_s[rows]
    flies = duration > 0
    return rows[flies], duration[flies]


def impacts_of(simulation: Simulation, site: str = "") -> Impacts:
    """The impacts of all runs, as those that were measured.

    ``run``, ``structure``, ``source`` (the model) and ``seed`` are further columns. The position is that of the
    contact, the normal that from the contact to the centre.
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
            "seed": np.full(rows.size, str(simulation.settings.seed)),
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
    """(n,) see `RunFigures`."""
    n, ground, records = len(simulation), simulation.ground, simulation.records
    if simulation.recorded == "ends":
        return np.full(n, np.nan)
    rows, duration = flights_of(simulation)
    if isinstance(ground.terrain, Cloud) or simulation.settings.drag is not None:
        highest = _sampled_greatest(simulation, rows, duration)
    else:
        from .height_kernels import greatest_heights

        highest, begin = np.empty(n), np.searchsorted(records.run[rows], np.arange(n + 1))
        position, velocity = as_rows(records.position[rows]), as_rows(records.v2[rows])
        tree, gravity = ground.terrain_tree, simulation.settings.gravity_mps2
        in_chunks(lambda i, j: greatest_heights(tree, begin, position, velocity, gravity, duration, highest, i, j), n)
    return np.where(np.isfinite(highest), highest, np.nan)


def _sampled_greatest(simulation: Simulation, rows: Indices, duration: Array) -> Array:
    """(n,) greatest heights on any ground and through air, of flights from the records `rows`.

    Notes
    -----
    A first value from the longest flights leaves those that rise high enough above their chord, gT²/8, to have a higher
    point; the highest of these are looked at every `SPACING_M` in plan.
    """
    run = simulation.records.run[rows]
    order = np.lexsort((-duration, run))
    rank = np.arange(order.size) - np.searchsorted(run[order], run[order])
    looked, highest = order[rank < FIRST_FLIGHTS], np.full(len(simulation), -np.inf)

    def look(moments: Indices) -> Array:
        """The heights of the flights that are `looked` at."""
        heights = _sampled_heights(simulation, rows[looked], duration[looked], moments)
        np.maximum.at(highest, run[looked], heights)
        return heights

    look(np.full(looked.size, MOMENTS))
    rise = simulation.settings.gravity_mps2 * duration**2 / 8
    looked = np.flatnonzero(rise >= RISING * highest[run])
    looked = looked[look(np.full(looked.size, MOMENTS)) >= HIGH * highest[run[looked]]]
    length = np.hypot(*(simulation.records.position[rows + 1] - simulation.records.position[rows])[looked, :2].T)
    look(np.clip(np.ceil(length / SPACING_M).astype(np.intp) + 1, MOMENTS, MOST_MOMENTS))
    return highest


def _sampled_heights(simulation: Simulation, start: Indices, duration: Array, moments: Indices) -> Array:
    """(q,) greatest height above the terrain of flights from the records `start`, at so many moments (q,) of each.

    −inf for those that are nowhere above terrain.
    """
    if not start.size:
        return np.empty(0)
    first = np.cumsum(moments) - moments
    within = np.arange(int(moments.sum())) - np.repeat(first, moments)
    elapsed = np.repeat(duration / (moments - 1), moments) * within
    place, _ = _on_flight(simulation, np.repeat(start, moments), elapsed)
    above = simulation.ground.heights_in_flight(place)
    return np.maximum.reduceat(np.where(np.isnan(above), -np.inf, above), first)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The reconstructed motion, sampled in time: the rows of trajectories.csv."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ..errors import RockfallError
from ..georeference import GlobalShift
from ..vectors import Array, Indices, Names, dot
from .block import per_pick
from .flight import flight_states

if TYPE_CHECKING:
    from ..terrain.surface import Surface
    from .trajectory import Reconstruction


STEP_S = 0.05
"""Between the rows of a trajectory, where none is given."""
NEARLY = 1e-6
"""Part of a step: an end of a segment that is this near to a multiple of the step takes its place."""


@dataclass(frozen=True, eq=False)
class TrajectorySamples:
    """Motion sampled in time: the q rows of trajectories.csv.

    Attributes
    ----------
    source : (q,) "observed" or a model's name.
    trajectory : (q,) name.
    run : (q,) number of the chain within an observed trajectory, or of the simulation run, from 1.
    time_s : (q,) [s].
    position, velocity : (q, 3) local [m], [m/s].
    height_m : (q,) above the terrain, vertically [m]; NaN without terrain.
    kinetic_j : (q,) translational energy ½mv² [J].
    shift : of the local frame.
    """

    source: Names
    trajectory: Names
    run: Indices
    time_s: Array
    position: Array
    velocity: Array
    height_m: Array
    kinetic_j: Array
    shift: GlobalShift = field(default_factory=GlobalShift)

    def __len__(self) -> int:
        return self.time_s.size


def sample_trajectories(
    reconstruction: "Reconstruction", step_s: float, surface: "Surface | None" = None
) -> TrajectorySamples:
    """The observed motion at the multiples of `step_s` and at the ends of every segment.

    An impact therefore has two rows of one time, with the incident and the restituted velocity; a stop has two, the
    second one at rest.

    Raises
    ------
    RockfallError : the step is not positive.
    """
    if not (np.isfinite(step_s) and step_s > 0):
        raise RockfallError(f"The time step must be a positive number [s], not {step_s}.")
    picks, flights = reconstruction.picks, reconstruction.flights
    k = len(flights)
    first = np.floor(flights.start_time_s / step_s + NEARLY).astype(np.int64) + 1
    last = np.ceil(flights.end_time_s / step_s - NEARLY).astype(np.int64) - 1
    inner = np.maximum(last - first + 1, 0)
    stops = picks.kind[flights.last_pick] == "stop"
    size = inner + 2 + stops
    which = np.repeat(np.arange(k), size)
    within = np.arange(which.size) - np.repeat(np.cumsum(size) - size, size)
    time = (first[which] + within - 1) * step_s
    time[within == 0] = flights.start_time_s
    time[within == (inner + 1)[which]] = flights.end_time_s
    at_rest = within == (inner + 2)[which]
    time[at_rest] = flights.end_time_s[stops]
    position, velocity = flight_states(flights, which, time)
    velocity[at_rest] = 0.0

    height = np.full(which.size, np.nan)
    if surface is not None and which.size:
        from ..terrain.raycast import heights_above

        height = heights_above(surface, position)
    mass = per_pick(picks, reconstruction.block, lambda block: block.mass_kg)[flights.first_pick]
    starts = np.flatnonzero(np.r_[True, flights.trajectory[1:] != flights.trajectory[:-1]][:k])
    run = flights.chain - np.repeat(flights.chain[starts], np.diff(np.r_[starts, k])) + 1
    return TrajectorySamples(
        source=np.full(which.size, "observed"),
        trajectory=flights.trajectory[which],
        run=run[which],
        time_s=time,
        position=position,
        velocity=velocity,
        height_m=height,
        kinetic_j=0.5 * mass[which] * dot(velocity, velocity),
        shift=picks.shift,
    )

# SPDX-License-Identifier: GPL-3.0-or-later
"""The paths of runs as lines: few points, and yet the parabolas."""

from dataclasses import dataclass

import numpy as np

from ..errors import RockfallError
from ..reconstruction.free_flight import fly
from ..vectors import Array, Indices
from .engine import Simulation
from .results import flights_of

DEVIATION_M = 0.05
"""Lines are nowhere further from the parabola than this."""


@dataclass(frozen=True, eq=False)
class RunLines:
    """A line for each of n runs.

    Attributes
    ----------
    points : (k, 3) of the blocks' centres, run after run, local [m].
    first : (n + 1,) the first point of each run, and k.
    """

    points: Array
    first: Indices


def lines_of(simulation: Simulation, deviation_m: float = DEVIATION_M) -> RunLines:
    """The paths of a simulation that recorded all.

    Raises
    ------
    RockfallError : it did not record all, or the deviation is not positive.

    Notes
    -----
    A chord of a parabola over the time T is gT²/8 from it at the most; drag only bends it less.
    """
    if simulation.recorded != "all":
        raise RockfallError('Lines of runs need record="all".')
    if not deviation_m > 0:
        raise RockfallError(f"The deviation of lines from parabolas must be positive [m], not {deviation_m}.")
    records, settings = simulation.records, simulation.settings
    rows, duration = flights_of(simulation)
    chord_s = (8 * deviation_m / settings.gravity_mps2) ** 0.5
    inner = np.maximum(np.ceil(duration / chord_s).astype(np.intp) - 1, 0)
    which = np.repeat(np.arange(rows.size), inner)
    within = np.arange(which.size) - np.repeat(np.cumsum(inner) - inner, inner) + 1
    elapsed = within * (duration / (inner + 1))[which]
    start = rows[which]
    drag = simulation.releases.drag_per_m(settings.drag)[records.run[start]]
    between, _ = fly(records.position[start], records.v2[start], elapsed, settings.gravity_mps2, drag)

    after = np.zeros(len(records), np.intp)
    after[rows] = inner
    place = np.arange(len(records)) + np.cumsum(after) - after
    points = np.empty((len(records) + between.shape[0], 3))
    points[place] = records.position
    points[place[start] + within] = between
    run = np.repeat(records.run, after + 1)
    return _without_repeats(points, run, len(simulation))


def _without_repeats(points: Array, run: Indices, runs: int) -> RunLines:
    """A point that is where the one before was is left out; the first and the last of a run stay."""
    same = np.zeros(len(points), np.bool_)
    same[1:] = (points[1:] == points[:-1]).all(axis=1) & (run[1:] == run[:-1])
    last = np.append(run[1:] != run[:-1], True)
    kept = ~same | last
    return RunLines(points[kept], np.searchsorted(run[kept], np.arange(runs + 1)))

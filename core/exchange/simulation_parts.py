# SPDX-License-Identifier: GPL-3.0-or-later
"""Simulations in parts of some runs, whose rows of a table are computed at once."""

from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise

import numpy as np

from ..simulation.engine import Simulation
from ..vectors import Array, Indices
from .decimal_tables import DecimalColumns, Words

PART_ROWS = 9000
"""Rows that are computed at once: they stay in the processor's cache."""


def in_parts(
    simulations: Sequence[Simulation],
    rows: Callable[[Simulation], Indices],
    columns: Callable[[Simulation], DecimalColumns],
) -> list[Callable[[], DecimalColumns]]:
    """What makes the columns of some runs each; the first of none, which gives the header of an empty table.

    Parameters
    ----------
    rows : (n,) how many each run has, about.
    columns : of a part of a simulation.
    """
    parts: list[Callable[[], DecimalColumns]] = [lambda: columns(simulations[0].part(0, 0))]
    for one in simulations:
        end = np.cumsum(rows(one))
        edges = np.searchsorted(end, np.arange(PART_ROWS, int(end[-1]), PART_ROWS))
        edges = np.unique([0, *edges.tolist(), len(one)])
        parts += [partial(_columns, columns, one, a, b) for a, b in pairwise(edges.tolist())]
    return parts


def all_digits(which: Indices, values: Array) -> Words:
    """A column of numbers that are written with all their digits: those of few, as a block's mass at its impacts."""
    return Words(which, tuple(map(repr, values.tolist())))


def _columns(
    make: Callable[[Simulation], DecimalColumns], simulation: Simulation, start: int, end: int
) -> DecimalColumns:
    return make(simulation.part(start, end))

# SPDX-License-Identifier: GPL-3.0-or-later
"""Impacts that are in a database twice: under their own name, or exactly the same under another."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..reconstruction.impact import Impacts
from ..vectors import Indices, Mask, numbered

SAME_TIME_S, SAME_PLACE_M = 1e-3, 0.01
"""Impacts of one trajectory that are nearer in time and place are one."""
EXACT = 1e-6
"""[m/s, or of a unit normal] to which velocities and normals are compared."""
MIXER = np.uint64(0x9E3779B97F4A7C15)


@dataclass(frozen=True, eq=False)
class Duplicates:
    """k impacts that are there before.

    Attributes
    ----------
    row : (k,) of the impact.
    first : (k,) row of the same impact that is there first.
    renamed : (k,) whether that one has another site or trajectory.
    """

    row: Indices
    first: Indices
    renamed: Mask

    def __len__(self) -> int:
        return self.row.size


def find_duplicates(impacts: Impacts) -> Duplicates:
    """All rows that repeat an earlier one.

    Two impacts are the same when site, trajectory, time and place agree (`SAME_TIME_S`, `SAME_PLACE_M`); or, under any
    names, when both velocities and the normal do, to `EXACT`. Those of different runs of a simulation never are.
    """
    _, code = numbered(*impacts.falls)
    first = np.arange(len(impacts), dtype=np.intp)
    for found in (_same_values(impacts), _same_place(impacts, code)):
        first = np.minimum(first, found)
    row = np.flatnonzero(first < np.arange(len(impacts)))
    return Duplicates(row, first[row], code[row] != code[first[row]])


def _same_place(impacts: Impacts, code: Indices) -> Indices:
    order = np.lexsort((impacts.time_s, code))
    near = np.diff(code[order]) == 0
    near &= np.diff(impacts.time_s[order]) <= SAME_TIME_S  # an undefined time is near no other
    near &= np.sqrt((np.diff(impacts.position[order], axis=0) ** 2).sum(axis=1)) <= SAME_PLACE_M
    return _first_of_runs(order, near)


def _same_values(impacts: Impacts) -> Indices:
    values = np.concatenate([impacts.v1, impacts.v2, impacts.normal], axis=1)
    known = np.flatnonzero(np.isfinite(values).all(axis=1))
    whole = np.round(values[known] / EXACT).astype(np.int64)
    if impacts.runs:
        _, run = numbered(*impacts.runs.values())
        whole = np.column_stack([whole, run[known]])
    order = np.argsort(_hashed(whole), kind="stable")
    near = (np.diff(whole[order], axis=0) == 0).all(axis=1)
    first = np.arange(len(impacts), dtype=np.intp)
    first[known] = known[_first_of_runs(order, near)]
    return first


def _hashed(whole: NDArray[np.int64]) -> NDArray[np.uint64]:
    """(n,) one number for each row, which is the same for equal rows."""
    mixed = np.zeros(len(whole), dtype=np.uint64)
    for column in whole.T:
        mixed = (mixed ^ column.astype(np.uint64)) * MIXER
        mixed ^= mixed >> np.uint64(29)
    return mixed


def _first_of_runs(order: Indices, near: Mask) -> Indices:
    """(n,) the least row of each row's run; `near` says which of `order` belong to the run of the one before."""
    if not order.size:
        return order
    starts = np.flatnonzero(np.r_[True, ~near])
    least = np.minimum.reduceat(order, starts)
    first = np.empty_like(order)
    first[order] = np.repeat(least, np.diff(np.r_[starts, order.size]))
    return first

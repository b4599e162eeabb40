# SPDX-License-Identifier: GPL-3.0-or-later
"""Hits of trees: which stem, how far beside its axis, and what it did to the block."""

from dataclasses import dataclass

import numpy as np

from ..errors import RockfallError
from ..vectors import Array, Indices, Mask, dot
from .engine import TREE, Simulation

INWARDS_MPS = 1e-9
"""A block that moves faster than this towards the axis after the hit has broken the stem."""


@dataclass(frozen=True, eq=False)
class TreeHits:
    """h hits, in the order of the runs and of time.

    Attributes
    ----------
    record : (h,) row of the simulation's records.
    tree : (h,) place among the trees.
    up_m : (h,) of the centre, above the stem's foot.
    offset : (h,) beside the axis, as a part of both radii: 0 is head-on, 1 a graze.
    kinetic1_j, kinetic2_j : (h,) of translation, before and after [J].
    deviation : (h,) in plan, 0…π [rad]; NaN where the block comes to rest.
    stands : (h,) whether the stem does not give way.
    """

    record: Indices
    tree: Indices
    up_m: Array
    offset: Array
    kinetic1_j: Array
    kinetic2_j: Array
    deviation: Array
    stands: Mask

    def __len__(self) -> int:
        return self.record.size


def tree_hits_of(simulation: Simulation) -> TreeHits:
    """All hits of trees of runs whose impacts were recorded.

    Raises
    ------
    RockfallError : there are no trees.
    """
    trees, records = simulation.settings.trees, simulation.records
    if trees is None:
        raise RockfallError("The simulation has no trees.")
    rows = np.flatnonzero(records.what == TREE)
    tree = records.face[rows].astype(np.intp)
    v1, v2, normal = records.v1[rows], records.v2[rows], records.normal[rows]
    radius, mass = simulation.releases.radius_m[records.run[rows]], simulation.releases.mass_kg[records.run[rows]]
    away = records.position[rows, :2] - trees.position[tree]
    flat1, flat2 = np.hypot(*v1[:, :2].T), np.hypot(*v2[:, :2].T)
    across = np.abs(v1[:, 0] * away[:, 1] - v1[:, 1] * away[:, 0])
    both = flat1 * (radius + 0.5 * trees.dbh_m[tree])
    cosine = np.full(rows.size, np.nan)
    goes_on = (flat1 > 0) & (flat2 > 0)
    along = (v1[:, :2] * v2[:, :2]).sum(axis=1)
    cosine[goes_on] = np.clip(along[goes_on] / (flat1 * flat2)[goes_on], -1.0, 1.0)
    return TreeHits(
        rows,
        tree,
        records.position[rows, 2] - trees.foot_m[tree],
        np.divide(across, both, out=np.zeros_like(across), where=both > 0),
        0.5 * mass * dot(v1, v1),
        0.5 * mass * dot(v2, v2),
        np.arccos(cosine),
        np.asarray(dot(v2, normal) > -INWARDS_MPS),
    )

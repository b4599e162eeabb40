# SPDX-License-Identifier: GPL-3.0-or-later
"""Hits of structures: where along and up them, how fast, and whether the block goes on beyond."""

from dataclasses import dataclass

import numpy as np

from ..vectors import Array, Indices, Mask, dot, norm
from .engine import ENDED, IMPACT, Simulation
from .structures import heights_up, structure_frame


@dataclass(frozen=True, eq=False)
class Hits:
    """h impacts on structures, in the order of the runs and of time.

    Attributes
    ----------
    record : (h,) row of the simulation's records.
    structure : (h,) place in the ground's structures.
    along_m : (h,) of the contact, from the structure's western end along its main direction; see `StructureFrame`.
    up_m : (h,) of the contact, above the structure's foot; see `heights_up`.
    angle : (h,) between the velocity and the normal of the contact [rad]: 0 is head-on.
    kinetic_j, rotational_j : (h,) before the hit [J].
    passes : (h,) whether the block is beyond the structure at a later impact or at its end: on the other side of the
        vertical main plane than it was released, by more than its radius.
    """

    record: Indices
    structure: Indices
    along_m: Array
    up_m: Array
    angle: Array
    kinetic_j: Array
    rotational_j: Array
    passes: Mask

    def __len__(self) -> int:
        return self.record.size


def hits_of(simulation: Simulation) -> Hits:
    """All impacts on structures."""
    records, releases, ground = simulation.records, simulation.releases, simulation.ground
    impacts = np.flatnonzero(records.what == IMPACT)
    owner = ground.owner[records.face[impacts]]
    rows, structure = impacts[owner > 0], owner[owner > 0].astype(np.intp) - 1
    run = records.run[rows]
    v1, normal = records.v1[rows], records.normal[rows]
    speed, mass, radius = norm(v1), releases.mass_kg[run], releases.radius_m[run]
    contact = records.position[rows] - radius[:, None] * normal
    along, up, passes = np.empty(rows.size), np.empty(rows.size), np.zeros(rows.size, np.bool_)
    seen = np.flatnonzero((records.what == IMPACT) | (records.what == ENDED))
    for one in np.unique(structure).tolist():
        frame, own = structure_frame(ground, one), structure == one
        along[own] = frame.along_m(contact[own])
        up[own] = heights_up(ground, frame, contact[own])
        side = np.where(frame.across_m(releases.position) < 0, -1.0, 1.0)
        there = records.run[seen]
        beyond = -side[there] * frame.across_m(records.position[seen]) > releases.radius_m[there]
        last = np.full(len(simulation), -1)
        last[there[beyond]] = seen[beyond]  # in order of time: the last one stays
        passes[own] = last[run[own]] > rows[own]
    spin = records.omega1[rows]
    return Hits(
        rows,
        structure,
        along,
        up,
        np.arccos(np.clip(-dot(v1, normal) / speed, -1.0, 1.0)),
        0.5 * mass * speed**2,
        0.5 * releases.inertia[run] * mass * radius**2 * dot(spin, spin),
        passes,
    )

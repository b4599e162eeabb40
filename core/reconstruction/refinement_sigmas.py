# SPDX-License-Identifier: GPL-3.0-or-later
"""Standard deviations of refined impacts, from the covariance of the refinement's unknowns."""

import numpy as np

from ..vectors import Array, dot, norm
from .impact import Impacts, apparent, cross
from .node_motion import NodeMotion
from .picks import Indices
from .refinement_problem import NODE, Problem

NUDGE = 1e-6
SCALARS = ("vn1", "vt1", "vn2", "vt2", "rn", "rt", "r", "theta1", "theta_dev")


def velocity_rows(problem: Problem, motion: NodeMotion, segment: Indices, *, at_end: bool) -> Array:
    """(q, 3, size) derivatives of the velocities at the ends of segments by the free unknowns; zero for segment −1."""
    has = np.flatnonzero(segment >= 0)
    which = segment[has]
    if at_end:
        by_place, by_law = motion.end_by_displacement[which], motion.end_between_by_law[which]
        by_duration = motion.end_acceleration[which] - (by_place @ motion.end_velocity[which][:, :, None])[:, :, 0]
    else:
        by_place, by_law = motion.inverse[which], motion.start_by_law[which]
        by_duration = -(by_place @ motion.end_velocity[which][:, :, None])[:, :, 0]
    result = np.zeros((segment.size, 3, problem.columns.size + 1))
    first, last = NODE * problem.first[which], NODE * problem.last[which]
    for axis in range(3):
        result[has, :, first + axis] = -by_place[:, :, axis]
        result[has, :, last + axis] = by_place[:, :, axis]
    result[has, :, first + 3] = -by_duration
    result[has, :, last + 3] = by_duration
    result[has, :, problem.columns.law[0]] = by_law[:, :, 0] * problem.reference_drag[which, None]
    result[has, :, problem.columns.law[1]] = by_law[:, :, 1]
    return result[:, :, :-1]


def impact_sigmas(impacts: Impacts, covariance: Array, spread: Array) -> dict[str, Array]:
    """Standard deviations of n impacts' velocities, coefficients, angles and energies.

    Parameters
    ----------
    covariance : (n, 6, 6) of v1 and v2.
    spread : (n,) root mean square angle by which the block-scale normal is off [rad]; NaN counts as none.

    Returns
    -------
    the columns of `uncertainty.propagate`, and kinetic1_j, kinetic2_j; NaN where the column is undefined.

    Notes
    -----
    To first order, by differences. The normal is tilted by spread/√2 about each of two axes at right angles to it,
    independent of everything else.
    """
    n = len(impacts)
    full = np.zeros((n, 8, 8))
    full[:, :6, :6] = covariance
    full[:, 6, 6] = full[:, 7, 7] = np.nan_to_num(spread) ** 2 / 2
    step = np.maximum(1.0, np.maximum(np.nan_to_num(norm(impacts.v1)), np.nan_to_num(norm(impacts.v2)))) * NUDGE

    def values(row: int, sign: float) -> Array:
        v1, v2, normal = impacts.v1.copy(), impacts.v2.copy(), impacts.normal
        if row < 3:
            v1[:, row] += sign * step
        elif row < 6:
            v2[:, row - 3] += sign * step
        else:
            tilt = _across(normal)[row - 6]
            normal = normal + sign * step[:, None] * tilt
            normal = normal / norm(normal)[:, None]
        found = apparent(v1, v2, normal)
        energies = [0.5 * impacts.mass_kg * dot(v, v) for v in (v1, v2)]
        return np.stack([getattr(found, name) for name in SCALARS] + energies, axis=1)

    with np.errstate(invalid="ignore", divide="ignore"):
        slope = np.stack([(values(i, 1.0) - values(i, -1.0)) / (2 * step[:, None]) for i in range(8)], axis=2)
        # What a column does not depend on must not make it undefined.
        slope = np.where(np.isfinite(slope), slope, 0.0)
        deviation = np.sqrt(np.maximum(np.einsum("nci,nij,ncj->nc", slope, full, slope), 0.0))
        result = {name: deviation[:, i] for i, name in enumerate((*SCALARS, "kinetic1_j", "kinetic2_j"))}
        diagonal = np.sqrt(np.maximum(np.einsum("nii->ni", covariance), 0.0))
    result["v1"], result["v2"] = diagonal[:, :3], diagonal[:, 3:]
    return {name: np.where(np.isfinite(getattr(impacts, name)), sd, np.nan) for name, sd in result.items()}


def _across(normal: Array) -> tuple[Array, Array]:
    """Two unit vectors (n, 3) at right angles to each normal and to each other."""
    helper = np.where(np.abs(normal[:, :1]) < 0.8, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    first = cross(normal, np.broadcast_to(helper, normal.shape))
    first = first / norm(first)[:, None]
    return first, cross(normal, first)

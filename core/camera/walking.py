# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses of a camera that moves, frame by frame, from points of the terrain that were followed."""

from dataclasses import dataclass

import numpy as np

from ..least_squares import BELIEVED, believed_scatter, damped_step, inverse, sums_by
from ..vectors import Array, Indices, Mask, norm
from .model import Camera, project_with_derivatives, rotation_from_vector

LEAST_POINTS = 4
ROUNDS = 9
LOOSE = 12.0
"""Width of the weights at the start, in standard deviations."""


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses of f frames; rows of frames that were not asked for keep what they had.

    Attributes
    ----------
    position : (f, 3) local [m]; rotation : (f, 3, 3).
    covariance : (f, 6, 6) of the rotation about the camera's axes [rad] and the position [m].
    """

    position: Array
    rotation: Array
    covariance: Array


def solve_poses(
    camera: Camera,
    points: Array,
    pixels: Array,
    frame: Indices,
    sigma_px: float,
    position: Array,
    rotation: Array,
    asked: Mask,
) -> Poses:
    """Levenberg–Marquardt on all frames at once, each for itself, with weights that fall to nothing.

    Parameters
    ----------
    points, pixels, frame : (m, 3) local [m], (m, 2) [px], (m,).
    position, rotation : (f, 3), (f, 3, 3) to start from.
    asked : (f,) the frames to solve.
    """
    frames = len(position)
    position, rotation = position.copy(), rotation.copy()
    covariance = np.full((frames, 6, 6), np.inf)
    order = np.flatnonzero(asked[frame])
    points, pixels, frame = points[order], pixels[order], frame[order]
    damping = np.full(frames, 1e-4)
    scatter = 1.0

    def measured(position: Array, rotation: Array) -> tuple[Array, Array]:
        seen = project_with_derivatives(camera, points, position=position[frame], rotation=rotation[frame])
        gap = np.where(np.isfinite(seen.pixel), pixels - seen.pixel, 1e3 * sigma_px) / sigma_px
        slopes = np.nan_to_num(np.concatenate([seen.d_rotation, seen.d_position], axis=2)) / sigma_px
        return gap, slopes

    gap, slopes = measured(position, rotation)
    for number in range(ROUNDS):
        length = norm(gap)
        scatter = believed_scatter(length)
        width = BELIEVED * scatter * max(1.0, LOOSE / BELIEVED * 0.6**number)
        weight = 1 / (1 + (length / width) ** 2) ** 2
        cost = np.bincount(frame, weights=_cost(length, width), minlength=frames)
        weighted = slopes * weight[:, None, None]
        normal = sums_by(frame, np.swapaxes(weighted, 1, 2) @ slopes, frames)
        right = sums_by(frame, (np.swapaxes(weighted, 1, 2) @ gap[:, :, None])[..., 0], frames)
        step = damped_step(normal, right, damping)
        new_position = position + step[:, 3:]
        new_rotation = rotation_from_vector(np.clip(step[:, :3], -0.3, 0.3)) @ rotation
        new_gap, new_slopes = measured(new_position, new_rotation)
        better = np.bincount(frame, weights=_cost(norm(new_gap), width), minlength=frames) <= cost
        better &= asked
        position[better], rotation[better] = new_position[better], new_rotation[better]
        rows = better[frame]
        gap[rows], slopes[rows] = new_gap[rows], new_slopes[rows]
        damping = np.clip(np.where(better, damping / 10, damping * 10), 1e-9, 1e3)
    enough = asked & (np.bincount(frame, minlength=frames) >= LEAST_POINTS)
    believed = norm(gap) < BELIEVED * scatter
    kept = slopes * believed[:, None, None]
    normal = sums_by(frame, np.swapaxes(kept, 1, 2) @ slopes, frames)
    covariance[enough] = inverse(normal[enough]) * scatter**2
    return Poses(position, rotation, covariance)


def _cost(length: Array, width: float) -> Array:
    """Geman and McClure's."""
    squared = (length / width) ** 2
    return squared / (1 + squared)

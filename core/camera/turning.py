# SPDX-License-Identifier: GPL-3.0-or-later
"""Rotations of a camera that stays in its place, from features that were followed through many frames.

Frame by frame outwards from the solved one first, with absolute weights that bear wrong tracks; then all rotations and
all features at once, by least squares with weights that fall to nothing (Geman and McClure).
"""

from dataclasses import dataclass

import numpy as np

from ..least_squares import BELIEVED, believed_scatter, damped_step, sums_by
from ..vectors import Array, Indices, Mask, across, cross, norm, perpendicular, unit
from .model import rotation_from_vector

LEAST_FEATURES = 3
WAHBA_ROUNDS, SETTLED = 15, 1e-9
"""Most rounds, and the change of all rotations that ends them, far below what features tell [rad]."""
ROUNDS = 6
RIDGE = 1e-9
"""What is added to the normal equations, for frames that too few features hold."""


@dataclass(frozen=True, eq=False)
class Turns:
    """Rotations of f frames.

    Attributes
    ----------
    rotation : (f, 3, 3) from the world to the camera; NaN where no feature leads.
    covariance : (f, 3, 3) about the world's axes [rad²], relative to the solved frame.
    direction : (i, 3) of the features in the world, unit; NaN where never tied.
    """

    rotation: Array
    covariance: Array
    direction: Array


def solve_turns(
    bearing: Array,
    frame: Indices,
    feature: Indices,
    sigma: Array,
    frames: int,
    reference: int,
    rotation: Array,
) -> Turns:
    """Rotations of all frames.

    Parameters
    ----------
    bearing : (m, 3) unit rays in the camera's frame.
    frame, feature : (m,) from 0, each feature once a frame.
    sigma : (m,) of the rays' directions [rad].
    rotation : (3, 3) of the reference frame.
    """
    features = int(feature.max(initial=-1)) + 1
    rotations, directions = _outwards(bearing, frame, feature, sigma, frames, features, reference, rotation)
    solved = np.isfinite(rotations[:, 0, 0])
    use = solved[frame] & np.isfinite(directions[feature, 0])
    covariance = np.full((frames, 3, 3), np.inf)
    rotations, directions, covariance[solved] = _together(
        bearing[use], frame[use], feature[use], sigma[use], rotations, directions, reference, solved
    )
    return Turns(rotations, covariance, directions)


def _outwards(
    bearing: Array,
    frame: Indices,
    feature: Indices,
    sigma: Array,
    frames: int,
    features: int,
    reference: int,
    rotation: Array,
) -> tuple[Array, Array]:
    """Rotations by waves: the frames that see most of the known features, then the features that these know."""
    rotations = np.full((frames, 3, 3), np.nan)
    directions = np.full((features, 3), np.nan)
    rotations[reference] = rotation
    total = np.bincount(frame, minlength=frames)
    while True:
        new = np.isnan(directions[feature, 0]) & np.isfinite(rotations[frame, 0, 0])
        if new.any():
            seen = np.einsum("mji,mj->mi", rotations[frame[new]], bearing[new])
            found = _median_directions(seen, feature[new], sigma[new], features)
            directions = np.where(np.isfinite(found), found, directions)
        known = np.isfinite(directions[feature, 0]) & np.isnan(rotations[frame, 0, 0])
        count = np.bincount(frame[known], minlength=frames)
        if count.max(initial=0) < LEAST_FEATURES:
            return rotations, directions
        wanted = (count >= 0.5 * total) & (count >= 12)
        if not wanted.any():
            wanted = count >= max(LEAST_FEATURES, 0.9 * count.max())
        rows = known & wanted[frame]
        rotations[wanted] = _wahba(
            bearing[rows], directions[feature[rows]], frame[rows], sigma[rows], frames, rotation
        )[wanted]


def _wahba(bearing: Array, direction: Array, frame: Indices, sigma: Array, frames: int, start: Array) -> Array:
    """The rotation of each frame that brings directions to bearings, (f, 3, 3), by least absolute angles."""
    weight = np.ones(len(bearing))
    rotation = np.broadcast_to(start, (frames, 3, 3))
    products = bearing[:, :, None] * direction[:, None, :]
    for _ in range(WAHBA_ROUNDS):
        left, _, right = np.linalg.svd(sums_by(frame, weight[:, None, None] * products, frames))
        left[:, :, 2] *= np.linalg.det(left @ right)[:, None]
        last, rotation = rotation, left @ right
        if np.abs(rotation - last).max() < SETTLED:
            break
        gap = norm(bearing - np.einsum("mij,mj->mi", rotation[frame], direction))
        weight = 1 / np.maximum(gap / sigma, 1) / sigma
    return rotation


def _median_directions(seen: Array, feature: Indices, sigma: Array, features: int) -> Array:
    """The direction of each feature with the least sum of angles to its rays, (i, 3); NaN for those without any."""
    weight = 1 / sigma
    middle = np.full((features, 3), np.nan)
    for _ in range(5):
        middle = unit(sums_by(feature, weight[:, None] * seen, features))
        weight = 1 / np.maximum(norm(seen - middle[feature]), sigma)
    return middle


def _together(
    bearing: Array,
    frame: Indices,
    feature: Indices,
    sigma: Array,
    rotations: Array,
    directions: Array,
    reference: int,
    solved: Mask,
) -> tuple[Array, Array, Array]:
    """All rotations and directions by Gauss–Newton; the directions are eliminated from the normal equations.

    With the rays drawn back into the world, a turn φ of a frame moves the ray of a feature by G φ, where G depends on
    the feature alone.
    """
    frames, features = len(rotations), len(directions)
    rotations, directions = rotations.copy(), directions.copy()
    free = solved.copy()
    free[reference] = False
    unknown = np.flatnonzero(np.repeat(free, 3))
    base, gap, length = np.empty((0, 2, 3)), np.empty((0, 2)), np.empty(0)
    scatter = 1.0
    for number in range(ROUNDS):
        base = np.stack(perpendicular(directions), axis=1)
        seen = np.einsum("mji,mj->mi", rotations[frame], bearing)
        gap = np.einsum("mki,mi->mk", base[feature], seen)
        length = norm(gap) / sigma
        scatter = believed_scatter(length)
        width = BELIEVED * scatter * max(1.0, 4.0 - number)
        weight = 1 / ((1 + (length / width) ** 2) * sigma) ** 2
        normal, right, offset, total = _reduced(weight, gap, frame, feature, directions, base, frames, features)
        turn = np.zeros((frames, 3))
        turn.reshape(-1)[unknown] = damped_step(normal[np.ix_(unknown, unknown)], right[unknown], RIDGE)
        rotations = rotations @ rotation_from_vector(-turn)
        moved = cross(turn[frame], directions[feature])
        gained = sums_by(feature, weight[:, None] * np.einsum("mki,mi->mk", base[feature], moved), features)
        shift = np.divide(offset + gained, total[:, None], out=np.zeros_like(offset), where=total[:, None] > 0)
        directions = unit(directions + np.einsum("ikj,ik->ij", base, shift))
    covariance = np.zeros((frames, 3, 3))
    if unknown.size:
        from scipy.linalg import cho_factor, cho_solve

        believed = np.where(length < BELIEVED * scatter, 1 / sigma**2, 0.0)
        normal = _reduced(believed, gap, frame, feature, directions, base, frames, features)[0]
        normal = normal[np.ix_(unknown, unknown)]
        ridge = RIDGE * max(float(np.median(np.diagonal(normal))), 1.0) * np.eye(unknown.size)
        inverse = cho_solve(cho_factor(normal + ridge, check_finite=False), np.eye(unknown.size), check_finite=False)
        block = np.arange(unknown.size).reshape(-1, 3)
        covariance[free] = inverse[block[:, :, None], block[:, None, :]] * scatter**2
    return rotations, directions, covariance[solved]


def _reduced(
    weight: Array,
    gap: Array,
    frame: Indices,
    feature: Indices,
    directions: Array,
    base: Array,
    frames: int,
    features: int,
) -> tuple[Array, Array, Array, Array]:
    """Normal equations (3 f, 3 f) and right side (3 f,) of the turns; weighted sums of gaps and weights by feature."""
    total = sums_by(feature, weight, features)
    offset = sums_by(feature, weight[:, None] * gap, features)
    tied = np.zeros((frames, features))
    tied[frame, feature] = weight
    share = np.divide(tied, total, out=np.zeros_like(tied), where=total > 0)
    square = np.nan_to_num(across(directions))
    normal = np.empty((frames, 3, frames, 3))
    for i in range(3):
        for j in range(i, 3):
            block = -(share * square[:, i, j]) @ tied.T
            block[np.diag_indices(frames)] += tied @ square[:, i, j]
            normal[:, i, :, j] = block
            normal[:, j, :, i] = block.T
    mean = np.divide(offset, total[:, None], out=np.zeros_like(offset), where=total[:, None] > 0)
    left = gap - mean[feature]
    # G = [e₂; −e₁] for the tangents e₁, e₂ of the feature.
    pulled = left[:, :1] * base[feature, 1] - left[:, 1:] * base[feature, 0]
    right = -sums_by(frame, weight[:, None] * pulled, frames).reshape(-1)
    return normal.reshape(3 * frames, 3 * frames), right, offset, total

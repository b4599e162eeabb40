# SPDX-License-Identifier: GPL-3.0-or-later
"""Names of array types, and row-wise vector algebra on arrays whose last axis is x, y, z."""

from collections.abc import Hashable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]
Names = NDArray[np.str_]


def dot(a: NDArray[np.floating], b: NDArray[np.floating]) -> Array:
    """Row-wise scalar product, (..., 3) · (..., 3) → (...)."""
    return np.einsum("...i,...i->...", a, b)


def cross(a: Array, b: Array) -> Array:
    """Row-wise vector product, (..., 3) × (..., 3) → (..., 3); several times quicker than `numpy.cross`."""
    result = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for x, y, z in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.multiply(a[..., y], b[..., z], out=result[..., x])
        result[..., x] -= a[..., z] * b[..., y]
    return result


def norm(a: NDArray[np.floating]) -> Array:
    """Row-wise Euclidean length, (..., 3) → (...)."""
    return np.sqrt(dot(a, a))


def unit(a: Array) -> Array:
    """Row-wise unit vectors; a row of length zero becomes NaN, since it has no direction."""
    length = norm(a)
    return np.divide(a, length[..., None], out=np.full(a.shape, np.nan), where=length[..., None] > 0)


def angle_between(a: Array, b: Array) -> Array:
    """Angle between rows [rad], 0…π; well conditioned everywhere, unlike the arc cosine."""
    return np.arctan2(norm(cross(a, b)), dot(a, b))


def perpendicular(direction: Array) -> tuple[Array, Array]:
    """Two unit vectors (..., 3) at right angles to each direction (..., 3) and to each other, right-handed with it."""
    helper = np.where(np.abs(direction[..., :1]) < 0.8 * norm(direction)[..., None], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    first = unit(cross(direction, helper))
    return first, cross(unit(direction), first)


def across(direction: Array) -> Array:
    """What remains of a vector at right angles to a unit direction: 1 − ddᵀ, (..., 3) → (..., 3, 3)."""
    return np.eye(3) - direction[..., :, None] * direction[..., None, :]


def distance_to_ray(points: Array, origins: Array, directions: Array) -> Array:
    """Distance of points from the straight lines through origins along unit directions, (..., 3) → (...)."""
    return norm(cross(points - origins, directions))


def numbered(*columns: Names | Indices) -> tuple[list[tuple[Hashable, ...]], Indices]:
    """The different rows of some columns (n,), in the order of their first appearance, and (n,) which each row is."""
    keys: dict[tuple[Hashable, ...], int] = {}
    rows = zip(*(column.tolist() for column in columns), strict=True)
    number = np.array([keys.setdefault(row, len(keys)) for row in rows], dtype=np.intp)
    return list(keys), number

# SPDX-License-Identifier: GPL-3.0-or-later
"""Row-wise vector algebra on arrays whose last axis is x, y, z."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def dot(a: NDArray[np.floating], b: NDArray[np.floating]) -> Array:
    """Row-wise scalar product, (..., 3) · (..., 3) → (...)."""
    return np.einsum("...i,...i->...", a, b)


def norm(a: NDArray[np.floating]) -> Array:
    """Row-wise Euclidean length, (..., 3) → (...)."""
    return np.sqrt(dot(a, a))


def unit(a: Array) -> Array:
    """Row-wise unit vectors; a row of length zero becomes NaN, since it has no direction."""
    length = norm(a)
    return np.divide(a, length[..., None], out=np.full(a.shape, np.nan), where=length[..., None] > 0)


def angle_between(a: Array, b: Array) -> Array:
    """Angle between rows [rad], 0…π; well conditioned everywhere, unlike the arc cosine."""
    return np.arctan2(norm(np.cross(a, b)), dot(a, b))

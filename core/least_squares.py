# SPDX-License-Identifier: GPL-3.0-or-later
"""Least squares from normal equations N x = b: a damped step, their inverse, and the scatter of residuals.

N is (..., p, p) and b (..., p), for one problem or many of the same size. The unknowns may have any units: all is done
with N scaled to a diagonal of ones.
"""

import numpy as np

from .vectors import Array, Indices

SINGULAR = 1e-14
"""Eigenvalues of the scaled normal equations below this part of the largest determine nothing."""
BELIEVED = 3.0
"""Residuals beyond so many times the scatter are of wrong observations."""


def scales(normal: Array) -> Array:
    """(..., p) one over the standard deviation of each unknown with the others held; 1 where nothing tells of it."""
    diagonal = np.diagonal(normal, axis1=-2, axis2=-1)
    return np.sqrt(np.where(diagonal > 0, diagonal, 1.0))


def damped_step(normal: Array, right: Array, damping: Array | float = 0.0) -> Array:
    """(..., p) the step of Levenberg and Marquardt, (N + λ diag N) x = b; that of Gauss and Newton with λ = 0.

    Parameters
    ----------
    damping : λ, one or (...).
    """
    size = scales(normal)
    scaled = normal / (size[..., :, None] * size[..., None, :])
    one = np.arange(size.shape[-1])
    scaled[..., one, one] = 1.0 + np.asarray(damping)[..., None]
    if normal.ndim > 2:
        return np.linalg.solve(scaled, (right / size)[..., None])[..., 0] / size
    from scipy.linalg import cho_factor, cho_solve

    try:
        step = cho_solve(cho_factor(scaled, check_finite=False), right / size, check_finite=False)
    except np.linalg.LinAlgError:
        step = np.linalg.lstsq(scaled, right / size, rcond=None)[0]
    return np.asarray(step / size, dtype=np.float64)


def inverse(normal: Array, *, partly: bool = False) -> Array:
    """(..., p, p) the inverse of N, which is the covariance of the unknowns.

    Where N is singular it is infinite throughout; or, `partly`, the inverse over what is determined, and 0 beside it.
    """
    size = scales(normal)
    outer = size[..., :, None] * size[..., None, :]
    values, vectors = np.linalg.eigh(normal / outer)
    known = values > SINGULAR * values[..., -1:]
    parts = np.divide(1.0, values, out=np.zeros_like(values), where=known)
    result = (vectors * parts[..., None, :]) @ np.swapaxes(vectors, -1, -2) / outer
    singular = np.asarray(~known.all(axis=-1))[..., None, None]
    return result if partly else np.where(singular, np.inf, result)


def sums_by(index: Indices, values: Array, size: int) -> Array:
    """Sums of rows with the same index, (m, ...) → (size, ...)."""
    flat = values.reshape(len(index), -1)
    sums = np.empty((size, flat.shape[1]))
    for i in range(flat.shape[1]):
        sums[:, i] = np.bincount(index, weights=flat[:, i], minlength=size)
    return sums.reshape(size, *values.shape[1:])


def believed_scatter(length: Array) -> float:
    """The scatter of residuals (m,) in standard deviations, at least 1, of those that are no wrong observations."""
    scatter = max(1.0, float(np.median(length)) / 1.18) if length.size else 1.0
    for _ in range(3):
        inner = length[length < BELIEVED * scatter]
        scatter = max(1.0, float(np.median(inner)) / 1.16) if inner.size else scatter
    return scatter

# SPDX-License-Identifier: GPL-3.0-or-later
"""What a camera and its pairs are off because the lens is not as it was assumed (consider parameters)."""

from dataclasses import dataclass

import numpy as np

from ...least_squares import inverse
from ...vectors import Array, Mask
from ..model import INTRINSICS, project_with_derivatives
from .adjustment import Solution
from .problem import Problem, assumed_of_lens


@dataclass(frozen=True, eq=False)
class AssumedLens:
    """Of the q parameters of the lens that were assumed: what they may be off, and what that does.

    Attributes
    ----------
    names : of the parameters.
    moment : (q, q) second moment of their errors: what the pairs say of them, with their prior, and how well.
    on_parameters : (p, q) by how much the p parameters move with them.
    on_residuals : (n, 2, q) by how much the residuals do [px].
    explained : by how much the squared residuals would be less with the lens that the pairs and the prior suggest.
    """

    names: tuple[str, ...]
    moment: Array
    on_parameters: Array
    on_residuals: Array
    explained: float

    @property
    def covariance(self) -> Array:
        """(p, p) of the parameters."""
        return self.on_parameters @ self.moment @ self.on_parameters.T

    @property
    def noise(self) -> Array:
        """(n, 2, 2) of the pairs [px²]."""
        return self.on_residuals @ self.moment @ np.swapaxes(self.on_residuals, 1, 2)


def assumed_lens(solution: Solution, problem: Problem, used: Mask, variance: float = 1.0) -> AssumedLens:
    """What the assumed lens does to a solution.

    The lens is held, so that what the pairs say against it is an error as much as what they leave open.

    Parameters
    ----------
    variance : of the clicks, in units of the stated one.
    """
    columns, prior = assumed_of_lens(solution.camera, problem)
    p, q = len(solution.normal), len(columns)
    spread = inverse(solution.normal)
    if not columns or not np.isfinite(spread).all():
        return AssumedLens(columns, np.zeros((q, q)), np.zeros((p, q)), np.zeros((len(used), 2, q)), 0.0)
    derivatives = project_with_derivatives(solution.camera, problem.points).d_intrinsics
    slope = np.nan_to_num(derivatives[:, :, [INTRINSICS.index(name) for name in columns]])
    known = np.nan_to_num(solution.slopes)
    trust = np.linalg.inv(solution.noise) * solution.weight[:, None, None]
    mixed = np.einsum("nip,nij,njq->pq", known, trust, slope)
    own = np.einsum("nip,nij,njq->pq", slope, trust, slope)
    right = np.einsum("niq,nij,nj->q", slope, trust, np.nan_to_num(solution.residual))
    effect = -spread @ mixed
    left = inverse((own + mixed.T @ effect) / variance + np.diag(prior**-2.0))
    found = left @ right / variance
    moment = left + np.outer(found, found)
    return AssumedLens(columns, moment, effect, slope + known @ effect, float(right @ found))

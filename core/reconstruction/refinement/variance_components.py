# SPDX-License-Identifier: GPL-3.0-or-later
"""How accurate the terrain is, as far as the pixels tell: its errors are estimated beside what was stated.

Where the pixels alone place the contacts well (two views and more), their distances from the terrain show how far it
is off. Two factors are sought, on what differs from contact to contact and on what the terrain's accuracy does
(variance components; Searle et al. 1992, Variance Components, ch. 6): of each the mean of its logarithm, with the
likelihood of the distances that the pixels alone would give and a wide prior about one, where they stay if nothing
tells of them.
"""

import numpy as np

from ...least_squares import inverse
from .held_poses import spread_of_poses
from .problem import Problem, ground_rows
from .solver import Solution

SPREAD = np.log(2.0)
"""Standard deviation of the prior of a factor's logarithm."""
GRID = np.exp(np.linspace(-np.log(16.0), np.log(16.0), 15))
LEAST_SHARE = 1e-9
"""Of what the pixels tell about a distance beside the terrain itself; less than that is none."""


def terrain_scales(problem: Problem, solution: Solution) -> tuple[float, float]:
    """Factors on the standard deviations of the contacts' own and of the terrain's errors, both against the stated."""
    ground = problem.ground
    if problem.surface is None or not problem.grounded.size:
        return 1.0, 1.0
    count, size = problem.grounded.size, problem.columns.size
    rows = ground_rows(problem, solution.state)
    slope = np.zeros((count, size))
    slope[:, rows.columns[0]] = rows.jacobian[0]
    covariance = inverse(solution.information, partly=True)
    told = np.eye(count) - slope @ covariance @ slope.T
    share, axes = np.linalg.eigh((told + told.T) / 2)
    share = np.clip(share, LEAST_SHARE, 1.0)
    root = np.sqrt(share)
    innovation = (axes.T @ rows.residual[0]) / root

    def turned(covariance: np.ndarray) -> np.ndarray:
        own = axes.T @ ground.whitening @ covariance @ ground.whitening.T @ axes
        return np.asarray(root[:, None] * own * root)

    contact, terrain = turned(np.diag(ground.contact_m**2)), turned(ground.terrain)
    poses = (axes.T @ slope @ spread_of_poses(problem, solution, covariance)) / root[:, None]
    pixels = np.diag(1 - share) + poses @ poses.T + turned(ground.datum)
    likelihood = np.empty((GRID.size, GRID.size))
    for i, own in enumerate(GRID):
        for j, smooth in enumerate(GRID):
            factor = np.linalg.cholesky(pixels + own**2 * contact + smooth**2 * terrain + LEAST_SHARE * np.eye(count))
            white = np.linalg.solve(factor, innovation)
            prior = (np.log(own) ** 2 + np.log(smooth) ** 2) / SPREAD**2
            likelihood[i, j] = -np.log(np.diag(factor)).sum() - 0.5 * (white @ white + prior)
    weight = np.exp(likelihood - likelihood.max())
    weight /= weight.sum()
    return float(np.exp(weight.sum(axis=1) @ np.log(GRID))), float(np.exp(weight.sum(axis=0) @ np.log(GRID)))

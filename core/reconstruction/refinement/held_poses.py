# SPDX-License-Identifier: GPL-3.0-or-later
"""What the errors of poses that the fit holds do to its unknowns.

A pose that is not fitted stays as it was given: what it is off by, its covariance tells, correlated as it is, and this
moves all that is fitted (consider parameters; Schmidt 1966).
"""

from dataclasses import replace

import numpy as np

from ...vectors import Array
from .problem import POSE_COLUMNS, Problem
from .solver import Solution, normal_equations


def spread_of_poses(problem: Problem, solution: Solution, covariance: Array) -> Array:
    """(size, 6h) by how much the unknowns move with each of h held poses: S with a covariance of S Sᵀ.

    Parameters
    ----------
    covariance : (size, size) of the unknowns without.
    """
    size = problem.columns.size
    held = [i for i in np.unique(problem.view[solution.weight > 0]) if problem.columns.pose[i, 0] < 0]
    if not held:
        return np.zeros((size, 0))
    pixels = solution.evaluation.pixels
    columns = pixels.columns.copy()
    root = np.zeros((6 * len(held), 6 * len(held)))
    for number, i in enumerate(held):
        columns[problem.view == i, POSE_COLUMNS] = size + 6 * number + np.arange(6)
        root[6 * number : 6 * number + 6, 6 * number : 6 * number + 6] = np.linalg.inv(problem.pose_whitening[i])
    wide = replace(problem, columns=replace(problem.columns, size=size + 6 * len(held)))
    evaluation = replace(solution.evaluation, pixels=replace(pixels, columns=columns), others=())
    information, _ = normal_equations(wide, evaluation, solution.weight)
    return np.asarray(-covariance @ information[:size, size:] @ root)

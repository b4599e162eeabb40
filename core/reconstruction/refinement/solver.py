# SPDX-License-Identifier: GPL-3.0-or-later
"""Levenberg–Marquardt with reweighting (Triggs et al. 2000, Bundle adjustment, §4)."""

from dataclasses import dataclass, replace

import numpy as np

from ...least_squares import damped_step, inverse
from ...progress import Progress, silent
from ...vectors import Array, Indices, Mask, norm
from ..choices import Loss
from .problem import (
    Evaluation,
    Problem,
    Rows,
    Unknowns,
    chains_at,
    evaluate,
    moved,
)

HUBER, CAUCHY = 2.5, 3.5
"""Length of a whitened pixel residual from which it counts less: 98 % efficient on normal noise in two dimensions."""
REJECTED = 4.5
"""Longer ones are outliers: a normal one is with a probability of 4e-5."""
MOST_ITERATIONS, MOST_ROUNDS = 100, 5
HEAVIEST = 1e10
"""A damping with which no step gets anywhere."""
SETTLED = 1e-7
"""A last step of this part of a standard deviation ends the search,"""
NO_GAIN = 1e-10
"""and so does a step that takes less than this part off the cost."""
ROUGHLY_SETTLED, ROUGHLY_NO_GAIN = 0.02, 0.02
"""Enough to tell solutions apart: a last step in standard deviations, and what it takes off half the squares."""
UNEXPLAINED = 0.999
"""A sum of squares that chance exceeds only in one of a thousand cases is not explained by the stated noise."""
MEDIAN_LENGTH = float(np.sqrt(2 * np.log(2)))
"""Median length of a normal vector of two dimensions."""


@dataclass(frozen=True, eq=False)
class Solution:
    """Where the search ended.

    Attributes
    ----------
    state : the unknowns.
    evaluation : the problem there.
    weight : (m,) of the squared residuals of the pixels; zero for outliers and unused ones.
    outlier : (m,).
    information : (size, size) the normal equations' matrix.
    iterations : number of them.
    settled : the search ended by itself.
    """

    state: Unknowns
    evaluation: Evaluation
    weight: Array
    outlier: Mask
    information: Array
    iterations: int
    settled: bool


def solve(
    problem: Problem, state: Unknowns, loss: Loss, progress: Progress = silent, *, roughly: bool = False
) -> Solution:
    """Search from a first state; once more without outliers, and as long as pixels join or leave the ends of chains.

    Parameters
    ----------
    roughly : one search, as far as it takes to compare its end with others'.
    """
    found = _search(problem, state, chains_at(problem, state), loss, progress, reject=False, roughly=roughly)
    if roughly:
        return found
    iterations = found.iterations
    for _ in range(MOST_ROUNDS):
        reject = loss != "linear" and bool(found.outlier.any())
        chain = chains_at(problem, found.state)
        unchanged = bool(((chain >= 0) == (found.evaluation.segment >= 0)).all())
        if unchanged and reject == bool((found.weight[found.evaluation.segment >= 0] == 0).any()):
            break
        found = _search(problem, found.state, chain, loss, progress, reject=reject)
        iterations += found.iterations
    return replace(found, iterations=iterations)


def _search(
    problem: Problem,
    state: Unknowns,
    chain: Indices,
    loss: Loss,
    progress: Progress,
    *,
    reject: bool,
    roughly: bool = False,
) -> Solution:
    damping, settled, iteration = 1e-6, False, 0
    last_step = ROUGHLY_SETTLED if roughly else SETTLED
    here = evaluate(problem, state, chain)
    weight, outlier = _weights(here, loss, reject)
    information, gradient = normal_equations(problem, here, weight)
    while iteration < MOST_ITERATIONS and not settled:
        iteration += 1
        progress("Fitting", iteration, MOST_ITERATIONS)
        improved = False
        while not improved and damping < HEAVIEST:
            step = -damped_step(information, gradient, damping)
            settled = float(step @ information @ step) < last_step**2
            trial_state = moved(problem, state, step)
            trial = evaluate(problem, trial_state, chain)
            before = _cost(here, weight)
            after = _cost(trial, weight) if trial.valid else np.inf
            improved = after <= before
            if settled:
                break
            damping *= 0.1 if improved else 10
        settled = settled or not improved or before - after < (ROUGHLY_NO_GAIN if roughly else NO_GAIN * before)
        if improved:
            state, here, damping = trial_state, trial, max(damping, 1e-12)
            weight, outlier = _weights(here, loss, reject)
            information, gradient = normal_equations(problem, here, weight)
    return Solution(state, here, weight, outlier, information, iteration, settled)


def unexplained(spare: float) -> float:
    """The sum of squares with `spare` degrees of freedom that chance does not explain: a quantile of χ²."""
    from scipy.special import gammaincinv

    return float(2 * gammaincinv(spare / 2, UNEXPLAINED))


def pixel_noise(problem: Problem, solution: Solution) -> float:
    """By how much the pixels scatter more than stated; 1 where chance may explain it."""
    squares = float(solution.weight @ (solution.evaluation.pixels.residual**2).sum(axis=1))
    of_pixels, _ = normal_equations(problem, replace(solution.evaluation, others=()), solution.weight)
    told = float((inverse(solution.information, partly=True) * of_pixels).sum())  # unknowns that pixels determine
    spare = 2 * int((solution.weight > 0).sum()) - told
    return float(np.sqrt(squares / spare)) if spare > 0 and squares > unexplained(spare) else 1.0


def objective(solution: Solution, loss: Loss) -> float:
    """Half the squares that the search makes small, with the loss in place of weights: comparable between solutions."""
    evaluation = solution.evaluation
    length = _lengths(evaluation)[evaluation.segment >= 0]
    if loss != "linear":
        length = np.minimum(length, REJECTED)
    if loss == "huber":
        pixels = np.where(length < HUBER, length**2, HUBER * (2 * length - HUBER))
    elif loss == "cauchy":
        pixels = CAUCHY**2 * np.log1p((length / CAUCHY) ** 2)
    else:
        pixels = length**2
    return 0.5 * (float(pixels.sum()) + sum(float((rows.residual**2).sum()) for rows in evaluation.others))


def _lengths(evaluation: Evaluation) -> Array:
    return norm(evaluation.pixels.residual)


def _weights(evaluation: Evaluation, loss: Loss, reject: bool) -> tuple[Array, Mask]:
    """Weights of the pixels (m,), and which are outliers."""
    length, used = _lengths(evaluation), evaluation.segment >= 0
    scale = max(1.0, float(np.median(length[used])) / MEDIAN_LENGTH) if used.any() else 1.0
    ratio = length / scale
    outlier = used & (ratio > REJECTED)
    if loss == "linear":
        weight = np.ones(length.size)
    elif loss == "cauchy":
        weight = 1 / (1 + (ratio / CAUCHY) ** 2)
    else:
        weight = HUBER / np.maximum(ratio, HUBER)
    if reject:
        weight = np.where(outlier, 0.0, weight)
    return np.where(used, weight, 0.0), outlier


def _cost(evaluation: Evaluation, weight: Array) -> float:
    """Half the weighted squares; with the weights of the present state a smaller one is progress for any loss here."""
    cost = float(weight @ (evaluation.pixels.residual**2).sum(axis=1))
    return 0.5 * (cost + sum(float((rows.residual**2).sum()) for rows in evaluation.others))


def normal_equations(problem: Problem, evaluation: Evaluation, weight: Array) -> tuple[Array, Array]:
    """Information matrix (size, size) and gradient (size,) of half the weighted squares."""
    size = problem.columns.size
    information, gradient = np.zeros((size + 1) ** 2), np.zeros(size + 1)
    used = np.flatnonzero(weight > 0)
    pixels = evaluation.pixels
    chosen = Rows(pixels.residual[used], pixels.jacobian[used], pixels.columns[used])
    _add(chosen, weight[used], size, information, gradient)
    for rows in evaluation.others:
        _add(rows, np.ones(len(rows.residual)), size, information, gradient)
    return information.reshape(size + 1, size + 1)[:size, :size], gradient[:size]


def _add(rows: Rows, weight: Array, size: int, information: Array, gradient: Array) -> None:
    """Add the rows to a flat (size + 1)² matrix and a vector, whose last places take what is not free."""
    if not len(rows.residual):
        return
    free = (rows.columns >= 0).any(axis=0)
    columns, jacobian = rows.columns[:, free], rows.jacobian[:, :, free]
    place: Indices = np.where(columns < 0, size, columns)
    weighted = jacobian * weight[:, None, None]
    turned = np.swapaxes(weighted, 1, 2)
    squares = turned @ jacobian
    cells = place[:, :, None] * (size + 1) + place[:, None, :]
    information += np.bincount(cells.ravel(), squares.ravel(), information.size)
    products = (turned @ rows.residual[:, :, None])[:, :, 0]
    gradient += np.bincount(place.ravel(), products.ravel(), gradient.size)

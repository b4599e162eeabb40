# SPDX-License-Identifier: GPL-3.0-or-later
"""Residuals of a track that are alike from frame to frame, and what this means for the covariance of a fit.

A tracker that follows a template, or the lit side of a turning block, is off by about the same in neighbouring frames.
As many pixels then tell less than independent ones. The noise of each track is taken for autoregressive of the first
order: correlated by ρ from one frame to the next, by ρ² to the one after. The fit takes part of such noise for motion,
so that its residuals are correlated by less than ρ; by how much less is computed.
"""

from dataclasses import dataclass

import numpy as np

from ...vectors import Array, Indices
from .problem import Problem
from .solver import Solution

GRID = np.array([0.0, 0.2, 0.4, 0.6, 0.7, 0.8, 0.85, 0.9, 0.93, 0.96, 0.98])
"""Correlations for which what to expect of the residuals is computed; between them it is interpolated."""
SIGNIFICANCE = 3.0
"""Chance alone correlates residuals of m pixels by 1/√(2m); less than so many times that is taken for none."""
FEWEST = 20
"""Pixels of a track that tell its correlation."""


@dataclass(frozen=True, eq=False)
class TrackNoise:
    """The noise of one track.

    Attributes
    ----------
    view, group : which.
    correlation : ρ from one frame to the next; 0 where chance may explain what there is.
    larger : factor on the standard deviation of the pixels, 1 without correlation: by how much the squares exceed what
        such noise leaves.
    columns : (q,) the unknowns that its pixels depend on.
    excess : (q, q) by how much the information of the pixels, JᵀJ, falls short of JᵀCJ, which is the covariance of the
        gradient.
    """

    view: int
    group: int
    correlation: float
    larger: float
    columns: Indices
    excess: Array


def track_noise(problem: Problem, solution: Solution, covariance: Array) -> list[TrackNoise]:
    """The noise of each track of a solution.

    Parameters
    ----------
    covariance : (size, size) of the unknowns for independent noise as stated.
    """
    used = np.flatnonzero(solution.weight > 0)
    track = problem.view[used] * (problem.obs_group.max(initial=0) + 1) + problem.obs_group[used]
    found = []
    for one in np.unique(track):
        rows = used[track == one]
        rows = rows[np.argsort(problem.video_s[rows], kind="stable")]
        if rows.size >= FEWEST:
            found.append(_noise_of(problem, solution, covariance, rows))
    return found


def _noise_of(problem: Problem, solution: Solution, covariance: Array, rows: Indices) -> TrackNoise:
    root = np.sqrt(solution.weight[rows])
    pixels = solution.evaluation.pixels
    residual = pixels.residual[rows] * root[:, None]
    place = pixels.columns[rows]
    columns = np.unique(place[place >= 0])
    known = covariance[np.ix_(columns, columns)]
    jacobian = np.zeros((rows.size, 2, columns.size + 1))  # the last place takes what is held
    at = np.where(place >= 0, np.searchsorted(columns, place), columns.size)[:, None, :]
    np.add.at(
        jacobian,
        (np.arange(rows.size)[:, None, None], np.arange(2)[None, :, None], at),
        pixels.jacobian[rows] * root[:, None, None],
    )
    jacobian = jacobian[:, :, :-1]
    frames = _frame_numbers(problem.video_s[rows])
    beside = np.diff(frames) == 1

    def inner(one: Array, other: Array) -> Array:
        return one.reshape(-1, columns.size).T @ other.reshape(-1, columns.size)

    def smoothed(correlation: float) -> Array:
        matrix = correlation ** np.abs(frames[:, None] - frames[None, :])
        return (matrix @ jacobian.reshape(rows.size, -1)).reshape(jacobian.shape)

    stepped = np.zeros_like(jacobian)  # the mean of the derivatives one frame before and after
    stepped[:-1][beside] += 0.5 * jacobian[1:][beside]
    stepped[1:][beside] += 0.5 * jacobian[:-1][beside]
    plain = inner(jacobian, jacobian)
    twice, twice_stepped = known @ plain @ known, known @ inner(jacobian, stepped) @ known

    def expected(correlation: float) -> tuple[float, float]:
        """Of the squares of the residuals, and of their products with their neighbours, for noise as stated."""
        smooth = smoothed(correlation)
        information = inner(jacobian, smooth)
        squares = 2 * rows.size + ((twice - 2 * known) * information).sum()
        products = 2 * correlation * beside.sum() - 2 * (known * inner(stepped, smooth)).sum()
        return float(squares), float(products + (twice_stepped * information).sum())

    square = float((residual**2).sum())
    ratio = float((residual[:-1] * residual[1:])[beside].sum()) / max(square, 1e-300)
    correlation, larger, excess = 0.0, 1.0, np.zeros_like(plain)
    squares, products = expected(0.0)
    if squares > 0 and ratio > products / squares + SIGNIFICANCE / np.sqrt(2 * rows.size):
        table = np.array([expected(one) for one in GRID])
        correlation = float(np.interp(ratio, np.maximum.accumulate(table[:, 1] / table[:, 0]), GRID))
        larger = max(1.0, float(np.sqrt(square / expected(correlation)[0])))
        excess = larger**2 * inner(jacobian, smoothed(correlation)) - plain
    view, group = int(problem.view[rows[0]]), int(problem.obs_group[rows[0]])
    return TrackNoise(view, group, correlation, larger, columns, excess)


def _frame_numbers(time_s: Array) -> Indices:
    """(m,) frames since the first pixel, by the usual interval between two of them."""
    if time_s.size < 2:
        return np.zeros(time_s.size, dtype=np.intp)
    step = max(float(np.median(np.diff(time_s))), 1e-9)
    return np.round((time_s - time_s[0]) / step).astype(np.intp)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether the flights are those of gravity (and drag) alone, and what it means for the covariance where they are not.

A block that spins is lifted (Magnus), a flat one sails, a light one brakes: over a flight of a second much like a
constant acceleration beside that of gravity. Whether the pixels ask for one in each flight, all of the same size in
the mean, is tested by the ratio of likelihoods with and without; its standard deviation is the likeliest one. The fit
keeps its flights, and its covariance is that of its errors with such accelerations; where the pixels do not ask for
them, with those that could pass unseen.
"""

from dataclasses import dataclass, replace

import numpy as np

from ...least_squares import inverse
from ...vectors import Array
from .correlation import TrackNoise, track_noise
from .problem import Problem, Rows, common_times
from .solver import Solution, normal_equations

SIZES_MPS2 = np.geomspace(0.03, 30.0, 31)
"""Standard deviations of the acceleration that are tried [m/s²]."""
ASKED_FOR = 4.0
"""Logarithm of the ratio of likelihoods from which the accelerations are there."""
LIFT = 0.35
"""Coefficient of lift of a ball whose surface turns about as fast as it flies, as one that rolls (Nathan 2008)."""
UNSEEN_PARTS = np.array([0.25, 0.5, 1.0])
"""Of what the air may do to a block: accelerations that the pixels may not tell from none."""
FREEDOM, REWEIGHTED = 2.0, 10
"""Degrees of freedom of Student's distribution of the flights' accelerations, and rounds of reweighting."""


@dataclass(frozen=True, eq=False)
class Accelerations:
    """Of the k segments, beside gravity and drag.

    Attributes
    ----------
    problem : with the columns of the accelerations, after those of the unknowns.
    mean : (k, 3) the likeliest ones [m/s²].
    sigma_mps2 : standard deviation of one of their components.
    spread : (size + 3k, size + 3k) covariance of what they do to the unknowns, and of themselves about none.
    own : (size, size) covariance of the unknowns for given accelerations.
    tracks : noise of the tracks with the accelerations.
    gain : logarithm of the ratio of likelihoods with and without.
    asked : the pixels ask for them; where not, `spread` is of what could pass unseen.
    """

    problem: Problem
    mean: Array
    sigma_mps2: float
    spread: Array
    own: Array
    tracks: tuple[TrackNoise, ...]
    gain: float
    asked: bool


def find_accelerations(problem: Problem, solution: Solution, noise: float) -> Accelerations | None:
    """The accelerations that the pixels ask for, or that they do not rule out; None without flights.

    Parameters
    ----------
    noise : factor on the stated standard deviations of the pixels in the problem.
    """
    size, flying = problem.columns.size, np.flatnonzero(~problem.contact)
    used = solution.evaluation.segment >= 0
    if not flying.size or not used.any():
        return None
    push = np.full((len(problem.first), 3), -1)
    push[flying] = size + np.arange(3 * flying.size).reshape(-1, 3)
    wide = replace(problem, columns=replace(problem.columns, push=push))
    pixels = _with_accelerations(wide, solution)
    evaluation = replace(solution.evaluation, pixels=pixels)
    counted = replace(wide, columns=replace(wide.columns, size=size + 3 * flying.size))
    information, gradient = normal_equations(counted, evaluation, solution.weight)

    own = inverse(information[:size, :size], partly=True)
    drawn = -own @ information[:size, size:]
    wanted = information[size:, size:] + information[size:, :size] @ drawn
    slope = gradient[size:] + drawn.T @ gradient[:size]
    curvature, axes = np.linalg.eigh((wanted + wanted.T) / 2)
    curvature = np.maximum(curvature, 0.0)

    shift = -np.linalg.lstsq(
        wanted + 1e-9 * np.trace(wanted) / curvature.size * np.eye(curvature.size), slope, rcond=None
    )[0]
    step = np.concatenate([drawn @ shift - own @ gradient[:size], shift])
    left = replace(pixels, residual=pixels.residual + _times(pixels, step))
    after = replace(solution, evaluation=replace(evaluation, pixels=left))
    covariance = inverse(information, partly=True)
    tracks = track_noise(counted, after, covariance)
    squares = float(solution.weight @ (left.residual**2).sum(axis=1))
    spare = 2 * int((solution.weight > 0).sum()) - size - 3 * flying.size
    variance = max(squares / spare if spare > 0 else 1.0, noise**-2.0)
    alike = [track.larger**2 * (1 + track.correlation) / (1 - track.correlation) for track in tracks]
    variance *= max(1.0, float(np.mean(alike))) if alike else 1.0

    curvature, slope = curvature / variance, axes.T @ slope / variance
    gain = _gains(curvature, slope, SIZES_MPS2)
    best = int(np.argmax(gain))
    asked = bool(gain[best] >= ASKED_FOR)
    if asked:
        mean, spread = _in_each_flight(axes @ (curvature[:, None] * axes.T), axes @ slope, float(SIZES_MPS2[best]))
    else:
        mean, spread = np.zeros(curvature.size), _too_small_to_tell(axes, curvature, slope, _in_air(problem, solution))
    through = np.concatenate([drawn, np.eye(curvature.size)])
    found = np.zeros((len(problem.first), 3))
    found[flying] = mean.reshape(-1, 3)
    kept = tuple(replace(track, columns=track.columns[track.columns < size]) for track in tracks)
    return Accelerations(
        wide,
        found,
        float(SIZES_MPS2[best]),
        through @ spread @ through.T,
        variance * own,
        kept,
        float(gain[best]),
        asked,
    )


def _in_each_flight(curvature: Array, slope: Array, size: float) -> tuple[Array, Array]:
    """The accelerations (3k,) that are there, and the covariance of their errors about none.

    One size holds for all flights in the mean, but single ones may have much more (drag of the fastest, another spin):
    their prior is Student's distribution, solved by reweighting each flight.

    Parameters
    ----------
    curvature, slope : (3k, 3k), (3k,) Hessian and gradient of half the squares.
    """
    flights, weight = slope.size // 3, np.ones(slope.size // 3)
    for _ in range(REWEIGHTED):
        covariance = np.linalg.inv(curvature + np.diag(np.repeat(weight, 3)) / size**2)
        mean = -covariance @ slope
        square = (mean**2 + np.diag(covariance)).reshape(flights, 3).sum(axis=1) / size**2
        weight = (FREEDOM + 3) / (FREEDOM + square)
    return mean, covariance + np.outer(mean, mean)


def _gains(curvature: Array, slope: Array, sizes_mps2: Array) -> Array:
    """(s,) logarithm of the ratio of likelihoods with accelerations of s sizes and without."""
    size_2 = sizes_mps2[:, None] ** 2
    return np.asarray(
        (0.5 * size_2 * slope**2 / (1 + size_2 * curvature) - 0.5 * np.log1p(size_2 * curvature)).sum(axis=1)
    )


def _in_air(problem: Problem, solution: Solution) -> float:
    """What the air does to blocks that spin as if they rolled, in the mean of the flights [m/s²]."""
    pace = solution.evaluation.motion.start_velocity[~problem.contact]
    lift = LIFT * problem.reference_drag[~problem.contact] * (pace**2).sum(axis=1)
    return float(np.sqrt((lift**2).mean()))


def _too_small_to_tell(axes: Array, curvature: Array, slope: Array, greatest_mps2: float) -> Array:
    """(3k, 3k) covariance of accelerations about none that the pixels do not ask for, but do not rule out either.

    There are none, or some of a part of the greatest, each as much as it is likely.
    """
    sizes = greatest_mps2 * UNSEEN_PARTS
    weight = np.exp(np.minimum(_gains(curvature, slope, sizes), ASKED_FOR)) / sizes.size
    weight /= 1 + weight.sum()
    spread = np.zeros_like(axes)
    for part, size_2 in zip(weight, sizes**2, strict=True):
        narrow = size_2 / (1 + size_2 * curvature)
        mean = axes @ (narrow * slope)
        spread += part * ((axes * narrow) @ axes.T + np.outer(mean, mean))
    return spread


def _with_accelerations(problem: Problem, solution: Solution) -> Rows:
    """The pixels' rows with derivatives by the accelerations, under which the ends of a flight stay."""
    pixels, segment = solution.evaluation.pixels, solution.evaluation.segment
    motion, state = solution.evaluation.motion, solution.state
    elapsed = common_times(problem, state) - state.time_s[problem.first][segment]
    away = 0.5 * elapsed * (elapsed - motion.duration_s[segment])
    away = np.where(segment >= 0, away, 0.0)
    by_place = pixels.jacobian[:, :, 0:3] + pixels.jacobian[:, :, 4:7]
    return Rows(
        pixels.residual,
        np.concatenate([pixels.jacobian, away[:, None, None] * by_place], axis=2),
        np.concatenate([pixels.columns, np.where(segment[:, None] >= 0, problem.columns.push[segment], -1)], axis=1),
    )


def _times(rows: Rows, step: Array) -> Array:
    """(r, d) the rows' derivatives times a step of the unknowns."""
    padded = np.append(step, 0.0)
    return np.asarray((rows.jacobian @ padded[rows.columns][:, :, None])[:, :, 0])

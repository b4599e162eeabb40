# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether the flights are those of gravity (and drag) alone, and what it means for the covariance where they are not.

A block that spins is lifted (Magnus), a flat one sails, a light one brakes: over a flight of a second much like a
constant acceleration beside that of gravity. Whether the pixels ask for one in each flight, all of the same size in
the mean, is tested by the ratio of likelihoods with and without; its standard deviation is the likeliest one. The fit
keeps its flights, and its covariance is that of its errors with such accelerations.
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


@dataclass(frozen=True, eq=False)
class Accelerations:
    """Of the k segments, beside gravity and drag.

    Attributes
    ----------
    problem : with the columns of the accelerations, after those of the unknowns.
    mean : (k, 3) the likeliest ones [m/s²].
    sigma_mps2 : standard deviation of one of their components.
    covariance : (size + 3k, size + 3k) of the errors of the unknowns, and of the accelerations about none.
    tracks : noise of the tracks with the accelerations.
    gain : logarithm of the ratio of likelihoods with and without.
    """

    problem: Problem
    mean: Array
    sigma_mps2: float
    covariance: Array
    tracks: tuple[TrackNoise, ...]
    gain: float


def find_accelerations(problem: Problem, solution: Solution, noise: float) -> Accelerations | None:
    """The accelerations that the pixels ask for; None where they do not.

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
    told, axes = np.linalg.eigh((wanted + wanted.T) / 2)
    told = np.maximum(told, 0.0)

    shift = -np.linalg.lstsq(wanted + 1e-9 * np.trace(wanted) / told.size * np.eye(told.size), slope, rcond=None)[0]
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

    told, slope = told / variance, axes.T @ slope / variance
    gain = [
        float((0.5 * size_2 * slope**2 / (1 + size_2 * told) - 0.5 * np.log1p(size_2 * told)).sum())
        for size_2 in SIZES_MPS2**2
    ]
    best = int(np.argmax(gain))
    if gain[best] < ASKED_FOR:
        return None
    likely = SIZES_MPS2[best] ** 2
    mean = -axes @ (likely * slope / (1 + likely * told))
    spread = (axes * (likely / (1 + likely * told))) @ axes.T + np.outer(mean, mean)
    through = np.concatenate([drawn, np.eye(told.size)])
    covariance = through @ spread @ through.T
    covariance[:size, :size] += variance * own
    found = np.zeros((len(problem.first), 3))
    found[flying] = mean.reshape(-1, 3)
    kept = tuple(replace(track, columns=track.columns[track.columns < size]) for track in tracks)
    return Accelerations(wide, found, float(SIZES_MPS2[best]), covariance, kept, gain[best])


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

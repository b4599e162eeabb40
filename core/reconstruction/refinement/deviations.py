# SPDX-License-Identifier: GPL-3.0-or-later
"""The covariance of a refinement's unknowns, and how the velocities follow from them."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...least_squares import inverse
from ...vectors import Array, Indices
from ..node_motion import NodeMotion
from .accelerations import Accelerations, find_accelerations
from .correlation import TrackNoise, track_noise
from .faults import Fault
from .held_poses import spread_of_poses
from .mending import Mended, spread_of_faults
from .problem import NODE, Problem
from .search import Rival
from .setup import Setup
from .solver import Solution, unexplained


@dataclass(frozen=True, eq=False)
class Fit:
    """A solved problem with the covariance (size, size) of its unknowns.

    Attributes
    ----------
    covariance : of this solution, and of its rivals about it as much as they are likely; where there are accelerations,
        (size + 3k, size + 3k) with theirs.
    independent : (size, size) of this solution, were the noise of its pixels independent.
    scale : factor on the stated standard deviations, which the covariance contains.
    tracks : the noise of each track, which the covariance contains where it is correlated.
    accelerations : of the flights beside gravity, where the pixels ask for them.
    mended : what was found untrue of what was given.
    rivals : other solutions within the noise; chance (r,) of each, this one's being the rest of its trajectory's.
    """

    setup: Setup
    solution: Solution
    covariance: Array
    independent: Array
    scale: float
    tracks: tuple[TrackNoise, ...] = ()
    rivals: tuple[Rival, ...] = ()
    chance: Array = field(default_factory=lambda: np.zeros(0))
    accelerations: Accelerations | None = None
    mended: Mended | None = None

    @property
    def faults(self) -> tuple[Fault, ...]:
        """What was found untrue of what was given."""
        return () if self.mended is None else self.mended.faults


def with_covariance(
    setup: Setup, solution: Solution, rivals: Sequence[Rival] = (), mended: Mended | None = None
) -> Fit:
    """The covariance, enlarged when the residuals are larger than the stated noise allows, by rivals and by faults."""
    used = solution.weight > 0
    pixels = solution.evaluation.pixels.residual[used]
    squares = float((solution.weight[used, None] * pixels**2).sum())
    count = 2 * int(used.sum())
    for rows in solution.evaluation.others:
        squares += float((rows.residual**2).sum())
        count += rows.residual.size
    spare = count - setup.problem.columns.size
    scale = 1.0
    if spare > 0 and squares > unexplained(spare):
        scale = float(np.sqrt(squares / spare))
    independent = inverse(solution.information, partly=True)
    tracks = tuple(track_noise(setup.problem, solution, independent))
    alike = np.zeros_like(independent)
    for track in tracks:
        alike[np.ix_(track.columns, track.columns)] += track.excess
    covariance = scale**2 * (independent + independent @ alike @ independent)
    poses = spread_of_poses(setup.problem, solution, independent)
    faults = np.zeros((len(poses), 0))
    if mended is not None:
        faults = spread_of_faults(setup.problem, solution, independent, mended.faults)
        faults *= np.sqrt(np.trace(covariance) / max(np.trace(independent), 1e-300))
    accelerations = find_accelerations(setup.problem, solution, setup.noise)
    if accelerations is not None:
        without, covariance = covariance, accelerations.spread
        asked, tracks = accelerations.asked, accelerations.tracks if accelerations.asked else tracks
        covariance[: len(poses), : len(poses)] += accelerations.own if asked else without
        setup = replace(setup, problem=accelerations.problem)
        accelerations = accelerations if asked else None
    covariance[: len(poses), : len(poses)] += poses @ poses.T + faults @ faults.T
    for other in () if mended is None else mended.otherwise:
        away = _away(setup.problem, solution, other, len(covariance))
        covariance += np.outer(away, away)
    odds = np.array([np.exp(-rival.worse / scale**2) for rival in rivals])
    of = np.array([rival.trajectory for rival in rivals])
    chance = np.array([one / (1 + odds[of == name].sum()) for one, name in zip(odds, of, strict=True)])
    for rival, weight in zip(rivals, chance, strict=True):
        away = np.empty((rival.nodes.size, NODE))
        away[:, :3] = rival.centre - solution.state.centre[rival.nodes]
        away[:, 3] = rival.time_s - solution.state.time_s[rival.nodes]
        place = (NODE * rival.nodes[:, None] + np.arange(NODE)).ravel()
        covariance[place[:, None], place] += weight * np.outer(away, away)
    return Fit(
        setup, solution, covariance, scale**2 * independent, scale, tracks, tuple(rivals), chance, accelerations, mended
    )


def _away(problem: Problem, solution: Solution, other: Solution, size: int) -> Array:
    """(size,) what another solution of the same nodes has otherwise; what brakes its flights, as accelerations."""
    away, state = np.zeros(size + 1), solution.state
    nodes = np.column_stack([other.state.centre - state.centre, other.state.time_s - state.time_s])
    away[: nodes.size] = nodes.ravel()
    mean, here = (
        (one.evaluation.motion.end_velocity - one.evaluation.motion.start_velocity)
        / one.evaluation.motion.duration_s[:, None]
        for one in (other, solution)
    )
    away[problem.columns.push] = mean - here
    return away[:-1]


def velocity_rows(problem: Problem, motion: NodeMotion, segment: Indices, *, at_end: bool) -> Array:
    """(q, 3, size) derivatives of the velocities at the ends of segments by the free unknowns; zero for segment −1.

    With columns of accelerations, (q, 3, size + 3k).
    """
    has = np.flatnonzero(segment >= 0)
    which = segment[has]
    if at_end:
        by_place, by_law = motion.end_by_displacement[which], motion.end_between_by_law[which]
        by_duration = motion.end_acceleration[which] - (by_place @ motion.end_velocity[which][:, :, None])[:, :, 0]
    else:
        by_place, by_law = motion.inverse[which], motion.start_by_law[which]
        by_duration = -(by_place @ motion.end_velocity[which][:, :, None])[:, :, 0]
    push = problem.columns.push
    result = np.zeros((segment.size, 3, problem.columns.width + 1))
    first, last = NODE * problem.first[which], NODE * problem.last[which]
    half = (0.5 if at_end else -0.5) * motion.duration_s[which]
    for axis in range(3):
        result[has, axis, push[which, axis]] = half
        result[has, :, first + axis] = -by_place[:, :, axis]
        result[has, :, last + axis] = by_place[:, :, axis]
    result[has, :, first + 3] = -by_duration
    result[has, :, last + 3] = by_duration
    result[has, :, problem.columns.law[0]] = by_law[:, :, 0] * problem.reference_drag[which, None]
    result[has, :, problem.columns.law[1]] = by_law[:, :, 1]
    return result[:, :, :-1]


def centre_rows(problem: Problem, node: Indices) -> Array:
    """(q, 3, size) derivatives of the nodes' places by the free unknowns; with columns of accelerations, as above."""
    result = np.zeros((node.size, 3, problem.columns.width))
    for axis in range(3):
        result[np.arange(node.size), axis, NODE * node + axis] = 1.0
    return result

# SPDX-License-Identifier: GPL-3.0-or-later
"""The search for the best of several solutions, and the others that fit as well."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...progress import Progress, part, silent
from ...vectors import Array, Indices, norm
from ..choices import Loss
from .accelerations import find_accelerations
from .problem import Problem, Unknowns
from .ray_starts import SIGMA_FOUND_PX, SIGMA_MARK_PX, states_along_rays
from .setup import Setup
from .solver import Solution, objective, pixel_noise, solve
from .variance_components import terrain_scales

RIVAL = 6.0
"""A solution with half the squares larger by this has a chance of 1 in 400 beside the best one."""
MOST_MARKED, MOST_FOUND = 2, 4
"""Starts from the marked places, and about the best solution from there."""
SAME_SCALE = 0.1
"""Standard deviations whose logarithm changes by less are left as they are."""
SAME = 0.5
"""Solutions whose nodes are all nearer than this part of the block's diameter are one."""


@dataclass(frozen=True, eq=False)
class Rival:
    """Another solution of one trajectory within the noise.

    Attributes
    ----------
    trajectory : its name.
    nodes : (q,) of the problem; centre (q, 3), time_s (q,) theirs in this solution [m], [s].
    worse : by how much half the squares are larger than the best solution's.
    """

    trajectory: str
    nodes: Indices
    centre: Array
    time_s: Array
    worse: float


@dataclass(frozen=True, eq=False)
class Found:
    """The best solution.

    Attributes
    ----------
    problem : as solved, the pixels' standard deviations enlarged by `noise`, the ground's as the pixels tell.
    rivals : of the best solution, the likeliest first.
    """

    problem: Problem
    solution: Solution
    noise: float
    rivals: tuple[Rival, ...] = ()


def solve_with_noise(problem: Problem, state: Unknowns, loss: Loss, progress: Progress = silent) -> Found:
    """Solve; once more with larger standard deviations of the pixels if these scatter more than stated, and with those
    of the terrain that the pixels tell."""
    solution = solve(problem, state, loss, progress)
    noise = pixel_noise(problem, solution)
    if noise > 1:
        problem = replace(problem, sigma_px=noise * problem.sigma_px)
        solution = solve(problem, solution.state, loss, progress)
    pushed = find_accelerations(problem, solution, noise)
    if pushed is not None and pushed.asked:
        return Found(problem, solution, noise)  # what the flights are off by is not the terrain's
    contact, terrain = terrain_scales(problem, solution)
    if max(abs(np.log(contact)), abs(np.log(terrain))) > SAME_SCALE:
        problem = replace(problem, ground=problem.ground.scaled(contact, terrain))
        solution = solve(problem, solution.state, loss, progress)
    return Found(problem, solution, noise)


def search(setup: Setup, state: Unknowns, loss: Loss, progress: Progress = silent) -> Found:
    """Solve one trajectory from the marked places, and from where else along their rays the nodes may be.

    Notes
    -----
    Twice: about the marked places, which are off the rays by some pixels and some of a frame, and about the best
    solution from there, across whose rays little is left open. The least squares win; what is within the noise of them
    and farther off than half a block is a rival.
    """
    problem, most = setup.problem, MOST_MARKED + MOST_FOUND + 3

    def roughly(start: Unknowns) -> Solution:
        return solve(problem, start, loss, part(progress, len(tried), most), roughly=True)

    tried = list[Solution]()
    for start in [state, *states_along_rays(problem, state, SIGMA_MARK_PX)[:MOST_MARKED]]:
        tried.append(roughly(start))
    nearest = min(tried, key=lambda one: objective(one, loss)).state
    found = solve_with_noise(problem, nearest, loss, part(progress, len(tried), most))
    problem, best = found.problem, found.solution
    others = [one.state for one in tried if _apart(problem, one.state, best.state)]
    others += states_along_rays(problem, best.state, SIGMA_FOUND_PX)[:MOST_FOUND]
    different = [best.state]
    tried = [best]
    for start in others:
        if all(_apart(problem, start, other) for other in different):
            tried.append(roughly(start))
            different += [start, tried[-1].state]
    tried.sort(key=lambda one: objective(one, loss))
    if tried[0] is not best:
        found = replace(found, solution=solve(problem, tried[0].state, loss, part(progress, most - 1, most)))
    least, kept, rivals = objective(found.solution, loss), [found.solution.state], list[Rival]()
    for one in tried:
        worse = objective(one, loss) - least
        if worse < RIVAL and all(_apart(problem, one.state, other) for other in kept):
            kept.append(one.state)
            nodes = np.arange(setup.nodes.size)
            rivals.append(Rival(setup.names[0], nodes, one.state.centre, one.state.time_s, max(worse, 0.0)))
    return replace(found, rivals=tuple(rivals))


def search_one_by_one(
    setup: Setup, alone: Sequence[Setup], loss: Loss, progress: Progress = silent
) -> tuple[Unknowns, list[Rival]]:
    """Where to start with several trajectories: each one's best solution by itself, and their rivals.

    Parameters
    ----------
    setup : of all the trajectories; alone : of each of them.
    """
    rivals = list[Rival]()
    centre, time_s = setup.state.centre.copy(), setup.state.time_s.copy()
    for i, one in enumerate(alone):
        found = search(one, one.state, loss, part(progress, i, len(alone)))
        rows = setup.node_of[one.nodes]
        centre[rows], time_s[rows] = found.solution.state.centre, found.solution.state.time_s
        rivals += [replace(rival, nodes=rows[rival.nodes]) for rival in found.rivals]
    return replace(setup.state, centre=centre, time_s=time_s), rivals


def _apart(problem: Problem, state: Unknowns, other: Unknowns) -> bool:
    reach = 2 * SAME * float(np.median(problem.radius_m)) if problem.radius_m.size else 0.0
    return bool((norm(state.centre - other.centre) > reach).any())

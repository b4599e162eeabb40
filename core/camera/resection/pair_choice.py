# SPDX-License-Identifier: GPL-3.0-or-later
"""Which pairs are believed, and the camera that fits them.

A pair is called wrong by its residual against what the others predict (Baarda 1968, with a variance that is estimated
together with the stated one). One that decides the camera is left out only when there is no doubt: the others tell
little of where it should be, and a good one that is lost costs more than a wrong one that a person is asked about.
"""

from dataclasses import replace

import numpy as np

from ...errors import RockfallError
from ...vectors import Array, Mask, norm
from ..model import Camera
from .adjustment import Solution, adjusted, adjusted_from, is_settled, squares, without_each
from .assumed_lens import assumed_lens
from .problem import Problem
from .starting import Starts, mirrored
from .uncertainty import scatter_of

ADJUSTED = 3
"""From how many of the starts the least squares begin."""

CHECKED_BY = 12
"""Observations more than unknowns from which the least squares may begin at the last camera alone."""

NEAR_STEPS, MIRRORED_STEPS = 12, 5
HOPELESS_SCATTER = 20.0
"""A mirrored camera that is still so bad after `MIRRORED_STEPS` is no rival."""

STARTS_OF_MAJORITIES = 8
COST_OF_A_PAIR = 30.0
"""What leaving a pair out costs, in squared residuals: sets of few pairs fit too well to be compared without."""

RIVAL = 6.0
"""Another camera is worth a word when its squared residuals are no more than this above the best one's."""

PRIOR_FREEDOM = 6.0
"""How many observations the stated errors are worth when the scatter of the pairs is judged."""

FALSE_ALARM = 0.002
"""Chance that a sound set of pairs loses one."""

DECIDES = 0.5
"""A pair that takes up more than this part of its own error decides the camera, which then fits it, right or wrong."""
BEYOND_DOUBT = 2.0
"""Such a pair is left out from so many times the limit on only; before that a person is asked."""

TRUSTED_SCATTER = 3.0
"""Up to this many times the stated errors, all pairs are believed unless one stands out."""


def choose(start: Camera, problem: Problem, starts: Starts, robust: bool) -> tuple[Solution, Solution | None, Mask]:
    """The best of the starts, adjusted; a rival that fits as well; and which pairs are believed."""
    used = np.ones(len(problem.points), dtype=bool)
    best, other = _best_adjusted(start, problem, starts, used)
    if robust and _may_lose_one(problem, used):
        if best is None or scatter_of(best, problem, used) > TRUSTED_SCATTER:
            best, used = _least_contradicted(start, problem, starts)
            other = None
        else:
            best, used = _snooped(problem, best, used)
    if best is None:
        raise RockfallError(
            "No camera sees the points where they were picked. Check that each pixel belongs to its point, that v "
            "counts down from the top of the image, and the points' coordinates."
        )
    return best, other, used


def choose_near(last: Camera, problem: Problem, robust: bool) -> tuple[Solution, Mask] | None:
    """The camera and the pairs that are believed, from a camera that is nearly known; None where a search must tell.

    That is where few pairs are more than needed, where some do not fit, where the least squares take long, and where
    the camera mirrored in a flat set of points may be a rival.
    """
    if 2 * len(problem.points) - problem.unknowns < CHECKED_BY:
        return None
    used = np.ones(len(problem.points), dtype=bool)
    best = adjusted(last, problem, used, steps=NEAR_STEPS)
    if best is None or not is_settled(best) or scatter_of(best, problem, used) > TRUSTED_SCATTER:
        return None
    other = adjusted(mirrored(best.camera, problem.points), problem, used, steps=MIRRORED_STEPS)
    if other is not None and _may_rival(other, best, problem, used):
        return None
    return _snooped(problem, best, used) if robust else (best, used)


def _may_rival(other: Solution, best: Solution, problem: Problem, used: Mask) -> bool:
    """Whether more steps could make another camera fit as well as the best."""
    distance = float(norm(problem.points - best.camera.position).mean())
    apart = float(norm(other.camera.position - best.camera.position))
    return apart > 0.001 * distance and scatter_of(other, problem, used) < HOPELESS_SCATTER


def _best_adjusted(
    start: Camera, problem: Problem, starts: Starts, used: Mask
) -> tuple[Solution | None, Solution | None]:
    """Least squares from the promising starts: the best, and another one that fits nearly as well."""
    found = [each for index in _promising(starts, used) if (each := adjusted_from(start, problem, starts, index, used))]
    if not found:
        return None, None
    best = min(found, key=lambda each: each.misfit)
    scatter = scatter_of(best, problem, used)
    limit = best.misfit + RIVAL * (max(1.0, scatter**2) if np.isfinite(scatter) else 1.0)
    distance = float(norm(problem.points - best.camera.position).mean())
    for each in found:
        if each.misfit < limit and norm(each.camera.position - best.camera.position) > 0.02 * distance:
            return best, each
    return best, None


def _promising(starts: Starts, used: Mask, most: int = ADJUSTED) -> list[int]:
    """Starts that differ, the best first."""
    residual = np.minimum(starts.residual, 1e3)
    cost = np.log1p(residual[:, used] ** 2).sum(axis=1)
    order = np.argsort(cost, kind="stable")
    chosen: list[int] = []
    for index in order.tolist():
        if chosen and (len(chosen) == most or cost[index] > cost[chosen[0]] + 3 * np.sqrt(used.sum())):
            break
        # The same minimum has the same residuals, whatever the units of its parameters.
        if all(np.abs(residual[index] - residual[other]).max() > 0.3 for other in chosen):
            chosen.append(index)
    return chosen


def _least_contradicted(start: Camera, problem: Problem, starts: Starts) -> tuple[Solution | None, Mask]:
    """The camera that the fewest pairs contradict, among those that a majority of them leads to."""
    everyone = np.ones(len(problem.points), dtype=bool)
    best: Solution | None = None
    kept, least = everyone, np.inf
    for index in _promising(starts, everyone, STARTS_OF_MAJORITIES):
        used = _majority(problem, starts.residual[index])
        found = adjusted_from(start, problem, starts, index, used)
        if found is None:
            continue
        found, used = _snooped(problem, found, used)
        cost = float(squares(found)[used].sum()) + COST_OF_A_PAIR * int((~used).sum())
        if cost < least:
            best, kept, least = found, used, cost
    return best, kept


def _majority(problem: Problem, residual: Array) -> Mask:
    """The pairs that fit a start, where each pair counts little when it is far off."""
    scale = max(1.0, float(np.median(residual)) / 1.18)  # the median of two normal components
    used = residual < 4.5 * scale
    least = max(4, (problem.unknowns + 2) // 2)
    if used.sum() < least:
        used[np.argsort(residual, kind="stable")[:least]] = True
    return used


def _snooped(problem: Problem, solution: Solution, used: Mask) -> tuple[Solution, Mask]:
    """Pairs leave that the others contradict, the worst first, and return when they are believed again."""
    tried = {used.tobytes()}
    for _ in range(2 * len(used)):
        suspicion, decides = _suspicion(problem, solution, used)
        changed = used.copy()
        limit = np.where(decides, BEYOND_DOUBT, 1.0)
        leaving, returning = np.where(used, suspicion / limit, -np.inf), np.where(used, np.inf, suspicion)
        if leaving.max() > 1 and _may_lose_one(problem, used) and used.sum() > 4:
            changed[np.argmax(leaving)] = False
        elif returning.min() < 1:
            changed[np.argmin(returning)] = True
        if changed.tobytes() in tried:
            break
        tried.add(changed.tobytes())
        better = adjusted(solution.camera, problem, changed)
        if better is None:
            break
        solution, used = better, changed
    return solution, used


def _suspicion(problem: Problem, solution: Solution, used: Mask) -> tuple[Array, Mask]:
    """(n,) each pair's squared residual against what the others predict, over the limit for a wrong pair; and whether
    it decides the camera.

    The variance is that of the others, together with the stated one as if `PRIOR_FREEDOM` observations had shown it,
    and no less than the stated one.
    """
    from scipy.special import fdtri

    deletion = without_each(solution)
    deletion = replace(deletion, expected=deletion.expected + assumed_lens(solution, problem, used).noise)
    squared, own = deletion.squared, squares(solution)
    total = float(own[used].sum())
    others = 2 * int(used.sum()) - problem.unknowns + PRIOR_FREEDOM - 2.0 * used
    rest = np.maximum(total - np.where(used, np.maximum(squared, own), 0.0), 0.0)
    limit = 2 * fdtri(2, others, 1 - FALSE_ALARM / len(used))
    suspicion = squared / np.maximum(1.0, (PRIOR_FREEDOM + rest) / others) / limit
    with np.errstate(invalid="ignore"):
        decides = used & (norm(solution.residual) < (1 - DECIDES) * norm(deletion.residual))
    return np.where(np.isnan(suspicion), np.where(used, 0.0, np.inf), suspicion), decides


def _may_lose_one(problem: Problem, used: Mask) -> bool:
    return 2 * (int(used.sum()) - 1) - problem.unknowns >= 1

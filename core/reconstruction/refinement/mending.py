# SPDX-License-Identifier: GPL-3.0-or-later
"""Which faults the residuals ask for, and the fit without them.

All are tried, as columns beside those of the unknowns: the ratio of likelihoods with and without one, its size
integrated over its prior, says how much the residuals ask for it (Bayes factor, Laplace's approximation). The fit is
made anew with the likeliest one, its size found by steps of Gauss and Newton; it stays where the squares really fall by
as much and no further acceleration of the flights explains more. Then the next one is sought.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...least_squares import inverse
from ...progress import Progress, silent
from ...vectors import Array, Indices
from ..choices import Loss
from .accelerations import find_accelerations
from .correlation import track_noise
from .faults import Fault, applied, at_contact, can_be, candidates, columns_of, gaps, prior_sigma, rarity
from .problem import CLOCK_COLUMN, NODE, POSE_COLUMNS, Problem, Rows, Unknowns, evaluate, ground_distances
from .search import Found, solve_with_noise
from .solver import HUBER, REJECTED, Solution, objective, solve

if TYPE_CHECKING:
    from scipy.sparse import csr_array

ASKED_FOR = 4.0
"""Logarithm of the ratio of likelihoods, with how rare it is, from which a fault is there."""
MOST, ROUNDS, SETTLED = 4, 8, 0.05
"""Faults of a fit, steps to the size of one, and a last step in its standard deviations."""
BESIDE = 0.5
"""What explains so much of what another cause does, by the logarithms of their likelihoods, is not ruled out by it."""
AS_STATED = 1.5
"""One contact alone is off the ground where the terrain is by no more than so many times what was stated elsewhere."""
POWER = 0.84
"""So many standard deviations beyond the threshold an error is found four times in five."""
LEAST_RATE = 0.025
"""A capture rate that is wrong is so by more than this part."""


@dataclass(frozen=True, eq=False)
class Trial:
    """A fault with the logarithm of its ratio of likelihoods, how rare it is, and the step of its size."""

    fault: Fault
    evidence: float
    rare: float
    step: Array
    covariance: Array


@dataclass(frozen=True, eq=False)
class Mended:
    """A fit, and the faults that were taken out of its problem.

    Attributes
    ----------
    found : the fit.
    faults : in the order in which they were found.
    unseen : contacts that may be off the ground although the pixels do not ask for it.
    otherwise : the solutions with another capture rate or drag, which stay in the problem since they are
        a person's to set; and with or without a fault that accelerations of the flights explain about as well.
    """

    found: Found
    faults: tuple[Fault, ...] = ()
    otherwise: tuple[Solution, ...] = ()
    unseen: tuple[Trial, ...] = ()


@dataclass(frozen=True, eq=False)
class _Linear:
    """Residuals of a solution, whitened and weighted, with what is needed to try columns beside its own.

    Attributes
    ----------
    residual, jacobian : (rows,), (rows, q) sparse; of the pixels, the times of all nodes, the ground, and the rest.
    own : (q, q) the inverse of its normal equations.
    root : (m,) of the pixels' weights.
    spare : number of residuals of pixels beyond the unknowns.
    floor : least variance of the pixels, as they were stated.
    """

    problem: Problem
    solution: Solution
    residual: Array
    jacobian: "csr_array"
    own: Array
    root: Array
    spare: float
    floor: float

    def columns(self, faults: Sequence[Fault]) -> Array:
        """(rows, c) of faults."""
        columns = columns_of(self.problem, self.solution.state, self.solution.evaluation.pixels.jacobian, faults)
        m = self.root.size
        columns[: 2 * m] *= np.repeat(self.root, 2)[:, None]
        return np.concatenate([columns, np.zeros((self.residual.size - len(columns), columns.shape[1]))])


def _linear(problem: Problem, solution: Solution, noise: float) -> _Linear:
    """Outliers count as far as Huber's loss lets them: what is far off may be so by the fault that is sought.

    Poses and clocks that are held are free, with their covariance: what they explain needs no other fault.
    """
    from scipy.sparse import csr_array

    evaluation, size, n = solution.evaluation, problem.columns.size, solution.state.time_s.size
    pixels = evaluation.pixels
    used = evaluation.segment >= 0
    length = np.sqrt((pixels.residual**2).sum(axis=1))
    root = np.sqrt(np.where(used, HUBER / np.maximum(length, HUBER), 0.0))
    columns = pixels.columns.copy()
    extra = list[Rows]()
    held = [i for i in np.unique(problem.view[used]) if problem.columns.pose[i, 0] < 0]
    for number, i in enumerate(held):
        own = size + 6 * number + np.arange(6)
        columns[problem.view == i, POSE_COLUMNS] = own
        extra.append(Rows(np.zeros((1, 6)), problem.pose_whitening[i][None], own[None]))
    size += 6 * len(held)
    times = Rows(np.zeros((n, 1)), np.zeros((n, 1, 1)), NODE * np.arange(n)[:, None] + 3)
    known = np.isfinite(problem.sigma_time_s)
    times.residual[known], times.jacobian[known] = evaluation.others[0].residual, evaluation.others[0].jacobian
    weighted = Rows(pixels.residual * root[:, None], pixels.jacobian * root[:, None, None], columns)
    on_ground = problem.surface is not None and bool(problem.grounded.size)
    ground = [evaluation.others[2]] if on_ground else []
    rest = [evaluation.others[1], *evaluation.others[2 + len(ground) :], *extra]
    values, residuals, places, lines = list[Array](), list[Array](), list[Indices](), list[Indices]()
    start = 0
    for rows in (weighted, times, *ground, *rest):
        r, d, q = rows.jacobian.shape
        free = np.broadcast_to((rows.columns >= 0)[:, None, :], (r, d, q))
        values.append(rows.jacobian[free])
        places.append(np.broadcast_to(rows.columns[:, None, :], (r, d, q))[free])
        line = start + np.broadcast_to(np.arange(r * d).reshape(r, d)[:, :, None], (r, d, q))
        lines.append(np.asarray(line[free]))
        residuals.append(rows.residual.ravel())
        start += r * d
    cells = (np.concatenate(values), (np.concatenate(lines), np.concatenate(places)))
    jacobian = csr_array(cells, shape=(start, size))
    inverted = inverse((jacobian.T @ jacobian).toarray(), partly=True)
    spare = max(2.0 * float(used.sum()) - size, 1.0)
    return _Linear(problem, solution, np.concatenate(residuals), jacobian, inverted, root, spare, noise**-2.0)


def _tried(linear: _Linear, faults: Sequence[Fault], count: int = 0) -> list[Trial]:
    """Each fault by itself.

    Parameters
    ----------
    count : of how many they are; 0 for as many as are given.
    """
    columns, m2 = linear.columns(faults), 2 * linear.root.size
    across = np.asarray(linear.jacobian.T @ columns)
    through = linear.own @ across
    slope = -(columns.T @ linear.residual - through.T @ (linear.jacobian.T @ linear.residual))
    squares = float((linear.residual[:m2] ** 2).sum())
    found, place = list[Trial](), 0
    for fault in faults:
        own = slice(place, place + fault.value.size)
        place = own.stop
        information = columns[:, own].T @ columns[:, own] - across[:, own].T @ through[:, own]
        sigma = prior_sigma(linear.problem, fault)
        known = np.eye(fault.value.size) / sigma**2
        gain = float(slope[own] @ np.linalg.solve(information + known, slope[own]))
        variance = max((squares - gain) / linear.spare, linear.floor)
        information, asked = information / variance, slope[own] / variance - known @ fault.value
        covariance = np.linalg.inv(information + known)
        step = covariance @ asked
        wide = np.linalg.slogdet(np.eye(fault.value.size) + sigma**2 * information)[1]
        rare = rarity(fault) + float(np.log(count or len(faults)))
        evidence = 0.5 * float(asked @ step) - 0.5 * float(wide) - rare
        found.append(Trial(fault, evidence, rare, step, covariance))
    return found


def _alike(problem: Problem, solution: Solution) -> float:
    """Factor on the variance of the pixels for errors that are alike from frame to frame."""
    tracks = track_noise(problem, solution, inverse(solution.information, partly=True))
    factors = [track.larger**2 * (1 + track.correlation) / (1 - track.correlation) for track in tracks]
    return max(1.0, float(np.mean(factors))) if factors else 1.0


def mend(found: Found, loss: Loss, progress: Progress = silent) -> Mended:
    """Find faults, and the fit without them.

    Parameters
    ----------
    found : the fit as everything was given.
    """
    faults, otherwise, unseen = list[Fault](), list[Solution](), list[Trial]()
    for _ in range(MOST):
        linear = _linear(found.problem, found.solution, found.noise)
        stated = _as_stated(found, loss)
        ahead = list[Trial]()
        for group in candidates(found.problem, found.solution.state):
            on_ground = group[0].kind == "ground" and stated is not found
            about = _linear(stated.problem, stated.solution, stated.noise) if on_ground else linear
            trials = _tried(about, group)
            unseen = trials if group[0].kind == "ground" else unseen
            best = max(trials, key=lambda one: one.evidence)
            if best.fault.kind == "gap":
                near = [g for g in gaps(found.problem, best.fault.view, best.fault.at) if g.picks == best.fault.picks]
                best = max(_tried(linear, near, len(group)), key=lambda one: one.evidence)
            if best.evidence > ASKED_FOR:
                ahead.append(best)
        for trial in sorted(ahead, key=lambda one: -one.evidence):
            progress("Trying what may be untrue", 0, 0)
            made = _without(found, stated if trial.fault.kind == "ground" else found, trial, loss)
            if made is not None:
                break
        else:
            break
        fault, mended, in_doubt = made
        faults.append(fault)
        if fault.kind in ("rate", "drag") or fault.doubtful:
            otherwise.append(mended.solution)
            break
        if in_doubt:
            otherwise.append(found.solution)
        found = mended
    known = {fault.at for fault in faults if fault.kind == "ground"}
    unseen = [one for one in unseen if one.evidence < ASKED_FOR and one.fault.at not in known]
    return Mended(found, tuple(faults), tuple(otherwise), tuple(unseen))


def _is_as_stated(problem: Problem) -> bool:
    return max(problem.ground.contact_scale, problem.ground.terrain_scale) < AS_STATED


def _as_stated(found: Found, loss: Loss) -> Found:
    """The fit with a terrain as accurate as stated, where it found one that is much less so.

    A single contact that is off makes all of the terrain seem so.
    """
    if _is_as_stated(found.problem):
        return found
    problem = replace(found.problem, ground=found.problem.ground.scaled(1.0, 1.0))
    return replace(found, problem=problem, solution=solve(problem, found.solution.state, loss))


def _without(found: Found, at: Found, trial: Trial, loss: Loss) -> tuple[Fault, Found, bool] | None:
    """The fit without a fault; None where the squares do not fall by as much as they should.

    Parameters
    ----------
    at : the fit to whose problem the fault is added, the same or `_as_stated`.
    """
    base, before = at.problem, at.solution
    fault, step, state, problem = trial.fault, trial.step, before.state, base
    for _ in range(ROUNDS):
        fault = replace(fault, value=fault.value + step)
        if not can_be(fault):
            return None
        _, moved_state = applied(problem, state, fault, step)
        problem, _ = applied(base, before.state, fault, fault.value)
        if not evaluate(problem, moved_state).valid:
            return None
        solution = solve(problem, moved_state, loss)
        state = solution.state
        (again,) = _tried(_linear(problem, solution, found.noise), [fault])
        step, sigma = again.step, np.sqrt(np.diag(again.covariance))
        fault = replace(fault, sigma=sigma)
        if fault.kind == "ground":
            fault = _gone(problem, solution, fault)
            break
        if fault.kind == "gap":
            instant = _jump(problem, solution, fault)
            if instant != fault.at:
                problem, fault = base, replace(fault, at=instant)
                continue
        if (np.abs(step) < SETTLED * sigma).all():
            break
    if at_contact(problem, state, fault):
        return None
    if fault.kind == "rate" and abs(float(fault.value[0])) < LEAST_RATE:
        return None
    variance = max(_scatter(solution), found.noise**-2.0) * _alike(problem, solution)
    gain = (objective(before, loss) - objective(solution, loss)) / variance
    if fault.kind == "ground":
        with_it, without, as_found = (
            _likelihood(one, other.state, variance, loss)
            for one, other in ((problem, solution), (base, before), (found.problem, found.solution))
        )
        gain = with_it - max(without, as_found - trial.rare - ASKED_FOR)
    else:
        prior = prior_sigma(base, fault)
        gain -= 0.5 * float(((fault.value / prior) ** 2).sum())
        gain += 0.5 * (_log_det(again.covariance) - 2 * fault.value.size * float(np.log(prior)))
    gain -= trial.rare
    rival = find_accelerations(found.problem, found.solution, found.noise)
    # a fault is rare, an acceleration is not
    against = 0.0 if rival is None or not rival.asked else rival.gain - trial.rare
    if gain < max(ASKED_FOR, against * (BESIDE if fault.kind in ("zoom", "drag", "rate") else 1.0)):
        return None
    fault = replace(fault, doubtful=gain < against)
    unscaled = replace(problem, sigma_px=problem.sigma_px / found.noise, ground=problem.ground.scaled(1.0, 1.0))
    mended = solve_with_noise(unscaled, state, loss)
    if fault.kind == "ground" and not _is_as_stated(mended.problem):
        return None
    return fault, mended, against > BESIDE * gain


def _likelihood(problem: Problem, state: Unknowns, variance: float, loss: Loss) -> float:
    """Logarithm of the likelihood of a problem whose ground has other standard deviations, but for a constant.

    Parameters
    ----------
    variance : factor on that of the pixels.
    """
    wider = replace(problem, sigma_px=np.sqrt(variance) * problem.sigma_px)
    solution = solve(wider, state, loss)
    return -objective(solution, loss) + _log_det(problem.ground.whitening) - _log_det(solution.information) / 2


def _log_det(matrix: Array) -> float:
    return float(np.linalg.slogdet(matrix)[1])


def _scatter(solution: Solution) -> float:
    """Mean square of the residuals of the pixels that count."""
    used = solution.weight > 0
    squares = float(solution.weight @ (solution.evaluation.pixels.residual**2).sum(axis=1))
    return squares / max(2 * int(used.sum()) - len(solution.information), 1)


def _gone(problem: Problem, solution: Solution, fault: Fault) -> Fault:
    """How far the ground lies below the terrain at a contact."""
    assert problem.surface is not None
    node = problem.grounded[int(fault.at)]
    distance, gradient = ground_distances(problem.surface, solution.state.centre[node][None])
    own = NODE * node + np.arange(3)
    covariance = inverse(solution.information, partly=True)[np.ix_(own, own)]
    sigma = np.sqrt(gradient[0] @ covariance @ gradient[0])
    return replace(fault, value=problem.radius_m[[int(fault.at)]] - distance, sigma=np.array([sigma]))


def _jump(problem: Problem, solution: Solution, fault: Fault) -> float:
    """After which frame a clock jumps by as much: each frame by itself is nearer to the flight before or after."""
    pixels, size = solution.evaluation.pixels, float(fault.value[0])
    rows = np.flatnonzero((problem.view == fault.view) & (solution.evaluation.segment >= 0))
    rows = rows[np.argsort(problem.video_s[rows], kind="stable")]
    late = (problem.video_s[rows] > fault.at)[:, None]
    move = size * pixels.jacobian[rows][:, :, CLOCK_COLUMN]
    squares = [((pixels.residual[rows] + part * move) ** 2).sum(axis=1) for part in (-1.0 * late, 1.0 - late)]
    before, after = (np.minimum(each, REJECTED**2) for each in squares)
    split = int(np.argmin(np.cumsum(before - after)[:-1]))
    return float(problem.video_s[rows[split]])


def _moved_by(linear: _Linear, covariance: Array, faults: Sequence[Fault]) -> Array:
    """(size, c) by how much the unknowns move with each number of faults."""
    across = np.asarray(linear.jacobian.T @ linear.columns(faults))
    return np.asarray(-covariance @ across[: len(covariance)])


def unseen_ground(
    problem: Problem, solution: Solution, covariance: Array, unseen: Sequence[Trial]
) -> tuple[Array, Array]:
    """What the ground at single contacts may be off by without being noticed, four times in five (c,) [m], and by how
    much the unknowns move with a metre of it (size, c): Baarda's internal and external reliability (1968)."""
    information = np.array([1 / one.covariance[0, 0] for one in unseen]) - np.array(
        [prior_sigma(problem, one.fault) ** -2 for one in unseen]
    )
    asked = np.sqrt(2 * (ASKED_FOR + np.array([one.rare for one in unseen])))
    least = (asked + POWER) / np.sqrt(np.maximum(information, 1e-12))
    return least, _moved_by(_linear(problem, solution, 1.0), covariance, [one.fault for one in unseen])


def spread_of_faults(problem: Problem, solution: Solution, covariance: Array, faults: Sequence[Fault]) -> Array:
    """(size, c) by how much the unknowns move with the numbers of faults that were taken out: S with S Sᵀ.

    Parameters
    ----------
    covariance : (size, size) of the unknowns without.
    """
    sized = [fault for fault in faults if fault.kind in ("gap", "zoom")]
    size = problem.columns.size
    if not sized:
        return np.zeros((size, 0))
    linear = _linear(problem, solution, 1.0)
    columns = linear.columns(sized)
    across = np.asarray(linear.jacobian.T @ columns)
    known = np.concatenate([np.full(fault.value.size, prior_sigma(problem, fault) ** -2) for fault in sized])
    own = np.linalg.inv(columns.T @ columns - across.T @ linear.own @ across + np.diag(known))
    return np.asarray(-covariance @ across[:size] @ np.linalg.cholesky(own))

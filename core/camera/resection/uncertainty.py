# SPDX-License-Identifier: GPL-3.0-or-later
"""How well a camera is known from its pairs, with what few pairs cannot show.

The inverse of the normal equations alone believes that clicks scatter as stated, that what is held of the lens is true,
and that the right pairs were left out. With many pairs the residuals would show it otherwise; with few they cannot.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ...least_squares import inverse
from ...vectors import Array, Mask, norm
from ..model import INTRINSICS, Camera, vector_from_rotation
from .adjustment import Deletion, Solution, adjusted, squares, without_each
from .assumed_lens import AssumedLens, assumed_lens
from .problem import Problem

CLICKS_FREEDOM = 4.0
"""How many observations the stated errors are worth: what people state for clicks is often wrong by half."""

PRIOR_WRONG = 0.05
"""Part of all pairs that are wrong before they were seen."""
WRONG_WITHIN = 0.03
"""So far off a wrong pixel may be, in diagonals of the image."""
NEGLIGIBLE = 1e-4
"""Choices less probable than this are not looked at."""
DOUBTFUL = 0.05
"""A pair that is wrong with this probability is worth a look."""
HANGS = 1.5
CHANCE = 0.02
"""So is one whose residual is of less than this chance, and without which the position moves by so many of its own
standard deviations."""

FEW_PAIRS = 12
"""Up to so many pairs the choice between two of them is looked at, too: of more, one is told from another."""
CHOICE_STEPS = 15
MOST_CHOICES = 40


@dataclass(frozen=True, eq=False)
class Confidence:
    """What is known of a camera's p parameters.

    Attributes
    ----------
    scatter : residuals in units of the stated errors, 1 when they agree; NaN without redundancy.
    factor : by which standard deviations are larger than from the stated errors, for the scatter that was seen and
        for the scatter that so few residuals cannot show; of the position, 1.96 of them then hold 95 %.
    own : (p, p) what comes from the clicks alone.
    covariance : (p, p) all together; infinite where the pairs determine nothing.
    whole : (15, 15) of the pose and the whole lens together, with what was assumed of it.
    by_lens : (p, p) the part of it that comes from what was assumed of the lens.
    by_choice : (p, p) the part that comes from which pairs were believed.
    doubt : (n,) probability that a pair is wrong.
    asked : (n,) pairs that are used, and that a person should look at again.
    moved_m : (n,) by how much the position moves without each used pair [m], linearised.
    """

    scatter: float
    factor: float
    own: Array
    covariance: Array
    whole: Array
    by_lens: Array
    by_choice: Array
    doubt: Array
    asked: Mask
    moved_m: Array


def confidence(solution: Solution, problem: Problem, used: Mask, rival: Solution | None, *, robust: bool) -> Confidence:
    """What is known of a camera that was found with some of the pairs.

    Parameters
    ----------
    rival : a different camera that fits nearly as well.
    robust : pairs may be left out, so that it is a choice which.
    """
    factor, deletion = scale_factor(solution, problem, used), without_each(solution)
    own = inverse(solution.normal) * factor**2
    lens = assumed_lens(solution, problem, used, factor**2)
    by_lens = lens.covariance
    by_choice, doubt = np.zeros_like(own), np.where(used, 0.0, 1.0)
    if np.isfinite(own).all():
        by_choice, doubt = _by_choice(solution, problem, used, rival, own, deletion, robust)
    return Confidence(
        scatter=scatter_of(solution, problem, used),
        factor=factor,
        own=own,
        covariance=own + by_lens + by_choice,
        whole=_of_all_parameters(own + by_choice, problem, lens),
        by_lens=by_lens,
        by_choice=by_choice,
        doubt=doubt,
        asked=used & ((doubt > DOUBTFUL) | _hanging(solution, problem, used, deletion, own + by_lens)),
        moved_m=norm(deletion.moved[:, 3:6]),
    )


def _of_all_parameters(covariance: Array, problem: Problem, lens: AssumedLens) -> Array:
    """(15, 15) of pose and lens: of the (p, p) that were found, and of the lens that was assumed with what it moves."""
    if not np.isfinite(covariance).all():
        return np.full((15, 15), np.inf)
    found = np.zeros((15, len(covariance)))
    found[:6, :6] = np.eye(6)
    found[6:, 6:] = problem.basis
    assumed = found @ lens.on_parameters
    assumed[[6 + INTRINSICS.index(name) for name in lens.names], range(len(lens.names))] += 1.0
    return np.asarray(found @ covariance @ found.T + assumed @ lens.moment @ assumed.T)


def _hanging(solution: Solution, problem: Problem, used: Mask, deletion: Deletion, covariance: Array) -> Mask:
    """(n,) pairs that the others hardly believe, and without which the camera would stand elsewhere."""
    from scipy.special import fdtrc

    place = covariance[3:6, 3:6]
    deletion = replace(deletion, expected=deletion.expected + assumed_lens(solution, problem, used).noise)
    redundancy = 2 * int(used.sum()) - problem.unknowns
    if redundancy <= 2 or not np.isfinite(place).all():
        return np.zeros(len(used), dtype=np.bool_)
    moved, squared = np.nan_to_num(deletion.moved[:, 3:6]), np.nan_to_num(deletion.squared)
    own = float(squares(solution)[used].sum())
    freedom = CLICKS_FREEDOM + redundancy - 2
    variance = np.maximum(1.0, (CLICKS_FREEDOM + np.maximum(own - squared, 0.0)) / freedom)
    sigmas = np.sqrt(np.einsum("ni,ij,nj->n", moved, np.linalg.inv(place), moved))
    unlikely = fdtrc(2, freedom, squared / variance / 2) < CHANCE
    return np.asarray(used & unlikely & (sigmas > HANGS))


def scale_factor(solution: Solution, problem: Problem, used: Mask) -> float:
    """By which standard deviations from the stated errors are multiplied.

    Notes
    -----
    The variance of the clicks is estimated from the residuals together with the stated one, which counts as
    `CLICKS_FREEDOM` observations, and is never below the stated one: few residuals are small by chance. For a variance
    that is estimated from ν observations, three components lie within 3 F(3, ν) in place of χ²(3); the ratio of their
    95 % points is in the factor, so that who takes it for a normal distribution is right.
    """
    from scipy.special import chdtri, fdtri

    freedom = CLICKS_FREEDOM + max(2 * int(used.sum()) - problem.unknowns, 0)
    total = float(squares(solution)[used].sum())
    variance = max(1.0, (CLICKS_FREEDOM + total) / freedom)
    plain = scatter_of(solution, problem, used)
    if np.isfinite(plain):
        variance = max(variance, plain**2)
    return float(np.sqrt(variance * 3 * fdtri(3, freedom, 0.95) / chdtri(3, 0.05)))


def worst_sigma(covariance: Array) -> float:
    """Of a vector in the direction in which it is known worst; infinite where it is not known."""
    if not np.isfinite(covariance).all():
        return float("inf")
    return float(np.sqrt(max(np.linalg.eigvalsh(covariance)[-1], 0.0)))


def scatter_of(solution: Solution, problem: Problem, used: Mask) -> float:
    """Residuals of the used pairs in units of the stated errors; NaN without redundancy."""
    redundancy = 2 * int(used.sum()) - problem.unknowns
    return float(np.sqrt(squares(solution)[used].sum() / redundancy)) if redundancy > 0 else float("nan")


def _by_choice(
    solution: Solution,
    problem: Problem,
    used: Mask,
    rival: Solution | None,
    own: Array,
    deletion: Deletion,
    robust: bool,
) -> tuple[Array, Array]:
    """(p, p) what other choices of pairs move and widen, each with its probability; and (n,) that a pair is wrong.

    The choices are those that differ from the one that was made in one pair, or in two where there are few pairs. The
    probability of each is that of its residuals, of unknown scatter, when a wrong pixel may be anywhere around.
    """
    chosen = [(used, _evidence(solution, problem, used), solution)]
    if robust:
        for others in _other_choices(problem, solution, deletion, used):
            found = adjusted(solution.camera, problem, others, steps=CHOICE_STEPS)
            if found is not None and np.isfinite(inverse(found.normal)).all():
                chosen.append((others, _evidence(found, problem, others), found))
    if rival is not None:
        chosen.append((used, _evidence(rival, problem, used), rival))
    level = np.array([evidence for _, evidence, _ in chosen])
    probability = np.exp(level - level.max())
    probability /= probability.sum()
    total = np.zeros_like(own)
    doubt = np.zeros(len(used))
    for share, (mask, _, found) in zip(probability, chosen, strict=True):
        doubt += share * ~mask
        if found is solution or share < NEGLIGIBLE:
            continue
        away = _apart(solution.camera, found.camera, problem)
        spread = inverse(found.normal) * scale_factor(found, problem, mask) ** 2
        total += share * (spread - own + np.outer(away, away))
    values, vectors = np.linalg.eigh(total / np.outer(size := np.sqrt(np.diagonal(own)), size))
    # A choice that is known better than the one that was made takes nothing away.
    total = (vectors * np.maximum(values, 0.0)) @ vectors.T * np.outer(size, size)
    return total, doubt


def _other_choices(problem: Problem, solution: Solution, deletion: Deletion, used: Mask) -> Iterator[Mask]:
    """Other sets of pairs that may be the right ones, the likeliest first, as far as one solution tells."""
    squared, own = deletion.squared, float(squares(solution)[used].sum())
    n, p, m = len(used), problem.unknowns, int(used.sum())
    area = _areas(solution, problem)
    logdet = _logdet(solution.normal)
    evidence = _log_evidence(own, 2 * m - p, logdet, float(np.log(area[~used]).sum()), n - m)
    sets: list[tuple[float, Mask]] = []

    def consider(out: tuple[int, ...], back: tuple[int, ...], total: float, larger: float) -> None:
        size = m - len(out) + len(back)
        if 2 * size - p < 1 or size <= 4 or not np.isfinite(total):
            return
        other = used.copy()
        other[list(out)], other[list(back)] = False, True
        value = _log_evidence(max(total, 0.0), 2 * size - p, larger, float(np.log(area[~other]).sum()), n - size)
        if value > evidence + np.log(NEGLIGIBLE):
            sets.append((value, other))

    inner, outer = np.flatnonzero(used).tolist(), np.flatnonzero(~used).tolist()
    checked = np.isfinite(squared)
    gain = np.full(n, np.nan)
    gain[checked] = np.linalg.slogdet(deletion.expected[checked])[1] - np.linalg.slogdet(solution.noise[checked])[1]
    for k in inner:
        consider((k,), (), own - squared[k], logdet - gain[k])
    for i in outer:
        consider((), (i,), own + squared[i], logdet + gain[i])
        if n <= FEW_PAIRS:
            for k in inner:
                if (swapped := _swapped(problem, solution, used, i, k)) is not None:
                    consider((k,), (i,), *swapped)
    sets.sort(key=lambda one: -one[0])
    return iter([mask for _, mask in sets[:MOST_CHOICES]])


def _swapped(problem: Problem, solution: Solution, used: Mask, back: int, out: int) -> tuple[float, float] | None:
    """The sum of squares, and the determinant of the normal equations, with one pair in place of another."""
    both = used.copy()
    both[back], both[out] = True, False
    known, gap = solution.slopes[both], solution.residual[both]
    if not (np.isfinite(known).all() and np.isfinite(gap).all()):
        return None
    trust = np.linalg.inv(solution.noise[both])
    normal = np.einsum("nip,nij,njq->pq", known, trust, known)
    spread = inverse(normal)
    if not np.isfinite(spread).all():
        return None
    right = np.einsum("nip,nij,nj->p", known, trust, gap)
    total = float(np.einsum("ni,nij,nj->", gap, trust, gap) - right @ spread @ right)
    return total, _logdet(normal)


def _evidence(solution: Solution, problem: Problem, mask: Mask) -> float:
    """Logarithm of how probable a choice of pairs is, but for a constant."""
    size = int(mask.sum())
    area = float(np.log(_areas(solution, problem)[~mask]).sum())
    total = float(squares(solution)[mask].sum()) - assumed_lens(solution, problem, mask).explained
    return _log_evidence(max(total, 0.0), 2 * size - problem.unknowns, _logdet(solution.normal), area, len(mask) - size)


def _log_evidence(total: float, redundancy: int, logdet: float, log_area: float, wrong: int) -> float:
    """Of residuals of unknown scatter with their parameters integrated out, and of wrong pixels anywhere around."""
    from scipy.special import gammaln

    freedom = CLICKS_FREEDOM + redundancy
    fit = gammaln(freedom / 2) - redundancy / 2 * np.log(np.pi * CLICKS_FREEDOM)
    fit -= freedom / 2 * np.log1p(total / CLICKS_FREEDOM)
    return float(fit - logdet / 2 + wrong * np.log(PRIOR_WRONG / (1 - PRIOR_WRONG)) - log_area)


def _areas(solution: Solution, problem: Problem) -> Array:
    """(n,) where a wrong pixel may lie, in areas of the pairs' own scatter."""
    around = np.pi * (WRONG_WITHIN * np.hypot(*solution.camera.size)) ** 2
    return np.asarray(around / np.sqrt(np.linalg.det(solution.noise)), dtype=np.float64)


def _logdet(normal: Array) -> float:
    return float(np.linalg.slogdet(normal)[1])


def _apart(one: Camera, other: Camera, problem: Problem) -> Array:
    """(p,) the parameters of another camera minus those of one."""
    lens = np.linalg.lstsq(problem.basis, other.intrinsics - one.intrinsics, rcond=None)[0]
    turn = vector_from_rotation(other.rotation @ one.rotation.T)
    return np.concatenate([turn, other.position - one.position, lens])

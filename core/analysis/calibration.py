# SPDX-License-Identifier: GPL-3.0-or-later
"""Fit chosen parameters of one impact model to measured impacts, and say how far the result can be trusted."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal, get_args

import numpy as np

from ..errors import InputError
from ..impact_models.machinery.parameters import Value
from ..impact_models.registry import find_model
from ..progress import Progress, silent
from ..reconstruction.impact import Impacts
from ..vectors import Array, Indices
from .clouds import OBJECTIVE, Contest, Target, make_contest, measured_target
from .courses import Spin, find_courses
from .estimation import Estimate, Estimation, Question, ask, check_effort, estimate, paired_gain
from .fitting import COARSE, descend_from_best, watched
from .verdicts import holdout_verdict, use_verdict

HoldOut = Literal["trajectory", "none"]
FOLDS = 5


@dataclass(frozen=True)
class Fold:
    """A part of the trajectories that was predicted by a fit to the others.

    Attributes
    ----------
    trajectories : names; with the site's, when there are several sites.
    impacts : how many of theirs count.
    default, fitted : mean scores of them, with the default settings and with those fitted to the others.
    """

    trajectories: tuple[str, ...]
    impacts: int
    default: float
    fitted: float


@dataclass(frozen=True, eq=False)
class Calibration:
    """Fitted parameters of one model.

    Attributes
    ----------
    model : name.
    estimates : the fitted parameters, in the order asked for.
    settings : all parameters of the model, as `compare` takes them.
    objective : what was made least.
    impacts, trajectories : how many count.
    default_score, fitted_score : mean scores over all impacts; no unit, 0 is perfect.
    held_out_score : mean score of impacts in trajectories that were not fitted to; NaN when none were held out.
    blind_score : of a guess that ignores the incident state; see `Target.blind_score`.
    folds : of the hold-out.
    names, correlation : fitted numbers and their (k, k) correlation over the resamples.
    replicates, resamples, seed, spin : what it was computed with.
    verdict : sentences.
    """

    model: str
    estimates: tuple[Estimate, ...]
    settings: Mapping[str, Value]
    objective: str
    impacts: int
    trajectories: int
    default_score: float
    fitted_score: float
    held_out_score: float
    blind_score: float
    folds: tuple[Fold, ...]
    names: tuple[str, ...]
    correlation: Array
    replicates: int
    resamples: int
    seed: int
    spin: str
    verdict: tuple[str, ...]


def calibrate(
    impacts: Impacts,
    model: str,
    fit: Sequence[str],
    *,
    fixed: Mapping[str, object] | None = None,
    starts: int = 4,
    seed: int = 0,
    replicates: int = 16,
    resamples: int = 200,
    holdout: HoldOut = "trajectory",
    spin: Spin = "rolling",
    radius_m: float | None = None,
    progress: Progress = silent,
) -> Calibration:
    """Fit chosen parameters of one model to measured impacts.

    The objective is the mean energy score of the outcomes (v_N2, v_T2, θ_dev); see `clouds`. Numbers are fitted within
    the ranges of their specifications; choices and switches by trying all.

    Parameters
    ----------
    model : name.
    fit : names of the parameters to fit.
    fixed : other parameters that are not to have their default.
    starts : descents, from the best places of a scan of the whole range.
    replicates : draws of a random model for each impact, the same for all parameters tried.
    resamples : of the trajectories, for the intervals.
    holdout : "trajectory" also predicts each fifth of the trajectories from the others.
    spin, radius_m : as for `compare`.

    Raises
    ------
    InputError : unknown model or parameter, value out of range, too few impacts or none that can be used.

    Notes
    -----
    Intervals are 95 % percentiles over resampled trajectories, expanded for their number (Hesterberg 2015): impacts of
    one trajectory are not independent. With fewer than five trajectories impacts are resampled, which is too sure of
    itself; the verdict says so. The noise of `replicates` draws adds about 1/replicates to the variance of an estimate.
    """
    chosen = find_model(model)
    question = ask(chosen, fit, fixed)
    check_effort(starts, seed, replicates, resamples)
    _check(holdout)
    courses = find_courses(impacts, spin, radius_m)
    target = measured_target(impacts, courses)
    contest = make_contest(chosen, impacts, target, replicates, seed)
    found = estimate(
        question,
        contest,
        fit,
        starts=starts,
        seed=seed,
        resamples=resamples,
        progress=progress,
    )
    counts = target.counts
    total = float(counts.sum())
    held: Array | None = None
    parts: tuple[Fold, ...] = ()
    if holdout == "trajectory" and target.clusters > 1:
        held, members = _hold_out(question, contest, found, seed, progress)
        parts = _folds(impacts, target, members, held, found.default_sums)
    return Calibration(
        model=chosen.name,
        estimates=found.estimates,
        settings=found.settings,
        objective=OBJECTIVE,
        impacts=int(total),
        trajectories=target.trajectories,
        default_score=float(found.default_sums.sum()) / total,
        fitted_score=float(found.sums.sum()) / total,
        held_out_score=float(held.sum()) / total if held is not None else np.nan,
        blind_score=target.blind_score(chance=chosen.is_random),
        folds=parts,
        names=found.names,
        correlation=found.correlation,
        replicates=replicates if chosen.is_random else 0,
        resamples=resamples,
        seed=seed,
        spin=spin,
        verdict=_verdict(target, found, held, chosen.is_random),
    )


def _hold_out(
    question: Question, contest: Contest, found: Estimation, seed: int, progress: Progress
) -> tuple[Array, list[Indices]]:
    """(clusters,) sums of scores, each from a fit without its part; the parts."""
    counts = contest.target.counts
    n = counts.size
    members = np.array_split(np.random.default_rng([seed, 2]).permutation(n), min(FOLDS, n))
    held = np.empty(n)
    for k, part in enumerate(members):
        say = partial(progress, "Predicting trajectories that were held out", k, len(members))
        weights = np.ones(n)
        weights[part] = 0.0
        best, least = found.sums, np.inf
        for i, one in enumerate(found.fits):
            sums = watched(question.sums(contest, i), say)
            place = descend_from_best(sums, counts, weights, one.scanned, one.scanned_sums, 2, COARSE)
            here = sums(place)
            if weights @ here < least:
                best, least = here, float(weights @ here)
        held[part] = best[part]
    return held, members


def _folds(impacts: Impacts, target: Target, members: list[Indices], held: Array, default: Array) -> tuple[Fold, ...]:
    row, counts = target.courses.row, target.counts
    several = np.unique(impacts.site).size > 1
    site, trajectory = impacts.site[row].tolist(), impacts.trajectory[row].tolist()
    label = [f"{a}/{b}" if several else str(b) for a, b in zip(site, trajectory, strict=True)]
    folds = []
    for part in members:
        inside = np.flatnonzero(np.isin(target.cluster, part))
        n = float(counts[part].sum())
        names = tuple(dict.fromkeys(label[i] for i in inside))
        folds.append(Fold(names, int(n), float(default[part].sum()) / n, float(held[part].sum()) / n))
    return tuple(folds)


def _verdict(target: Target, found: Estimation, held: Array | None, chance: bool) -> tuple[str, ...]:
    counts = target.counts
    total = float(counts.sum())
    sentences, blind = [], target.blind_score(chance=chance)
    unsure = [one.name for one in found.estimates if one.verdict.startswith("The data cannot tell")]
    if unsure:
        sentences.append(
            f"These impacts cannot tell {', '.join(unsure)}: set a value, or fit fewer parameters together."
        )
    if held is not None:
        gain, error = paired_gain(found.default_sums, held, counts)
        default, score = float(found.default_sums.sum()) / total, float(held.sum()) / total
        better = int((held < found.default_sums).sum())
        sentences.append(holdout_verdict(default, score, gain, error, better, target.clusters))
        sentences.append(use_verdict(score, blind, chance=chance))
    else:
        sentences.append(use_verdict(float(found.sums.sum()) / total, blind, chance=chance))
    if not target.by_trajectory:
        sentences.append(
            f"With {target.trajectories} trajector{'y' if target.trajectories == 1 else 'ies'} single impacts were "
            "resampled as if independent: the intervals are likely too narrow, the hold-out too kind."
        )
    return tuple(sentences)


def _check(holdout: str) -> None:
    if holdout not in get_args(HoldOut):
        raise InputError(f"There is no hold-out {holdout!r}", advice=f"Choose one of {', '.join(get_args(HoldOut))}")

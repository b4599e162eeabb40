# SPDX-License-Identifier: GPL-3.0-or-later
"""Fit chosen parameters of one impact model to measured impacts, and say how far the result can be trusted."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..impact_models.machinery.base import ImpactModel
from ..impact_models.registry import find_model
from ..progress import Progress, silent
from ..reconstruction.impact import Impacts
from ..remarks import Remark
from ..vectors import Array, Indices
from .clouds import OBJECTIVE, Contest, Target, make_contest, measured_target
from .courses import find_courses
from .estimation import Estimation, FitOptions, FittedModel, Question, ask, estimate, paired_gain
from .fitting import COARSE, descend_from_best, watched
from .verdicts import about_holdout, about_use

FOLDS = 5
USUAL = ("rn", "rt", "rn_exponent")
"""Parameters that are usually fitted, where a model has them."""


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
class Calibration(FittedModel):
    """Parameters of a model, fitted to measured impacts.

    Attributes
    ----------
    objective : what was made least.
    default_score, fitted_score : mean scores over all impacts; no unit, 0 is perfect.
    held_out_score : mean score of impacts in trajectories that were not fitted to; NaN when none were held out.
    folds : of the hold-out.
    """

    objective: str
    default_score: float
    fitted_score: float
    held_out_score: float
    folds: tuple[Fold, ...]


def calibrate(
    impacts: Impacts,
    model: str,
    fit: Sequence[str],
    fixed: Mapping[str, object] | None = None,
    options: FitOptions | None = None,
    *,
    holdout: bool = True,
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
    holdout : whether each fifth of the trajectories is also predicted from the others.

    Raises
    ------
    InputError : unknown model or parameter, value out of range, too few impacts or none that can be used.

    Notes
    -----
    Intervals are 95 % percentiles over resampled trajectories, expanded for their number (Hesterberg 2015): impacts of
    one trajectory are not independent. With fewer than five trajectories impacts are resampled, which is too sure of
    itself; a remark says so. The noise of `replicates` draws adds about 1/replicates to the variance of an estimate.
    """
    options = options or FitOptions()
    chosen = find_model(model)
    question = ask(chosen, fit, fixed)
    courses = find_courses(impacts, options.spin, options.radius_m)
    target = measured_target(impacts, courses)
    contest = make_contest(chosen, impacts, target, options.replicates, options.seed)
    found = estimate(question, contest, fit, options, progress)
    held: Array | None = None
    parts: tuple[Fold, ...] = ()
    if holdout and target.clusters > 1:
        held, members = _hold_out(question, contest, found, options.seed, progress)
        parts = _folds(impacts, target, members, held, found.default_sums)
    total = float(target.counts.sum())
    return Calibration(
        model=chosen.name,
        estimates=found.estimates,
        settings=found.settings,
        impacts=int(total),
        trajectories=target.trajectories,
        remarks=tuple(_remarks(target, found, held, contest.scatters(chosen.numbers(found.settings)))),
        objective=OBJECTIVE,
        default_score=float(found.default_sums.sum()) / total,
        fitted_score=float(found.sums.sum()) / total,
        held_out_score=float(held.sum()) / total if held is not None else np.nan,
        folds=parts,
    )


def usual_names(model: ImpactModel) -> tuple[str, ...]:
    """The parameters of a model that are usually fitted, or else its first one."""
    names = [spec.name for spec in model.parameters]
    return tuple(name for name in names if name in USUAL) or tuple(names[:1])


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


def _remarks(target: Target, found: Estimation, held: Array | None, chance: bool) -> Iterator[Remark]:
    unsure = [one.name for one in found.estimates if not one.is_determined]
    if unsure:
        text = f"These impacts cannot tell {', '.join(unsure)}: set a value, or fit fewer parameters together."
        yield Remark(text, "advice", "parameters")
    total, blind = float(target.counts.sum()), target.blind_score(chance=chance)
    score = float((found.sums if held is None else held).sum()) / total
    if held is not None:
        gain, error = paired_gain(found.default_sums, held, target.counts)
        better = int((held < found.default_sums).sum())
        yield about_holdout(float(found.default_sums.sum()) / total, score, gain, error, better, target.clusters)
    yield about_use(score, blind, chance=chance)
    if not target.by_trajectory:
        text = (
            f"With {target.trajectories} trajector{'y' if target.trajectories == 1 else 'ies'} single impacts were "
            "resampled as if independent: the intervals are likely too narrow, the hold-out too kind."
        )
        yield Remark(text, "warning", "trajectories")

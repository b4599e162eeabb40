# SPDX-License-Identifier: GPL-3.0-or-later
"""Equivalent parameters: those with which one model behaves most like another, on the same impacts.

For people who use two programs (Noël et al. 2018). The objective is that of `clouds`, the first model's draws taking
the place of the measurements: twice the score less the first model's own scatter is the squared energy distance
D² = 2E|X − Y| − E|X − X′| − E|Y − Y′| between the two clouds of each impact (Székely & Rizzo 2013), 0 only where they
are the same.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..impact_models.machinery.parameters import Value
from ..impact_models.registry import find_model
from ..progress import Progress, silent
from ..reconstruction.impact import Impacts
from ..vectors import Array
from .clouds import Target, cloud_of, make_contest, make_target
from .courses import Spin, find_courses
from .estimation import Estimate, ask, check_effort, estimate
from .verdicts import likeness_verdict

OTHER_CHANCE = 1
"""Added to the seed for the second model: shared draws would make equal models look more than equal."""


@dataclass(frozen=True, eq=False)
class Equivalence:
    """Parameters of a second model that make it behave like a first.

    Attributes
    ----------
    model, settings : the first model and all its parameters.
    other : the second model.
    estimates : its fitted parameters; the interval says how they vary with the trajectories they are found on.
    other_settings : all its parameters, as `compare` takes them.
    impacts, trajectories : on how many.
    default_distance, distance : energy distance of the two, with the second model's defaults and as fitted; in robust
        standard deviations of the first model's outcomes.
    rms : root mean square difference of the two models' means: v_N2 [m/s], v_T2 [m/s], deviation [°].
    names, correlation : fitted numbers and their (k, k) correlation over the resamples.
    replicates, resamples, seed, spin : what it was computed with.
    verdict : sentences.
    """

    model: str
    settings: Mapping[str, Value]
    other: str
    estimates: tuple[Estimate, ...]
    other_settings: Mapping[str, Value]
    impacts: int
    trajectories: int
    default_distance: float
    distance: float
    rms: tuple[float, float, float]
    names: tuple[str, ...]
    correlation: Array
    replicates: int
    resamples: int
    seed: int
    spin: str
    verdict: tuple[str, ...]


def equivalent(
    impacts: Impacts,
    model_a: str,
    parameters_a: Mapping[str, object] | None,
    model_b: str,
    fit: Sequence[str],
    *,
    fixed: Mapping[str, object] | None = None,
    starts: int = 4,
    seed: int = 0,
    replicates: int = 16,
    resamples: int = 100,
    spin: Spin = "rolling",
    radius_m: float | None = None,
    progress: Progress = silent,
) -> Equivalence:
    """Parameters of `model_b` that behave most like `model_a` with `parameters_a`.

    Only the incident states of the impacts are used, not what was measured after them.

    Parameters
    ----------
    parameters_a : those of the first model that are not to have their default.
    fit, fixed : parameters of the second model to find, and others that are not to have their default.
    starts, seed, replicates, resamples, spin, radius_m, progress : as for `calibrate`.

    Raises
    ------
    InputError : unknown model or parameter, value out of range, too few impacts or none that can be used.
    """
    a, b = find_model(model_a), find_model(model_b)
    settings = a.settings(parameters_a)
    question = ask(b, fit, fixed)
    check_effort(starts, seed, replicates, resamples)
    courses = find_courses(impacts, spin, radius_m)
    cloud = cloud_of(a, impacts, courses, settings, replicates, seed)
    target = make_target(courses, cloud, np.asarray(np.isfinite(cloud).all(axis=(0, 2))))
    contest = make_contest(b, impacts, target, replicates, seed + OTHER_CHANCE)
    found = estimate(question, contest, fit, starts=starts, seed=seed, resamples=resamples, progress=progress)
    own, total = _own_scatter(target), float(target.counts.sum())
    distances = [
        float(np.sqrt(max(2 * (float(sums.sum()) - own) / total, 0.0))) for sums in (found.default_sums, found.sums)
    ]
    means = [cloud.mean(axis=0), contest.points(b.numbers(found.settings)).mean(axis=0) * target.scale]
    across = np.sqrt(np.mean((means[0] - means[1])[target.counted] ** 2, axis=0))
    rms = float(across[0]), float(across[1]), float(np.degrees(across[2]))
    # Like with like: a distance of two points is D²/2, that of two outcomes of the first model twice its scatter.
    nearness = (float(found.sums.sum()) - own) / total
    return Equivalence(
        model=a.name,
        settings=settings,
        other=b.name,
        estimates=found.estimates,
        other_settings=found.settings,
        impacts=int(total),
        trajectories=target.trajectories,
        default_distance=distances[0],
        distance=distances[1],
        rms=rms,
        names=found.names,
        correlation=found.correlation,
        replicates=replicates if a.is_random or b.is_random else 0,
        resamples=resamples,
        seed=seed,
        spin=spin,
        verdict=(likeness_verdict(max(nearness, 0.0), 2 * target.blind_score(chance=True), rms),),
    )


def _own_scatter(target: Target) -> float:
    """Sum of ½E|Y − Y′| over the impacts that count."""
    from .cloud_kernels import own_scatters

    scatters = np.empty(target.points.shape[1])
    own_scatters(target.points, scatters)
    return float(scatters[target.counted].sum())

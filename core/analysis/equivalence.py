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
from .clouds import Target, cloud_of, make_contest, make_target
from .courses import find_courses
from .estimation import FitOptions, FittedModel, ask, estimate
from .verdicts import about_likeness

OTHER_CHANCE = 1
"""Added to the seed for the second model: shared draws would make equal models look more than equal."""


@dataclass(frozen=True, eq=False)
class Equivalence(FittedModel):
    """Parameters of a model that make it behave like another; the intervals say how they vary with the trajectories.

    Attributes
    ----------
    source, source_settings : the model that is imitated, and all its parameters.
    default_distance, distance : energy distance of the two, with the defaults and as fitted; in robust standard
        deviations of the outcomes that are imitated.
    rms : root mean square difference of the two models' means: v_N2 [m/s], v_T2 [m/s], deviation [°].
    """

    source: str
    source_settings: Mapping[str, Value]
    default_distance: float
    distance: float
    rms: tuple[float, float, float]


def equivalent(
    impacts: Impacts,
    source: str,
    parameters: Mapping[str, object] | None,
    model: str,
    fit: Sequence[str],
    fixed: Mapping[str, object] | None = None,
    options: FitOptions | None = None,
    *,
    progress: Progress = silent,
) -> Equivalence:
    """Parameters of `model` with which it behaves most like `source` with `parameters`.

    Only the incident states of the impacts are used, not what was measured after them.

    Parameters
    ----------
    parameters : those of `source` that are not to have their default.
    fit, fixed : parameters of `model` to find, and others that are not to have their default.

    Raises
    ------
    InputError : unknown model or parameter, value out of range, too few impacts or none that can be used.
    """
    options = options or FitOptions()
    a, b = find_model(source), find_model(model)
    settings = a.settings(parameters)
    question = ask(b, fit, fixed)
    courses = find_courses(impacts, options.spin, options.radius_m)
    cloud = cloud_of(a, impacts, courses, settings, options.replicates, options.seed)
    target = make_target(courses, cloud, np.asarray(np.isfinite(cloud).all(axis=(0, 2))))
    contest = make_contest(b, impacts, target, options.replicates, options.seed + OTHER_CHANCE)
    found = estimate(question, contest, fit, options, progress)
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
        model=b.name,
        estimates=found.estimates,
        settings=found.settings,
        impacts=int(total),
        trajectories=target.trajectories,
        remarks=(about_likeness(max(nearness, 0.0), 2 * target.blind_score(chance=True), rms),),
        source=a.name,
        source_settings=settings,
        default_distance=distances[0],
        distance=distances[1],
        rms=rms,
    )


def _own_scatter(target: Target) -> float:
    """Sum of ½E|Y − Y′| over the impacts that count."""
    from .cloud_kernels import own_scatters

    scatters = np.empty(target.points.shape[1])
    own_scatters(target.points, scatters)
    return float(scatters[target.counted].sum())

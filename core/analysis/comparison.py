# SPDX-License-Identifier: GPL-3.0-or-later
"""All models on all measured impacts, with the incident conditions imposed (Noël et al. 2018, § 5)."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import InputError
from ..impact_models.machinery.base import ImpactModel
from ..impact_models.machinery.measured import MeasuredRebounds
from ..impact_models.machinery.parameters import Value
from ..impact_models.registry import COMPARED, find_model
from ..reconstruction.impact import Impacts, apparent
from ..vectors import Array, Indices, Mask, Names
from .courses import Courses, Spin, find_courses
from .measured_rebounds import chain_from_others, measured_rebounds

Parameters = Mapping[str, Mapping[str, object]]
"""Model → parameter → value, for those that are not to have their default."""

MOST_PREDICTIONS = 20_000_000
"""A prediction takes about 0.2 kB while it is made."""


@dataclass(frozen=True, eq=False)
class Predictions:
    """What k models make of m impacts, in 1 + R runs each: run 0 is the model's mean, the others are its replicates.

    Attributes
    ----------
    models : k names.
    row : (m,) row of each impact in the table of impacts.
    site, trajectory, impact : (m,) names and number of the impacts.
    v2, omega2 : (k, 1 + R, m, 3) restituted velocity [m/s] and angular velocity [rad/s].
    omega1 : (k, 1 + R, m, 3) incident angular velocity that was imposed [rad/s]; NaN when read from a table.
    vn2, vt2 : (k, 1 + R, m) norms of the normal and tangential parts of v2 [m/s].
    rn, rt, r, theta_dev : (k, 1 + R, m) apparent coefficients [-] and deviation angle [rad], as in `Impacts`.
    into_ground : (k, 1 + R, m) whether v2 points into the ground.
    settings : model → all its parameters; empty when read from a table.
    spin, seed : what they were computed with.
    skipped : (row, reason) of the impacts that could not be compared.
    measured : what the models that draw from measured impacts drew from; None without such a model. No impact is
        predicted from its own trajectory.
    runs : column → (m,) which run of a simulation each impact is of, as in `Impacts.runs`.
    beyond : (m,) whether an impact is beyond the conditions that these were measured under; None without such a model.
    """

    models: tuple[str, ...]
    row: Indices
    site: Names
    trajectory: Names
    impact: Indices
    v2: Array
    omega2: Array
    omega1: Array
    vn2: Array
    vt2: Array
    rn: Array
    rt: Array
    r: Array
    theta_dev: Array
    into_ground: Mask
    settings: Mapping[str, Mapping[str, Value]] = field(default_factory=dict)
    spin: str = ""
    seed: int = 0
    skipped: tuple[tuple[int, str], ...] = ()
    measured: MeasuredRebounds | None = None
    beyond: Mask | None = None
    runs: Mapping[str, Names] = field(default_factory=dict)

    @property
    def replicates(self) -> int:
        """R, the number of runs with chance."""
        return self.v2.shape[1] - 1

    def index(self, model: str) -> int:
        """Place of a model on the first axis.

        Raises
        ------
        InputError : it is not among them.
        """
        if model not in self.models:
            raise InputError(f"{model} was not compared", advice=f"There are {', '.join(self.models)}")
        return self.models.index(model)


def compare(
    impacts: Impacts,
    models: Sequence[str] = COMPARED,
    parameters: Parameters | None = None,
    *,
    replicates: int = 0,
    seed: int = 0,
    spin: Spin = "rolling",
    radius_m: float | None = None,
    measured: MeasuredRebounds | None = None,
) -> Predictions:
    """All models on all measured impacts.

    Parameters
    ----------
    models : names.
    replicates : runs with chance, besides the mean.
    seed : not negative. A trajectory's random numbers depend on it, on the model and on the names of site and
        trajectory (and run): not on the other models and trajectories, nor on their order, and with more replicates the
        first ones stay.
    spin, radius_m : see `find_courses`.
    measured : what a model that draws from measured impacts draws from, None for the compared impacts themselves. The
        impacts of a trajectory are always drawn from those of the others.

    Raises
    ------
    InputError : unknown model or parameter, value out of range, too few measured impacts to draw from, and what
        `find_courses` refuses.
    """
    courses = find_courses(impacts, spin, radius_m)
    return predict(impacts, courses, models, parameters, replicates=replicates, seed=seed, measured=measured)


def predict(
    impacts: Impacts,
    courses: Courses,
    models: Sequence[str] = COMPARED,
    parameters: Parameters | None = None,
    *,
    replicates: int = 0,
    seed: int = 0,
    measured: MeasuredRebounds | None = None,
    draws: Mapping[str, Array] | None = None,
) -> Predictions:
    """As `compare`, for courses that were found once: what a slider or a calibration calls again and again.

    Parameters
    ----------
    draws : model → its `random_numbers` for these replicates and this seed, where they were drawn before.
    """
    if replicates < 0 or seed < 0:
        raise InputError("The number of replicates and the seed are whole numbers of zero or more")
    if (1 + replicates) * len(models) * len(courses) > MOST_PREDICTIONS:
        raise InputError(
            f"{replicates} replicates of {len(courses)} impacts and {len(models)} models are too many for the memory",
            advice=f"Stay below {MOST_PREDICTIONS} predictions",
        )
    for name in parameters or {}:
        find_model(name)
    models = tuple(dict.fromkeys(models))
    chosen = [find_model(name) for name in models]
    settings = {model.name: model.settings((parameters or {}).get(model.name)) for model in chosen}

    site, trajectory = impacts.site[courses.row], impacts.trajectory[courses.row]
    shape = (len(models), 1 + replicates, len(courses))
    omega1, v2, omega2 = (np.empty((*shape, 3)) for _ in range(3))
    beyond = None
    if any(model.draws_from_impacts for model in chosen):
        measured = measured_rebounds(impacts) if measured is None else measured
    else:
        measured = None
    for i, model in enumerate(chosen):
        uniform = (draws or {}).get(model.name)
        if uniform is None:
            uniform = random_numbers(model, courses, impacts, replicates, seed)
        if measured is not None and model.draws_from_impacts:
            found = chain_from_others(model, settings[model.name], measured, courses, site, trajectory, uniform)
            omega1[i], v2[i], omega2[i], beyond = found
        else:
            numbers = model.numbers(settings[model.name])
            omega1[i], v2[i], omega2[i] = model.chain(courses.incident, courses.follows, numbers, uniform)

    state = courses.incident
    v1, normal = (
        np.ascontiguousarray(np.broadcast_to(rows, v2.shape)).reshape(-1, 3) for rows in (state.velocity, state.normal)
    )
    seen = apparent(v1, v2.reshape(-1, 3), normal)
    return Predictions(
        models=models,
        row=courses.row,
        site=site,
        trajectory=trajectory,
        impact=impacts.impact[courses.row],
        v2=v2,
        omega2=omega2,
        omega1=omega1,
        vn2=seen.vn2.reshape(shape),
        vt2=seen.vt2.reshape(shape),
        rn=seen.rn.reshape(shape),
        rt=seen.rt.reshape(shape),
        r=seen.r.reshape(shape),
        theta_dev=seen.theta_dev.reshape(shape),
        into_ground=(seen.escape < 0).reshape(shape),
        settings=settings,
        spin=courses.spin,
        seed=seed,
        skipped=courses.skipped,
        measured=measured,
        beyond=beyond,
        runs={name: column[courses.row] for name, column in impacts.runs.items()},
    )


def thinned(predictions: Predictions, most: int) -> Predictions:
    """At most so many of the impacts, evenly spaced."""
    m = predictions.row.size
    if m <= most:
        return predictions
    kept = np.linspace(0, m - 1, most).round().astype(np.intp)
    rows = ("row", "site", "trajectory", "impact")
    runs = ("v2", "omega2", "omega1", "vn2", "vt2", "rn", "rt", "r", "theta_dev", "into_ground")
    return replace(
        predictions,
        **{name: getattr(predictions, name)[kept] for name in rows},
        **{name: getattr(predictions, name)[:, :, kept] for name in runs},
        beyond=None if predictions.beyond is None else predictions.beyond[kept],
        runs={name: column[kept] for name, column in predictions.runs.items()},
    )


def random_numbers(model: ImpactModel, courses: Courses, impacts: Impacts, replicates: int, seed: int) -> Array:
    """(1 + replicates, m, draws) uniform numbers, one stream for each fall; the first run is NaN, the mean.

    A model without chance has its mean alone: (1, m, 0).
    """
    draws = np.full((1 + replicates if model.is_random else 1, len(courses), model.draws), np.nan)
    if model.is_random and replicates:
        runs = impacts.runs.values()
        for start, stop in zip(courses.first[:-1], courses.first[1:], strict=True):
            row = courses.row[start]
            run = (str(column[row]) for column in runs if column[row] != "")
            name = "\0".join((model.name, str(impacts.site[row]), str(impacts.trajectory[row]), *run))
            words = np.frombuffer(hashlib.sha256(name.encode()).digest(), dtype="<u4")
            stream = np.random.default_rng([seed, *words.tolist()])
            draws[1:, start:stop] = stream.random((replicates, stop - start, model.draws))
    return draws

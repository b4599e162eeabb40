# SPDX-License-Identifier: GPL-3.0-or-later
"""The one objective of all fits: how far a model's cloud of outcomes is from what it should be, impact by impact.

Each outcome is a point (v_N2, v_T2, θ_dev), the axes divided by the scatter of the target values. The score of one
impact is the energy score (Gneiting & Raftery 2007, eq. 22)

    ES = E|X − y| − ½ E|X − X′|

of the model's outcomes X, X′ against the measured y. It is strictly proper: on average only the true distribution has
the least score, so that means *and* standard deviations of random parameters can be fitted; a model gains nothing by
scattering too little or too much. For a model without chance it is |x − y|, the distance itself and not its square,
which one wild measurement cannot pull away. Random numbers are common to all parameters that are tried.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..constants import IQR_PER_SD
from ..errors import InputError
from ..impact_models.machinery.base import ImpactModel
from ..impact_models.registry import FORMULAS
from ..reconstruction.impact import Impacts
from ..vectors import Array, Indices, Mask
from .comparison import random_numbers
from .courses import Courses

OBJECTIVE = (
    "mean energy score of (v_N2, v_T2, deviation), each in units of its robust standard deviation over the impacts, "
    "with common random numbers; for a model without chance it is the mean distance"
)
MOST_POOLED = 2000
WEISZFELD_STEPS = 50
HOPELESS = 1e9
FEWEST_CLUSTERS = 5
"""With fewer trajectories their resampling says nothing, and single impacts are resampled."""


@dataclass(frozen=True, eq=False)
class Target:
    """Where outcomes should lie, for m impacts.

    Attributes
    ----------
    courses : the impacts as the models meet them.
    points : (K, m, 3) v_N2, v_T2, θ_dev in units of `scale`: K = 1 measurement, or K draws of another model.
    scale : (3,) [m/s, m/s, rad].
    counted : (m,) impacts that count; the others only hand on their spin.
    cluster : (m,) number of the trajectory, or of the impact when there are few trajectories: what is resampled.
    clusters, trajectories : how many there are among those that count.
    """

    courses: Courses
    points: Array
    scale: Array
    counted: Mask
    cluster: Indices
    clusters: int
    trajectories: int

    @property
    def by_trajectory(self) -> bool:
        """Whether a cluster is a trajectory."""
        return self.trajectories >= FEWEST_CLUSTERS

    @property
    def counts(self) -> Array:
        """(clusters,) impacts that count."""
        return np.bincount(self.cluster[self.counted], minlength=self.clusters).astype(np.float64)

    def blind_score(self, *, chance: bool) -> float:
        """What a model must beat: the score, whatever the incident state, of the same outcome for all impacts (the one
        with the least), or with `chance` of any of their outcomes drawn at random.
        """
        from .cloud_kernels import own_scatters

        pooled = self.points[:, self.counted].reshape(-1, 1, 3)[:MOST_POOLED]
        if chance:
            scatter = np.empty(1)
            own_scatters(pooled, scatter)
            return float(scatter[0])
        centre = np.median(pooled, axis=0)
        for _ in range(WEISZFELD_STEPS):
            away = np.maximum(np.linalg.norm(pooled - centre, axis=-1, keepdims=True), 1e-12)
            centre = (pooled / away).sum(axis=0) / (1.0 / away).sum(axis=0)
        return float(np.linalg.norm(pooled - centre, axis=-1).mean())


def measured_target(impacts: Impacts, courses: Courses) -> Target:
    """The measured outcomes.

    Raises
    ------
    InputError : no impact is left.
    """
    row = courses.row
    values = np.stack([impacts.vn2[row], impacts.vt2[row], impacts.theta_dev[row]], axis=1)
    known = np.asarray(np.isfinite(values).all(axis=1))
    if not known.any():
        raise InputError(
            f"None of the {len(impacts)} impacts can be used: {len(courses.skipped)} cannot be compared, "
            f"{row.size} have no restituted velocity",
            advice="An impact needs both velocities and the normal: reconstruct more than two impacts of a trajectory",
        )
    return make_target(courses, values[None], known)


def make_target(courses: Courses, values: Array, counted: Mask) -> Target:
    """From values (K, m, 3) in m/s, m/s and rad."""
    first, third = np.quantile(values[:, counted].reshape(-1, 3), [0.25, 0.75], axis=0)
    scale = np.where(third > first, (third - first) / IQR_PER_SD, 1.0)
    number = np.repeat(np.arange(courses.first.size - 1), np.diff(courses.first))
    trajectories = np.unique(number[counted]).size
    of = number if trajectories >= FEWEST_CLUSTERS else np.arange(len(courses))
    present, packed = np.unique(of[counted], return_inverse=True)
    cluster = np.full(len(courses), -1, dtype=np.intp)
    cluster[counted] = packed
    return Target(
        courses,
        np.ascontiguousarray(values / scale),
        scale,
        counted,
        cluster,
        present.size,
        trajectories,
    )


@dataclass(frozen=True, eq=False)
class Contest:
    """One model against a target.

    Attributes
    ----------
    draws : (R, m, d) the common random numbers; one run of NaN, the mean, for a model without chance.
    """

    model: ImpactModel
    target: Target
    draws: Array

    def points(self, numbers: Array) -> Array:
        """(R, m, 3) outcomes in units of the target's scale, for the model's parameters as numbers."""
        from .cloud_kernels import points_of

        courses = self.target.courses
        _, v2, _ = self.model.chain(courses.incident, courses.follows, numbers, self.draws)
        points = np.empty_like(v2)
        points_of(v2, courses.incident.velocity, courses.incident.normal, self.target.scale, points)
        return points

    def scatters(self, numbers: Array) -> bool:
        """Whether chance has a part in any outcome with these parameters; CRSP without roughness has none."""
        if len(self.draws) < 2:
            return False
        points = self.points(numbers)[:, self.target.counted]
        return bool((points != points[:1]).any())

    def sums(self, numbers: Array) -> Array:
        """(clusters,) sums of the scores of the impacts that count; `HOPELESS` where the model gives no velocity."""
        from .cloud_kernels import energy_scores

        scores = np.empty(len(self.target.courses))
        energy_scores(self.points(numbers), self.target.points, scores)
        counted = self.target.counted
        sums = np.bincount(self.target.cluster[counted], scores[counted], minlength=self.target.clusters)
        return np.where(np.isfinite(sums), sums, HOPELESS)


def make_contest(model: ImpactModel, impacts: Impacts, target: Target, replicates: int, seed: int) -> Contest:
    """A model against a target, its random numbers those of `compare` with the same seed.

    Raises
    ------
    InputError : the model draws from measured impacts.
    """
    if model.draws_from_impacts:
        raise InputError(
            f"{model.name} has no coefficients to fit: its rebounds are the measured ones",
            advice=f"Choose one of {', '.join(FORMULAS)}; compare {model.name} with other bandwidths by --set",
        )
    courses = target.courses
    draws = random_numbers(model, courses, impacts, replicates, seed)
    return Contest(model, target, draws[1:] if model.is_random else draws)


def cloud_of(
    model: ImpactModel,
    impacts: Impacts,
    courses: Courses,
    parameters: Mapping[str, object],
    replicates: int,
    seed: int,
) -> Array:
    """(R, m, 3) v_N2 [m/s], v_T2 [m/s] and θ_dev [rad] of a model with given parameters."""
    plain = Target(
        courses, np.empty((0, len(courses), 3)), np.ones(3), np.ones(len(courses), np.bool_), courses.row, 0, 0
    )
    return make_contest(model, impacts, plain, replicates, seed).points(model.numbers(parameters))

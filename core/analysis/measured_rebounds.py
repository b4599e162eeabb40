# SPDX-License-Identifier: GPL-3.0-or-later
"""From measured impacts to the table that the model `observed` draws from."""

from collections.abc import Mapping

import numpy as np

from ..errors import InputError
from ..impact_models.machinery.base import ImpactModel, Incident
from ..impact_models.machinery.measured import FEWEST_NEAR, IQR_PER_SD, MeasuredRebounds
from ..impact_models.machinery.parameters import Value
from ..reconstruction.impact import REFUSED, Impacts
from ..vectors import Array, Mask, Names, cross, dot, norm, unit
from .courses import Courses

INCOMPLETE = "without R_N and R_T"
WEIGHED = ("rn", "rt", "theta_dev")
"""Whose standard deviations weigh an impact."""
SAME = 1e-9
"""Relative difference of incident conditions below which two impacts are the same."""


def measured_rebounds(impacts: Impacts) -> MeasuredRebounds:
    """The measured impacts that can be drawn, weighed by their errors.

    Raises
    ------
    InputError : too few are left.

    Notes
    -----
    The weight is 1/(1 + e), e the mean of (σ/s)² over R_N, R_T and θ_dev, σ the impact's standard deviation and s that
    of the quantity over the table (interquartile range/1.349): the worth of a value that is its own scatter plus its
    error. An impact without σ among others with it has their median e; without any σ all weigh 1.
    """
    free, left_out = np.ones(len(impacts), dtype=np.bool_), {}
    for flag in REFUSED:
        left_out[flag] = int((impacts.flags[flag] & free).sum())
        free &= ~impacts.flags[flag]
    normal = unit(impacts.normal)
    approach = -dot(impacts.v1, normal)
    known = impacts.complete & (approach > 0) & np.isfinite(impacts.v2).all(axis=1)
    left_out[INCOMPLETE] = int((free & ~known).sum())
    used = free & known
    v1, v2, normal, approach = impacts.v1[used], impacts.v2[used], normal[used], approach[used]
    tangential = v1 + approach[:, None] * normal
    return MeasuredRebounds(
        site=impacts.site[used],
        trajectory=impacts.trajectory[used],
        theta1=impacts.theta1[used],
        vn1=approach,
        rn=dot(v2, normal) / approach,
        rt=impacts.rt[used],
        turn=np.abs(np.arctan2(dot(v2, cross(normal, tangential)), dot(v2, tangential))),
        weight=_weights(impacts, used),
        left_out={reason: number for reason, number in left_out.items() if number},
    )


def without_own(measured: MeasuredRebounds, site: str, trajectory: str, theta1: Array, vn1: Array) -> MeasuredRebounds:
    """Those of other trajectories: what an impact of this one may be predicted from.

    Parameters
    ----------
    theta1, vn1 : (m,) incident angles [rad] and normal speeds [m/s] of the trajectory's own impacts: one that has an
        impact under the very same conditions is the same trajectory, whatever its name (a database has given it
        another site).

    Raises
    ------
    InputError : too few are left.
    """
    own = (measured.site == site) & (measured.trajectory == trajectory)
    same = (np.abs(measured.theta1 - theta1[:, None]) <= SAME * measured.theta1) & (
        np.abs(measured.vn1 - vn1[:, None]) <= SAME * measured.vn1
    )
    for place in np.flatnonzero(same.any(axis=0) & ~own).tolist():
        own |= (measured.site == measured.site[place]) & (measured.trajectory == measured.trajectory[place])
    try:
        return measured.without(own)
    except InputError as error:
        raise InputError(
            f"{error.problem} for trajectory {trajectory}, which must not be predicted from its own impacts",
            advice=error.advice,
        ) from error


def chain_from_others(
    model: ImpactModel,
    settings: Mapping[str, Value],
    measured: MeasuredRebounds,
    courses: Courses,
    site: Names,
    trajectory: Names,
    draws: Array,
) -> tuple[Array, Array, Array, Mask]:
    """As `ImpactModel.chain`, each trajectory from the impacts of the others; and which impacts are beyond those.

    Parameters
    ----------
    site, trajectory : (m,) names of the impacts of `courses`.

    Raises
    ------
    InputError : too few are left for a trajectory.
    """
    state = courses.incident
    shape = (draws.shape[0], len(courses), 3)
    omega1, v2, omega2 = np.empty(shape), np.empty(shape), np.empty(shape)
    beyond = np.zeros(len(courses), dtype=np.bool_)
    theta1, vn1 = _conditions(state.velocity, state.normal)
    for start, stop in zip(courses.first[:-1].tolist(), courses.first[1:].tolist(), strict=True):
        own = slice(start, stop)
        others = without_own(measured, str(site[start]), str(trajectory[start]), theta1[own], vn1[own])
        incident = Incident(
            state.velocity[own],
            state.normal[own],
            state.angular_velocity[own],
            state.radius_m[own],
            state.mass_kg[own],
        )
        follows = np.where(courses.follows[own] < 0, -1, courses.follows[own] - start)
        numbers = model.numbers(settings, others)
        part = model.chain(incident, follows, numbers, np.ascontiguousarray(draws[:, own]))
        omega1[:, own], v2[:, own], omega2[:, own] = part
        beyond[own] = beyond_measured(others, settings, state.velocity[own], state.normal[own])
    return omega1, v2, omega2, beyond


def beyond_measured(measured: MeasuredRebounds, settings: Mapping[str, Value], v1: Array, normal: Array) -> Mask:
    """(m,) whether impacts (m, 3) are beyond the measured conditions, with the bandwidths of these settings."""
    theta1, vn1 = _conditions(v1, normal)
    return measured.beyond(theta1, vn1, float(settings["angle_bandwidth"]), float(settings["speed_bandwidth"]))


def _conditions(v1: Array, normal: Array) -> tuple[Array, Array]:
    """(m,) incident angle [rad] and normal speed [m/s]."""
    vn1 = -dot(v1, normal)
    return np.arctan2(vn1, norm(v1 + vn1[:, None] * normal)), vn1


def measured_sentence(measured: MeasuredRebounds) -> str:
    """What is drawn from, and how widely."""
    angle, speed = measured.bandwidths
    out = ", ".join(f"{number} {reason}" for reason, number in measured.left_out.items())
    return (
        f"observed draws from {len(measured)} measured impacts"
        + (f" (left out: {out})" if out else "")
        + f", incident angles {np.degrees(measured.theta1.min()):.1f}–{np.degrees(measured.theta1.max()):.1f}° and "
        f"normal speeds {measured.vn1.min():.2f}–{measured.vn1.max():.2f} m/s; bandwidths {100 * angle:.0f} % of the "
        f"angle and {100 * speed:.0f} % of the speed."
    )


def beyond_sentence(beyond: Mask) -> str:
    """How many impacts are beyond the measured conditions."""
    return (
        f"{beyond.sum()} of {beyond.size} impacts looked at ({100 * beyond.mean():.0f} %) are beyond the measured "
        f"conditions, with fewer than {FEWEST_NEAR} measured impacts near: there the nearest ones stand for them."
    )


def _weights(impacts: Impacts, used: Mask) -> Array:
    errors = []
    for name in WEIGHED:
        values: Array = getattr(impacts, name)[used]
        if name in impacts.sigma and values.size:
            first, third = np.quantile(values, [0.25, 0.75])
            spread = (third - first) / IQR_PER_SD if third > first else float(np.std(values))
            if spread > 0:
                errors.append((impacts.sigma[name][used] / spread) ** 2)
    if not errors:
        return np.ones(int(used.sum()))
    error = np.mean(errors, axis=0)
    known = np.isfinite(error)
    weights: Array = 1.0 / (1.0 + np.where(known, error, np.median(error[known]) if known.any() else 0.0))
    return weights

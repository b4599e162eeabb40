# SPDX-License-Identifier: GPL-3.0-or-later
"""First-order propagation of the picks' standard deviations to the impacts."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..vectors import Array, Indices, cross, dot, norm
from .flight import Flights, flight_states
from .impact import Apparent
from .observations import observe, velocity_weights
from .picks import Picks

Gradient = tuple[Array, Array]


@dataclass(frozen=True, eq=False)
class _Flight:
    """How the velocity of one flight per impact depends on the picks; all rows belong to impacts.

    A position error δx of an observation changes the velocity by weight·δx. A time error δt is a position error −v·δt,
    and, when the velocity is evaluated at that pick, moves the instant: + a·δt.
    """

    near: Array  # (n,) weight of the impact's own pick [1/s]
    near_time: Array  # (n, 3) δv/δt of the impact's own pick
    far_variance: Callable[[Array], Array]  # gradient (n, 3) → variance (n,) from all the other picks of the flight


def propagate(
    picks: Picks,
    flights: Flights,
    incident: Indices,
    restituted: Indices,
    own: Indices,
    values: Apparent,
    normal: Array,
) -> dict[str, Array]:
    """Standard deviations of the velocities, coefficients and angles of n impacts.

    Parameters
    ----------
    incident, restituted : (n,) index of the flight before and after each impact, −1 when there is none.
    own : (n,) index of the impact's pick.
    values : eq. 7–10 of the impacts.
    normal : (n, 3).

    Returns
    -------
    "v1", "v2" (n, 3); "speed1", "speed2", "vn1", "vt1", "vn2", "vt2", "rn", "rt", "r", "theta1", "theta_dev" (n,); NaN
    where undefined or where a pick of the flights has no standard deviation.

    Notes
    -----
    The picks' errors are independent, and the same in x, y and z; v1 and v2 share the impact's pick, so they are
    correlated. The terrain normal counts as exact. With drag, the sensitivities are those of the flight without it.
    """
    before = _sensitivity(picks, flights, incident, own, at_end=True)
    after = _sensitivity(picks, flights, restituted, own, at_end=False)
    sigma_x, sigma_t = _sigmas(picks, own)
    v1 = _velocities(flights.end_velocity, incident)
    v2 = _velocities(flights.start_velocity, restituted)
    nothing = np.zeros_like(v1)

    def sigma(gradient: Gradient, uses: str = "12") -> Array:
        g1, g2 = gradient
        near = np.zeros_like(g1)
        timing = np.zeros(len(g1))
        variance = np.zeros(len(g1))
        if "1" in uses:
            near = near + before.near[:, None] * g1
            timing = timing + dot(before.near_time, g1)
            variance = variance + before.far_variance(g1)
        if "2" in uses:
            near = near + after.near[:, None] * g2
            timing = timing + dot(after.near_time, g2)
            variance = variance + after.far_variance(g2)
        return np.sqrt(variance + sigma_x**2 * dot(near, near) + sigma_t**2 * timing**2)

    def along(axis: int) -> Array:
        direction = np.zeros_like(v1)
        direction[:, axis] = 1.0
        return direction

    with np.errstate(invalid="ignore", divide="ignore"):
        normal1, normal2 = np.sign(values.approach)[:, None] * normal, np.sign(values.escape)[:, None] * normal
        tangent1 = (v1 - values.approach[:, None] * normal) / values.vt1[:, None]
        tangent2 = (v2 - values.escape[:, None] * normal) / values.vt2[:, None]
        speed1, speed2 = norm(v1)[:, None], norm(v2)[:, None]
        axis = cross(v1, v2)
        axis = axis / norm(axis)[:, None]
        result = {
            "v1": np.stack([sigma((along(i), nothing), "1") for i in range(3)], axis=1),
            "v2": np.stack([sigma((nothing, along(i)), "2") for i in range(3)], axis=1),
            "speed1": sigma((v1 / speed1, nothing), "1"),
            "speed2": sigma((nothing, v2 / speed2), "2"),
            "vn1": sigma((normal1, nothing), "1"),
            "vt1": sigma((tangent1, nothing), "1"),
            "vn2": sigma((nothing, normal2), "2"),
            "vt2": sigma((nothing, tangent2), "2"),
            "rn": sigma(_of_ratio(values.rn, normal1, values.vn1, normal2, values.vn2)),
            "rt": sigma(_of_ratio(values.rt, tangent1, values.vt1, tangent2, values.vt2)),
            "r": sigma(_of_ratio(values.r, v1 / speed1, speed1[:, 0], v2 / speed2, speed2[:, 0])),
            "theta1": sigma(
                ((values.vt1[:, None] * normal1 - values.vn1[:, None] * tangent1) / speed1**2, nothing), "1"
            ),
            "theta_dev": sigma((cross(v1, axis) / speed1**2, cross(axis, v2) / speed2**2)),
        }
    return {name: np.where(np.isfinite(sd), sd, np.nan) for name, sd in result.items()}


def _of_ratio(ratio: Array, direction1: Array, size1: Array, direction2: Array, size2: Array) -> Gradient:
    """Gradients of |part of v2| / |part of v1| by v1 and v2."""
    return -(ratio / size1)[:, None] * direction1, (ratio / size2)[:, None] * direction2


def _velocities(velocity: Array, which: Indices) -> Array:
    if not len(velocity):
        return np.full((which.size, 3), np.nan)
    return np.where((which >= 0)[:, None], velocity[which], np.nan)


def _sigmas(picks: Picks, of: Indices) -> tuple[Array, Array]:
    """Position and time standard deviations; of the two, one that is not given is zero, both make NaN."""
    position, time = picks.sigma_position_m[of], picks.sigma_time_s[of]
    unknown = np.isnan(position) & np.isnan(time)
    position, time = np.nan_to_num(position), np.nan_to_num(time)
    position[unknown] = np.nan
    return position, time


def _sensitivity(picks: Picks, flights: Flights, which: Indices, own: Indices, *, at_end: bool) -> _Flight:
    """The dependence of the flight `which` (n,) at the impact's end on its picks."""
    n = which.size
    has = np.flatnonzero(which >= 0)
    near, near_time = np.full(n, np.nan), np.full((n, 3), np.nan)
    if not has.size:
        return _Flight(near, near_time, lambda gradient: np.full(n, np.nan))

    flight = which[has]
    obs = observe(picks, flights.first_pick[flight], flights.last_pick[flight])
    weight = velocity_weights(obs)
    _, velocity = flight_states(flights, flight[obs.flight], picks.time_s[obs.pick])
    mine = obs.pick == own[has][obs.flight]

    fall = np.array([0.0, 0.0, -flights.gravity_mps2])
    near[has] = weight[mine]
    near_time[has] = fall - weight[mine, None] * velocity[mine]

    sigma_x, sigma_t = _sigmas(picks, obs.pick)

    def far_variance(gradient: Array) -> Array:
        rows = gradient[has][obs.flight]
        parts = weight**2 * (sigma_x**2 * dot(rows, rows) + sigma_t**2 * dot(rows, velocity) ** 2)
        variance = np.full(n, np.nan)
        variance[has] = obs.sums(np.where(mine, 0.0, parts))
        return variance

    return _Flight(near, near_time, far_variance)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Covariance of the velocities and the place of impacts, from the standard deviations of the picks."""

import numpy as np

from ..vectors import Array, Indices
from .flight import Flights, flight_states
from .observations import observe, velocity_weights
from .picks import Picks

ERRORS = 9
"""Of an impact: those of v1 and of v2 [m/s], and of its place [m]."""


def pick_covariance(
    picks: Picks, flights: Flights, incident: Indices, restituted: Indices, landing: Indices, leaving: Indices
) -> Array:
    """Covariance of v1, v2 and the place of n impacts.

    Parameters
    ----------
    incident, restituted : (n,) index of the flight before and after each impact, −1 when there is none.
    landing, leaving : (n,) index of the pick where the block lands, which is the impact's, and where it leaves the
        ground; the same but for impacts with a take-off.

    Returns
    -------
    (n, 9, 9); the rows and columns of a velocity are NaN where there is none, or where a pick of its flight has no
    standard deviation.

    Notes
    -----
    First order. The picks' errors are independent, and the same in x, y and z; v1, v2 and the place share the impact's
    pick, so they are correlated, but for v2 from a take-off. With drag, the sensitivities are those of the flight
    without it.
    """
    n = landing.size
    sigma_x, sigma_t = _sigmas(picks, landing)
    by_place, by_time = np.zeros((n, ERRORS, 3)), np.zeros((n, ERRORS))
    by_place[:, 6:] = np.eye(3)
    covariance = np.zeros((n, ERRORS, ERRORS))
    for part, flight, pick in ((slice(0, 3), incident, landing), (slice(3, 6), restituted, leaving)):
        weight, timing, covariance[:, part, part] = _velocity(picks, flights, flight, pick)
        shared = pick == landing
        own_x, own_t = (np.where(shared, 0.0, sigma) for sigma in _sigmas(picks, pick))
        covariance[:, part, part] += ((own_x * weight) ** 2)[:, None, None] * np.eye(3)
        covariance[:, part, part] += (own_t**2)[:, None, None] * (timing[:, :, None] * timing[:, None, :])
        by_place[:, part] = np.where(shared, weight, 0.0)[:, None, None] * np.eye(3)
        by_time[:, part] = np.where(shared[:, None], timing, 0.0)
    covariance += (sigma_x**2)[:, None, None] * (by_place @ np.swapaxes(by_place, 1, 2))
    return covariance + (sigma_t**2)[:, None, None] * (by_time[:, :, None] * by_time[:, None, :])


def _sigmas(picks: Picks, of: Indices) -> tuple[Array, Array]:
    """Position and time standard deviations; of the two, one that is not given is zero, both make NaN."""
    position, time = picks.sigma_position_m[of], picks.sigma_time_s[of]
    unknown = np.isnan(position) & np.isnan(time)
    position, time = np.nan_to_num(position), np.nan_to_num(time)
    position[unknown] = np.nan
    return position, time


def _velocity(picks: Picks, flights: Flights, which: Indices, own: Indices) -> tuple[Array, Array, Array]:
    """How the velocity of one flight `which` per impact depends on its picks; NaN where there is no flight.

    A position error δx of an observation changes the velocity by weight·δx. A time error δt is a position error −v·δt,
    and, when the velocity is evaluated at that pick, moves the instant: + a·δt.

    Returns
    -------
    (n,) weight of the impact's own pick [1/s], (n, 3) δv/δt of its time, (n, 3, 3) covariance from all other picks.
    """
    n = which.size
    has = np.flatnonzero(which >= 0)
    near, by_time, far = np.full(n, np.nan), np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)
    if not has.size:
        return near, by_time, far
    flight = which[has]
    obs = observe(picks, flights.first_pick[flight], flights.last_pick[flight])
    weight = velocity_weights(obs)
    _, velocity = flight_states(flights, flight[obs.flight], picks.time_s[obs.pick])
    mine = obs.pick == own[has][obs.flight]

    near[has] = weight[mine]
    by_time[has] = [0.0, 0.0, -flights.gravity_mps2] - weight[mine, None] * velocity[mine]
    sigma_x, sigma_t = _sigmas(picks, obs.pick)
    factor = np.where(mine, 0.0, weight**2)
    for i in range(3):
        for j in range(i + 1):
            part = sigma_t**2 * velocity[:, i] * velocity[:, j] + (sigma_x**2 if i == j else 0.0)
            far[has, i, j] = far[has, j, i] = obs.sums(np.where(mine, 0.0, factor * part))
    return near, by_time, far

# SPDX-License-Identifier: GPL-3.0-or-later
"""A free flight from one known point, from the rays of a single view."""

from dataclasses import dataclass

import numpy as np

from ..vectors import Array, across, angle_between, norm
from .free_flight import fall

ROUNDS = 3
"""Of weighting by the distance, which the first round does not know."""


@dataclass(frozen=True, eq=False)
class RayFlight:
    """The free flight nearest to m rays.

    Attributes
    ----------
    velocity : (3,) at the known point [m/s].
    position : (m, 3) at the times of the rays [m].
    miss : (m,) angle between each ray and the direction of the block [rad].
    """

    velocity: Array
    position: Array
    miss: Array


def flight_through_rays(
    point: Array, point_time_s: float, origins: Array, directions: Array, time_s: Array, gravity_mps2: float
) -> RayFlight:
    """The velocity at `point` (3,) with which a free flight passes nearest to the rays, in angle.

    Parameters
    ----------
    origins, directions : (m, 3) of the rays, unit directions; m ≥ 2.
    time_s : (m,) of the rays [s], before or after `point_time_s`.

    Notes
    -----
    Linear in the velocity: the part of o − x(t) at right angles to each ray vanishes, with x(t) = p + vτ − ½gτ²ẑ.
    Gravity, being known, tells the distance that a single view does not see.
    """
    elapsed = time_s - point_time_s
    fallen = fall(elapsed, gravity_mps2)
    beside = across(directions)
    rest = (beside @ (origins - point - fallen)[:, :, None])[:, :, 0]
    rows = beside * elapsed[:, None, None]
    distance = np.maximum(norm(point - origins), 1e-6)
    velocity, position = np.zeros(3), np.broadcast_to(point, origins.shape)
    for _ in range(ROUNDS):
        weighted = rows / distance[:, None, None]
        velocity = np.linalg.lstsq(weighted.reshape(-1, 3), (rest / distance[:, None]).ravel(), rcond=None)[0]
        position = point + velocity * elapsed[:, None] + fallen
        distance = np.maximum(norm(position - origins), 1e-6)
    return RayFlight(velocity, position, angle_between(position - origins, directions))

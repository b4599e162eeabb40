# SPDX-License-Identifier: GPL-3.0-or-later
"""Free flight: Noël et al. 2018, eq. 5 and 6, and where a block is after a time, through nothing or through air."""

import numpy as np

from ..errors import RockfallError
from ..vectors import Array

UNFLYABLE = "A flight with drag cannot be integrated. Check its duration, and the block's size and density."


def restituted_velocity(displacement: Array, duration_s: Array, gravity_mps2: float | Array) -> Array:
    """Velocity at the start of a free flight, (n, 3) [m/s]: Noël et al. 2018, eq. 5.

    Parameters
    ----------
    displacement : (n, 3) from the start to the end [m].
    duration_s : (n,) [s].
    """
    velocity = displacement / duration_s[:, None]
    velocity[:, 2] += 0.5 * gravity_mps2 * duration_s
    return velocity


def incident_velocity(restituted: Array, duration_s: Array, gravity_mps2: float | Array) -> Array:
    """Velocity at the end of a free flight that starts with `restituted`, (n, 3) [m/s]: Noël et al. 2018, eq. 6."""
    velocity = restituted.copy()
    velocity[:, 2] -= gravity_mps2 * duration_s
    return velocity


def fall(elapsed_s: Array, gravity_mps2: float | Array) -> Array:
    """What gravity alone moves a block by, −½gt²ẑ, (n, 3) [m]."""
    displacement = np.zeros((elapsed_s.size, 3))
    displacement[:, 2] = -0.5 * gravity_mps2 * elapsed_s**2
    return displacement


def parabola(position: Array, velocity: Array, elapsed_s: Array, gravity_mps2: float | Array) -> tuple[Array, Array]:
    """Position and velocity (n, 3) after a free flight of `elapsed_s` (n,) [s]; negative before its start."""
    later = position + velocity * elapsed_s[:, None] + fall(elapsed_s, gravity_mps2)
    return later, incident_velocity(velocity, elapsed_s, gravity_mps2)


def fly(
    position: Array, velocity: Array, elapsed_s: Array, gravity_mps2: float | Array, drag_per_m: Array
) -> tuple[Array, Array]:
    """Position and velocity (n, 3) after flights of which some are through air.

    Parameters
    ----------
    position, velocity : (n, 3) at the start [m], [m/s].
    elapsed_s : (n,) [s], may be negative.
    gravity_mps2 : one or (n,).
    drag_per_m : (n,) ½ρC_D·A/m [1/m], 0 without drag.

    Raises
    ------
    RockfallError : a flight with drag cannot be integrated.

    Notes
    -----
    Exact: the closed form without drag, the equation of motion integrated to 1e-10 m with drag.
    """
    later, faster = parabola(position, velocity, elapsed_s, gravity_mps2)
    rows = np.flatnonzero(drag_per_m > 0)
    if rows.size:
        from . import drag_kernels

        states = np.empty((rows.size, drag_kernels.MOTION))
        gravity = np.broadcast_to(np.asarray(gravity_mps2, dtype=np.float64), elapsed_s.shape)[rows]
        drag_kernels.states_along(
            np.arange(rows.size), elapsed_s[rows], velocity[rows], drag_per_m[rows], gravity, states
        )
        if np.isnan(states).any():
            raise RockfallError(UNFLYABLE)
        later[rows], faster[rows] = position[rows] + states[:, :3], states[:, 3:]
    return later, faster

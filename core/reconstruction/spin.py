# SPDX-License-Identifier: GPL-3.0-or-later
"""Spin from marks: how often a side of the block came round between two frames."""

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..vectors import Array, norm

SIGMA_TURN = 1 / 24
"""Standard deviation of a marked attitude without one: 15°, in turns."""


@dataclass(frozen=True, eq=False)
class Spin:
    """A steady rotation, as free flight keeps it.

    Attributes
    ----------
    rate, sigma_rate : turns as an angle per time, ω and its standard deviation [rad/s].
    axis : (3,) unit, right-handed; NaN when nothing tells it.
    angular_velocity, sigma_angular_velocity : (3,) ω·axis and its standard deviations for a certain axis [rad/s].
    residual_turns : (n,) of the marks from the steady rotation.
    """

    rate: float
    sigma_rate: float
    axis: Array
    angular_velocity: Array
    sigma_angular_velocity: Array
    residual_turns: Array


def rolling_axis(velocity: Array) -> Array:
    """(3,) horizontal axis about which a block of this velocity rolls forwards: ẑ × v; NaN straight down."""
    across = np.array([-velocity[1], velocity[0], 0.0])
    length = float(norm(across))
    return across / length if length > 1e-9 * float(norm(velocity)) else np.full(3, np.nan)


def measure_spin(
    time_s: Array,
    turns: Array,
    *,
    sigma_time_s: Array | float = 0.0,
    sigma_turns: Array | float = SIGMA_TURN,
    velocity: Array | None = None,
    axis: Array | None = None,
) -> Spin:
    """Spin from two marks or more of one side of the block.

    Parameters
    ----------
    time_s : (n,) of the marks [s].
    turns : (n,) turns made since any start: 0, 1, 2 … when the same side shows again, or parts of turns; negative for
        a block that turns the other way about the axis.
    sigma_time_s, sigma_turns : (n,) or a number, of the marks; a turn without one is known to 15°.
    velocity : (3,) of the flight [m/s]: the block rolls forwards about the horizontal axis across it.
    axis : (3,) instead of that.

    Raises
    ------
    InputError : fewer than two marks, all at one time, or a standard deviation that is not one.

    Notes
    -----
    ω = 2π·Δturns/Δt for two marks, the weighted regression line for more. An error δt of a mark counts as ω·δt of turn.
    """
    time, turn = np.asarray(time_s, dtype=np.float64).reshape(-1), np.asarray(turns, dtype=np.float64).reshape(-1)
    if time.size < 2 or turn.size != time.size:
        raise InputError("Spin needs two marks or more of the same side", advice="Mark the side when it shows again")
    if not (np.isfinite(time).all() and np.isfinite(turn).all() and np.ptp(time) > 0):
        raise InputError("The marks of the spin are at one time, or not numbers", advice="Mark each in its own frame")
    sigma_t = np.broadcast_to(np.asarray(sigma_time_s, dtype=np.float64), time.shape)
    sigma_n = np.broadcast_to(np.asarray(sigma_turns, dtype=np.float64), time.shape)
    if not ((sigma_t >= 0).all() and (sigma_n >= 0).all()):
        raise InputError("A standard deviation of a mark is negative or not a number")
    pace = float(np.polyfit(time - time[0], turn, 1)[0])
    variance = sigma_n**2 + (pace * sigma_t) ** 2
    weight = np.ones(time.size) if (variance <= 0).any() else 1 / variance
    middle = float(np.average(time, weights=weight))
    mean = float(np.average(turn, weights=weight))
    lever = weight * (time - middle) / float((weight * (time - middle) ** 2).sum())
    pace = float(lever @ (turn - mean))
    deviation = float(np.sqrt((lever**2 * variance).sum()))

    direction = np.full(3, np.nan)
    if axis is not None:
        given = np.asarray(axis, dtype=np.float64)
        if not float(norm(given)) > 0:
            raise InputError("The axis of the spin has length zero")
        direction = given / float(norm(given))
    elif velocity is not None:
        direction = rolling_axis(np.asarray(velocity, dtype=np.float64))
    rate, sigma_rate = 2 * np.pi * pace, 2 * np.pi * deviation
    return Spin(
        rate=rate,
        sigma_rate=sigma_rate,
        axis=direction,
        angular_velocity=rate * direction,
        sigma_angular_velocity=sigma_rate * np.abs(direction),
        residual_turns=turn - mean - pace * (time - middle),
    )

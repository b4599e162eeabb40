# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a marked point of a block is as seen from the block's centre, and how far it has come round an axis."""

import numpy as np

from ..vectors import Array, cross, dot, norm, perpendicular, unit


def directions(origin: Array, ray: Array, centre: Array, radius_m: float) -> Array:
    """(n, 3) unit vectors from a block's centre to marked points of its surface.

    Parameters
    ----------
    origin, ray : (n, 3) rays through the marks.
    centre : (n, 3) of the block at the marks' times.
    radius_m : of the block, taken as a ball; a ray that misses it means the nearest point of its outline.
    """
    to_centre = centre - origin
    along = dot(to_centre, ray)
    off = origin + along[:, None] * ray - centre
    depth = np.sqrt(np.maximum(radius_m**2 - dot(off, off), 0.0))
    return unit(off - depth[:, None] * ray)


def phases(direction: Array, axis: Array) -> Array:
    """(n,) turns about an axis, right-handed, from any start, −½…½; NaN for a direction along the axis."""
    first, second = perpendicular(axis)
    x, y = direction @ first, direction @ second
    turn = np.arctan2(y, x) / (2 * np.pi)
    return np.where(np.hypot(x, y) > 1e-6, turn, np.nan)


def nearest(turn: Array, to: Array) -> Array:
    """Turns, a whole number more or less, so that they are nearest to others."""
    return turn + np.round(to - turn)


def turned(direction: Array, axis: Array, turn: Array) -> Array:
    """(n, 3) a direction (3,) turned about a unit axis (3,) by turns (n,): Rodrigues' formula."""
    angle = 2 * np.pi * np.asarray(turn, dtype=np.float64)[..., None]
    about = cross(axis, direction)
    rest = axis * float(axis @ direction)
    result: Array = np.cos(angle) * (direction - rest) + np.sin(angle) * about + rest
    return result


def tilted(axis: Array, angle: float) -> tuple[Array, ...]:
    """A unit axis (3,) tilted by an angle [rad] in two directions, to either side of each: four axes."""
    ways = perpendicular(axis)
    return tuple(unit(axis + sign * np.tan(angle) * way) for way in ways for sign in (1.0, -1.0))


def is_direction(axis: Array) -> bool:
    """Whether a vector has a direction."""
    return bool(np.isfinite(axis).all() and norm(axis) > 0)

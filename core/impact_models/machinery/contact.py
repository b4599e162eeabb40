# SPDX-License-Identifier: GPL-3.0-or-later
"""What the models share about a block that touches the ground; plain functions that compile as they stand.

n is the unit normal out of the ground, v_N1 = −v1·n > 0 the approach speed, v_T = v − (v·n) n the tangential velocity,
t its direction and b = n × t. A spin ω along +b is forward rolling, ω = (n × v_T)/r, and the contact point then does
not slip: s = v_T + r (n × ω) = 0. Inertia is I = c·m·r², and q = 1/c.
"""

from math import atan2, degrees

from .triples import Vector, add, cross, dot, length, scaled

SPHERE_INERTIA = 2.0 / 5.0
"""c of a solid sphere."""
CUBE_INERTIA = 2.0 / 3.0
"""c of a cube of side 2r: k² = 2r²/3 (Noël et al. 2017)."""
NO_DIRECTION_MPS = 1e-9
"""A tangential velocity below this has no direction."""


def split(v1: Vector, n: Vector) -> tuple[float, Vector, float]:
    """v_N1 [m/s] (above zero for an approaching block), v_T1 as a vector, |v_T1| [m/s]."""
    along = dot(v1, n)
    tangential = add(v1, scaled(n, -along))
    return -along, tangential, length(tangential)


def with_length(vector: Vector, size: float, new_size: float) -> Vector:
    """`vector` of length `size` with another length; zero when it has no direction."""
    return scaled(vector, new_size / size) if size > NO_DIRECTION_MPS else (0.0, 0.0, 0.0)


def leaving(n: Vector, normal_speed: float, tangential: Vector) -> Vector:
    """v2 = v_N2 n + v_T2."""
    return add(scaled(n, normal_speed), tangential)


def rolling(n: Vector, tangential: Vector, radius: float) -> Vector:
    """ω = (n × v_T)/r of a block that rolls without slip [rad/s]."""
    return scaled(cross(n, tangential), 1.0 / radius)


def slip(n: Vector, tangential: Vector, omega: Vector, radius: float) -> Vector:
    """s = v_T + r (n × ω), the velocity of the contact point along the ground [m/s]."""
    return add(tangential, scaled(cross(n, omega), radius))


def spin_in_plane(n: Vector, omega: Vector) -> float:
    """|ω| without the part about n [rad/s]: the spin that rolls."""
    return length(add(omega, scaled(n, -dot(omega, n))))


def gripped(n: Vector, tangential: Vector, omega: Vector, radius: float, inertia: float) -> tuple[Vector, Vector]:
    """The impact that ends the slip: v_T2 = v_T1 − s/(1+q), ω2 = ω1 + q/((1+q) r) n × s (Goldsmith 1960)."""
    s = slip(n, tangential, omega, radius)
    q = 1.0 / inertia
    v = add(tangential, scaled(s, -1.0 / (1.0 + q)))
    return v, add(omega, scaled(cross(n, s), q / (1.0 + q) / radius))


def incident_angle_deg(approach: float, tangential_speed: float) -> float:
    """θ1 between the incident path and the ground [°]: 0 grazing, 90 along the normal (Noël et al. 2018, eq. 9)."""
    return degrees(atan2(approach, tangential_speed))

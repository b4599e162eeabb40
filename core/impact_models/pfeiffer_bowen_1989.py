# SPDX-License-Identifier: GPL-3.0-or-later
"""Pfeiffer & Bowen 1989: the lumped mass of CRSP, the Colorado Rockfall Simulation Program, up to version 4.0.

    v_N2 = R_n v_N1 / (1 + (v_N1/9.144)²)                                         9.144 m/s = 30 ft/s
    f    = R_t + (1 − R_t) / ((|s|/6.096)² + 1.2)                                 6.096 m/s = 20 ft/s
    SF   = R_t / ((v_N1/(76.2 R_n))² + 1)                                         76.2 m/s = 250 ft/s, R_n not scaled
    v_T2 = √[ r² (I ω1² + m v_T1²) f·SF / (I + m r²) ]  along t                   I = 2/5·m·r²
    ω2   = (n × v_T2)/r                                                           [rad/s]

s is the slip as a vector and ω1 the part of the spin in the tangent plane; the spin about n ends. v_N2 is greatest,
4.6·R_n, at v_N1 = 9.144 m/s and falls beyond: that is the model. R_n = 0 stops the block.

Roughness S [m] (off by default): at every impact the normal leans by an angle U(0, 1)·atan(S/r), of which a share
U(0, 1) leans against the motion and the rest to one side, left or right.

Source: Pfeiffer, T., Bowen, T. (1989) Computer simulation of rockfalls. Bull. Assoc. Eng. Geol. 26(1); Jones et al.
(2000) CRSP 4.0. Two published programs agree on the equations (PlatRock, PyRockfall). Not verified against the primary
text: the ranges, and how the three-dimensional roughness is shared (CRSP is two-dimensional). Coefficients: Noël et
al. 2018.
"""

from math import atan, isnan, sqrt
from typing import NamedTuple

from .machinery.base import ImpactModel
from .machinery.chance import uniform
from .machinery.contact import SPHERE_INERTIA, leaving, rolling, slip, spin_in_plane, split, with_length
from .machinery.parameters import number
from .machinery.triples import Motion, Vector, cross, length, turned

NORMAL_SPEED_MPS = 9.144
FRICTION_SPEED_MPS = 6.096
SCALING_SPEED_MPS = 76.2
GROUND = "Noël et al. 2018; ranges of ground types not verified"


class Parameters(NamedTuple):
    """What can be set."""

    rn: float = number(0.35, 0, 1, "normal coefficient; 0.28 soft soil to 0.42 hard surface", GROUND, symbol="R_n")
    rt: float = number(0.85, 0, 1, "tangential coefficient; 0.80 soft soil to 0.92 hard surface", GROUND, symbol="R_t")
    roughness: float = number(
        0,
        0,
        5,
        "height of the ground's roughness over one block radius; 0 for none",
        "the two-dimensional form of PlatRock; in three dimensions ours",
        unit="m",
        symbol="S",
        verified=False,
    )


class Draws(NamedTuple):
    """The chance of one impact: how far the normal leans, how much of it against the motion, and to which side."""

    angle: float
    share: float
    side: float


def restituted_tangential(
    tangential: Vector, speed: float, n: Vector, omega: Vector, radius: float, approach: float, rn: float, rt: float
) -> Vector:
    """v_T2 [m/s] of CRSP, by its friction function f and scaling factor SF."""
    if rn <= 0.0:
        return (0.0, 0.0, 0.0)
    slipping = length(slip(n, tangential, omega, radius)) / FRICTION_SPEED_MPS
    friction = rt + (1.0 - rt) / (slipping * slipping + 1.2)
    scaling = rt / ((approach / (SCALING_SPEED_MPS * rn)) ** 2 + 1.0)
    spin = radius * spin_in_plane(n, omega)
    energy = (SPHERE_INERTIA * spin * spin + speed * speed) / (1.0 + SPHERE_INERTIA)
    return with_length(tangential, speed, sqrt(energy * friction * scaling))


def rough_normal(v1: Vector, n: Vector, angle: float, share: float, side: float) -> Vector:
    """The normal leaned by `share` of `angle` [rad] against the motion and by the rest sideways, `side` = ±1."""
    _, tangential, speed = split(v1, n)
    t = with_length(tangential, speed, 1.0)
    if length(t) == 0.0:
        return n
    braked = turned(n, cross(t, n), share * angle)
    return turned(braked, t, side * (1.0 - share) * angle)


def rebound(v1: Vector, n: Vector, omega1: Vector, radius: float, mass: float, p: Parameters, u: Draws) -> Motion:
    """v2 [m/s] and ω2 [rad/s]; see the module."""
    if p.roughness > 0.0 and not isnan(u.angle):
        angle = u.angle * atan(p.roughness / radius)
        n = rough_normal(v1, n, angle, uniform(u.share, 0.0, 1.0), -1.0 if u.side < 0.5 else 1.0)
    approach, tangential, speed = split(v1, n)
    after = restituted_tangential(tangential, speed, n, omega1, radius, approach, p.rn, p.rt)
    ratio = approach / NORMAL_SPEED_MPS
    return leaving(n, approach * p.rn / (1.0 + ratio * ratio), after), rolling(n, after, radius)


MODEL = ImpactModel(
    name="pfeiffer_bowen_1989",
    title="CRSP (Pfeiffer & Bowen 1989)",
    reference="Pfeiffer, T., Bowen, T. (1989): Computer simulation of rockfalls. Bull. Assoc. Eng. Geol. 26(1).",
    function=rebound,
    parameter_type=Parameters,
    draw_type=Draws,
    colour=(0.94, 0.89, 0.26),
    compared=True,
)

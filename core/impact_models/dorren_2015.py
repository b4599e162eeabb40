# SPDX-License-Identifier: GPL-3.0-or-later
"""Dorren 2015: Rockyfor3D v5.2.

    v_N2 = R_n v_N1 / (1 + (v_N1/9)²)                                  9 m/s
    R_t  = 1 / (1 + (MOH + D_p)/r)                                     MOH height of the obstacle, D_p penetration [m]
    v_T2 = √[ r² (I ω1² + m v_T1²) R_t / (I + m r²) ]  along t         I = c·m·r² of the block shape
    ω2   = (n × v_T2)/r                                                [rad/s]

ω1 is the part of the spin in the tangent plane. v_N2 is greatest, 4.5·R_n, at 9 m/s and falls beyond: that is the
model.
R_n = 0 (soil type 0) stops the block.

Chance, at every rebound: R_n = mean · U(0.9, 1.1), at most 1; MOH is Rg70, Rg20 or Rg10 with probability 0.7, 0.2, 0.1;
the block is deviated sideways by an angle whose class depends on the speed before the rebound, uniform within the
class, to the left or right (or towards the dip). Off by default: ±10 % on R_t, a slope angle reduced by U(0°, 4°). The
mean takes the mean R_n and MOH and no deviation.

The deviation turns v2 and ω2 about the vertical, so that v2 may point into the ground; or about the normal, which
leaves the apparent R_N as it is; or by the same angle in any direction (cone).

Penetration (Pichler et al. 2005), for R_n < 0.34, with d = 2r and v = |v1|:

    R_I = 55e9 R_n⁷ Pa,  ρ_s = 1200 ln R_n + 3300 kg/m³,  k = 1.207,  I* = m v²/(R_I d³),  N = m/(1.2 ρ_s d³)
    x = √[(1 + kπ/4N)/(1 + I*/N) · 4kI*/π];  if x > k:  x = (2N/π) ln[(1 + I*/N)/(1 + kπ/4N)] + k;  D_p = d·x

Source: Dorren, L. (2015, 2016) Rockyfor3D (v5.2) revealed. ecorisQ. Verified in Noël et al. 2018: soil type 5 with
R_n = 0.43 ± 10 %, Rg70, Rg20, Rg10 = 0, 0.05, 0.10 m, rectangular block, and results that agree with the equations.
Not verified against the manual: the equations, other soils, the shares of obstacles and deviations, the third class's
limit, the axis of the deviation (a turn about the normal contradicts Noël et al. 2018, who find R_N > 1), penetration.
Shape "none" (0) is not a block and left out.
"""

from math import cos, isnan, log, pi, radians, sin, sqrt
from typing import NamedTuple

from .machinery.base import ImpactModel
from .machinery.chance import uniform
from .machinery.contact import leaving, rolling, spin_in_plane, split, with_length
from .machinery.parameters import choice, number, switch
from .machinery.triples import Motion, Vector, add, cross, dot, length, scaled, turned
from .rockyfor3d_tables import (
    DEVIATION_LIMITS_DEG,
    DEVIATION_SHARES,
    DEVIATION_SPEEDS_MPS,
    OBSTACLE_SHARES,
    SHAPES,
    SOILS,
)

NORMAL_SPEED_MPS = 9.0
INERTIA = tuple(inertia for _, inertia in SHAPES)
FIRST_SHAPE = 1
AXES = ("vertical", "normal", "cone")
NORMAL, CONE = AXES.index("normal"), AXES.index("cone")
SIDES = ("random", "downslope")
DOWNSLOPE = SIDES.index("downslope")
HARD_RN, SOFTEST_RN = 0.34, 0.1
"""No penetration from the first on; below the second the density of the soil would near zero, so it stays."""
UP = (0.0, 0.0, 1.0)
STOPPED = (0.0, 0.0, 0.0)
SOIL_TYPES = tuple(str(soil) for soil in range(len(SOILS)))
SOIL_NAMES = "; ".join(f"{soil} {name}" for soil, (name, _) in enumerate(SOILS))
SOIL_RN = tuple(rn for _, rn in SOILS)
SHAPE_NAMES = tuple(name for name, _ in SHAPES)
PAPER, MANUAL = "Noël et al. 2018", "Rockyfor3D v5.2; not verified"


class Parameters(NamedTuple):
    """What can be set."""

    soil_type: float = choice("5", SOIL_TYPES, SOIL_NAMES, f"type 5: {PAPER}")
    rn: float = number(
        SOILS[5][1],
        0,
        1,
        "mean normal coefficient; when it is not given, that of the soil type",
        f"0.43 for type 5: {PAPER}; other soils not verified",
        symbol="R_n",
        follows=("soil_type", SOIL_RN),
    )
    rn_spread: float = number(
        0.10, 0, 1, "R_n = mean · U(1 − spread, 1 + spread)", f"±10 %: {PAPER}; that it is uniform is not verified"
    )
    rg70: float = number(0, 0, 100, "obstacle height of 70 % of the rebounds", PAPER, unit="m", symbol="Rg70")
    rg20: float = number(0.05, 0, 100, "obstacle height of 20 % of the rebounds", PAPER, unit="m", symbol="Rg20")
    rg10: float = number(0.10, 0, 100, "obstacle height of 10 % of the rebounds", PAPER, unit="m", symbol="Rg10")
    block_shape: float = choice(
        "rectangular",
        SHAPE_NAMES,
        "shape of the block for its moment of inertia, with three equal diameters",
        f"rectangular: {PAPER}; moments of inertia not verified",
        first_code=FIRST_SHAPE,
    )
    deviation: float = switch(
        "on", "lateral deviation at random, by classes that depend on the speed", MANUAL, verified=False
    )
    deviation_axis: float = choice(
        "vertical",
        AXES,
        "what the deviation turns about; cone: the same angle in any direction",
        f"inferred from {PAPER}, who find R_N > 1",
        verified=False,
    )
    deviation_side: float = choice(
        "random", SIDES, "to either side, or towards the dip of the ground", MANUAL, verified=False
    )
    rt_spread: float = number(
        0, 0, 1, "R_t · U(1 − spread, 1 + spread), at most 1; 0.1 to have it", MANUAL, verified=False
    )
    slope_reduction: float = number(
        0, 0, 45, "the slope is less steep by U(0, this) at a rebound; 4 to have it", MANUAL, unit="deg", verified=False
    )
    penetration: float = switch(
        "on",
        "penetration of the block into soils with R_n below 0.34",
        "Pichler et al. 2005; not verified",
        symbol="D_p",
        verified=False,
    )
    deviation_limit: float = number(
        55,
        45,
        180,
        "upper limit of the third class of the deviation; 67.5 is the rival",
        MANUAL,
        unit="deg",
        verified=False,
    )


class Draws(NamedTuple):
    """The chance of one impact."""

    rn: float
    obstacle: float
    rt: float
    reduction: float
    deviation_class: float
    deviation_angle: float
    deviation_side: float


def obstacle_height(u: float, rg70: float, rg20: float, rg10: float) -> float:
    """MOH [m]: one of three heights, or their mean."""
    p70, p20, p10 = OBSTACLE_SHARES
    if isnan(u):
        return p70 * rg70 + p20 * rg20 + p10 * rg10
    return rg70 if u < p70 else rg20 if u < p70 + p20 else rg10


def penetration_depth(rn: float, speed: float, radius: float, mass: float) -> float:
    """D_p [m] of a block of this speed [m/s]."""
    if rn >= HARD_RN:
        return 0.0
    rn, d = max(rn, SOFTEST_RN), 2.0 * radius
    k = 1.207
    hardness = mass * speed * speed / (55e9 * rn**7 * d**3)
    slenderness = mass / ((1200.0 * log(rn) + 3300.0) * d**3 * 1.2)
    shape = 1.0 + k * pi / (4.0 * slenderness)
    force = 1.0 + hardness / slenderness
    x = sqrt(shape / force * 4.0 * k * hardness / pi)
    if x > k:
        x = 2.0 * slenderness / pi * log(force / shape) + k
    return d * x


def deviation_angle(speed: float, u_class: float, u_angle: float, limit_deg: float) -> float:
    """Lateral deviation [rad], not negative, of a block with this speed before the rebound [m/s]."""
    row = 0 if speed < DEVIATION_SPEEDS_MPS[0] else 1 if speed < DEVIATION_SPEEDS_MPS[1] else 2
    first, second, _ = DEVIATION_SHARES[row]
    low, high = 0.0, DEVIATION_LIMITS_DEG[0]
    if u_class >= first + second:
        low, high = DEVIATION_LIMITS_DEG[1], limit_deg
    elif u_class >= first:
        low, high = DEVIATION_LIMITS_DEG[0], DEVIATION_LIMITS_DEG[1]
    return radians(uniform(u_angle, low, high))


def side_of(u: float, v1: Vector, n: Vector, downslope: bool) -> float:
    """+1 to the left seen from above, −1 to the right: at random, or from the incident azimuth to that of the dip."""
    across = v1[0] * n[1] - v1[1] * n[0]
    if downslope and across != 0.0:
        return 1.0 if across > 0.0 else -1.0
    return -1.0 if u < 0.5 else 1.0


def cone_axis(v: Vector, u: float) -> Vector:
    """A unit vector at right angles to `v`, in the direction that `u` picks."""
    size = length(v)
    if size == 0.0:
        return UP
    along = scaled(v, 1.0 / size)
    helper = (1.0, 0.0, 0.0) if abs(along[0]) < 0.6 else (0.0, 1.0, 0.0)
    first = cross(along, helper)
    first = scaled(first, 1.0 / length(first))
    return add(scaled(first, cos(2.0 * pi * u)), scaled(cross(along, first), sin(2.0 * pi * u)))


def lowered(v1: Vector, n: Vector, angle: float) -> Vector:
    """The normal of a slope that is less steep by `angle` [rad]; as it is where the block would not approach that."""
    horizontal = sqrt(n[0] * n[0] + n[1] * n[1])
    flat = UP if horizontal <= sin(angle) else turned(n, (n[1] / horizontal, -n[0] / horizontal, 0.0), angle)
    return flat if dot(v1, flat) < 0.0 else n


def rebound(v1: Vector, n: Vector, omega1: Vector, radius: float, mass: float, p: Parameters, u: Draws) -> Motion:
    """v2 [m/s] and ω2 [rad/s]; see the module."""
    if p.slope_reduction > 0.0:
        n = lowered(v1, n, radians(uniform(u.reduction, 0.0, p.slope_reduction)))
    rn = min(1.0, p.rn * uniform(u.rn, 1.0 - p.rn_spread, 1.0 + p.rn_spread))
    if rn <= 0.0:
        return STOPPED, STOPPED
    approach, tangential, tangential_speed = split(v1, n)
    speed = length(v1)
    depth = penetration_depth(rn, speed, radius, mass) if p.penetration else 0.0
    rt = radius / (radius + obstacle_height(u.obstacle, p.rg70, p.rg20, p.rg10) + depth)
    rt = min(1.0, rt * uniform(u.rt, 1.0 - p.rt_spread, 1.0 + p.rt_spread))
    c = INERTIA[int(p.block_shape) - FIRST_SHAPE]
    spin = radius * spin_in_plane(n, omega1)
    restituted = sqrt((c * spin * spin + tangential_speed * tangential_speed) * rt / (1.0 + c))
    after = with_length(tangential, tangential_speed, restituted)
    ratio = approach / NORMAL_SPEED_MPS
    v2, omega2 = leaving(n, approach * rn / (1.0 + ratio * ratio), after), rolling(n, after, radius)
    if isnan(u.deviation_class) or not p.deviation:
        return v2, omega2
    angle = deviation_angle(speed, u.deviation_class, u.deviation_angle, p.deviation_limit)
    if p.deviation_axis == CONE:
        about = cone_axis(v2, u.deviation_side)
    else:
        angle *= side_of(u.deviation_side, v1, n, p.deviation_side == DOWNSLOPE)
        about = n if p.deviation_axis == NORMAL else UP
    return turned(v2, about, angle), turned(omega2, about, angle)


MODEL = ImpactModel(
    name="dorren_2015",
    title="Rockyfor3D v5.2 (Dorren 2015)",
    reference="Dorren, L. (2015): Rockyfor3D (v5.2) revealed. ecorisQ.",
    function=rebound,
    parameter_type=Parameters,
    draw_type=Draws,
    colour=(0.00, 0.62, 0.45),
    compared=True,
    turns_with_the_frame=False,
)

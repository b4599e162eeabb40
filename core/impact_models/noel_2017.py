# SPDX-License-Identifier: GPL-3.0-or-later
"""Noël et al. 2017 (poster EGU2017-16699): an angle-dependent normal coefficient that pays for its gains.

    R_N  = min{2 ; 10 (θ1 − 4)^μ_N + 0.08}     μ_N ~ N(−1.08, σ_N),  σ_N = 0.15 (1 − θ1/100)     θ1 in degrees
    R_T  = min{1 ; |μ_T|}                      μ_T ~ N(0.69, 0.13)
    v_N2 = −R_N v_N1
    v_T2 = R_T [v_T1 − s/(1+q)]                s = v_T1 + r n × ω1, the slip;  q = 3/2 (cube of side 2r)
    ω2   = ω1 + q/((1+q) r) n × s              [rad/s]; not multiplied by R_T, the spin about n stays

R_N = 2 for θ1 ≤ 4°, where the power has no value. R_T multiplies the velocity without slip, so it is not the apparent
R_T of the block: that is 0.41 without spin and 0.69 for a rolling block.

A normal gain (R_N > 1) is taken from v_T2, of which at most a part f = 20 % goes (½m left out):

    need = (R_N² − 1) v_N1²     available = (1 − (1−f)²) v_T2²  ("velocity"),  f v_T2²  ("energy")
    give = min(need, available)     v_N2 = √(v_N1² + give)     |v_T2| ← √(v_T2² − give)

so R_N is lower when it cannot be paid, and kinetic energy with rotation never grows.

Source: the poster, whose equations were read. Its "maximum corresponding to 20 % of the tangential velocity" leaves
open which tangential velocity, and whether velocity or energy: the restituted one, and velocity, are our reading.
"""

from math import sqrt
from typing import NamedTuple

from .machinery.base import ImpactModel
from .machinery.chance import normal
from .machinery.contact import CUBE_INERTIA, gripped, incident_angle_deg, leaving, split
from .machinery.parameters import choice, number
from .machinery.triples import Motion, Vector, length, scaled

LIMIT_ANGLE_DEG = 4.0
RN_FACTOR, RN_FLOOR = 10.0, 0.08
SD_ANGLE_DEG = 100.0
BASES = ("velocity", "energy")
ENERGY = BASES.index("energy")
POSTER = "the poster"


class Parameters(NamedTuple):
    """What can be set."""

    rn_limit: float = number(2, 0, 10, "greatest R_N before it is paid for", POSTER)
    transfer: float = number(
        0.20, 0, 1, "greatest part of the tangential velocity (or energy) that can become normal", POSTER, symbol="f"
    )
    transfer_basis: float = choice(
        "velocity",
        BASES,
        "whether the transfer is a part of the restituted tangential velocity or of its energy",
        "the poster says velocity; our reading",
        verified=False,
    )
    rn_exponent: float = number(-1.08, -3, 0, "mean exponent of R_N = 10 (θ1 − 4)^μ_N + 0.08", POSTER, symbol="μ_N")
    rn_exponent_sd: float = number(
        0.15, 0, 1, "its standard deviation at θ1 = 0; at θ1 it is (1 − θ1/100) times that", POSTER, symbol="σ_N"
    )
    rt: float = number(0.69, 0, 1, "mean factor of the tangential velocity without slip", POSTER, symbol="μ_T")
    rt_sd: float = number(0.13, 0, 1, "its standard deviation", POSTER)


class Draws(NamedTuple):
    """The chance of one impact: of the exponent and of the tangential factor."""

    rn_exponent: float
    rt: float


def normal_coefficient(theta1_deg: float, exponent: float, limit: float) -> float:
    """R_N before any gain is paid for."""
    base = theta1_deg - LIMIT_ANGLE_DEG
    return min(limit, RN_FACTOR * base**exponent + RN_FLOOR) if base > 0.0 else limit


def rebound(v1: Vector, n: Vector, omega1: Vector, radius: float, mass: float, p: Parameters, u: Draws) -> Motion:
    """v2 [m/s] and ω2 [rad/s]; see the module."""
    approach, tangential, speed = split(v1, n)
    theta1 = incident_angle_deg(approach, speed)
    exponent = normal(u.rn_exponent, p.rn_exponent, p.rn_exponent_sd * (1.0 - theta1 / SD_ANGLE_DEG))
    rn = normal_coefficient(theta1, exponent, p.rn_limit)
    rt = min(1.0, abs(normal(u.rt, p.rt, p.rt_sd)))
    grip, omega2 = gripped(n, tangential, omega1, radius, CUBE_INERTIA)
    after = scaled(grip, rt)
    if rn <= 1.0:
        return leaving(n, rn * approach, after), omega2
    restituted = length(after)
    part = p.transfer if p.transfer_basis == ENERGY else 1.0 - (1.0 - p.transfer) ** 2
    give = min((rn * rn - 1.0) * approach * approach, part * restituted * restituted)
    kept = sqrt(max(restituted * restituted - give, 0.0)) / restituted if give > 0.0 else 1.0
    return leaving(n, sqrt(approach * approach + give), scaled(after, kept)), omega2


MODEL = ImpactModel(
    name="noel_2017",
    title="Noël et al. 2017",
    reference="Noël, F. et al. (2017): poster EGU2017-16699, EGU General Assembly.",
    function=rebound,
    parameter_type=Parameters,
    draw_type=Draws,
    colour=(0.34, 0.71, 0.91),
    compared=True,
)

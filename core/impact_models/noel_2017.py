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

from collections.abc import Sequence
from math import sqrt

from .machinery.base import ImpactModel
from .machinery.chance import normal
from .machinery.contact import CUBE_INERTIA, gripped, incident_angle_deg, leaving, split
from .machinery.parameters import ParameterSpec
from .machinery.triples import Vector, length, scaled

LIMIT_ANGLE_DEG = 4.0
RN_FACTOR, RN_FLOOR = 10.0, 0.08
SD_ANGLE_DEG = 100.0
ENERGY = 1.0


def normal_coefficient(theta1_deg: float, exponent: float, limit: float) -> float:
    """R_N before any gain is paid for."""
    base = theta1_deg - LIMIT_ANGLE_DEG
    return min(limit, RN_FACTOR * base**exponent + RN_FLOOR) if base > 0.0 else limit


def rebound(
    v1: Vector, n: Vector, omega1: Vector, radius: float, mass: float, p: Sequence[float], draws: Sequence[float]
) -> tuple[Vector, Vector]:
    """v2 [m/s] and ω2 [rad/s]; see the module."""
    limit, transfer, basis = p[0], p[1], p[2]
    approach, tangential, speed = split(v1, n)
    theta1 = incident_angle_deg(approach, speed)
    exponent = normal(draws[0], p[3], p[4] * (1.0 - theta1 / SD_ANGLE_DEG))
    rn = normal_coefficient(theta1, exponent, limit)
    rt = min(1.0, abs(normal(draws[1], p[5], p[6])))
    grip, omega2 = gripped(n, tangential, omega1, radius, CUBE_INERTIA)
    after = scaled(grip, rt)
    if rn <= 1.0:
        return leaving(n, rn * approach, after), omega2
    restituted = length(after)
    part = transfer if basis == ENERGY else 1.0 - (1.0 - transfer) ** 2
    give = min((rn * rn - 1.0) * approach * approach, part * restituted * restituted)
    kept = sqrt(max(restituted * restituted - give, 0.0)) / restituted if give > 0.0 else 1.0
    return leaving(n, sqrt(approach * approach + give), scaled(after, kept)), omega2


MODEL = ImpactModel(
    name="noel_2017",
    title="Noël et al. 2017",
    reference="Noël, F. et al. (2017): poster EGU2017-16699, EGU General Assembly.",
    function=rebound,
    draws=2,
    parameters=(
        ParameterSpec(
            "rn_limit", "", "", 2.0, 0.0, 10.0, description="greatest R_N before it is paid for", source="the poster"
        ),
        ParameterSpec(
            "transfer",
            "f",
            "",
            0.20,
            0.0,
            1.0,
            description="greatest part of the tangential velocity (or energy) that can become normal",
            source="the poster",
        ),
        ParameterSpec(
            "transfer_basis",
            "",
            "",
            "velocity",
            choices=("velocity", "energy"),
            description="whether the transfer is a part of the restituted tangential velocity or of its energy",
            source="the poster says velocity; our reading",
            verified=False,
        ),
        ParameterSpec(
            "rn_exponent",
            "μ_N",
            "",
            -1.08,
            -3.0,
            0.0,
            description="mean exponent of R_N = 10 (θ1 − 4)^μ_N + 0.08",
            source="the poster",
        ),
        ParameterSpec(
            "rn_exponent_sd",
            "σ_N",
            "",
            0.15,
            0.0,
            1.0,
            description="its standard deviation at θ1 = 0; at θ1 it is (1 − θ1/100) times that",
            source="the poster",
        ),
        ParameterSpec(
            "rt",
            "μ_T",
            "",
            0.69,
            0.0,
            1.0,
            description="mean factor of the tangential velocity without slip",
            source="the poster",
        ),
        ParameterSpec("rt_sd", "", "", 0.13, 0.0, 1.0, description="its standard deviation", source="the poster"),
    ),
)

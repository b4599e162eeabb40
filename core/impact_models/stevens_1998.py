# SPDX-License-Identifier: GPL-3.0-or-later
"""Stevens 1998: the lumped mass of RocFall, up to version 6.

    v_N2 = R_n v_N1 / (1 + (v_N1/K)²) / (1 + (m/C)²)          each divisor only with its switch
    rotational on:   v_T2 and ω2 of CRSP, see `pfeiffer_bowen_1989`; R_n unscaled in its SF
    rotational off:  v_T2 = R_t v_T1,  ω2 = ω1
    R_n ~ N(0.35, 0.04),  R_t ~ N(0.85, 0.04)                 independent, within 3 sd and within 0…1

With both switches on and without chance the model is CRSP. Velocities in m/s, m and C in kg, ω in rad/s. R_n = 0 stops
the block. Coefficients are drawn at every impact; RocFall may draw them once for a run.

Source: Stevens, W. (1998) RocFall, MSc thesis, University of Toronto. Equations as in one published program that reads
and writes RocFall's files (PyRockfall); RocFall's help calls the tangential law "CRSP damping". Coefficients and
standard deviations: Noël et al. 2018. Not verified: the truncation, and how the mass scales R_n.
"""

from collections.abc import Sequence

from .machinery.base import ImpactModel
from .machinery.chance import truncated_normal
from .machinery.contact import leaving, rolling, split
from .machinery.parameters import SWITCH, ParameterSpec
from .machinery.triples import Vector, scaled
from .pfeiffer_bowen_1989 import restituted_tangential

WIDEST_SD = 3.0


def drawn_coefficient(u: float, mean: float, sd: float) -> float:
    """N(mean, sd) within 3 sd and within 0…1."""
    return truncated_normal(u, mean, sd, max(0.0, mean - WIDEST_SD * sd), min(1.0, mean + WIDEST_SD * sd))


def rebound(
    v1: Vector, n: Vector, omega1: Vector, radius: float, mass: float, p: Sequence[float], draws: Sequence[float]
) -> tuple[Vector, Vector]:
    """v2 [m/s] and ω2 [rad/s]; see the module."""
    rotational, by_velocity, by_mass = p[4], p[5], p[7]
    rn, rt = drawn_coefficient(draws[0], p[0], p[2]), drawn_coefficient(draws[1], p[1], p[3])
    approach, tangential, speed = split(v1, n)
    scaled_rn = rn
    if by_velocity == 1.0:
        scaled_rn /= 1.0 + (approach / p[6]) ** 2
    if by_mass == 1.0:
        scaled_rn /= 1.0 + (mass / p[8]) ** 2
    if rotational == 1.0:
        after = restituted_tangential(tangential, speed, n, omega1, radius, approach, rn, rt)
        return leaving(n, approach * scaled_rn, after), rolling(n, after, radius)
    return leaving(n, approach * scaled_rn, scaled(tangential, rt)), omega1


MODEL = ImpactModel(
    name="stevens_1998",
    title="RocFall 6 (Stevens 1998)",
    reference="Stevens, W. (1998): RocFall: a tool for probabilistic analysis. MSc thesis, University of Toronto.",
    function=rebound,
    draws=2,
    parameters=(
        ParameterSpec(
            "rn", "R_n", "", 0.35, 0.0, 1.0, description="mean normal coefficient", source="Noël et al. 2018"
        ),
        ParameterSpec(
            "rt", "R_t", "", 0.85, 0.0, 1.0, description="mean tangential coefficient", source="Noël et al. 2018"
        ),
        ParameterSpec(
            "rn_sd",
            "",
            "",
            0.04,
            0.0,
            0.5,
            description="standard deviation of R_n before it is cut at 3 sd",
            source="Noël et al. 2018; the cut is not verified",
        ),
        ParameterSpec(
            "rt_sd",
            "",
            "",
            0.04,
            0.0,
            0.5,
            description="standard deviation of R_t before it is cut at 3 sd",
            source="Noël et al. 2018; the cut is not verified",
        ),
        ParameterSpec(
            "rotational",
            "",
            "",
            "on",
            choices=SWITCH,
            description="consider rotational velocity: the tangential law of CRSP",
            source="RocFall's help; PyRockfall",
        ),
        ParameterSpec(
            "scale_rn_by_velocity",
            "",
            "",
            "on",
            choices=SWITCH,
            description="R_n falls with the normal velocity",
            source="PyRockfall",
        ),
        ParameterSpec(
            "velocity_scale",
            "K",
            "m/s",
            9.144,
            0.1,
            100.0,
            description="normal velocity that halves R_n",
            source="PyRockfall; 30 ft/s",
        ),
        ParameterSpec(
            "scale_rn_by_mass",
            "",
            "",
            "off",
            choices=SWITCH,
            description="R_n falls with the mass",
            source="PyRockfall; not verified against RocFall",
            verified=False,
        ),
        ParameterSpec(
            "mass_scale",
            "C",
            "kg",
            1000.0,
            1.0,
            1e7,
            description="mass that halves R_n",
            source="PyRockfall; not verified against RocFall",
            verified=False,
        ),
    ),
)

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

from typing import NamedTuple

from .machinery.base import ImpactModel
from .machinery.chance import truncated_normal
from .machinery.contact import leaving, rolling, split
from .machinery.parameters import number, switch
from .machinery.triples import Motion, Vector, scaled
from .pfeiffer_bowen_1989 import restituted_tangential

WIDEST_SD = 3.0
PAPER, CUT = "Noël et al. 2018", "Noël et al. 2018; the cut is not verified"
PROGRAM, UNSURE = "PyRockfall", "PyRockfall; not verified against RocFall"


class Parameters(NamedTuple):
    """What can be set."""

    rn: float = number(0.35, 0, 1, "mean normal coefficient", PAPER, symbol="R_n")
    rt: float = number(0.85, 0, 1, "mean tangential coefficient", PAPER, symbol="R_t")
    rn_sd: float = number(0.04, 0, 0.5, "standard deviation of R_n before it is cut at 3 sd", CUT)
    rt_sd: float = number(0.04, 0, 0.5, "standard deviation of R_t before it is cut at 3 sd", CUT)
    rotational: float = switch(
        "on", "consider rotational velocity: the tangential law of CRSP", f"RocFall's help; {PROGRAM}"
    )
    scale_rn_by_velocity: float = switch("on", "R_n falls with the normal velocity", PROGRAM)
    velocity_scale: float = number(
        9.144, 0.1, 100, "normal velocity that halves R_n", f"{PROGRAM}; 30 ft/s", unit="m/s", symbol="K"
    )
    scale_rn_by_mass: float = switch("off", "R_n falls with the mass", UNSURE, verified=False)
    mass_scale: float = number(1000, 1, 1e7, "mass that halves R_n", UNSURE, unit="kg", symbol="C", verified=False)


class Draws(NamedTuple):
    """The chance of one impact: of its two coefficients."""

    rn: float
    rt: float


def drawn_coefficient(u: float, mean: float, sd: float) -> float:
    """N(mean, sd) within 3 sd and within 0…1."""
    return truncated_normal(u, mean, sd, max(0.0, mean - WIDEST_SD * sd), min(1.0, mean + WIDEST_SD * sd))


def rebound(v1: Vector, n: Vector, omega1: Vector, radius: float, mass: float, p: Parameters, u: Draws) -> Motion:
    """v2 [m/s] and ω2 [rad/s]; see the module."""
    rn, rt = drawn_coefficient(u.rn, p.rn, p.rn_sd), drawn_coefficient(u.rt, p.rt, p.rt_sd)
    approach, tangential, speed = split(v1, n)
    scaled_rn = rn
    if p.scale_rn_by_velocity:
        scaled_rn /= 1.0 + (approach / p.velocity_scale) ** 2
    if p.scale_rn_by_mass:
        scaled_rn /= 1.0 + (mass / p.mass_scale) ** 2
    if p.rotational:
        after = restituted_tangential(tangential, speed, n, omega1, radius, approach, rn, rt)
        return leaving(n, approach * scaled_rn, after), rolling(n, after, radius)
    return leaving(n, approach * scaled_rn, scaled(tangential, rt)), omega1


MODEL = ImpactModel(
    name="stevens_1998",
    title="RocFall 6 (Stevens 1998)",
    reference="Stevens, W. (1998): RocFall: a tool for probabilistic analysis. MSc thesis, University of Toronto.",
    function=rebound,
    parameter_type=Parameters,
    draw_type=Draws,
    colour=(0.80, 0.47, 0.65),
    compared=True,
)

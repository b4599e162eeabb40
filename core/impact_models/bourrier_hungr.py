# SPDX-License-Identifier: GPL-3.0-or-later
"""Friction-limited rebound of a sphere, after Bourrier et al. and Hungr.

    R_n  = V½ / (v_N1 + V½)                    v_N2 = −R_n v_N1
    J    = min{(2/7) R_t |s| ; tan φ (1 + R_n) v_N1}      s = v_T1 + r n × ω1, the slip
    v_T2 = R_t v_T1 − J s/|s|
    ω2   = R_t ω1 + (5/2) (J/r) n × s/|s|      [rad/s]

The contact sticks when the friction suffices: then J = (2/7) R_t |s| and v_T2 = R_t (5 v_T1 + 2 rω)/7, a rolling block.
Else it slides, with the impulse of dry friction. Energy never grows. No chance.

Source: the equations are derived from the two cases as they are used in PlatRock ("Bourrier"), RockGIS and PIERRE,
whose codes differ in signs; ranges of V½, φ and R_t as in PlatRock. Not verified against a primary text; the default of
R_t is ours.
"""

from collections.abc import Sequence
from math import radians, tan

from .machinery.base import ImpactModel
from .machinery.contact import leaving, slip, split
from .machinery.parameters import ParameterSpec
from .machinery.triples import Vector, add, cross, length, scaled


def rebound(
    v1: Vector, n: Vector, omega1: Vector, radius: float, mass: float, p: Sequence[float], draws: Sequence[float]
) -> tuple[Vector, Vector]:
    """v2 [m/s] and ω2 [rad/s]; see the module."""
    half_speed, rt, friction_deg = p[0], p[1], p[2]
    approach, tangential, _ = split(v1, n)
    rn = half_speed / (approach + half_speed)
    s = slip(n, tangential, omega1, radius)
    slipping = length(s)
    impulse = min(2.0 / 7.0 * rt * slipping, tan(radians(friction_deg)) * (1.0 + rn) * approach)
    unit_slip = scaled(s, 1.0 / slipping) if slipping > 0.0 else s
    after = add(scaled(tangential, rt), scaled(unit_slip, -impulse))
    omega2 = add(scaled(omega1, rt), scaled(cross(n, unit_slip), 2.5 * impulse / radius))
    return leaving(n, rn * approach, after), omega2


MODEL = ImpactModel(
    name="bourrier_hungr",
    title="Friction-limited rebound (Bourrier, Hungr)",
    reference="Bourrier, F. et al. (2009): Nat. Hazards Earth Syst. Sci. 9, 831–842, for the idea; see the module.",
    function=rebound,
    parameters=(
        ParameterSpec(
            "half_speed",
            "V½",
            "m/s",
            10.0,
            0.01,
            1000.0,
            description="normal velocity at which R_n is one half",
            source="PlatRock, 0–50",
            verified=False,
        ),
        ParameterSpec(
            "rt",
            "R_t",
            "",
            0.9,
            0.0,
            1.0,
            description="tangential coefficient beside friction",
            source="range of PlatRock; the default is ours",
            verified=False,
        ),
        ParameterSpec(
            "friction_angle",
            "φ",
            "deg",
            20.0,
            0.0,
            89.0,
            description="angle of friction between block and ground",
            source="PlatRock, 0–40",
            verified=False,
        ),
    ),
)

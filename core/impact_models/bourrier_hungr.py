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

from math import radians, tan
from typing import NamedTuple

from .machinery.base import ImpactModel, NoDraws
from .machinery.contact import leaving, slip, split
from .machinery.parameters import number
from .machinery.triples import Motion, Vector, add, cross, length, scaled

HALF, ANGLE, OURS = "PlatRock, 0–50", "PlatRock, 0–40", "range of PlatRock; the default is ours"


class Parameters(NamedTuple):
    """What can be set."""

    half_speed: float = number(
        10, 0.01, 1000, "normal velocity at which R_n is one half", HALF, unit="m/s", symbol="V½", verified=False
    )
    rt: float = number(0.9, 0, 1, "tangential coefficient beside friction", OURS, symbol="R_t", verified=False)
    friction_angle: float = number(
        20, 0, 89, "angle of friction between block and ground", ANGLE, unit="deg", symbol="φ", verified=False
    )


def rebound(v1: Vector, n: Vector, omega1: Vector, radius: float, mass: float, p: Parameters, u: NoDraws) -> Motion:
    """v2 [m/s] and ω2 [rad/s]; see the module."""
    approach, tangential, _ = split(v1, n)
    rn = p.half_speed / (approach + p.half_speed)
    s = slip(n, tangential, omega1, radius)
    slipping = length(s)
    impulse = min(2.0 / 7.0 * p.rt * slipping, tan(radians(p.friction_angle)) * (1.0 + rn) * approach)
    unit_slip = scaled(s, 1.0 / slipping) if slipping > 0.0 else s
    after = add(scaled(tangential, p.rt), scaled(unit_slip, -impulse))
    omega2 = add(scaled(omega1, p.rt), scaled(cross(n, unit_slip), 2.5 * impulse / radius))
    return leaving(n, rn * approach, after), omega2


MODEL = ImpactModel(
    name="bourrier_hungr",
    title="Friction limit (Bourrier, Hungr)",
    reference="Bourrier, F. et al. (2009): Nat. Hazards Earth Syst. Sci. 9, 831–842, for the idea; see the module.",
    function=rebound,
    parameter_type=Parameters,
    colour=(0.62, 0.80, 0.25),
)

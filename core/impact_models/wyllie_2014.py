# SPDX-License-Identifier: GPL-3.0-or-later
"""Wyllie 2014: a normal coefficient that depends on the incident angle only, and a contact that grips.

    R_N  = 19.5 θ1^(−1.03)                     θ1 in degrees, from the ground
    v_N2 = −R_N v_N1                           not limited
    v_T2 = v_T1 − s/(1+q)                      s = v_T1 + r n × ω1, the slip
    ω2   = ω1 + q/((1+q) r) n × s              [rad/s]; the spin about n stays

q = 3/2 for a cube of side 2r, 5/2 for a sphere. θ1 is at least 0.1° in the power. The normal velocity stays finite at
grazing incidence (v_N2/|v1| = R_N sin θ1 → 0.39), but energy may grow: the model does not look at it. No chance.

Source: Wyllie, D. (2014) Rock Fall Engineering, CRC Press; the power law as in one published program (RockGIS), the
tangential law of Goldsmith (1960) as on the poster of Noël et al. 2017. Not verified against the book. That energy is
not conserved: Noël et al. 2018.
"""

from typing import NamedTuple

from .machinery.base import ImpactModel, NoDraws
from .machinery.contact import CUBE_INERTIA, SPHERE_INERTIA, gripped, incident_angle_deg, leaving, split
from .machinery.parameters import choice, number
from .machinery.triples import Motion, Vector

SMALLEST_ANGLE_DEG = 0.1
SHAPES = ("cube", "sphere")
SPHERE = SHAPES.index("sphere")


class Parameters(NamedTuple):
    """What can be set."""

    rn_factor: float = number(
        19.5, 0, 100, "factor of R_N = factor · θ1^exponent, θ1 in degrees", "RockGIS", verified=False
    )
    rn_exponent: float = number(-1.03, -2, 0, "exponent of R_N = factor · θ1^exponent", "RockGIS", verified=False)
    inertia: float = choice(
        "cube", SHAPES, "shape of the block for its moment of inertia", "cube: Noël et al. 2017", verified=False
    )


def rebound(v1: Vector, n: Vector, omega1: Vector, radius: float, mass: float, p: Parameters, u: NoDraws) -> Motion:
    """v2 [m/s] and ω2 [rad/s]; see the module."""
    approach, tangential, speed = split(v1, n)
    rn = p.rn_factor * max(incident_angle_deg(approach, speed), SMALLEST_ANGLE_DEG) ** p.rn_exponent
    after, omega2 = gripped(n, tangential, omega1, radius, SPHERE_INERTIA if p.inertia == SPHERE else CUBE_INERTIA)
    return leaving(n, rn * approach, after), omega2


MODEL = ImpactModel(
    name="wyllie_2014",
    title="Wyllie 2014",
    reference="Wyllie, D. (2014): Rock Fall Engineering. CRC Press.",
    function=rebound,
    parameter_type=Parameters,
    colour=(0.00, 0.45, 0.70),
    compared=True,
    energy_never_grows=False,
)

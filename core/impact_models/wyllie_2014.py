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

from collections.abc import Sequence

from .machinery.base import ImpactModel
from .machinery.contact import CUBE_INERTIA, SPHERE_INERTIA, gripped, incident_angle_deg, leaving, split
from .machinery.parameters import ParameterSpec
from .machinery.triples import Vector

SMALLEST_ANGLE_DEG = 0.1
SPHERE = 1.0


def rebound(
    v1: Vector, n: Vector, omega1: Vector, radius: float, mass: float, p: Sequence[float], draws: Sequence[float]
) -> tuple[Vector, Vector]:
    """v2 [m/s] and ω2 [rad/s]; see the module."""
    factor, exponent, inertia = p[0], p[1], p[2]
    approach, tangential, speed = split(v1, n)
    rn = factor * max(incident_angle_deg(approach, speed), SMALLEST_ANGLE_DEG) ** exponent
    after, omega2 = gripped(n, tangential, omega1, radius, SPHERE_INERTIA if inertia == SPHERE else CUBE_INERTIA)
    return leaving(n, rn * approach, after), omega2


MODEL = ImpactModel(
    name="wyllie_2014",
    title="Wyllie 2014",
    reference="Wyllie, D. (2014): Rock Fall Engineering. CRC Press.",
    function=rebound,
    energy_never_grows=False,
    parameters=(
        ParameterSpec(
            "rn_factor",
            "",
            "",
            19.5,
            0.0,
            100.0,
            description="factor of R_N = factor · θ1^exponent, θ1 in degrees",
            source="RockGIS",
            verified=False,
        ),
        ParameterSpec(
            "rn_exponent",
            "",
            "",
            -1.03,
            -2.0,
            0.0,
            description="exponent of R_N = factor · θ1^exponent",
            source="RockGIS",
            verified=False,
        ),
        ParameterSpec(
            "inertia",
            "",
            "",
            "cube",
            choices=("cube", "sphere"),
            description="shape of the block for its moment of inertia",
            source="cube: Noël et al. 2017",
            verified=False,
        ),
    ),
)

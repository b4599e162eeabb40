# SPDX-License-Identifier: GPL-3.0-or-later
"""Azimi & Desvarreux 1977 (ADRGT): constant coefficients of restitution.

    v_N2 = −R_N v_N1        v_T2 = R_T v_T1

No scaling with the velocity, no coupling with the spin, no chance. With ``definition = energy`` the two coefficients
are ratios of energies, and the velocities are multiplied by their square roots.

The spin plays no part; ω2 = (n × v_T2)/r [rad/s], a rolling block, is given for display: rotational energy may grow.

Source: Noël et al. 2018 for "no scaling", R_N = 0.35 and R_T = 0.85. Not verified: the report of 1977 could not be
read. That its coefficients are ratios of velocities is the classical reading; later papers of Azimi define ratios of
energies.
"""

from collections.abc import Sequence
from math import sqrt

from .machinery.base import ImpactModel
from .machinery.contact import leaving, rolling, split
from .machinery.parameters import ParameterSpec
from .machinery.triples import Vector, scaled

ENERGY = 1.0


def rebound(
    v1: Vector, n: Vector, omega1: Vector, radius: float, mass: float, p: Sequence[float], draws: Sequence[float]
) -> tuple[Vector, Vector]:
    """v2 [m/s] and ω2 [rad/s]; see the module."""
    rn, rt, definition = p[0], p[1], p[2]
    if definition == ENERGY:
        rn, rt = sqrt(rn), sqrt(rt)
    approach, tangential, _ = split(v1, n)
    after = scaled(tangential, rt)
    return leaving(n, rn * approach, after), rolling(n, after, radius)


MODEL = ImpactModel(
    name="azimi_desvarreux_1977",
    title="Azimi & Desvarreux 1977",
    reference="Azimi, C., Desvarreux, P. (1977): Calcul de chutes de blocs et vérification sur modèle réduit. ADRGT.",
    function=rebound,
    energy_never_grows=False,
    parameters=(
        ParameterSpec(
            "rn",
            "R_N",
            "",
            0.35,
            0.0,
            1.0,
            description="normal coefficient of restitution",
            source="Noël et al. 2018",
        ),
        ParameterSpec(
            "rt",
            "R_T",
            "",
            0.85,
            0.0,
            1.0,
            description="tangential coefficient of restitution",
            source="Noël et al. 2018",
        ),
        ParameterSpec(
            "definition",
            "",
            "",
            "velocity",
            choices=("velocity", "energy"),
            description="whether the coefficients are ratios of velocities or of energies",
            source="the classical reading is velocity",
            verified=False,
        ),
    ),
)

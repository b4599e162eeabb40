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

from math import sqrt
from typing import NamedTuple

from .machinery.base import ImpactModel, NoDraws
from .machinery.contact import leaving, rolling, split
from .machinery.parameters import choice, number
from .machinery.triples import Motion, Vector, scaled

DEFINITIONS = ("velocity", "energy")
ENERGY = DEFINITIONS.index("energy")


class Parameters(NamedTuple):
    """What can be set."""

    rn: float = number(0.35, 0, 1, "normal coefficient of restitution", "Noël et al. 2018", symbol="R_N")
    rt: float = number(0.85, 0, 1, "tangential coefficient of restitution", "Noël et al. 2018", symbol="R_T")
    definition: float = choice(
        "velocity",
        DEFINITIONS,
        "whether the coefficients are ratios of velocities or of energies",
        "the classical reading is velocity",
        verified=False,
    )


def rebound(v1: Vector, n: Vector, omega1: Vector, radius: float, mass: float, p: Parameters, u: NoDraws) -> Motion:
    """v2 [m/s] and ω2 [rad/s]; see the module."""
    rn, rt = (sqrt(p.rn), sqrt(p.rt)) if p.definition == ENERGY else (p.rn, p.rt)
    approach, tangential, _ = split(v1, n)
    after = scaled(tangential, rt)
    return leaving(n, rn * approach, after), rolling(n, after, radius)


MODEL = ImpactModel(
    name="azimi_desvarreux_1977",
    title="Azimi & Desvarreux 1977",
    reference="Azimi, C., Desvarreux, P. (1977): Calcul de chutes de blocs et vérification sur modèle réduit. ADRGT.",
    function=rebound,
    parameter_type=Parameters,
    colour=(0.90, 0.62, 0.00),
    compared=True,
    energy_never_grows=False,
)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Drag of air: ½ρC_D·A|v|v against the motion (Noël et al. 2017, EGU2017-16699), and flights with it through points."""

from collections.abc import Callable
from dataclasses import dataclass
from math import pi

import numpy as np

from ..constants import AIR_DENSITY_KGPM3, DRAG_COEFFICIENT
from ..errors import RockfallError
from ..least_squares import damped_step
from ..vectors import Array, norm
from .block import Block
from .observations import Observations

SOLVED_M = 1e-10
"""The fit ends when no start position and no end point moves by more than this."""
MAX_ITERATIONS = 60


@dataclass(frozen=True)
class Drag:
    """Air drag ½ρC_D·A|v|v on a block, as a vector (not by components), with A = π·d²/4.

    Attributes
    ----------
    air_density : ρ [kg/m³].
    coefficient : C_D [-].
    """

    air_density: float = AIR_DENSITY_KGPM3
    coefficient: float = DRAG_COEFFICIENT

    def per_metre(self, block: Block) -> float:
        """½ρC_D·A/m [1/m]: the deceleration is this times |v|v."""
        return self.of_size(block.diameter_m, block.mass_kg)

    def of_size[T: (float, Array)](self, diameter_m: T, mass_kg: T) -> T:
        """The same, for diameters [m] and masses [kg]."""
        return 0.5 * self.air_density * self.coefficient * pi / 4 * diameter_m**2 / mass_kg


def fit_with_drag(
    observations: Observations,
    position: Array,
    velocity: Array,
    gravity_mps2: float,
    drag_per_m: Array,
    name: Callable[[int], str],
) -> tuple[Array, Array]:
    """Start positions and velocities (k, 3) of the flights with drag that fit their observations best.

    With two observations this is the two-point boundary problem, met to 1e-9 m.

    Parameters
    ----------
    position, velocity : (k, 3) first guess: the flight without drag.
    drag_per_m : (k,) [1/m].
    name : index of a flight → its name, for the error message.

    Raises
    ------
    RockfallError : no flight through the observations is found.

    Notes
    -----
    Gauss–Newton over start position and velocity, all flights at once, with the derivatives of the equation of motion.
    """
    from . import drag_kernels

    position, velocity = position.copy(), velocity.copy()
    group, longest = observations.flight, np.maximum.reduceat(observations.time_s, observations.starts)
    gravity = np.full(observations.count, float(gravity_mps2))
    states = np.empty((group.size, drag_kernels.STATE))
    jacobian = np.tile(np.eye(3, 6), (group.size, 1, 1))
    wanting = np.ones(observations.count, dtype=np.bool_)
    for _ in range(MAX_ITERATIONS):
        drag_kernels.states_along(group, observations.time_s, velocity, drag_per_m, gravity, states)
        jacobian[:, :, 3:] = states[:, drag_kernels.MOTION : 21].reshape(-1, 3, 5)[:, :, :3]
        misfit = observations.position - position[group] - states[:, :3]
        weighted = jacobian * observations.weight[:, None, None]
        normal = observations.sums(np.einsum("mij,mik->mjk", weighted, jacobian))
        right = observations.sums(np.einsum("mij,mi->mj", weighted, misfit))
        step = damped_step(normal, right)
        moves = np.maximum(norm(step[:, :3]), norm(step[:, 3:]) * longest)
        lost = np.isnan(moves)
        wanting = lost if lost.any() else ~(moves < SOLVED_M)
        if lost.any():
            break
        position, velocity = position + step[:, :3], velocity + step[:, 3:]
        if not wanting.any():
            return position, velocity
    raise RockfallError(
        f"No flight with drag joins the picks of {name(int(np.argmax(wanting)))}. "
        "Check the times, and the block's size and density."
    )

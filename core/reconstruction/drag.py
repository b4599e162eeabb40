# SPDX-License-Identifier: GPL-3.0-or-later
"""Flight through air: ½ρC_D·A|v|v against the motion (Noël et al. 2017, EGU2017-16699)."""

from collections.abc import Callable
from dataclasses import dataclass
from math import pi

import numpy as np

from ..constants import AIR_DENSITY_KGPM3, DRAG_COEFFICIENT
from ..errors import RockfallError
from ..vectors import Array, norm
from .block import Block
from .observations import Observations

SETTLED_M = 1e-10
"""The integration is refined until an end point moves by less than this."""
SOLVED_M = 1e-10
"""The fit ends when no start position and no end point moves by more than this."""
MAX_STEPS = 1 << 15
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
        return 0.5 * self.air_density * self.coefficient * pi / 4 * block.diameter_m**2 / block.mass_kg


def fly(velocity: Array, duration_s: Array, gravity_mps2: float, drag_per_m: Array) -> tuple[Array, Array]:
    """Displacements (n, 3) [m] and final velocities (n, 3) [m/s] of flights with drag.

    Parameters
    ----------
    velocity : (n, 3) at the start [m/s].
    duration_s : (n,) [s], may be negative.
    drag_per_m : (n,) [1/m].

    Raises
    ------
    RockfallError : a flight cannot be integrated to 1e-10 m.

    Notes
    -----
    Classical Runge–Kutta steps, doubled for each flight until its end point settles, then extrapolated.
    """
    moved, final = np.empty_like(velocity), np.empty_like(velocity)
    open_rows = np.arange(duration_s.size)
    steps = 8
    coarse = _runge_kutta(velocity, duration_s, gravity_mps2, drag_per_m, steps)
    while open_rows.size:
        steps *= 2
        if steps > MAX_STEPS:
            raise RockfallError("A flight with drag cannot be integrated. Check the block's size and density.")
        rows = open_rows
        fine = _runge_kutta(velocity[rows], duration_s[rows], gravity_mps2, drag_per_m[rows], steps)
        change = fine - coarse
        better = fine + change / 15
        settled = (np.abs(change[:, :3]) < SETTLED_M).all(axis=1)
        moved[rows[settled]], final[rows[settled]] = better[settled, :3], better[settled, 3:]
        open_rows, coarse = rows[~settled], fine[~settled]
    return moved, final


def _runge_kutta(velocity: Array, duration_s: Array, gravity_mps2: float, drag_per_m: Array, steps: int) -> Array:
    """(n, 6): displacement and velocity after `steps` equal steps of the classical fourth-order method."""
    h = (duration_s / steps)[:, None]
    k = drag_per_m[:, None]
    fall = np.array([0.0, 0.0, -gravity_mps2])
    x, v = np.zeros_like(velocity), velocity.copy()

    def acceleration(u: Array) -> Array:
        return fall - k * norm(u)[:, None] * u

    with np.errstate(over="ignore", invalid="ignore"):  # a step that is far too long: the next doubling mends it
        for _ in range(steps):
            a1 = acceleration(v)
            a2 = acceleration(v + h / 2 * a1)
            a3 = acceleration(v + h / 2 * a2)
            a4 = acceleration(v + h * a3)
            x += h * v + h**2 / 6 * (a1 + a2 + a3)
            v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return np.concatenate([x, v], axis=1)


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
    Gauss–Newton over start position and velocity, all flights at once. The displacement does not depend on the start
    position, so only the three derivatives by the velocity are taken (numerically).
    """
    position, velocity = position.copy(), velocity.copy()
    active = np.arange(observations.count)
    obs = observations
    for _ in range(MAX_ITERATIONS):
        step = _gauss_newton_step(obs, position[active], velocity[active], gravity_mps2, drag_per_m[active])
        position[active] += step[:, :3]
        velocity[active] += step[:, 3:]
        longest = np.maximum.reduceat(obs.time_s, np.flatnonzero(np.r_[True, np.diff(obs.flight) > 0]))
        moves = np.maximum(norm(step[:, :3]), norm(step[:, 3:]) * longest)
        going = ~(moves < SOLVED_M)
        if not going.any():
            return position, velocity
        keep = going[obs.flight]
        obs = Observations(
            obs.pick[keep],
            (np.cumsum(going) - 1)[obs.flight[keep]],
            obs.time_s[keep],
            obs.position[keep],
            obs.weight[keep],
        )
        active = active[going]
    raise RockfallError(
        f"No flight with drag joins the picks of {name(int(active[0]))}. "
        "Check the times, and the block's size and density."
    )


def _gauss_newton_step(
    obs: Observations, position: Array, velocity: Array, gravity_mps2: float, drag_per_m: Array
) -> Array:
    """(k, 6) change of start position and velocity."""
    group, m = obs.flight, obs.time_s.size
    v, k = velocity[group], drag_per_m[group]
    nudge = 1e-4 * (1.0 + norm(v))
    nudged = [v]
    for axis in range(3):
        shift = np.zeros((m, 3))
        shift[:, axis] = nudge
        nudged += [v + shift, v - shift]
    moved, _ = fly(np.concatenate(nudged), np.tile(obs.time_s, 7), gravity_mps2, np.tile(k, 7))
    moved = moved.reshape(7, m, 3)
    slope = (moved[1::2] - moved[2::2]) / (2 * nudge[None, :, None])  # (by axis, m, xyz)

    jacobian = np.zeros((m, 3, 6))
    jacobian[:, :, :3] = np.eye(3)
    jacobian[:, :, 3:] = slope.transpose(1, 2, 0)
    misfit = obs.position - position[group] - moved[0]
    weighted = jacobian * obs.weight[:, None, None]
    normal = obs.sums(np.einsum("mij,mik->mjk", weighted, jacobian))
    right = obs.sums(np.einsum("mij,mi->mj", weighted, misfit))
    return np.asarray(np.linalg.solve(normal, right[:, :, None])[:, :, 0], dtype=np.float64)

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
FEWEST_STEPS, MOST_STEPS = 4, 1 << 14
COARSEST = 0.5
"""Largest product of a first step and the rate at which drag changes the velocity."""
MAX_ITERATIONS = 60
CACHED_ROWS = 4096
"""Flights whose intermediate results stay in the processor's cache."""


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
    """Displacements (n, 3) [m] and final velocities (n, 3) [m/s] of flights with drag, to 1e-10 m.

    Parameters
    ----------
    velocity : (n, 3) at the start [m/s].
    duration_s : (n,) [s], may be negative.
    drag_per_m : (n,) [1/m].

    Raises
    ------
    RockfallError : a flight cannot be integrated.
    """
    moved, final = _integrate(velocity, duration_s, gravity_mps2, drag_per_m)
    if np.isnan(moved).any():
        raise RockfallError(
            "A flight with drag cannot be integrated. Check its duration, and the block's size and density."
        )
    return moved, final


def _integrate(velocity: Array, duration_s: Array, gravity_mps2: float, drag_per_m: Array) -> tuple[Array, Array]:
    """As `fly`, with NaN where it fails. Flights that need steps of about one number are taken together."""
    states = np.full((duration_s.size, 6), np.nan)
    rate = drag_per_m * norm(velocity) + np.sqrt(drag_per_m * gravity_mps2)
    with np.errstate(invalid="ignore"):
        least = np.maximum(np.abs(duration_s) * rate / COARSEST, FEWEST_STEPS)
    feasible = least <= MOST_STEPS
    size = np.zeros(duration_s.size, dtype=np.int64)
    size[feasible] = 2 ** np.ceil(np.log2(least[feasible])).astype(np.int64)
    for steps in np.unique(size[feasible]):
        rows = np.flatnonzero(size == steps)
        states[rows] = _extrapolate(velocity[rows], duration_s[rows], gravity_mps2, drag_per_m[rows], int(steps))
    return states[:, :3], states[:, 3:]


def _extrapolate(velocity: Array, duration_s: Array, gravity_mps2: float, drag_per_m: Array, steps: int) -> Array:
    """(n, 6): displacement and velocity; Runge–Kutta with doubled steps, extrapolated (Romberg) until they settle."""
    states = np.full((duration_s.size, 6), np.nan)
    rows = np.arange(duration_s.size)
    table = [_runge_kutta(velocity, duration_s, gravity_mps2, drag_per_m, steps)]
    while rows.size and steps < MOST_STEPS:
        steps *= 2
        line = [_runge_kutta(velocity[rows], duration_s[rows], gravity_mps2, drag_per_m[rows], steps)]
        for order, coarser in enumerate(table, start=4):  # the errors go as h⁴, h⁵, h⁶ …
            line.append(line[-1] + (line[-1] - coarser) / (2**order - 1))
        settled = (np.abs(line[-1] - table[-1])[:, :3] < SETTLED_M).all(axis=1)
        states[rows[settled]] = line[-1][settled]
        rows, table = rows[~settled], [entry[~settled] for entry in line]
    return states


def _runge_kutta(velocity: Array, duration_s: Array, gravity_mps2: float, drag_per_m: Array, steps: int) -> Array:
    """(n, 6): displacement and velocity after `steps` equal steps of the classical fourth-order method."""
    states = np.empty((duration_s.size, 6))
    for i in range(0, duration_s.size, CACHED_ROWS):
        rows = slice(i, i + CACHED_ROWS)
        h, k = duration_s[rows] / steps, -drag_per_m[rows]
        states[rows] = _steps(velocity[rows].T.copy(), h, gravity_mps2, k, steps).T
    return states


def _steps(v: Array, h: Array, gravity_mps2: float, k: Array, steps: int) -> Array:
    """(6, n) from (3, n): components first, which is quicker here."""
    x = np.zeros_like(v)

    def acceleration(u: Array) -> Array:
        result = (k * np.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])) * u
        result[2] -= gravity_mps2
        return result

    half, third, sixth = h / 2, h * h / 6, h / 6
    for _ in range(steps):
        a1 = acceleration(v)
        a2 = acceleration(v + half * a1)
        a3 = acceleration(v + half * a2)
        a4 = acceleration(v + h * a3)
        middle = a2 + a3
        x += h * v + third * (a1 + middle)
        v += sixth * (a1 + 2 * middle + a4)
    return np.concatenate([x, v])


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
        if np.isnan(step).any():
            active = active[np.isnan(step).any(axis=1)]
            break
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
    later = np.flatnonzero(obs.time_s > 0)
    start = velocity[group[later]]
    nudge = 1e-4 * (1.0 + norm(start))
    nudged = [start + sign * nudge[:, None] * axis for axis in np.eye(3) for sign in (1, -1)]
    times, drags = np.tile(obs.time_s[later], 7), np.tile(drag_per_m[group[later]], 7)
    ends = _integrate(np.concatenate([start, *nudged]), times, gravity_mps2, drags)[0].reshape(7, -1, 3)
    moved, slope = np.zeros((m, 3)), np.zeros((m, 3, 3))
    moved[later] = ends[0]
    slope[later] = ((ends[1::2] - ends[2::2]) / (2 * nudge[:, None])).transpose(1, 2, 0)

    jacobian = np.concatenate([np.broadcast_to(np.eye(3), (m, 3, 3)), slope], axis=2)
    misfit = obs.position - position[group] - moved
    weighted = jacobian * obs.weight[:, None, None]
    normal = obs.sums(np.einsum("mij,mik->mjk", weighted, jacobian))
    right = obs.sums(np.einsum("mij,mi->mj", weighted, misfit))
    return np.asarray(np.linalg.solve(normal, right[:, :, None])[:, :, 0], dtype=np.float64)

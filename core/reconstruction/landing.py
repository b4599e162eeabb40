# SPDX-License-Identifier: GPL-3.0-or-later
"""Where free flights meet the terrain."""

from dataclasses import dataclass

import numpy as np

from ..compiled import in_chunks
from ..errors import RockfallError
from ..terrain.raycast import heights_above
from ..terrain.surface import Surface
from ..vectors import Array, Indices, Mask, dot, norm
from .free_flight import UNFLYABLE, fly

STEP_S = 0.02
"""Longest chord of the curved path, which it leaves by g·t²/8 = 0.5 mm; the first ones are shorter, as the path may be
a hop. The landing is refined on the path itself."""
LIMIT_S = 60.0
CHUNK_FLIGHTS = 256
REFINEMENTS = 5
PROFILE_POINTS = 33


@dataclass(frozen=True, eq=False)
class Landings:
    """Ends of n flights.

    Attributes
    ----------
    duration_s : (n,) [s].
    position, velocity : (n, 3) at the end [m], [m/s].
    into_ground : (n,) the flight never comes out of the ground, and so has no length.
    left_terrain : (n,) the flight leaves the terrain's border; it is cut at the terrain's lowest elevation, or when the
        time is up.
    """

    duration_s: Array
    position: Array
    velocity: Array
    into_ground: Mask
    left_terrain: Mask


@dataclass(frozen=True, eq=False)
class Launches:
    """Starts of n free flights.

    Attributes
    ----------
    position, velocity : (n, 3) [m], [m/s].
    drag_per_m : (n,) ½ρC_D·A/m [1/m], 0 without drag.
    gravity_mps2 : [m/s²].
    """

    position: Array
    velocity: Array
    drag_per_m: Array
    gravity_mps2: float

    def states(self, which: Indices, elapsed_s: Array | float) -> tuple[Array, Array]:
        """Positions and velocities (q, 3) of the flights `which` (q,), so many seconds (q,) after their starts.

        Exact: the closed form without drag, the equation of motion integrated to 1e-10 m with drag.
        """
        which = np.asarray(which, dtype=np.intp)
        elapsed = np.broadcast_to(np.asarray(elapsed_s, dtype=np.float64), which.shape)
        return fly(self.position[which], self.velocity[which], elapsed, self.gravity_mps2, self.drag_per_m[which])


def find_landings(
    launches: Launches,
    surface: Surface,
    clearing_m: Array | float = 0.0,
    *,
    step_s: float = STEP_S,
    limit_s: float = LIMIT_S,
) -> Landings:
    """The first time that each flight meets the terrain from outside after having left it.

    Parameters
    ----------
    clearing_m : (n,) a flight that meets the terrain nearer to its start than this [m] has not left it, unless it stays
        in the ground from there on. A block's radius suits.
    step_s : longest chord of the path; the result does not depend on it.
    limit_s : time after which a flight is given up.

    Raises
    ------
    RockfallError : the step or the limit is not positive.

    Notes
    -----
    A measured start lies a little above or below the terrain. So faces that the path meets from within the ground do
    not stop it, they let it out.
    """
    if not (np.isfinite(step_s) and step_s > 0 and np.isfinite(limit_s) and limit_s > 0):
        raise RockfallError(f"The time step ({step_s} s) and the limit ({limit_s} s) must be positive numbers.")
    from . import landing_kernels as kernels

    n = len(launches.position)
    clearing = np.ascontiguousarray(np.broadcast_to(np.asarray(clearing_m, dtype=np.float64), n))
    inside = heights_above(surface, launches.position) < -kernels.ON_SURFACE_M if n else np.zeros(0, dtype=np.bool_)
    lowest = float(surface.bounds[0, 2])
    duration, face = np.zeros(n), np.full(n, -1, dtype=np.intp)  # of the landing, or of the last touch near the start
    left = np.zeros(n, dtype=np.bool_)
    starts = np.column_stack([launches.position, launches.velocity, launches.drag_per_m])
    ground = surface.index.tree, surface.index.face, surface.face_normals, lowest
    steps, gravity = (float(step_s), float(limit_s)), float(launches.gravity_mps2)
    in_chunks(
        lambda i, j: kernels.fly_to_ground(
            *ground, starts, gravity, clearing, steps, inside, duration, face, left, i, j
        ),
        n,
        CHUNK_FLIGHTS,
    )
    if np.isnan(duration).any():
        raise RockfallError(UNFLYABLE)

    refined = np.flatnonzero(face >= 0)
    corner = surface.vertices[surface.faces[face[refined], 0]]
    duration[refined] = _crossings(launches, refined, duration[refined], corner, surface.face_normals[face[refined]])
    cut = np.flatnonzero(left & (launches.states(np.arange(n), duration)[0][:, 2] < lowest))
    floor = np.tile((0.0, 0.0, lowest), (cut.size, 1))
    duration[cut] = _crossings(launches, cut, duration[cut], floor, np.tile((0.0, 0.0, 1.0), (cut.size, 1)))
    never = inside & (duration * norm(launches.velocity) < kernels.ON_SURFACE_M)
    position, velocity = launches.states(np.arange(n), duration)
    return Landings(duration, position, velocity, never, left)


def greatest_heights(launches: Launches, duration_s: Array, surface: Surface) -> Array:
    """Greatest height above the terrain, vertically, of each flight, (n,) [m]; NaN where it has no duration.

    Taken at `PROFILE_POINTS` moments, as those of the measured flights to compare with have to be.
    """
    n = len(duration_s)
    result = np.full(n, np.nan)
    known = np.flatnonzero(np.isfinite(duration_s))
    if known.size:
        parts = np.linspace(0.0, 1.0, PROFILE_POINTS)
        elapsed: Array = (duration_s[known][:, None] * parts).ravel()
        places, _ = launches.states(np.repeat(known, PROFILE_POINTS), elapsed)
        heights = heights_above(surface, places).reshape(-1, PROFILE_POINTS)
        result[known] = np.where(np.isnan(heights), -np.inf, heights).max(axis=1)
    return np.where(np.isfinite(result), result, np.nan)


def _crossings(launches: Launches, which: Indices, guess_s: Array, point: Array, normal: Array) -> Array:
    """(q,) when the flights `which` pass through planes, by Newton from a guess that is less than a chord away."""
    time: Array = guess_s.copy()
    for _ in range(REFINEMENTS):
        position, velocity = launches.states(which, time)
        speed = dot(velocity, normal)
        step = np.divide(dot(position - point, normal), speed, out=np.zeros_like(time), where=np.abs(speed) > 1e-9)
        time = np.clip(time - step, np.maximum(guess_s - STEP_S, 0.0), guess_s + STEP_S)
    return time

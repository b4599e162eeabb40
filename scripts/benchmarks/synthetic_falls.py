# SPDX-License-Identifier: GPL-3.0-or-later
"""Synthetic falls down a rough slope: spheres that bounce, with drag and Magnus force if asked for."""

from dataclasses import dataclass

import numpy as np
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.placement import terrain_normals
from rockfall.core.terrain.raycast import cast_rays, closest_points
from rockfall.core.terrain.surface import Surface
from scipy.interpolate import CubicHermiteSpline
from scipy.ndimage import gaussian_filter

GRAVITY = 9.81
BLOCK = Block()
RADIUS = BLOCK.radius_m
DIP = np.radians(38.0)
SIGMA_TERRAIN = 0.02
GRID, GRID_STEP_M = (190, 110), 0.4
"""Points of the slope along x and y."""
STEP_S = 0.02
"""Of the integration where there is air."""


@dataclass(frozen=True)
class Air:
    """What acts on the blocks beside gravity.

    Attributes
    ----------
    drag_per_m : the deceleration is this times the speed squared [1/m].
    lift_per_s : the Magnus acceleration across the motion is up to this times the speed [1/s]; its axis and size are
        drawn anew for each flight.
    """

    drag_per_m: float = 0.0
    lift_per_s: float = 0.0


NONE = Air()


@dataclass(frozen=True, eq=False)
class Fall:
    """A true trajectory: n contacts with the centre, the contact point, times, velocities and R_N (NaN at the ends)."""

    centre: np.ndarray
    contact: np.ndarray
    time_s: np.ndarray
    v1: np.ndarray
    v2: np.ndarray
    rn: np.ndarray
    air: Air
    turning: np.ndarray
    """(n, 3) what the velocity of the flight after each contact is crossed with [1/s]."""

    def seen_at(self, time_s: np.ndarray) -> np.ndarray:
        """(m, 3) places of the centre at times between the first and the last contact."""
        places = np.empty((time_s.size, 3))
        flight = np.clip(np.searchsorted(self.time_s, time_s, side="right") - 1, 0, len(self.time_s) - 2)
        for i in np.unique(flight):
            rows = flight == i
            since = time_s[rows] - self.time_s[i]
            places[rows] = flown(self.centre[i], self.v2[i], since, self.air, self.turning[i])[0]
        return places


def rough_slope(rng: np.random.Generator) -> Surface:
    """A slope of 38° towards +x, with humps of metres and stones of decimetres; points 0.4 m apart."""
    step, (nx, ny) = GRID_STEP_M, GRID
    x, y = np.meshgrid(np.arange(nx) * step, (np.arange(ny) - ny / 2) * step, indexing="ij")
    rough = sum(
        height * noise / noise.std()
        for height, noise in (
            (size, gaussian_filter(rng.normal(size=(nx, ny)), width))
            for size, width in ((0.25, 6), (0.08, 2), (0.03, 0.7))
        )
    )
    vertices = np.stack([x, y, -np.tan(DIP) * x + rough], axis=-1).reshape(-1, 3)
    corner = (np.arange(nx - 1)[:, None] * ny + np.arange(ny - 1)).ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + ny, corner + ny + 1], 1), np.stack([corner, corner + ny + 1, corner + 1], 1)]
    )
    return Surface(vertices, faces.astype(np.int32), GlobalShift(), "rough slope")


def flown(
    centre: np.ndarray, velocity: np.ndarray, elapsed: np.ndarray, air: Air = NONE, turning: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Places and velocities along a flight: a parabola, or integrated (Runge and Kutta's fourth order)."""
    if air == NONE:
        fallen = np.outer(elapsed, [0, 0, GRAVITY])
        return centre + np.outer(elapsed, velocity) - elapsed[:, None] * fallen / 2, velocity - fallen
    assert turning is not None

    def slope(state: np.ndarray) -> np.ndarray:
        pace = state[3:]
        acceleration = np.cross(turning, pace) - air.drag_per_m * np.linalg.norm(pace) * pace - [0, 0, GRAVITY]
        return np.concatenate([pace, acceleration])

    steps = max(1, int(np.ceil(elapsed.max(initial=0.0) / STEP_S)))
    states = np.empty((steps + 1, 6))
    states[0] = *centre, *velocity
    for i in range(steps):
        k1 = slope(states[i])
        k2 = slope(states[i] + STEP_S / 2 * k1)
        k3 = slope(states[i] + STEP_S / 2 * k2)
        k4 = slope(states[i] + STEP_S * k3)
        states[i + 1] = states[i] + STEP_S / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    slopes = np.array([slope(state) for state in states])
    found = CubicHermiteSpline(STEP_S * np.arange(steps + 1), states, slopes)(elapsed)
    return found[:, :3], found[:, 3:]


def next_contact(
    surface: Surface, centre: np.ndarray, velocity: np.ndarray, reach: float, air: Air, turning: np.ndarray
) -> float:
    """When the sphere's centre comes within `reach` of the terrain again; NaN if not within 1.6 s."""

    def distance(elapsed: np.ndarray) -> np.ndarray:
        places = flown(centre, velocity, elapsed, air, turning)[0]
        closest = closest_points(surface, places)
        side = np.einsum("ni,ni->n", places - closest.point, surface.face_normals[closest.face])
        return np.where(side < 0, -closest.distance, closest.distance) - reach

    elapsed = np.arange(0.004, 1.6, 0.004)
    above = distance(elapsed)
    left = np.flatnonzero(above > 0.03)
    if not left.size:
        return np.nan
    hit = np.flatnonzero(above[left[0] :] < 0)
    if not hit.size:
        return np.nan
    high = elapsed[left[0] + hit[0]]
    low = high - 0.004
    for _ in range(8):
        trial = np.linspace(low, high, 9)
        under = int(np.argmax(distance(trial) < 0))
        low, high = trial[under - 1], trial[under]
    return float((low + high) / 2)


def fall(surface: Surface, rng: np.random.Generator, air: Air = NONE) -> Fall:
    """A random fall of 6 to 10 contacts; flights of 0.3 s and more, 4 to 17 m/s."""
    while True:
        wanted = int(rng.integers(6, 11))
        x, y = rng.uniform(6, 14), rng.uniform(-6, 6)
        ground = cast_rays(surface, [[x, y, 50.0]], (0, 0, -1)).point[0]
        centre = ground + np.array([0, 0, 1.0])
        velocity = np.array([rng.uniform(3, 6), rng.normal() * 0.8, rng.uniform(-3, 0)])
        t, rows, turns = 0.0, [], list[np.ndarray]()
        while len(rows) < wanted:
            off = rng.normal() * SIGMA_TERRAIN
            turning = air.lift_per_s * rng.uniform(-1, 1) * sideways(velocity, rng) if air.lift_per_s else np.zeros(3)
            duration = next_contact(surface, centre, velocity, RADIUS + off, air, turning)
            if not duration > (0.3 if rows else 0.05):
                break
            t += duration
            if turns:
                turns[-1] = turning
            places, velocities = flown(centre, velocity, np.array([duration]), air, turning)
            centre, arriving = places[0], velocities[0]
            contact = closest_points(surface, centre[None]).point[0]
            ground_normal = terrain_normals(surface, contact[None], np.array([2 * RADIUS]), None)
            normal = ground_normal.normal[0]
            into = arriving @ normal
            along = arriving - into * normal
            pace = np.linalg.norm(along)
            if into > -1.0 or pace < 2.0:
                break
            leaving = along / pace * min(rng.uniform(0.6, 0.9) * pace, rng.uniform(3.5, 8))
            leaving = leaving + np.cross(normal, leaving) * rng.normal() * 0.15 + rng.uniform(1.8, 4.0) * normal
            fast = max(np.linalg.norm(arriving), np.linalg.norm(leaving))
            if fast > 17 or centre[0] > 68 or abs(centre[1]) > 18:
                break
            rows.append((centre, contact, t, arriving, leaving, -(leaving @ normal) / into))
            turns.append(np.zeros(3))
            velocity = leaving
        if len(rows) == wanted:
            columns = [np.array(column) for column in zip(*rows, strict=True)]
            columns[3][0], columns[4][-1] = np.nan, np.nan
            columns[5][[0, -1]] = np.nan
            return Fall(*columns, air, np.array(turns))


def sideways(velocity: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The axis of a block that rolls along its motion, turned by some tens of degrees."""
    axis = np.cross([0, 0, 1], velocity) + 0.4 * np.linalg.norm(velocity) * rng.normal(size=3)
    return axis / np.linalg.norm(axis)

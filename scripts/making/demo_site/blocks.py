# SPDX-License-Identifier: GPL-3.0-or-later
"""Blocks bounce down a gully: exact parabolas between a sphere's contacts, and the rebound of Noël et al. 2017.

This simulation is on purpose independent of `rockfall.core`: what it writes is the truth against which the
reconstruction is measured, and the first contacts of `rockfall simulate` are compared with it. Everything is in the
gully's own frame, z up.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

GRAVITY_MPS2 = 9.81
NORMAL_RADIUS_M = 0.6
SHAPE_ANGLE_DEG = 9.0
"""Standard deviation of the tilt, about each of two axes, that an angular block gives to the surface it meets."""

TRANSFER = 0.20
REST_SPEED_MPS = 3.0


@dataclass(frozen=True, eq=False)
class Ground:
    """The mesh as a grid of cells with two triangles each, so that neighbours are found by counting."""

    vertices: Array
    faces: NDArray[np.int32]
    rows_x: Array
    columns_y: Array
    rest_beyond_x: float

    def closest(self, point: Array, reach: float) -> tuple[float, Array]:
        """Distance and nearest surface point, both exact when the distance is below ``reach``, else (reach, NaN)."""
        return _closest(point, reach, self.vertices, self.faces, self.rows_x, self.columns_y)

    def normal(self, point: Array, radius: float = NORMAL_RADIUS_M) -> Array:
        """Mean normal, by area, of the triangles whose centre lies within a radius."""
        return _normal(point, radius, self.vertices, self.faces, self.rows_x, self.columns_y)

    def height(self, x: float, y: float) -> float:
        """Height of the surface below a point of the plan [m]."""
        return _height(x, y, self.vertices, self.faces, self.rows_x, self.columns_y)


@dataclass(frozen=True, eq=False)
class Impact:
    """One contact, or a few that follow at once: when, where, and the centre's velocities before and after.

    ``leave_time`` and ``leave_centre`` are those of the last contact; the flight that follows starts there.
    """

    time: float
    centre: Array
    contact: Array
    normal: Array
    effective_normal: Array
    v1: Array
    v2: Array
    omega1: Array
    omega2: Array
    leave_time: float
    leave_centre: Array
    contacts: int = 1


@dataclass(frozen=True, eq=False)
class Run:
    """One block's fall; ``rolling`` holds (time, centre, contact) from the last impact to the stop."""

    radius: float
    release_time: float
    release_centre: Array
    release_contact: Array
    release_velocity: Array
    impacts: tuple[Impact, ...]
    rolling: tuple[tuple[float, Array, Array], ...]


def fall(ground: Ground, radius: float, x: float, y: float, velocity: Array, rng: np.random.Generator) -> Run:
    """Let a block of a radius go above (x, y) and follow it to rest or to the edge of the terrain.

    Positions and velocities are rounded after each contact (1e-9) so that the chaos of bouncing does not amplify the
    last bit, which may differ between machines.
    """
    contact = np.array([x, y, ground.height(x, y)])
    normal = ground.normal(contact)
    centre = contact + normal * radius
    while (gap := radius - ground.closest(centre, radius + 0.5)[0]) > -1e-4:
        centre = centre + normal * (gap + 2e-4)
    contact = ground.closest(centre, radius + 0.5)[1]
    start = centre.copy()
    time, omega, impacts = 0.0, np.zeros(3), []
    v = velocity.copy()
    while len(impacts) < 400:
        seconds = _fly(centre, v, radius, ground.vertices, ground.faces, ground.rows_x, ground.columns_y)
        if not np.isfinite(seconds):
            return Run(radius, 0.0, start, contact, velocity, tuple(impacts), ())
        time = round(time + seconds, 9)
        centre = np.round(centre + v * seconds - np.array([0.0, 0.0, 0.5 * GRAVITY_MPS2 * seconds**2]), 9)
        v1 = v - np.array([0.0, 0.0, GRAVITY_MPS2 * seconds])
        _, touched = ground.closest(centre, radius + 0.5)
        normal = ground.normal(touched)
        v2, omega2, effective = _meet(
            v1, omega, radius, normal, (centre - touched) / np.linalg.norm(centre - touched), rng
        )
        impacts.append(Impact(time, centre, touched, normal, effective, v1, v2, omega, omega2, time, centre))
        v, omega = v2, omega2
        trapped = len(impacts) > 10 and np.linalg.norm(centre - impacts[-10].centre) < 1.0
        if trapped or (np.linalg.norm(v) < REST_SPEED_MPS and centre[0] > ground.rest_beyond_x):
            return Run(radius, 0.0, start, contact, velocity, tuple(impacts), roll(ground, radius, impacts[-1], rng))
    return Run(radius, 0.0, start, contact, velocity, tuple(impacts), ())


def _meet(
    v1: Array, omega: Array, radius: float, normal: Array, outward: Array, rng: np.random.Generator
) -> tuple[Array, Array, Array]:
    """Rebound on the ground as an angular block feels it; the block must come nearer, and must leave."""
    for attempt in range(60):
        tilt = rng.standard_normal(2) * np.radians(SHAPE_ANGLE_DEG)
        mean = normal if attempt < 30 else outward
        side = np.cross(mean, [0.0, 1.0, 0.0])
        side /= np.linalg.norm(side)
        effective = mean + np.tan(tilt[0]) * side + np.tan(tilt[1]) * np.cross(mean, side)
        effective /= np.linalg.norm(effective)
        if v1 @ effective < -1e-3:
            v2, omega2 = rebound(v1, omega, radius, effective, rng)
            if v2 @ outward > 0.05 and v2 @ normal > 0.0:
                return np.round(v2, 9), np.round(omega2, 9), effective
    v2, omega2 = rebound(v1, omega, radius, outward, rng)
    return np.round(v2, 9), np.round(omega2, 9), outward


def rebound(v1: Array, omega: Array, radius: float, normal: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Restituted velocity and spin (3,), (3,), Noël et al. 2017 (EGU2017-16699), for a block with a cube's inertia."""
    q = 1.5
    approach = v1 @ normal
    tangential = v1 - approach * normal
    theta_deg = np.degrees(np.arctan2(-approach, np.linalg.norm(tangential)))
    rn = 2.0
    if theta_deg > 4.0:
        exponent = rng.normal(-1.08, 0.15 * (1.0 - theta_deg / 100.0))
        rn = min(2.0, 10.0 * (theta_deg - 4.0) ** exponent + 0.08)
    rt = min(1.0, abs(rng.normal(0.69, 0.13)))
    slip = tangential + radius * np.cross(normal, omega)
    leaving = rt * (tangential - slip / (1.0 + q))
    bounce = -rn * approach
    if rn > 1.0:
        need = (rn**2 - 1.0) * approach**2
        given = min(need, (1.0 - (1.0 - TRANSFER) ** 2) * float(leaving @ leaving))
        bounce = np.sqrt(approach**2 + given)
        speed = np.linalg.norm(leaving)
        leaving = leaving * np.sqrt(max(speed**2 - given, 0.0)) / max(speed, 1e-12)
    return leaving + bounce * normal, omega + q / (1.0 + q) / radius * np.cross(normal, slip)


def roll(
    ground: Ground, radius: float, last: Impact, rng: np.random.Generator
) -> tuple[tuple[float, Array, Array], ...]:
    """The end of a run: the block rolls on in its direction, turned half-way downhill, and slows down evenly."""
    speed = max(float(np.hypot(*last.v2[:2])), 0.5)
    downhill = last.normal[:2] / max(np.linalg.norm(last.normal[:2]), 1e-9)
    way = last.v2[:2] / max(np.linalg.norm(last.v2[:2]), 1e-9) + downhill
    way /= max(np.linalg.norm(way), 1e-9)
    deceleration = rng.uniform(1.4, 2.4)
    seconds = speed / deceleration
    places = []
    for share in (0.0, 0.5, 1.0):
        t = share * seconds
        x, y = last.contact[:2] + way * (speed * t - 0.5 * deceleration * t**2)
        contact = np.array([x, y, ground.height(x, y)])
        places.append((last.time + t, contact + radius * ground.normal(contact), contact))
    return tuple(places)


def merged(impacts: tuple[Impact, ...], shortest_s: float) -> Iterator[Impact]:
    """Impacts as a person sees them: contacts that follow one another within a time are one."""
    group: list[Impact] = []
    for impact in impacts:
        if group and impact.time - group[-1].time >= shortest_s:
            yield _one(group)
            group = []
        group.append(impact)
    if group:
        yield _one(group)


def _one(group: list[Impact]) -> Impact:
    last = group[-1]
    return replace(
        group[0],
        v2=last.v2,
        omega2=last.omega2,
        leave_time=last.time,
        leave_centre=last.centre,
        contacts=len(group),
    )


@njit(cache=True)
def _window(low, high, nodes):
    """Cells (first, end) of sorted nodes that a span can touch; nodes are known to a few millimetres."""
    first = max(np.searchsorted(nodes, low - 0.01) - 1, 0)
    end = min(np.searchsorted(nodes, high + 0.01), nodes.size - 1)
    return first, max(end, first)


@njit(cache=True)
def _on_triangle(p, a, b, c):
    """The point of a triangle nearest to p (Ericson 2005, Real-Time Collision Detection, 5.1.5)."""
    ab, ac, ap = b - a, c - a, p - a
    d1, d2 = np.dot(ab, ap), np.dot(ac, ap)
    if d1 <= 0.0 and d2 <= 0.0:
        return a
    bp = p - b
    d3, d4 = np.dot(ab, bp), np.dot(ac, bp)
    if d3 >= 0.0 and d4 <= d3:
        return b
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        return a + d1 / (d1 - d3) * ab
    cp = p - c
    d5, d6 = np.dot(ab, cp), np.dot(ac, cp)
    if d6 >= 0.0 and d5 <= d6:
        return c
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        return a + d2 / (d2 - d6) * ac
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b)
    return a + vb / (va + vb + vc) * ab + vc / (va + vb + vc) * ac


@njit(cache=True)
def _closest(p, reach, vertices, faces, rows_x, columns_y):
    columns = columns_y.size - 1
    best, nearest = reach, np.full(3, np.nan)
    first_i, end_i = _window(p[0] - reach, p[0] + reach, rows_x)
    first_j, end_j = _window(p[1] - reach, p[1] + reach, columns_y)
    for i in range(first_i, end_i):
        for face in range(2 * (i * columns + first_j), 2 * (i * columns + end_j)):
            a, b, c = faces[face]
            q = _on_triangle(p, vertices[a], vertices[b], vertices[c])
            distance = np.sqrt(np.dot(p - q, p - q))
            if distance < best:
                best, nearest = distance, q
    return best, nearest


@njit(cache=True)
def _normal(p, radius, vertices, faces, rows_x, columns_y):
    columns = columns_y.size - 1
    total = np.zeros(3)
    first_i, end_i = _window(p[0] - radius, p[0] + radius, rows_x)
    first_j, end_j = _window(p[1] - radius, p[1] + radius, columns_y)
    for i in range(first_i, end_i):
        for face in range(2 * (i * columns + first_j), 2 * (i * columns + end_j)):
            a, b, c = vertices[faces[face, 0]], vertices[faces[face, 1]], vertices[faces[face, 2]]
            off = (a + b + c) / 3.0 - p
            if np.dot(off, off) < radius**2:
                total += np.cross(b - a, c - a)
    return total / np.sqrt(np.dot(total, total))


@njit(cache=True)
def _height(x, y, vertices, faces, rows_x, columns_y):
    columns = columns_y.size - 1
    first_i, end_i = _window(x, x, rows_x)
    first_j, end_j = _window(y, y, columns_y)
    for i in range(first_i, end_i):
        for face in range(2 * (i * columns + first_j), 2 * (i * columns + end_j)):
            a, b, c = vertices[faces[face, 0]], vertices[faces[face, 1]], vertices[faces[face, 2]]
            n = np.cross(b - a, c - a)
            inside = True
            for s, e in ((a, b), (b, c), (c, a)):
                inside &= (e[0] - s[0]) * (y - s[1]) - (e[1] - s[1]) * (x - s[0]) >= -1e-9
            if inside:
                return a[2] - (n[0] * (x - a[0]) + n[1] * (y - a[1])) / n[2]
    return np.nan


@njit(cache=True)
def _fly(start, v, radius, vertices, faces, rows_x, columns_y):
    """Seconds until the sphere touches the ground, NaN when it leaves the terrain.

    Conservative advancement: the distance to the ground, divided by a bound of the speed, is a step that cannot miss
    a contact. A sphere that has just left may glide along; a step is never shorter than 2 µs (0.04 mm at 20 m/s).
    """
    t = 0.0
    g = GRAVITY_MPS2
    while t < 20.0:
        p = start + v * t
        p[2] -= 0.5 * g * t * t
        inside = (
            rows_x[0] + radius < p[0] < rows_x[-1] - radius and columns_y[0] + radius < p[1] < columns_y[-1] - radius
        )
        if not inside:
            return np.nan
        distance, q = _closest(p, radius + 0.4, vertices, faces, rows_x, columns_y)
        velocity = v.copy()
        velocity[2] -= g * t
        speed = np.sqrt(np.dot(velocity, velocity))
        gap = distance - radius
        if gap < 1e-6 and np.dot(velocity, p - q) < 0.0:
            return t
        t += max(min(gap / (speed + 0.5), 0.05), 2e-6)
    return np.nan

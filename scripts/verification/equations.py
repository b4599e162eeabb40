# SPDX-License-Identifier: GPL-3.0-or-later
"""Equations 1–10 of Noël et al. 2018, flight through air, normals, cameras and spin, against other numbers.

The other computations are written from the equations here, with plain numbers, or come from scipy and OpenCV; none of
them uses what it is compared with.
"""

import math
from fractions import Fraction

import numpy as np
from checks import Check, compared
from rockfall.core.camera.model import look_at, project, rays
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.drag import Drag
from rockfall.core.reconstruction.free_flight import fly
from rockfall.core.reconstruction.impact import apparent
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.placement import terrain_normals
from rockfall.core.reconstruction.spin import measure_spin
from rockfall.core.reconstruction.trajectory import reconstruct
from rockfall.core.reconstruction.triangulation import pick_on_terrain, triangulate
from rockfall.core.terrain.surface import Surface
from scipy.integrate import solve_ivp

G = 9.81
TITLE = "Equations of the reconstruction"
SUMMARY = "eq. 1–10 of Noël et al. 2018, drag, normals, cameras, spin"
INTRODUCTION = (
    "Velocities, coefficients and angles of impacts as in Noël et al. 2018, and what they are computed with. Of eq. 9 "
    "and 10 the forms that are well conditioned and that the paper's text describes are used; the printed ones are "
    "compared where they are defined."
)


def checks() -> list[Check]:
    """All of this chapter."""
    return [*_velocities(), *_coefficients(), *_drag(), *_normals(), *_cameras(), *_spin()]


def _falls(count: int = 200) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times (n, 3), places (n, 3, 3) and normals (n, 3) of three picks each, as a scan and a film would give them."""
    rng = np.random.default_rng(1)
    times = np.cumsum(rng.uniform(0.2, 1.6, (count, 3)), axis=1)
    places = np.cumsum(rng.normal([4, 0, -3], [2, 1, 2], (count, 3, 3)), axis=1)
    dip, azimuth = np.radians(rng.uniform(10, 70, count)), np.radians(rng.uniform(-40, 40, count))
    normals = np.stack([np.sin(dip) * np.cos(azimuth), np.sin(dip) * np.sin(azimuth), np.cos(dip)], axis=1)
    return times, places, normals


def _velocities() -> list[Check]:
    """Eq. 1–6: the parabola of two timed places, in fractions, without any rounding."""
    times, places, normals = _falls()
    made = reconstruct(
        make_picks(
            np.repeat([f"{i}" for i in range(len(times))], 3).tolist(),
            times.ravel(),
            places.reshape(-1, 3),
            normal=np.repeat(normals, 3, axis=0),
        )
    ).impacts
    exact = np.array([_exact(t, x) for t, x in zip(times, places, strict=True)])
    return [
        compared("v2, eq. 5", "two places and times in fractions", "closed form", made.v2[1::3], exact[:, 1], 1e-12),
        compared("v1, eq. 6", "two places and times in fractions", "closed form", made.v1[1::3], exact[:, 0], 1e-12),
    ]


def _exact(times: np.ndarray, places: np.ndarray) -> list[list[float]]:
    a, b, c = (Fraction(t) for t in times.tolist())
    (xa, xb, xc) = ([Fraction(value) for value in row] for row in places.tolist())
    half = Fraction(G) / 2
    first = [(q - p) / (b - a) for p, q in zip(xa, xb, strict=True)]
    second = [(q - p) / (c - b) for p, q in zip(xb, xc, strict=True)]
    first[2] -= half * (b - a)
    second[2] += half * (c - b)
    return [[float(value) for value in first], [float(value) for value in second]]


WORKED = (
    # normal, v1, v2, (R_N, R_T, R, θ1°, θ_dev°), worked by hand to six figures
    ((0, 0, 1), (5, 0, -3.924), (6, 2, 2.4525), (0.625, 1.264911, 1.067259, 38.124823, 61.796358)),
    (
        (math.sin(math.radians(40)), 0, math.cos(math.radians(40))),
        (20 / 3, 5 / 9, -11.636722),
        (8.75, -0.375, -4.201),
        (0.519819, 0.746932, 0.723665, 20.173592, 34.838987),
    ),
)


def _coefficients() -> list[Check]:
    """Eq. 7–10."""
    rng = np.random.default_rng(2)
    v1, v2 = rng.normal(size=(300, 3)) * 8, rng.normal(size=(300, 3)) * 6
    normal = rng.normal(size=(300, 3))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    normal *= -np.sign(np.einsum("ni,ni->n", normal, v1))[:, None]
    found = apparent(v1, v2, normal)
    printed = apparent(v1, v2, normal, eq10="as_printed")
    other = np.array([_by_hand(*row) for row in zip(v1, v2, normal, strict=True)])
    worked = apparent(*(np.array([row[i] for row in WORKED], dtype=float) for i in (1, 2, 0)))
    numbers = [worked.rn, worked.rt, worked.r, np.degrees(worked.theta1), np.degrees(worked.theta_dev)]
    rows = [
        compared("R_N, R_T, R, θ1, θ_dev", "two impacts worked by hand", "closed form", numbers,
                 np.array([row[3] for row in WORKED]).T, 2e-6, "1"),
        compared("R_N, eq. 7", "component by component", "independent", found.rn, other[:, 0], 1e-12),
        compared("R_T, eq. 7", "component by component", "independent", found.rt, other[:, 1], 1e-10),
        compared("R, eq. 8", "component by component", "independent", found.r, other[:, 2], 1e-12),
        compared("θ1, eq. 9", "the paper's arc sine", "printed", found.theta1, other[:, 3], 1e-6, "rad"),
        compared("θ_dev, eq. 10, 0–180°", "the signed arc cosine", "independent", found.theta_dev, other[:, 4], 1e-6,
                 "rad"),
        compared("θ_dev as printed, 0–90°", "the paper's |v1·v2|", "printed", printed.theta_dev, other[:, 5], 1e-6,
                 "rad"),
    ]  # fmt: skip
    grazing = np.radians([1e-6, 1e-3, 0.01, 0.1])
    v = np.stack([np.cos(grazing), 0 * grazing, -np.sin(grazing)], axis=1) * 20
    up = np.tile([0.0, 0.0, 1.0], (4, 1))
    rows.append(
        compared("θ1 near 0°", "its own definition", "closed form", apparent(v, v, up).theta1, grazing, 1e-15, "rad")
    )
    return rows


def _by_hand(v1: np.ndarray, v2: np.ndarray, n: np.ndarray) -> list[float]:
    a, b, unit = v1.tolist(), v2.tolist(), n.tolist()

    def size(v: list[float]) -> float:
        return math.sqrt(sum(x * x for x in v))

    def inner(u: list[float], v: list[float]) -> float:
        return sum(x * y for x, y in zip(u, v, strict=True))

    def tangential(v: list[float]) -> float:
        return size([x - inner(v, unit) * y for x, y in zip(v, unit, strict=True)])

    cosine = inner(a, b) / size(a) / size(b)
    return [
        abs(inner(b, unit)) / abs(inner(a, unit)),
        tangential(b) / tangential(a),
        size(b) / size(a),
        math.pi / 2 - math.asin(min(1.0, tangential(a) / size(a))),
        math.acos(cosine),
        math.acos(abs(cosine)),
    ]


def _drag() -> list[Check]:
    """Flight through air: against an integrator of high order, and the fall's closed form."""
    block, drag = Block(0.35, 0.35, 0.35, 2650.0), Drag(1.2, 0.9)
    k = drag.per_metre(block)
    mass, area = 2650 * math.pi / 6 * 0.35**3, math.pi / 4 * 0.35**2
    rng = np.random.default_rng(3)
    starts, velocities, times = np.zeros((20, 3)), rng.normal(0, 15, (20, 3)), rng.uniform(0.5, 4, 20)
    place, speed = fly(starts, velocities, times, G, np.full(20, k))

    def motion(t: float, state: np.ndarray) -> np.ndarray:
        v = state[3:]
        return np.r_[v, -k * np.linalg.norm(v) * v - [0, 0, G]]

    ends = np.array([
        solve_ivp(motion, (0, t), np.r_[x, v], method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
        for x, v, t in zip(starts, velocities, times, strict=True)
    ])  # fmt: skip
    fallen, down = fly(np.zeros((1, 3)), np.zeros((1, 3)), np.array([3.0]), G, np.array([k]))
    limit = math.sqrt(G / k)
    return [
        compared("½ρC_D A/m", "sphere of 0.35 m, 2650 kg/m³", "closed form", k, 0.5 * 1.2 * 0.9 * area / mass, 1e-12),
        compared("place after 0.5–4 s in air", "scipy, DOP853 at 1e-12", "independent", place, ends[:, :3], 1e-6, "m"),
        compared("velocity after 0.5–4 s in air", "scipy, DOP853 at 1e-12", "independent", speed, ends[:, 3:], 1e-6,
                 "m/s"),
        compared("speed of a fall from rest", "√(g/k) tanh(√(gk) t)", "closed form", -down[0, 2],
                 limit * math.tanh(math.sqrt(G * k) * 3.0), 1e-6, "m/s"),
        compared("depth of a fall from rest", "ln cosh(√(gk) t)/k", "closed form", -fallen[0, 2],
                 math.log(math.cosh(math.sqrt(G * k) * 3.0)) / k, 1e-6, "m"),
    ]  # fmt: skip


def _grid(height, step: float = 0.1, half: float = 6.0) -> Surface:
    line = np.arange(-half, half + step / 2, step)
    x, y = np.meshgrid(line, line, indexing="ij")
    n = line.size
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + n, corner + n + 1], 1), np.stack([corner, corner + n + 1, corner + 1], 1)]
    )
    vertices = np.stack([x, y, height(x, y)], axis=-1).reshape(-1, 3)
    return Surface(vertices, faces.astype(np.int32), GlobalShift(), "grid")


def _normals() -> list[Check]:
    """The normal at block scale, on a plane and on a sphere."""
    slope, radius = math.radians(38), 20.0
    plane = _grid(lambda x, y: -math.tan(slope) * x)
    ball = _grid(lambda x, y: np.sqrt(radius**2 - x**2 - y**2), 0.05)
    places = np.random.default_rng(4).uniform(-3, 3, (20, 2))
    size = np.full(20, 0.5)
    on_plane = np.column_stack([places, -math.tan(slope) * places[:, 0]])
    on_ball = np.column_stack([places, np.sqrt(radius**2 - (places**2).sum(axis=1))])
    found = terrain_normals(ball, on_ball, size, None).normal
    angle = np.degrees(np.arccos(np.clip(np.einsum("ni,ni->n", found, on_ball / radius), -1, 1)))
    return [
        compared("normal on a plane of 38°", "its equation", "closed form",
                 terrain_normals(plane, on_plane, size, None).normal,
                 np.tile([math.sin(slope), 0, math.cos(slope)], (20, 1)), 1e-9, "1"),
        compared("normal on a sphere of 20 m", "the direction from its centre", "closed form", angle, 0.0, 0.1, "°"),
    ]  # fmt: skip


def _cameras() -> list[Check]:
    """Rays, pictures and two views: a round trip, and algebra."""
    camera = look_at(1920, 1080, [40.0, -60.0, 25.0], [0.0, 0.0, 0.0], focal_px=1500.0)
    other = look_at(1920, 1080, [60.0, 20.0, 15.0], [0.0, 0.0, 0.0], focal_px=1400.0)
    rng = np.random.default_rng(5)
    points = rng.uniform(-5, 5, (50, 3))
    seen = project(camera, points)
    matrix = np.array([[1500.0, 0, 960], [0, 1500, 540], [0, 0, 1]]) @ np.column_stack(
        [camera.rotation, -camera.rotation @ camera.position]
    )
    plain = np.column_stack([points, np.ones(50)]) @ matrix.T
    plane = _grid(lambda x, y: -0.5 * x)
    on_plane = np.column_stack([points[:, :2], -0.5 * points[:, 0]])
    origin, direction = rays(camera, seen)
    along = np.einsum("ni,ni->n", points - origin, direction)
    away = np.linalg.norm(points - origin - along[:, None] * direction, axis=1)
    both = triangulate([camera, other], np.stack([project(each, points) for each in (camera, other)]))
    return [
        compared("pixel of a point", "the camera matrix K [R | t]", "independent", seen, plain[:, :2] / plain[:, 2:],
                 1e-9, "px"),
        compared("ray of a pixel", "passes its point", "closed form", away, 0.0, 1e-9, "m"),
        compared("point on the terrain from a pixel", "the point that was projected", "closed form",
                 pick_on_terrain(camera, project(camera, on_plane), plane).point, on_plane, 1e-8, "m"),
        compared("point from two views", "the point that was projected", "closed form", both.point, points, 1e-8, "m"),
    ]  # fmt: skip


def _spin() -> list[Check]:
    times = np.array([0.0, 0.04, 0.1, 0.18])
    found = measure_spin(times, 3.25 * times + 0.1, sigma_turns=np.full(4, 0.01), axis=np.array([0.0, 1.0, 0.0]))
    block = Block(1.2, 0.8, 0.5, 2700.0, "box")
    mass = 2700 * 1.2 * 0.8 * 0.5
    moments = [mass * (b * b + c * c) / 12 for b, c in ((0.8, 0.5), (1.2, 0.5), (1.2, 0.8))]
    return [
        compared("ω from marks", "3.25 turns/s that were given", "closed form", found.rate, 3.25 * 2 * math.pi, 1e-9),
        compared("mean moment of inertia of a box", "m(b² + c²)/12 of its axes", "closed form", block.inertia_kgm2,
                 sum(moments) / 3, 1e-12),
    ]  # fmt: skip

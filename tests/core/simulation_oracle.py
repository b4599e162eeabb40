# SPDX-License-Identifier: GPL-3.0-or-later
"""An independent simulator of falling blocks, to hold the engine against: slow, plain, and built otherwise.

The engine finds contacts in closed form on parabolas and takes blocks over whole triangles. Here time goes on in steps
that are small against the radius, contacts are found by trying all triangles around, and the ground acts through one
rule: a velocity into a contact is taken away (Moreau's time stepping). So there are no legs, edges, corners or hops: a
block leaves a crest when gravity no longer keeps it on the ground, and turns about an edge when it does.

`fall` does this on triangles, one block at a time. `fall_on_function` is the limit to which meshes have to converge: a
sphere on the graph of a smooth function, rolling by the equation of motion of its centre on the offset surface, by
Runge and Kutta's fourth order, many blocks in lock step.

Only the impact models are the engine's: their plain Python functions.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from rockfall.core.constants import GRAVITY_MPS2 as G
from rockfall.core.impact_models.registry import find_model
from scipy.spatial import cKDTree

type Corner = Literal["plastic", "keep", "sliding"]
HOP = 0.1
"""A rebound that rises less than this part of the radius is none: a rule of the simulation, not of its method."""
ROLLS = {"azzoni_1995": 0.4, "coulomb": 0.0}


@dataclass
class Fall:
    """What became of one block: places and velocities of impacts, and of take-offs; the path; the end."""

    impacts: list[tuple[np.ndarray, np.ndarray]] = field(default_factory=list)
    offs: list[np.ndarray] = field(default_factory=list)
    path: list[tuple[float, np.ndarray, np.ndarray, bool]] = field(default_factory=list)
    position: np.ndarray = field(default_factory=lambda: np.zeros(3))
    time_s: float = 0.0
    v_max_mps: float = 0.0
    left: bool = False


class Triangles:
    """Triangles, of which those near a place are found by their middles."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        self.corners = np.asarray(vertices, dtype=float)[faces]
        middle = self.corners.mean(axis=1)
        size = np.linalg.norm(self.corners - middle[:, None], axis=2).max(axis=1)
        # Triangles of like size in one tree, so that one large triangle does not slow the search for all.
        self.trees = []
        level = np.floor(np.log2(size)).astype(int)
        for one in np.unique(level):
            rows = np.flatnonzero(level == one)
            self.trees.append((cKDTree(middle[rows]), rows, size[rows].max()))
        self.low, self.high = self.corners.min(axis=(0, 1)), self.corners.max(axis=(0, 1))

    def near(self, p: np.ndarray, reach: float) -> np.ndarray:
        """(k, 3, 3) all triangles with a part nearer than `reach`, and some others."""
        rows = [rows[tree.query_ball_point(p, reach + size)] for tree, rows, size in self.trees]
        return self.corners[np.concatenate(rows).astype(int)]


class Near:
    """Triangles (k, 3, 3) near a block, with what the way to each of them needs."""

    def __init__(self, corners: np.ndarray) -> None:
        self.corners = corners
        self.edges = np.roll(corners, -1, axis=1) - corners
        self.squares = (self.edges**2).sum(axis=2)
        normal = np.cross(self.edges[:, 0], self.edges[:, 1])
        self.normal = normal / np.linalg.norm(normal, axis=1)[:, None]
        self.inward = np.cross(self.normal[:, None], self.edges)
        self.all = np.arange(len(corners))

    def ways(self, p: np.ndarray) -> np.ndarray:
        """(k, 3) from the nearest place on each to p: within, where the foot of p is, else on one of three edges."""
        from_corners = p - self.corners
        share = np.clip((from_corners * self.edges).sum(axis=2) / self.squares, 0.0, 1.0)
        from_edges = from_corners - share[:, :, None] * self.edges
        nearest = from_edges[self.all, (from_edges**2).sum(axis=2).argmin(axis=1)]
        height = (from_corners[:, 0] * self.normal).sum(axis=1)
        within = ((from_corners * self.inward).sum(axis=2) >= 0.0).all(axis=1)
        return np.where(within[:, None], height[:, None] * self.normal, nearest)


class _Around:
    """The triangles near a block, looked up again when it has moved."""

    def __init__(self, ground: Triangles, radius: float) -> None:
        self.ground, self.radius, self.centre = ground, radius, np.full(3, np.inf)
        self.near: Near | None = None

    def contacts(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(k, 3) directions from the ground to p, (k,) gaps below zero where the sphere is in it, of what is near."""
        if not np.linalg.norm(p - self.centre) < 1.5 * self.radius:
            self.centre, corners = p.copy(), self.ground.near(p, 3.0 * self.radius)
            self.near = Near(corners) if len(corners) else None
        if self.near is None:
            return np.zeros((0, 3)), np.zeros(0)
        way = self.near.ways(p)
        d = np.sqrt((way**2).sum(axis=1))
        return way / np.maximum(d, 1e-300)[:, None], d - self.radius


def fall(
    ground: Triangles,
    p: np.ndarray,
    v: np.ndarray,
    radius: float,
    *,
    model: str = "azimi_desvarreux_1977",
    parameters: dict[str, object] | None = None,
    rolling: str = "azzoni_1995",
    friction: float = 0.5,
    mass: float = 1.0,
    corner: Corner = "plastic",
    fine: float = 0.05,
    most_s: float = 120.0,
    rng: np.random.Generator | None = None,
    hop: float = HOP,
    keep_path: bool = False,
) -> Fall:
    """Let one block fall.

    Parameters
    ----------
    p, v : of the centre. Its spin counts from the first impact or take-off on; where it starts on the ground, it rolls.
    corner : what two contacts at once take: "plastic", what a body that rolls loses as it comes to roll on the second;
        "sliding", all that goes into it; "keep", nothing.
    fine : way of one step as a part of the radius.
    rng : of the models that draw; None for their mean.
    hop : a rebound or landing that rises less than this part of the radius is no impact.
    """
    found = find_model(model)
    numbers = found.parameter_type(*found.numbers(parameters or {}))
    c = ROLLS[rolling]
    factor = 1.0 / (1.0 + c)
    around = _Around(ground, radius)
    p, v, w = np.array(p, float), np.array(v, float), np.zeros(3)
    down = np.array([0.0, 0.0, -G])
    out, on, n, time = Fall(), False, np.array([0.0, 0.0, 1.0]), 0.0
    still, spun = 0, False
    while time < most_s:
        speed = np.linalg.norm(v)
        out.v_max_mps = max(out.v_max_mps, speed)
        if keep_path:
            out.path.append((time, p.copy(), v.copy(), on))
        if (p < ground.low - radius).any() or (p[:2] > ground.high[:2] + radius).any():
            out.left = True
            break
        dt = min(fine * radius / max(speed, 1e-9), 0.1 * np.sqrt(2.0 * fine * radius / G) * (1.0 if on else 3.0))
        if not on:
            q, u = p + v * dt + 0.5 * down * dt**2, v + down * dt
            normals, gaps = around.contacts(q)
            if not gaps.size or gaps.min() > 0.0:
                p, v, time = q, u, time + dt
                continue
            low, high = 0.0, dt  # when it first touches
            for _ in range(50):
                middle = 0.5 * (low + high)
                gaps = around.contacts(p + v * middle + 0.5 * down * middle**2)[1]
                low, high = (middle, high) if gaps.min() > 0.0 else (low, middle)
            p, v, time = p + v * low + 0.5 * down * low**2, v + down * low, time + low
            normals, gaps = around.contacts(p)
            n = normals[gaps.argmin()]
            if v @ n < 0.0 and (v @ n) ** 2 >= 2.0 * G * max(n[2], 0.0) * hop * radius:
                u = found.draw_type(*(rng.random(found.draws) if rng is not None else np.full(found.draws, np.nan)))
                out.impacts.append((p.copy(), v.copy()))
                spun = True
                v, w = (np.array(x) for x in found.function(tuple(v), tuple(n), tuple(w), radius, mass, numbers, u))
            elif v @ n < 0.0:
                v = _gripped(v, n, w, radius, c) if spun else v - (v @ n) * n
            if n[2] > 0.0 and (v @ n) ** 2 < 2.0 * G * n[2] * hop * radius:
                v, on = v - (v @ n) * n, True
            elif v @ n <= 0.0:
                v = v - (v @ n) * n + 1e-9 * n
            continue
        # On the ground: gravity along it, less friction, moves the block; across it until something holds.
        along = down - (down @ n) * n
        brake = friction * G * max(n[2], 0.0)
        if speed < 1e-3:
            if np.linalg.norm(along) <= brake * (1 + 1e-9):
                still += 1
                if still > 3:
                    break
            v = v + factor * along * dt
        else:
            pull = factor * (along - brake * v / speed)
            if pull @ v < 0.0 and speed < -(pull @ v) / speed * dt and np.linalg.norm(along) <= brake:
                p = p + v * (0.5 * speed / max(np.linalg.norm(pull), 1e-12))
                v = np.zeros(3)
                continue
            v = v + pull * dt
        q, u = p + v * dt, v + (down @ n) * n * dt
        q = q + 0.5 * (down @ n) * n * dt**2
        time += dt
        held = _held(around, q)
        if held is None:
            on, w, spun = False, np.cross(n, v) / radius, True
            out.offs.append(p.copy())
            time -= dt
            p = p + 1e-9 * n
            continue
        p, normals = held
        if np.linalg.norm(v) > 1e-3:
            v, hit = _turned(v, n, normals, c, corner)
        else:
            v, hit = _projected(u, normals), None
        n = max(normals, key=lambda m: m[2])
        if hit is not None and hit[2] <= 0.0:
            on = False
        still = 0
    out.position, out.time_s = p, time
    return out


def _gripped(v: np.ndarray, n: np.ndarray, w: np.ndarray, radius: float, c: float) -> np.ndarray:
    """The velocity along the ground of a block that lands softly and rolls on: (v + c r ω × n)/(1 + c)."""
    return (v - (v @ n) * n + c * radius * np.cross(w, n)) / (1.0 + c)


def _held(around: _Around, q: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]] | None:
    """The centre moved out of the ground, and the directions in which that pushes; None where nothing touches."""
    normals: list[np.ndarray] = []
    for _ in range(40):
        directions, gaps = around.contacts(q)
        if not gaps.size:
            break
        k = gaps.argmin()
        if gaps[k] >= -1e-12 * around.radius:
            break
        q = q - gaps[k] * directions[k]
        if not any(m @ directions[k] > 1.0 - 1e-7 for m in normals):
            normals.append(directions[k])
    return (q, normals) if normals else None


def _projected(v: np.ndarray, normals: list[np.ndarray]) -> np.ndarray:
    """The nearest velocity that leads into none of the contacts."""
    for _ in range(20):
        worst = min(normals, key=lambda m: v @ m)
        if v @ worst >= -1e-12:
            break
        v = v - (v @ worst) * worst
    return v


def _turned(
    v: np.ndarray, n: np.ndarray, normals: list[np.ndarray], c: float, corner: Corner
) -> tuple[np.ndarray, np.ndarray | None]:
    """The velocity along the ground after a step, and the last contact that it ran against.

    Between triangles the ground rises at once: there two contacts meet, and the second takes what runs into it.
    """
    speed, hit = np.linalg.norm(v), None
    for _ in range(12):
        m = min(normals, key=lambda one: v @ one)
        if v @ m >= -1e-9 * speed:
            break
        hit = m
        flat = v - (v @ m) * m
        size = np.linalg.norm(flat)
        if corner == "keep":
            v = flat * (np.linalg.norm(v) / size) if size > 0.0 else flat
        elif corner == "sliding":
            v = flat
        else:  # angular momentum about the new contact, of what runs across the edge between both; the rest rolls on
            edge = np.cross(n, m)
            edge = edge / max(np.linalg.norm(edge), 1e-12)
            along, across = (v @ edge) * edge, v - (v @ edge) * edge
            spin = (n @ m) * across - (across @ m) * n  # (n × v) × m, the velocity that the spin would roll with there
            v = along + (across - (across @ m) * m + c * (spin - (spin @ m) * m)) / (1.0 + c)
        n = m
    else:
        return _projected(v, normals), hit
    if hit is None:  # it turns about what it touches, which does no work
        m = max(normals, key=lambda one: one @ n)
        flat = v - (v @ m) * m
        size = np.linalg.norm(flat)
        v = flat * (speed / size) if size > 0.0 else flat
    return v, hit


# ------------------------------------------------------------------------------------------------- a smooth function


@dataclass
class Smooth:
    """What became of n blocks on a function: (n, 3) ends, (n,) times, impacts, take-offs, greatest speeds."""

    position: np.ndarray
    time_s: np.ndarray
    impacts: np.ndarray
    offs: np.ndarray
    v_max_mps: np.ndarray
    stopped: np.ndarray


type Height = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, ...]]
"""x, y (n,) → z, ∂z/∂x, ∂z/∂y, ∂²z/∂x², ∂²z/∂x∂y, ∂²z/∂y² (n,) each."""


def _foot(height: Height, p: np.ndarray, xy: np.ndarray, turns: int = 3) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(n, 2) plan of the nearest places of a graph, (n, 3) normals there, (n,) distances above: Newton's method."""
    for _ in range(turns):
        z, fx, fy, fxx, fxy, fyy = height(xy[:, 0], xy[:, 1])
        dz = z - p[:, 2]
        gx, gy = (xy[:, 0] - p[:, 0]) + dz * fx, (xy[:, 1] - p[:, 1]) + dz * fy
        a, b, d = 1 + fx**2 + dz * fxx, fx * fy + dz * fxy, 1 + fy**2 + dz * fyy
        det = a * d - b * b
        xy = xy - np.clip(np.column_stack([(d * gx - b * gy) / det, (a * gy - b * gx) / det]), -0.3, 0.3)
    z, fx, fy = height(xy[:, 0], xy[:, 1])[:3]
    n = np.column_stack([-fx, -fy, np.ones_like(fx)])
    n /= np.sqrt(1 + fx**2 + fy**2)[:, None]
    return xy, n, ((p - np.column_stack([xy, z])) * n).sum(axis=1)


def _turning(height: Height, xy: np.ndarray, u: np.ndarray, radius: float) -> np.ndarray:
    """(n,) −u·ṅ: how the surface bends the path of the centre, upwards above zero, at the feet xy (n, 2).

    With the shape operator S of the graph, ṅ = −S (1 − r S)⁻¹ u; in plan, with the first and second fundamental forms.
    """
    _, fx, fy, fxx, fxy, fyy = height(xy[:, 0], xy[:, 1])
    size = np.sqrt(1 + fx**2 + fy**2)
    one = np.stack([np.stack([1 + fx**2, fx * fy], -1), np.stack([fx * fy, 1 + fy**2], -1)], -2)
    two = np.stack([np.stack([fxx, fxy], -1), np.stack([fxy, fyy], -1)], -2) / size[:, None, None]
    foot = np.linalg.solve(one - radius * two, np.einsum("nij,nj->ni", one, u[:, :2])[..., None])[..., 0]
    return np.einsum("ni,nij,nj->n", u[:, :2], two, foot)


def fall_on_function(
    height: Height,
    p: np.ndarray,
    v: np.ndarray,
    radius: float,
    *,
    model: str = "azimi_desvarreux_1977",
    parameters: dict[str, object] | None = None,
    rolling: str = "azzoni_1995",
    friction: float = 0.5,
    mass: float = 1.0,
    dt: float = 0.004,
    most_s: float = 60.0,
    inside: Callable[[np.ndarray], np.ndarray] | None = None,
    rng: np.random.Generator | None = None,
    hop: float = HOP,
) -> Smooth:
    """Let n blocks fall on z = height(x, y), which is to bend nowhere more than 1/radius upwards.

    Parameters
    ----------
    p, v : (n, 3). inside : (n, 3) → (n,) whether a block is still over the terrain.

    Notes
    -----
    On the ground v' = A (g∥ − μ g cosβ v/|v|) − (v·ṅ) n, where ṅ is how the normal turns along v. It leaves where the
    ground would have to pull: −v·ṅ + g cosβ < 0.
    """
    found = find_model(model)
    numbers = found.parameter_type(*found.numbers(parameters or {}))
    c = ROLLS[rolling]
    factor = 1.0 / (1.0 + c)
    count = len(p)
    p, v, w = np.array(p, float), np.array(v, float), np.zeros((count, 3))
    down = np.array([0.0, 0.0, -G])
    on, going, spun = np.zeros(count, bool), np.ones(count, bool), np.zeros(count, bool)
    out = Smooth(p, np.zeros(count), np.zeros(count, int), np.zeros(count, int), np.zeros(count), np.zeros(count, bool))
    xy = p[:, :2].copy()

    def rate(q: np.ndarray, u: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Acceleration, the foot, and how hard the ground holds (per mass)."""
        foot, n, _ = _foot(height, q, at, 2)
        bend = _turning(height, foot, u, radius)
        speed = np.linalg.norm(u, axis=1)
        along = down + G * n[:, 2:] * n
        brake = friction * G * n[:, 2:] * u / np.maximum(speed, 1e-9)[:, None]
        return factor * (along - brake) + bend[:, None] * n, foot, bend + G * n[:, 2]

    for _ in range(int(most_s / dt)):
        if not going.any():
            break
        out.v_max_mps = np.maximum(out.v_max_mps, np.linalg.norm(v, axis=1))
        k = np.flatnonzero(going & on)
        if k.size:
            q, u = p[k], v[k]
            a1, foot, holds = rate(q, u, xy[k])
            off = holds < 0.0
            a2 = rate(q + 0.5 * dt * u, u + 0.5 * dt * a1, foot)[0]
            a3 = rate(q + 0.5 * dt * (u + 0.5 * dt * a1), u + 0.5 * dt * a2, foot)[0]
            a4 = rate(q + dt * (u + 0.5 * dt * a2), u + dt * a3, foot)[0]
            speed = np.linalg.norm(u, axis=1)
            n0 = _foot(height, q, foot)[1]
            static = G * np.sqrt(np.maximum(1 - n0[:, 2] ** 2, 0)) <= friction * G * n0[:, 2]
            slows = (a1 * u).sum(axis=1) / np.maximum(speed, 1e-12)
            rests = static & (speed <= -slows * dt)
            new_q = q + dt * u + dt**2 / 6 * (a1 + a2 + a3)
            new_u = u + dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
            foot, n, gap = _foot(height, new_q, foot)
            new_q = new_q + (radius - gap)[:, None] * n
            new_u = new_u - (new_u * n).sum(axis=1)[:, None] * n
            move = ~off & ~rests
            p[k[move]], v[k[move]], xy[k[move]] = new_q[move], new_u[move], foot[move]
            out.time_s[k[move]] += dt
            done = k[rests & ~off]
            going[done], out.stopped[done] = False, True
            p[done] = q[rests & ~off] + (u * (0.5 * speed / np.maximum(-slows, 1e-9))[:, None])[rests & ~off]
            on[k[off]] = False
            out.offs[k[off]] += 1
            w[k[off]] = np.cross(n0[off], u[off]) / radius
            spun[k[off]] = True
        k = np.flatnonzero(going & ~on)
        if k.size:
            step = np.full(k.size, dt)
            q = p[k] + v[k] * dt + 0.5 * down * dt**2
            foot, n, gap = _foot(height, q, xy[k])
            lands = (gap < radius) & (((v[k] + down * dt) * n).sum(axis=1) < 0)
            low, high = np.zeros(k.size), np.full(k.size, dt)
            for _ in range(30 if lands.any() else 0):
                middle = 0.5 * (low + high)
                q = p[k] + v[k] * middle[:, None] + 0.5 * down * middle[:, None] ** 2
                above = _foot(height, q, foot)[2] > radius
                low, high = np.where(above, middle, low), np.where(above, high, middle)
            step = np.where(lands, low, dt)
            p[k] = p[k] + v[k] * step[:, None] + 0.5 * down * step[:, None] ** 2
            v[k] = v[k] + down * step[:, None]
            out.time_s[k] += step
            foot, n, gap = _foot(height, p[k], foot)
            xy[k] = foot
            for row, i in zip(np.flatnonzero(lands).tolist(), k[lands].tolist(), strict=True):
                m = n[row]
                if (v[i] @ m) ** 2 >= 2 * G * m[2] * hop * radius:
                    u = found.draw_type(*(rng.random(found.draws) if rng is not None else np.full(found.draws, np.nan)))
                    v2, w2 = found.function(tuple(v[i]), tuple(m), tuple(w[i]), radius, mass, numbers, u)
                    v[i], w[i] = v2, w2
                    out.impacts[i] += 1
                    spun[i] = True
                else:
                    v[i] = _gripped(v[i], m, w[i], radius, c) if spun[i] else v[i] - (v[i] @ m) * m
                if (v[i] @ m) ** 2 < 2 * G * m[2] * hop * radius:
                    v[i], on[i] = v[i] - (v[i] @ m) * m, True
                    p[i] = p[i] + (radius - gap[row]) * m
        if inside is not None:
            gone = going & ~inside(p)
            going &= ~gone
    out.position = p
    return out

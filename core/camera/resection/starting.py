# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a resection starts: camera poses from three pairs at a time, for many focal lengths, and the best of them.

Three pairs leave at most four poses (Grunert 1841, in the form of Haralick et al. 1994, Int. J. Comput. Vision 13,
331–356). They are computed for many triples and focal lengths, ranked by all pairs with a cost that hardly cares for
wrong ones, and the best are improved together.
"""

from dataclasses import dataclass, replace
from itertools import combinations
from math import comb

import numpy as np

from ...least_squares import damped_step
from ...vectors import Array, cross, norm, unit
from ..model import Camera, project_with_derivatives, rotation_from_vector, undistort

TRIPLES = 32
KEPT = 8
TURNED_OVER = 5
"""Of so many candidates the mirrored twin is tried too."""

STEPS = 25
CULLED = {5: 12, 11: 6}
"""After so many steps the best so many candidates go on."""
FOCAL_WIDTHS = (0.35, 30.0)
"""The focal lengths that are tried, in diagonals of the image; 0.35 is 130° wide, 30 is 1300 mm on full frame."""

SETTLED = 0.01
"""A step that moves no pixel further than so many standard deviations."""

FAR = 1e4
"""Residual of a pair that has no pixel [standard deviations]."""


@dataclass(frozen=True, eq=False)
class Starts:
    """k candidates, the best first.

    Attributes
    ----------
    position : (k, 3) local [m].
    rotation : (k, 3, 3).
    focal_px : (k,).
    cost : (k,) the mean of log(1 + squared residual in standard deviations).
    residual : (k, n) in standard deviations.
    """

    position: Array
    rotation: Array
    focal_px: Array
    cost: Array
    residual: Array


def find_starts(
    camera: Camera,
    pixels: Array,
    points: Array,
    sigma_px: Array,
    sigma_m: Array,
    *,
    free_focal: bool,
    with_pose: bool,
) -> Starts:
    """Camera poses that fit most of the pairs.

    Parameters
    ----------
    camera : inner parameters; with `with_pose` its pose is a candidate too.
    pixels, points : (n, 2) [px], (n, 3) local [m].
    sigma_px, sigma_m : (n,) of the pixels and of the points.
    free_focal : try all focal lengths, with the ratio fy/fx of the camera.
    """
    diagonal = float(np.hypot(*camera.size))
    focals = np.array([camera.fx])
    if free_focal:
        focals = np.append(diagonal * np.geomspace(*FOCAL_WIDTHS, 24), camera.fx)
    bearings = _bearings(camera, pixels, focals)
    position, rotation, focal = _poses_of_triples(bearings, points, focals, _triples(pixels, points))
    if with_pose:
        position = np.concatenate([position, camera.position[None]])
        rotation = np.concatenate([rotation, camera.rotation[None]])
        focal = np.append(focal, camera.fx)
    # A focal length between those tried, and three pairs with errors, leave this much.
    loose = max(float(np.median(sigma_px)), 0.01 * diagonal if free_focal else 0.003 * diagonal)
    residual = _normalised_residuals(camera, pixels, points, position, rotation, focal)
    # Wide and narrow fields, with and without wrong pairs: no one width of the cost ranks them all.
    chosen = np.unique(
        np.concatenate(
            [_best_and_various(_robust_cost(residual / width), focal) for width in (loose, loose / 6, loose / 36)]
        )
    )
    best = chosen[np.argsort(_robust_cost(residual[chosen] / loose), kind="stable")[:TURNED_OVER]]
    over_position, over_rotation = _turned_over(points, position[best], rotation[best])
    position = np.concatenate([position[chosen], over_position])
    rotation = np.concatenate([rotation[chosen], over_rotation])
    chosen = np.append(chosen, best)
    width = np.clip(2 * np.median(residual[chosen], axis=1), loose / 16, loose)
    return _improved(camera, pixels, points, sigma_px, sigma_m, position, rotation, focal[chosen], free_focal, width)


def mirrored(camera: Camera, points: Array) -> Camera:
    """The camera that sees a flat set of points nearly alike from far."""
    position, rotation = _turned_over(points, camera.position[None], camera.rotation[None])
    return replace(camera, position=position[0], rotation=rotation[0])


def poses_from_three(bearings: Array, points: Array) -> tuple[Array, Array, Array]:
    """The cameras that see three points along three rays.

    Parameters
    ----------
    bearings : (m, 3, 3) unit rays in the camera's frame, the second axis counting the points.
    points : (m, 3, 3) [m].

    Returns
    -------
    (row (k,), position (k, 3), rotation (k, 3, 3)) : up to four poses a row.

    Notes
    -----
    Roots that are nearly real are kept as real ones, since errors make neighbouring roots complex.
    """
    a2, b2, c2 = (
        np.einsum("mi,mi->m", d, d)
        for d in (points[:, 1] - points[:, 2], points[:, 0] - points[:, 2], points[:, 0] - points[:, 1])
    )
    ca, cb, cg = (np.einsum("mi,mi->m", bearings[:, i], bearings[:, j]) for i, j in ((1, 2), (0, 2), (0, 1)))
    q, a, c = (a2 - c2) / b2, a2 / b2, c2 / b2
    coefficients = np.stack(
        [
            (q - 1) ** 2 - 4 * c * ca**2,
            4 * (q * (1 - q) * cb - (1 - a - c) * ca * cg + 2 * c * ca**2 * cb),
            2 * (q**2 - 1 + 2 * q**2 * cb**2 + 2 * (1 - c) * ca**2 - 4 * (a + c) * ca * cb * cg + 2 * (1 - a) * cg**2),
            4 * (-q * (1 + q) * cb + 2 * a * cg**2 * cb - (1 - a - c) * ca * cg),
            (1 + q) ** 2 - 4 * a * cg**2,
        ],
        axis=1,
    )
    roots = _quartic_roots(coefficients)
    with np.errstate(divide="ignore", invalid="ignore"):
        v = np.real(roots)
        nearly_real = np.abs(np.imag(roots)) < 0.2 * np.abs(v)
        q, ca, cb, cg = (each[:, None] for each in (q, ca, cb, cg))
        u = ((q - 1) * v**2 - 2 * q * cb * v + 1 + q) / (2 * (cg - v * ca))
        s1 = np.sqrt(b2[:, None] / (1 + v**2 - 2 * v * cb))
        good = nearly_real & (v > 0) & (u > 0) & np.isfinite(s1) & np.isfinite(u)
    row, column = np.nonzero(good)
    distance = np.stack([s1[row, column], (s1 * u)[row, column], (s1 * v)[row, column]], axis=1)
    seen = bearings[row] * distance[:, :, None]
    rotation = _triad(seen) @ np.swapaxes(_triad(points[row]), 1, 2)
    position = points[row].mean(axis=1) - np.einsum("nji,nj->ni", rotation, seen.mean(axis=1))
    finite = np.isfinite(position).all(axis=1) & np.isfinite(rotation).all(axis=(1, 2))
    return row[finite], position[finite], rotation[finite]


def _triad(points: Array) -> Array:
    """Right-handed frames of triangles, axes in columns, (m, 3, 3) → (m, 3, 3)."""
    first = unit(points[:, 1] - points[:, 0])
    third = unit(cross(first, points[:, 2] - points[:, 0]))
    return np.stack([first, cross(third, first), third], axis=2)


def _quartic_roots(coefficients: Array) -> np.ndarray:
    """The complex roots of quartics, (m, 5) from the highest power → (m, 4): Ferrari, then Newton's method."""
    with np.errstate(all="ignore"):
        leading = np.where(np.abs(coefficients[:, 0]) > 1e-300, coefficients[:, 0], 1e-300)
        b, c, d, e = ((coefficients[:, i] / leading).astype(complex) for i in range(1, 5))
        p = c - 3 * b**2 / 8
        q = d - b * c / 2 + b**3 / 8
        r = e - b * d / 4 + b**2 * c / 16 - 3 * b**4 / 256
        # A root of the resolvent m³ + p m² + (p²/4 − r) m − q²/8.
        shift = (p**2 / 4 - r) - p**2 / 3
        level = 2 * p**3 / 27 - p * (p**2 / 4 - r) / 3 - q**2 / 8
        root = np.sqrt(level**2 / 4 + shift**3 / 27)
        cube = -level / 2 + np.where(np.abs(-level / 2 + root) > np.abs(-level / 2 - root), root, -root)
        w = cube ** (1 / 3)
        m = w - np.where(np.abs(w) > 0, shift / (3 * np.where(np.abs(w) > 0, w, 1)), 0) - p / 3
        side = np.sqrt(2 * m)
        turn = np.where(np.abs(side) > 0, q / np.where(np.abs(side) > 0, side, 1), 0)
        x = np.empty((b.size, 4), dtype=complex)
        for column, (first, second) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1))):
            x[:, column] = -b / 4 + (first * side + second * np.sqrt(-(2 * p + 2 * m + first * 2 * turn))) / 2
        b, c, d, e = (each[:, None] for each in (b, c, d, e))
        for _ in range(2):
            value = (((x + b) * x + c) * x + d) * x + e
            slope = ((4 * x + 3 * b) * x + 2 * c) * x + d
            step = value / slope
            x = x - np.where(np.abs(step) < 0.1 * np.abs(x), step, 0)
    return x


def _bearings(camera: Camera, pixels: Array, focals: Array) -> Array:
    """(f, n, 3) unit rays in the camera's frame for each focal length."""
    flat = replace(camera, fx=1.0, fy=1.0, cx=0.0, cy=0.0)
    away = (pixels - [camera.cx, camera.cy]) / [1.0, camera.fy / camera.fx]
    plane = undistort(flat, (away[None] / focals[:, None, None]).reshape(-1, 2)).reshape(focals.size, -1, 2)
    return unit(np.asarray(np.concatenate([plane, np.ones((*plane.shape[:2], 1))], axis=2), dtype=np.float64))


def _triples(pixels: Array, points: Array) -> np.ndarray:
    """(t, 3) pairs to start from: wide triangles in the image and in space, chosen among all or many."""
    n = len(pixels)
    if comb(n, 3) <= 1200:
        triples = np.array(list(combinations(range(n), 3)))
    else:
        draws = np.random.default_rng(0).random((1200, n))
        triples = np.argsort(draws, axis=1, kind="stable")[:, :3]
    if len(triples) <= TRIPLES:
        return triples
    a, b = (pixels[triples[:, i]] - pixels[triples[:, 0]] for i in (1, 2))
    flat = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    solid = norm(cross(*(points[triples[:, i]] - points[triples[:, 0]] for i in (1, 2))))
    wide = flat / flat.max() * np.sqrt(solid / solid.max())
    # Half of the triples are the widest; the others come from all over, in case that a wide pair is wrong.
    order = np.argsort(-wide, kind="stable")
    usable = order[: max(TRIPLES, (6 * len(order)) // 10)]
    widest, rest = usable[: TRIPLES // 2], usable[TRIPLES // 2 :]
    spread = rest[np.random.default_rng(1).permutation(rest.size)[: TRIPLES - TRIPLES // 2]]
    return triples[np.concatenate([widest, spread])]


def _poses_of_triples(bearings: Array, points: Array, focals: Array, triples: np.ndarray) -> tuple[Array, Array, Array]:
    f, t = focals.size, len(triples)
    rays = bearings[:, triples].reshape(f * t, 3, 3)
    corners = np.tile(points[triples], (f, 1, 1))
    usable = np.isfinite(rays).all(axis=(1, 2))
    row, position, rotation = poses_from_three(rays[usable], corners[usable])
    return position, rotation, np.repeat(focals, t)[usable][row]


def _turned_over(points: Array, position: Array, rotation: Array) -> tuple[Array, Array]:
    """The poses that see a flat set of points nearly alike from far: mirrored in its plane and across the view."""
    centre = points.mean(axis=0)
    normal = np.linalg.svd(points - centre)[2][2]
    seen = np.einsum("kij,kj->ki", rotation, centre - position)
    sight = unit(seen)
    across = np.eye(3) - 2 * sight[:, :, None] * sight[:, None, :]
    over = across @ rotation @ (np.eye(3) - 2 * np.outer(normal, normal))
    return centre - np.einsum("kji,kj->ki", over, seen), over


def _normalised_residuals(
    camera: Camera, pixels: Array, points: Array, position: Array, rotation: Array, focal: Array
) -> Array:
    """(k, n) distances in the image [px]; infinite where a point has no pixel. The lens counts as undistorted."""
    turned = (rotation.reshape(-1, 3) @ points.T).reshape(len(rotation), 3, len(points))
    x, y, z = (turned - (rotation @ position[:, :, None])).swapaxes(0, 1)
    # The pixels as they would be without the distortion, which depends on the focal length.
    focals, number = np.unique(focal, return_inverse=True)
    rays = _bearings(camera, pixels, focals)
    with np.errstate(divide="ignore", invalid="ignore"):
        straight = np.ascontiguousarray((rays[..., :2] / rays[..., 2:]).transpose(2, 0, 1))
        across = x / z - straight[0][number]
        down = (y / z - straight[1][number]) * (camera.fy / camera.fx)
        distance = np.sqrt(across**2 + down**2) * focal[:, None]
    return np.where((z > 0) & np.isfinite(distance), distance, np.inf)


def _robust_cost(residual: Array) -> Array:
    """(k,) the mean of log(1 + r²), with an end to what one pair can cost."""
    return np.log1p(np.minimum(residual, FAR) ** 2).mean(axis=-1)


def _best_and_various(cost: Array, focal: Array) -> np.ndarray:
    """Candidates to improve: the best one of each focal length as far as they are good, and the best of all."""
    order = np.argsort(cost, kind="stable")
    _, first = np.unique(focal[order], return_index=True)
    best_of_each = order[np.sort(first)][: KEPT // 2]
    return np.unique(np.concatenate([best_of_each, order[:KEPT]]))


def _improved(
    camera: Camera,
    pixels: Array,
    points: Array,
    sigma_px: Array,
    sigma_m: Array,
    position: Array,
    rotation: Array,
    focal: Array,
    free_focal: bool,
    width: Array,
) -> Starts:
    """Levenberg–Marquardt on all candidates at once, with Cauchy weights whose scale shrinks to the stated errors."""
    n = len(points)
    flat = replace(camera, fx=1.0, fy=camera.fy / camera.fx, cx=0.0, cy=0.0)
    goal = pixels - [camera.cx, camera.cy]
    p = 7 if free_focal else 6
    damping = np.full(len(position), 1e-3)

    def measured(position: Array, rotation: Array, focal: Array) -> tuple[Array, Array]:
        """Residuals (k, 2 n) in standard deviations and their derivatives (k, 2 n, p)."""
        k = len(position)
        seen = project_with_derivatives(
            flat,
            np.tile(points, (k, 1)),
            position=np.repeat(position, n, axis=0),
            rotation=np.repeat(rotation, n, axis=0),
        )
        pixel = seen.pixel.reshape(k, n, 2)
        exists = np.isfinite(pixel[..., :1])
        depth = np.where(exists[..., 0], seen.depth.reshape(k, n), 1.0)
        spread = np.sqrt(sigma_px**2 + (focal[:, None] * sigma_m / depth) ** 2)[..., None]
        gap = np.where(exists, (goal - focal[:, None, None] * pixel) / spread, FAR / np.sqrt(2))
        slopes = np.empty((k, n, 2, p))
        by_pose = np.concatenate([seen.d_rotation, seen.d_position], axis=2).reshape(k, n, 2, 6)
        slopes[..., :6] = by_pose * (focal[:, None, None] / spread)[..., None]
        if free_focal:
            slopes[..., 6] = pixel / spread
        slopes[~exists[..., 0]] = 0.0
        return gap.reshape(k, 2 * n), slopes.reshape(k, 2 * n, p)

    def squares(gap: Array) -> Array:
        return (gap.reshape(len(gap), n, 2) ** 2).sum(axis=2)

    gap, slopes = measured(position, rotation, focal)
    widest = np.maximum(width / float(np.median(sigma_px)), 3.0)
    for number in range(STEPS):
        scale = 3.0 * (widest[:, None] / 3.0) ** max(1 - number / (STEPS - 8), 0.0)
        squared = squares(gap)
        cost = np.log1p(squared / scale**2).sum(axis=1)
        if number in CULLED:
            at_one_scale = np.log1p(squared / np.median(scale) ** 2).sum(axis=1)
            best = np.argsort(at_one_scale, kind="stable")[: CULLED[number]]
            position, rotation, focal, gap, slopes, damping, widest, scale, squared, cost = (
                each[best] for each in (position, rotation, focal, gap, slopes, damping, widest, scale, squared, cost)
            )
        weighted = slopes * np.repeat(1 / (1 + squared / scale**2), 2, axis=1)[:, :, None]
        normal = np.swapaxes(weighted, 1, 2) @ slopes
        right = (np.swapaxes(weighted, 1, 2) @ gap[:, :, None])[..., 0]
        step = damped_step(normal, right, damping)
        if squared.max() < 9 and np.abs(slopes @ step[..., None]).max() < SETTLED:
            break  # all pairs fit all candidates: a narrower cost would weigh them alike
        new_focal = focal
        if free_focal:
            new_focal = np.clip(focal * np.exp(np.clip(step[:, 6] / focal, -0.5, 0.5)), *_focal_range(camera))
        new_rotation = rotation_from_vector(np.clip(step[:, :3], -0.5, 0.5)) @ rotation
        new_position = position + step[:, 3:6]
        new_gap, new_slopes = measured(new_position, new_rotation, new_focal)
        better = np.log1p(squares(new_gap) / scale**2).sum(axis=1) <= cost
        position[better], rotation[better] = new_position[better], new_rotation[better]
        gap[better], slopes[better] = new_gap[better], new_slopes[better]
        focal = np.where(better, new_focal, focal)
        damping = np.clip(np.where(better, damping / 5, damping * 8), 1e-9, 1e3)

    residual = np.sqrt(squares(gap))
    cost = _robust_cost(residual / 3)
    order = np.argsort(cost, kind="stable")
    return Starts(position[order], rotation[order], focal[order], cost[order], residual[order])


def _focal_range(camera: Camera) -> Array:
    return float(np.hypot(*camera.size)) * np.array([FOCAL_WIDTHS[0] / 2, FOCAL_WIDTHS[1] * 4])

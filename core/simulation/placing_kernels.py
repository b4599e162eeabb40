# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiled kernels that put spheres on the ground."""

from math import inf, sqrt

import numpy as np

from ..compiled import kernel
from ..terrain.kernels import STACK_SIZE, nearest_point
from ..terrain.ray_kernels import hits_anything
from .ground_kernels import first_contact, is_in

ABOVE_M = 1e-6
"""A block that is placed on the terrain starts so much above it."""
STEPS, PARTS = 40, 32
"""So often a sphere is moved out of another part of the ground before it does not fit; in a furrow it grows."""


@kernel
def drop_many(tree, places, radius, top, heights, start, stop):  # type: ignore[no-untyped-def]
    """Heights of the centres of spheres that come from above to places (n, 2); NaN without ground."""
    stack, times = np.empty(STACK_SIZE, np.int64), np.empty(STACK_SIZE)
    for i in range(start, stop):
        high = top + 2.0 * radius[i]
        drop, _, place = first_contact(
            tree, stack, times, (places[i, 0], places[i, 1], high), (0.0, 0.0, -1.0), (0.0, 0.0, 0.0), radius[i], inf
        )
        heights[i] = high - drop + ABOVE_M if place >= 0 else np.nan


@kernel
def _is_free(tree, stack, p, q):  # type: ignore[no-untyped-def]
    """Whether no ground is between two places."""
    way = (q[0] - p[0], q[1] - p[1], q[2] - p[2])
    away = sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2])
    if away == 0.0:
        return True
    direction = (way[0] / away, way[1] / away, way[2] / away)
    return not hits_anything(tree, stack, p, direction, away)


@kernel
def _moved_out(tree, stack, p, radius):  # type: ignore[no-untyped-def]
    """The centre of a sphere moved out of the ground, and whether that came to an end without passing through any."""
    for _ in range(STEPS):
        x, y, z, square, place = nearest_point(tree, stack, p, 2.0 * radius)
        d = sqrt(square)
        if place < 0 or d >= radius - 0.5 * ABOVE_M:
            return p, True
        if d == 0.0:
            return p, False
        f = radius / d
        q = (x + f * (p[0] - x), y + f * (p[1] - y), z + f * (p[2] - z))
        if not _is_free(tree, stack, p, q):
            return p, False
        p = q
    return p, False


@kernel
def _stood(tree, stack, point, normal, radius, parts):  # type: ignore[no-untyped-def]
    """A sphere that grows to its radius in so many parts, moved out of the ground each time."""
    before = (
        point[0] + ABOVE_M * normal[0],
        point[1] + ABOVE_M * normal[1],
        point[2] + ABOVE_M * normal[2],
    )
    r = radius / parts
    p = (point[0] + r * normal[0], point[1] + r * normal[1], point[2] + r * normal[2])
    if not _is_free(tree, stack, before, p):
        return p, False
    for part in range(1, parts + 1):
        p, good = _moved_out(tree, stack, p, part * r)
        if not good:
            return p, False
    return p, True


@kernel
def stand_many(tree, points, normals, radius, centres, fits, start, stop):  # type: ignore[no-untyped-def]
    """Fill centres (n, 3) of spheres that touch the ground, near points (n, 3) on it, on the side of the normals.

    A sphere that would be in another part of the ground is moved out of it, from a furrow while it grows. It does not
    fit where that does not end, or only through the ground.
    """
    stack = np.empty(STACK_SIZE, np.int64)
    for i in range(start, stop):
        point = (points[i, 0], points[i, 1], points[i, 2])
        normal = (normals[i, 0], normals[i, 1], normals[i, 2])
        p, good = _stood(tree, stack, point, normal, radius[i] + ABOVE_M, 1)
        if not good:
            p, good = _stood(tree, stack, point, normal, radius[i] + ABOVE_M, PARTS)
        fits[i] = good
        centres[i, 0], centres[i, 1], centres[i, 2] = p


@kernel
def lean_many(tree, points, normals, radius, centres, fits, start, stop):  # type: ignore[no-untyped-def]
    """Fill centres (n, 3) of spheres that come to points (n, 3) of a cloud along their normals until they touch.

    Where the ground leaves no room for the sphere to come from, one radius away, it does not fit.
    """
    stack, times = np.empty(STACK_SIZE, np.int64), np.empty(STACK_SIZE)
    for i in range(start, stop):
        n, r = (normals[i, 0], normals[i, 1], normals[i, 2]), radius[i]
        far = 2.0 * r
        p = (points[i, 0] + far * n[0], points[i, 1] + far * n[1], points[i, 2] + far * n[2])
        fits[i] = False
        if is_in(tree, stack, p, r):
            continue
        way, _, place = first_contact(tree, stack, times, p, (-n[0], -n[1], -n[2]), (0.0, 0.0, 0.0), r, far)
        fits[i] = place >= 0
        back = far - way + ABOVE_M
        for k in range(3):
            centres[i, k] = points[i, k] + back * n[k]

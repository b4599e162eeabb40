# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiled kernels for a single ray or point, and for whether a ray hits anything; on the tree of `kernels`."""

from math import isfinite, sqrt

import numpy as np

from ..compiled import borrowing, kernel
from .kernels import STACK_SIZE, along_ray, enter_box, inverse, nearest_hit, nearest_point, push_children

REFUSED = -2
"""In place of a face: a coordinate is not finite, or a direction has length zero."""


@kernel
def first_hit(tree, face, x, y, z, u, v, w, limit):  # type: ignore[no-untyped-def]
    """First hit of one ray of any length: (distance, face, x, y, z), face −1 without one."""
    largest = max(abs(u), abs(v), abs(w))
    if not (isfinite(x) and isfinite(y) and isfinite(z) and isfinite(u) and isfinite(v) and isfinite(w)):
        return np.inf, REFUSED, x, y, z
    if largest == 0.0:
        return np.inf, REFUSED, x, y, z
    u, v, w = u / largest, v / largest, w / largest
    length = sqrt(u * u + v * v + w * w)
    u, v, w = u / length, v / length, w / length
    stack = np.empty(STACK_SIZE, np.int64)
    distance, place = nearest_hit(tree, stack, (x, y, z), (u, v, w), limit)
    if place < 0:
        return np.inf, -1, np.nan, np.nan, np.nan
    return distance, face[place], x + distance * u, y + distance * v, z + distance * w


@kernel
def closest(tree, face, x, y, z, limit):  # type: ignore[no-untyped-def]
    """The closest point of the triangles to one point: (distance, face, x, y, z), face −1 without one."""
    if not (isfinite(x) and isfinite(y) and isfinite(z)):
        return np.inf, REFUSED, x, y, z
    stack = np.empty(STACK_SIZE, np.int64)
    x, y, z, square, place = nearest_point(tree, stack, (x, y, z), limit)
    if place < 0:
        return np.inf, -1, np.nan, np.nan, np.nan
    return sqrt(square), face[place], x, y, z


@borrowing
def hits_anything(tree, stack, origin, direction, limit):  # type: ignore[no-untyped-def]
    """Whether a triangle is along a ray up to ``limit``: the one found first, wherever it is. See `nearest_hit`."""
    bounds, first, count, corners = tree
    ox, oy, oz = origin[0], origin[1], origin[2]
    ix, iy, iz = inverse(direction[0]), inverse(direction[1]), inverse(direction[2])
    kz = 0
    for a in range(1, 3):
        if abs(direction[a]) > abs(direction[kz]):
            kz = a
    kx, ky = (kz + 1) % 3, (kz + 2) % 3
    sz = 1.0 / direction[kz]
    sx, sy = direction[kx] * sz, direction[ky] * sz
    top = 0
    if enter_box(bounds, 0, ox, oy, oz, ix, iy, iz, limit) < np.inf:
        stack[0] = 0
        top = 1
    while top:
        top -= 1
        node = stack[top]
        if count[node]:
            for i in range(first[node], first[node] + count[node]):
                if 0.0 <= along_ray(corners, i, origin, kx, ky, kz, sx, sy, sz) <= limit:
                    return True
            continue
        left = first[node]
        near_left = enter_box(bounds, left, ox, oy, oz, ix, iy, iz, limit)
        near_right = enter_box(bounds, left + 1, ox, oy, oz, ix, iy, iz, limit)
        top = push_children(stack, top, left, near_left, near_right)
    return False


@kernel
def any_many(tree, origins, directions, limits, hit, start, stop):  # type: ignore[no-untyped-def]
    stack = np.empty(STACK_SIZE, np.int64)
    for i in range(start, stop):
        hit[i] = hits_anything(tree, stack, origins[i], directions[i], limits[i])

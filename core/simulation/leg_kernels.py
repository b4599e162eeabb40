# SPDX-License-Identifier: GPL-3.0-or-later
"""A block that rolls or slides on one triangle: compiled kernels.

There its centre moves on a plane, along p + v t + ½ a t² with the pull of gravity along the plane less friction. So one
leg takes it, in closed form, to the edge of the triangle, to where it touches the triangle that rises beyond the edge,
to rest, or to where another triangle stops it; whatever the size of the triangle. What comes at edges: `edge_kernels`.
"""

from math import inf, sqrt
from typing import Any

import numpy as np

from ..compiled import borrowing as kernel
from .contact_kernels import first_root
from .facet_kernels import is_clear
from .near_kernels import first_near, inside, leaves, look_around

SAG = 1e-3
"""A leg ends where another triangle is deeper in the block than this part of its radius."""
TURN = 0.05
"""Friction keeps its direction on a leg; so the path turns by no more than this [rad]."""
BEND = 0.01
"""The path bends by this part of the radius at least, however slow the block."""
FLAT = 1.0 - 1e-9
"""Cosine between a triangle's normal and that of the contact from which on the contact is within the triangle."""
ON_TRIANGLE: Any = np.int64(-1)
AT_ANOTHER = 3
"""Where a leg ends: on the triangle; at another one, or at an edge where steps have to follow; else at the edge 0 to 2
that it may be taken over."""


@kernel
def time_on(corners, bend, i, p, v, a, n, radius):  # type: ignore[no-untyped-def]
    """How long a sphere stays on triangle i and off those that rise beyond its edges; 0 when it is not so.

    Parameters
    ----------
    bend : see `facet_kernels`.
    p, v, a : of the centre. n : from the contact to the centre.

    Returns
    -------
    time, edge : the edge that ends it, −1 for none.
    """
    ax, ay, az = corners[i, 0, 0], corners[i, 0, 1], corners[i, 0, 2]
    bx, by, bz = corners[i, 1, 0] - ax, corners[i, 1, 1] - ay, corners[i, 1, 2] - az
    cx, cy, cz = corners[i, 2, 0] - ax, corners[i, 2, 1] - ay, corners[i, 2, 2] - az
    mx, my, mz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    size = sqrt(mx * mx + my * my + mz * mz)
    if abs(mx * n[0] + my * n[1] + mz * n[2]) < FLAT * size:
        return 0.0, -1
    limit, at = inf, -1
    for edge in range(3):
        other = (edge + 1) % 3
        sx, sy, sz = corners[i, edge, 0], corners[i, edge, 1], corners[i, edge, 2]
        ux, uy, uz = corners[i, other, 0] - sx, corners[i, other, 1] - sy, corners[i, other, 2] - sz
        kx, ky, kz = my * uz - mz * uy, mz * ux - mx * uz, mx * uy - my * ux  # into the triangle
        h = kx * (p[0] - sx) + ky * (p[1] - sy) + kz * (p[2] - sz)
        h1 = kx * v[0] + ky * v[1] + kz * v[2]
        h2 = kx * a[0] + ky * a[1] + kz * a[2]
        rises = bend[i, edge]
        if rises > 0.0:
            h -= radius * rises * size * sqrt(ux * ux + uy * uy + uz * uz)
        nearly = 1e-9 * radius * size * (abs(ux) + abs(uy) + abs(uz))
        t = inf
        if h <= nearly:
            if h < -nearly or h1 < 0.0 or (h1 == 0.0 and h2 < 0.0):
                return 0.0, edge
            if h2 < 0.0:
                t = -2.0 * h1 / h2
        elif h1 < 0.0 or h2 < 0.0:
            t = first_root(h, h1, h2)
        if t < limit:
            limit, at = t, edge
    return limit, at


@kernel
def leg(  # type: ignore[no-untyped-def]
    tree, facets, stack, nearby, p, v, n, place, radius, gravity, factor, mu, longest
):
    """The motion on a triangle.

    Parameters
    ----------
    facets, nearby : see `facet_kernels` and `near_kernels`.
    p, v, n, place : of the centre; v along the triangle; the normal; the triangle.
    factor, mu : part of gravity that accelerates; coefficient of friction.
    longest : [s].

    Returns
    -------
    t : [s], 0 for no leg. p : the centre after it. way : not the length, but the direction of v then.
    stop : the edge 0 to 2, `ON_TRIANGLE` or `AT_ANOTHER`.
    """
    speed = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    down = factor * gravity * n[2]
    pull = (down * n[0], down * n[1], down * n[2] - factor * gravity)
    if speed > 0.0:
        way = (v[0] / speed, v[1] / speed, v[2] / speed)
    else:
        size = sqrt(pull[0] * pull[0] + pull[1] * pull[1] + pull[2] * pull[2])
        if size == 0.0:
            return 0.0, p, v, AT_ANOTHER
        way = (pull[0] / size, pull[1] / size, pull[2] / size)
    brake = mu * max(down, 0.0)
    a = (pull[0] - brake * way[0], pull[1] - brake * way[1], pull[2] - brake * way[2])
    along = a[0] * way[0] + a[1] * way[1] + a[2] * way[2]
    bend = sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    across = sqrt(max(bend * bend - along * along, 0.0))
    whole, edge = time_on(tree[3], facets[1], place, p, v, a, n, radius)
    limit = min(longest, whole)
    if along < 0.0:
        limit = min(limit, -speed / along)
    if across > 1e-9 * bend:
        limit = min(limit, max(TURN * speed / across, sqrt(2.0 * BEND * radius / across)))
    if not 0.0 < limit < inf:
        return 0.0, p, v, AT_ANOTHER
    t, stop = limit, edge if limit == whole else ON_TRIANGLE
    h = 0.5 * t
    q = (p[0] + (v[0] + a[0] * h) * t, p[1] + (v[1] + a[1] * h) * t, p[2] + (v[2] + a[2] * h) * t)
    x, y, z = radius * n[0], radius * n[1], radius * n[2]
    contact, then = (p[0] - x, p[1] - y, p[2] - z), (q[0] - x, q[1] - y, q[2] - z)
    if not is_clear(tree, stack, facets, place, contact, then, 0.125 * bend * t * t, radius):
        if inside(nearby, p, speed, bend, radius) < limit and leaves(nearby, p):
            look_around(tree, stack, p, radius, nearby)
        t = min(limit, inside(nearby, p, speed, bend, radius))
        if t == 0.0:
            return 0.0, p, v, AT_ANOTHER
        if t < limit:
            stop = ON_TRIANGLE
        other_t, _, other = first_near(tree[3], nearby, p, v, a, (1.0 - SAG) * radius, place, t)
        if other >= 0:
            t, stop = other_t, AT_ANOTHER
        h = 0.5 * t
        q = (p[0] + (v[0] + a[0] * h) * t, p[1] + (v[1] + a[1] * h) * t, p[2] + (v[2] + a[2] * h) * t)
    kept = 1.0 - brake * 0.5 * t / speed if speed > 0.0 else 0.0
    way = (kept * v[0] + pull[0] * t, kept * v[1] + pull[1] * t, kept * v[2] + pull[2] * t)
    return t, q, way, stop

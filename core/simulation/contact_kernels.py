# SPDX-License-Identifier: GPL-3.0-or-later
"""The first contact of a flying sphere with a terrain of triangles: compiled kernels, exact on the parabola.

The path is p(t) = p + v t + ½ a t²; there are no chords. A node of the terrain's tree is entered when the parabola is
in its box, grown by the radius, axis by axis, and between the two planes that hold its triangles. A triangle is first
rejected by its plane, whose distance is a quadratic in t. What is left is found by conservative advancement: with the
closest point q of the triangle, at the distance d in the direction e = (p − q)/d, the triangle lies behind the plane
through q, because it is convex. So

    d(t + h) ≥ d + (v·e) h + ½ (a·e) h²

and a step to the first root of that bound, less the radius, never passes the contact. It is the contact itself on a
face, and converges quadratically on edges and corners.
"""

from functools import partial
from math import inf, sqrt

import numpy as np

from ..compiled import borrowing as kernel
from ..terrain.kernels import closest_on_triangle, inverse
from .pair_kernels import CODES, SECOND

inlined = partial(kernel, inline=True)

TOUCHING_M = 1e-8
"""A sphere this near to the terrain touches it."""
RESTING_S = 1e-9
"""A sphere that touches, and comes back within this time, has not left."""
STEPS = 100
FOREVER_S = 1e12
NOTHING = 1 << 40
"""No row of the tree."""
UNIT = 1.0 + 1e-6
"""Length of a unit vector in single precision, at most."""
SLOW_MPS = 0.5


@kernel
def first_root(c, b, a):  # type: ignore[no-untyped-def]
    """Smallest t ≥ 0 with c + b t + ½ a t² = 0, inf when there is none."""
    if a == 0.0:
        return -c / b if b != 0.0 and c * b <= 0.0 else inf
    square = b * b - 2.0 * a * c
    if square < 0.0:
        return inf
    q = -(b + sqrt(square)) if b >= 0.0 else -(b - sqrt(square))
    one = q / a
    other = 2.0 * c / q if q != 0.0 else 0.0
    low, high = min(one, other), max(one, other)
    return low if low >= 0.0 else high if high >= 0.0 else inf


@kernel
def last_root(c, b, a):  # type: ignore[no-untyped-def]
    """Largest t with c + b t + ½ a t² = 0 for a ≠ 0, −inf when there is none."""
    square = b * b - 2.0 * a * c
    if square < 0.0:
        return -inf
    q = -(b + sqrt(square)) if b >= 0.0 else -(b - sqrt(square))
    return max(q / a, 2.0 * c / q) if q != 0.0 else 0.0


@kernel
def slab(p, v, a, low, high):  # type: ignore[no-untyped-def]
    """When p + v t + ½ a t², t ≥ 0, is first, and at the latest last, between two values: (inf, −inf) when never."""
    if a == 0.0:
        if v == 0.0:
            return (0.0, inf) if low <= p <= high else (inf, -inf)
        one, other = (low - p) / v, (high - p) / v
        entry, leave = min(one, other), max(one, other)
        return (max(entry, 0.0), leave) if leave >= 0.0 else (inf, -inf)
    if p > high:
        entry = first_root(p - high, v, a)
    elif p < low:
        entry = first_root(p - low, v, a)
    else:
        entry = 0.0
    return entry, last_root(p - low, v, a) if a < 0.0 else last_root(p - high, v, a)


@inlined
def enter_box(low_x, low_y, low_z, high_x, high_y, high_z, p, v, a, path, limit):  # type: ignore[no-untyped-def]
    """Between which times the sphere can touch what is in a box: (inf, …) when not before `limit`.

    path : of `prepared`. In x and y the box is met between two planes; then the height on that part of the path is
    between those at its ends and at the apex, without a root.
    """
    grown_x, grown_y, grown, over_x, over_y, apex = path
    one, other = (low_x - grown_x - p[0]) * over_x, (high_x + grown_x - p[0]) * over_x
    near, far = max(min(one, other), 0.0), min(max(one, other), limit)
    one, other = (low_y - grown_y - p[1]) * over_y, (high_y + grown_y - p[1]) * over_y
    near, far = max(min(one, other), near), min(max(one, other), far)
    if near > far:
        return inf, far
    half = 0.5 * a[2]
    top = min(max(apex, near), far)
    z0, z1, z2 = (v[2] + half * near) * near, (v[2] + half * far) * far, (v[2] + half * top) * top
    low, high = p[2] + min(min(z0, z1), z2), p[2] + max(max(z0, z1), z2)
    return near if high >= low_z - grown and low <= high_z + grown else inf, far


@inlined
def enter_node(bounds, node, p, v, a, path, limit):  # type: ignore[no-untyped-def]
    """`enter_box` of a node."""
    return enter_box(
        bounds[node, 0], bounds[node, 1], bounds[node, 2], bounds[node, 3], bounds[node, 4], bounds[node, 5],
        p, v, a, path, limit,
    )  # fmt: skip


@kernel
def prepared(p, v, a, radius, limit):  # type: ignore[no-untyped-def]
    """What `enter_box` needs of a path: how much boxes grow, 1/v, the time of the apex.

    Along x and y only drag accelerates: boxes grow by how far that takes the block from its straight line.
    """
    grown = radius + 2.0 * TOUCHING_M
    bent_x = 0.5 * abs(a[0]) * limit * limit if a[0] != 0.0 else 0.0
    bent_y = 0.5 * abs(a[1]) * limit * limit if a[1] != 0.0 else 0.0
    return grown + bent_x, grown + bent_y, grown, inverse(v[0]), inverse(v[1]), -v[2] / a[2] if a[2] != 0.0 else 0.0


@kernel
def triangle_box(corners, i):  # type: ignore[no-untyped-def]
    """Low and high corner of the box of triangle i, as six numbers."""
    ax, ay, az = corners[i, 0, 0], corners[i, 0, 1], corners[i, 0, 2]
    bx, by, bz = corners[i, 1, 0], corners[i, 1, 1], corners[i, 1, 2]
    cx, cy, cz = corners[i, 2, 0], corners[i, 2, 1], corners[i, 2, 2]
    return (
        min(min(ax, bx), cx), min(min(ay, by), cy), min(min(az, bz), cz),
        max(max(ax, bx), cx), max(max(ay, by), cy), max(max(az, bz), cz),
    )  # fmt: skip


@kernel
def touch(corners, i, p, v, a, radius, t, limit):  # type: ignore[no-untyped-def]
    """First time in t…limit at which the sphere touches triangle i and comes nearer: (t, e), t inf when not."""
    nowhere = (0.0, 0.0, 0.0)
    ax, ay, az = corners[i, 0, 0], corners[i, 0, 1], corners[i, 0, 2]
    bx, by, bz = corners[i, 1, 0], corners[i, 1, 1], corners[i, 1, 2]
    cx, cy, cz = corners[i, 2, 0], corners[i, 2, 1], corners[i, 2, 2]
    bx, by, bz, cx, cy, cz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
    mx, my, mz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    size = sqrt(mx * mx + my * my + mz * mz)
    if size > 0.0:
        s = mx * (p[0] - ax) + my * (p[1] - ay) + mz * (p[2] - az)
        s1 = mx * v[0] + my * v[1] + mz * v[2]
        s2 = mx * a[0] + my * a[1] + mz * a[2]
        here, slope = s + (s1 + 0.5 * s2 * t) * t, s1 + s2 * t
        if here < 0.0:
            s, s1, s2, here, slope = -s, -s1, -s2, -here, -slope
        reach = (radius + TOUCHING_M) * size
        away = here > reach or (here > reach - 2.0 * TOUCHING_M * size and slope > 0.0)
        if away and s2 <= 0.0 and s + (s1 + 0.5 * s2 * limit) * limit > reach:
            return inf, nowhere  # off the plane at both ends of a path that is bent towards it
        if here > reach:
            t += first_root(here - reach, slope, s2)
            if t > limit or t == inf:
                return inf, nowhere
    for _ in range(STEPS):
        x = p[0] + (v[0] + 0.5 * a[0] * t) * t
        y = p[1] + (v[1] + 0.5 * a[1] * t) * t
        z = p[2] + (v[2] + 0.5 * a[2] * t) * t
        qx, qy, qz = closest_on_triangle(corners, i, x, y, z)
        ex, ey, ez = x - qx, y - qy, z - qz
        d = sqrt(ex * ex + ey * ey + ez * ez)
        vx, vy, vz = v[0] + a[0] * t, v[1] + a[1] * t, v[2] + a[2] * t
        if d > 0.0:
            ex, ey, ez = ex / d, ey / d, ez / d
        else:
            side = -1.0 / size if mx * vx + my * vy + mz * vz > 0.0 else 1.0 / size
            ex, ey, ez = side * mx, side * my, side * mz
        gap = d - radius
        speed = vx * ex + vy * ey + vz * ez
        bend = a[0] * ex + a[1] * ey + a[2] * ez
        if gap <= TOUCHING_M:
            if speed < 0.0:
                return t, (ex, ey, ez)
            step = -2.0 * speed / bend if bend < 0.0 else inf
            if step <= RESTING_S:
                return t, (ex, ey, ez)
        else:
            step = first_root(gap, speed, bend)
        t += step
        if t > limit or step == inf:
            return inf, nowhere
    return t, (ex, ey, ez)


@kernel
def span(p, v, a, start, stop, grown):  # type: ignore[no-untyped-def]
    """Between which values p + v t + ½ a t² stays from one time to another, and so much more."""
    one, other = p + (v + 0.5 * a * start) * start, p + (v + 0.5 * a * stop) * stop
    bow = 0.125 * a * (stop - start) * (stop - start)
    return min(one, other) - max(bow, 0.0) - grown, max(one, other) + max(-bow, 0.0) + grown


@inlined
def overlaps(pairs, row, k, x, y, z):  # type: ignore[no-untyped-def]
    """Whether a child's box overlaps three spans."""
    low = (pairs[row, k] <= x[1]) & (pairs[row, k + 1] <= y[1]) & (pairs[row, k + 2] <= z[1])
    return low & (pairs[row, k + 3] >= x[0]) & (pairs[row, k + 4] >= y[0]) & (pairs[row, k + 5] >= z[0])


@inlined
def enter_child(pairs, row, k, p, v, a, path, limit):  # type: ignore[no-untyped-def]
    """`enter_box` of a child, its first time alone; inf when not between the planes that hold its triangles, either."""
    near, far = enter_box(
        np.float64(pairs[row, k]), np.float64(pairs[row, k + 1]), np.float64(pairs[row, k + 2]),
        np.float64(pairs[row, k + 3]), np.float64(pairs[row, k + 4]), np.float64(pairs[row, k + 5]),
        p, v, a, path, limit,
    )  # fmt: skip
    if near == inf:
        return inf
    x, y, z = np.float64(pairs[row, k + 6]), np.float64(pairs[row, k + 7]), np.float64(pairs[row, k + 8])
    low, high = span(
        x * p[0] + y * p[1] + z * p[2], x * v[0] + y * v[1] + z * v[2], x * a[0] + y * a[1] + z * a[2],
        near, far, path[2] * UNIT,
    )  # fmt: skip
    return near if (low <= pairs[row, k + 10]) & (high >= pairs[row, k + 9]) else inf


@kernel
def soon(v, a):  # type: ignore[no-untyped-def]
    """When a flight has most likely met the ground: on a slope of 45° and some more."""
    return 2.0 * (sqrt(v[0] * v[0] + v[1] * v[1]) + max(v[2], 0.0) + SLOW_MPS) / -a[2] if a[2] < 0.0 else inf


@kernel
def first_contact(tree, stack, times, p, v, a, radius, limit):  # type: ignore[no-untyped-def]
    """The first contact of a sphere with the terrain before `limit`.

    Parameters
    ----------
    tree : of triangles, see `ground_kernels`.
    stack, times : work space of `STACK_SIZE`, int64 and float64.
    p, v, a : triples: place [m], velocity [m/s], acceleration [m/s²].

    Returns
    -------
    time, normal, place : [s], from the contact to the centre, in the order of the leaves; (inf, zeros, −1) for none.

    Notes
    -----
    The path is looked at in parts, since most flights are short: where only one of two children overlaps the box of a
    part, that is all that is asked.
    """
    bounds, _, _, corners, pairs, children = tree
    found, normal = -1, (0.0, 0.0, 0.0)
    grown = radius + 2.0 * TOUCHING_M
    whole, begin, length = min(limit, last_inside(bounds, p, v, a, grown)), 0.0, soon(v, a)
    while found < 0 and begin < whole:
        best = min(whole, begin + length)
        path = prepared(p, v, a, radius, best)
        x, y = span(p[0], v[0], a[0], begin, best, grown), span(p[1], v[1], a[1], begin, best, grown)
        z = span(p[2], v[2], a[2], begin, best, grown)
        stack[0], times[0] = 0, begin
        top = 1
        while top:
            top -= 1
            node = stack[top]
            if times[top] > best:
                continue
            while 0 <= node < NOTHING:
                one, other = overlaps(pairs, node, 0, x, y, z), overlaps(pairs, node, SECOND, x, y, z)
                left, right = np.int64(children[node, CODES]), np.int64(children[node, CODES + 1])
                if one and other:
                    near_left = enter_child(pairs, node, 0, p, v, a, path, best)
                    near_right = enter_child(pairs, node, SECOND, p, v, a, path, best)
                    if near_left > near_right:
                        left, right, near_left, near_right = right, left, near_right, near_left
                    if near_right < inf:
                        stack[top], times[top] = right, near_right
                        top += 1
                    node = left if near_left < inf else NOTHING
                elif one or other:
                    node = left if one else right
                else:
                    node = NOTHING
            if node == NOTHING:
                continue
            leaf = -1 - node
            for i in range(leaf >> 3, (leaf >> 3) + (leaf & 7)):
                low_x, low_y, low_z, high_x, high_y, high_z = triangle_box(corners, i)
                near, far = enter_box(low_x, low_y, low_z, high_x, high_y, high_z, p, v, a, path, best)
                if near == inf:
                    continue
                t, e = touch(corners, i, p, v, a, radius, near, far)
                if t < best or (t == best and found < 0):
                    best, found, normal = t, i, e
        begin, length = best, 2.0 * length
    return (best, normal, found) if found >= 0 else (inf, normal, -1)


@kernel
def last_inside(bounds, p, v, a, grown):  # type: ignore[no-untyped-def]
    """When the path is in the box of the terrain for the last time, a finite number; −1 when it never is."""
    far = FOREVER_S
    for axis in range(3):
        entry, leave = slab(p[axis], v[axis], a[axis], bounds[0, axis] - grown, bounds[0, axis + 3] + grown)
        if entry > leave:
            return -1.0
        far = min(far, leave)
    return far

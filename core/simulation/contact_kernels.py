# SPDX-License-Identifier: GPL-3.0-or-later
"""The first contact of a flying sphere with a terrain of triangles: compiled kernels, exact on the parabola.

The path is p(t) = p + v t + ½ a t²; there are no chords. A node of the terrain's tree is entered when the parabola is
in its box, grown by the radius, axis by axis. A triangle is first rejected by its plane, whose distance is a quadratic
in t. What is left is found by conservative advancement: with the closest point q of the triangle, at the distance d in
the direction e = (p − q)/d, the triangle lies behind the plane through q, because it is convex. So

    d(t + h) ≥ d + (v·e) h + ½ (a·e) h²

and a step to the first root of that bound, less the radius, never passes the contact. It is the contact itself on a
face, and converges quadratically on edges and corners.
"""

from math import inf, sqrt

from ..compiled import kernel
from ..terrain.kernels import closest_on_triangle

TOUCHING_M = 1e-8
"""A sphere this near to the terrain touches it."""
RESTING_S = 1e-9
"""A sphere that touches, and comes back within this time, has not left."""
STEPS = 100


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


@kernel
def enter_node(bounds, node, p, v, a, grown, limit):  # type: ignore[no-untyped-def]
    """When the sphere can first touch what is in a node, inf when not before `limit`."""
    near, far = 0.0, limit
    for axis in range(3):
        entry, leave = slab(p[axis], v[axis], a[axis], bounds[node, axis] - grown, bounds[node, axis + 3] + grown)
        near, far = max(near, entry), min(far, leave)
        if near > far:
            return inf
    return near


@kernel
def touch(corners, i, p, v, a, radius, start, limit):  # type: ignore[no-untyped-def]
    """First time in start…limit at which the sphere touches triangle i and comes nearer: (t, e), t inf when not."""
    ax, ay, az = corners[i, 0, 0], corners[i, 0, 1], corners[i, 0, 2]
    bx, by, bz = corners[i, 1, 0] - ax, corners[i, 1, 1] - ay, corners[i, 1, 2] - az
    cx, cy, cz = corners[i, 2, 0] - ax, corners[i, 2, 1] - ay, corners[i, 2, 2] - az
    mx, my, mz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    size = sqrt(mx * mx + my * my + mz * mz)
    t = start
    nowhere = (0.0, 0.0, 0.0)
    if size > 0.0:
        mx, my, mz = mx / size, my / size, mz / size
        s = mx * (p[0] - ax) + my * (p[1] - ay) + mz * (p[2] - az)
        s1 = mx * v[0] + my * v[1] + mz * v[2]
        s2 = mx * a[0] + my * a[1] + mz * a[2]
        here = s + (s1 + 0.5 * s2 * t) * t
        reach = radius + TOUCHING_M
        if abs(here) > reach:
            side = reach if here > 0.0 else -reach
            t += first_root(here - side, s1 + s2 * t, s2)
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
            side = -1.0 if mx * vx + my * vy + mz * vz > 0.0 else 1.0
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
def first_contact(tree, stack, times, p, v, a, radius, limit):  # type: ignore[no-untyped-def]
    """The first contact of a sphere with the terrain before `limit`.

    Parameters
    ----------
    tree : of the terrain's index.
    stack, times : work space of `STACK_SIZE`, int64 and float64.
    p, v, a : triples: place [m], velocity [m/s], acceleration [m/s²].

    Returns
    -------
    time, normal, place : [s], from the contact to the centre, in the order of the leaves; (inf, zeros, −1) for none.
    """
    bounds, first, count, corners = tree
    grown = radius + 2.0 * TOUCHING_M
    best, found = limit, -1
    normal = (0.0, 0.0, 0.0)
    near = enter_node(bounds, 0, p, v, a, grown, best)
    top = 0
    if near < inf:
        stack[0], times[0] = 0, near
        top = 1
    while top:
        top -= 1
        node = stack[top]
        if times[top] > best:
            continue
        if count[node]:
            for i in range(first[node], first[node] + count[node]):
                t, e = touch(corners, i, p, v, a, radius, times[top], best)
                if t < best or (t == best < inf and found < 0):
                    best, found, normal = t, i, e
            continue
        left = first[node]
        near_left = enter_node(bounds, left, p, v, a, grown, best)
        near_right = enter_node(bounds, left + 1, p, v, a, grown, best)
        if near_left <= near_right:
            if near_right < inf:
                stack[top], times[top] = left + 1, near_right
                top += 1
            if near_left < inf:
                stack[top], times[top] = left, near_left
                top += 1
        else:
            if near_left < inf:
                stack[top], times[top] = left, near_left
                top += 1
            stack[top], times[top] = left + 1, near_right
            top += 1
    return (best, normal, found) if found >= 0 else (inf, normal, -1)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The triangles about a block on the ground, looked up once for many steps. Compiled kernels.

They are kept in a tuple `nearby` of three: their places in the tree; their boxes (`MOST_NEAR`, 6); and what is known of
them: how many they are, −1 for none looked up or too many; about which place (three coordinates); how far away all
triangles are among them [m]; and how many radii that is to be the next time. It is adapted to the size of the
triangles: small blocks on large triangles look far, where they look around again and again.
"""

from math import inf, sqrt

from ..compiled import borrowing as kernel
from ..terrain.kernels import box_distance2, closest_on_triangle, nearest_point
from .contact_kernels import TOUCHING_M, enter_node, first_root, prepared, touch, triangle_box

NEIGHBOURHOOD, LEAST_NEIGHBOURHOOD, MOST_NEIGHBOURHOOD = 4.0, 2.5, 100.0
"""How many radii around a block are looked up: the first time, at least, at most."""
FEW_NEAR, MOST_NEAR = 20, 64


@kernel
def collect(tree, stack, p, reach, near, boxes):  # type: ignore[no-untyped-def]
    """Fill both with the triangles whose boxes are within `reach` of a point; how many, −1 when there is no room."""
    bounds, first, count, corners = tree[:4]
    square, found = reach * reach, 0
    stack[0] = 0
    top = 1
    while top:
        top -= 1
        node = stack[top]
        if box_distance2(bounds, node, p[0], p[1], p[2]) > square:
            continue
        if count[node]:
            for i in range(first[node], first[node] + count[node]):
                if found == near.size:
                    return -1
                near[found] = i
                box = triangle_box(corners, i)
                for k in range(6):
                    boxes[found, k] = box[k]
                found += box_distance2(boxes, found, p[0], p[1], p[2]) <= square
            continue
        stack[top], stack[top + 1] = first[node], first[node] + 1
        top += 2
    return found


@kernel
def look_around(tree, stack, p, radius, nearby):  # type: ignore[no-untyped-def]
    """Look up the triangles about a place: fills `nearby`."""
    near, boxes, around = nearby
    if around[0] < 0.0 or away(around, p) > 2.0 * around[4]:
        around[5] = min(around[5], NEIGHBOURHOOD)  # elsewhere: it may be for one step only
    found, reach = -1, 0.0
    while found < 0:
        reach = around[5] * radius
        found = collect(tree, stack, p, reach, near, boxes)
        if found < 0:
            if around[5] <= LEAST_NEIGHBOURHOOD:
                break
            around[5] = max(around[5] / 1.5, LEAST_NEIGHBOURHOOD)
    around[0], around[1], around[2], around[3], around[4] = found, p[0], p[1], p[2], reach
    if 0 <= found < FEW_NEAR:
        around[5] = min(around[5] * 1.5, MOST_NEIGHBOURHOOD)


@kernel
def away(around, p):  # type: ignore[no-untyped-def]
    """How far a point is from the place that was looked around."""
    x, y, z = p[0] - around[1], p[1] - around[2], p[2] - around[3]
    return sqrt(x * x + y * y + z * z)


@kernel
def leaves(nearby, p):  # type: ignore[no-untyped-def]
    """Whether a point is far enough from the place that was looked around to look around there."""
    around = nearby[2]
    return around[0] < 0.0 or away(around, p) > 0.3 * around[4]


@kernel
def inside(nearby, p, speed, bend, radius):  # type: ignore[no-untyped-def]
    """How long a sphere with a speed and an acceleration at least meets no other triangles than those of `nearby`."""
    around = nearby[2]
    room = around[4] - radius - away(around, p)
    return first_root(-room, speed, bend) if around[0] >= 0.0 and room > 0.0 else 0.0


@kernel
def closest_near(tree, stack, p, radius, nearby):  # type: ignore[no-untyped-def]
    """Where the terrain is closest to a sphere that touches it: (x, y, z, squared distance, place), place −1 if not."""
    near, boxes, around = nearby
    if around[0] < 0.0 or away(around, p) + 2.0 * radius > around[4]:
        look_around(tree, stack, p, radius, nearby)
        if around[0] < 0.0:
            return nearest_point(tree[:4], stack, p, radius + 2.0 * TOUCHING_M)
    corners = tree[3]
    best, place = (radius + 2.0 * TOUCHING_M) ** 2, -1
    qx, qy, qz = 0.0, 0.0, 0.0
    for k in range(int(around[0])):
        if box_distance2(boxes, k, p[0], p[1], p[2]) < best:
            i = near[k]
            x, y, z = closest_on_triangle(corners, i, p[0], p[1], p[2])
            square = (x - p[0]) ** 2 + (y - p[1]) ** 2 + (z - p[2]) ** 2
            if square < best:
                best, place, qx, qy, qz = square, i, x, y, z
    return qx, qy, qz, best, place


@kernel
def first_near(corners, nearby, p, v, a, radius, skipped, limit):  # type: ignore[no-untyped-def]
    """The first contact with the triangles of `nearby` but one, before `limit`: as `first_contact`."""
    near, boxes, around = nearby
    path = prepared(p, v, a, radius, limit)
    best, found, normal = limit, -1, (0.0, 0.0, 0.0)
    for k in range(int(around[0])):
        start, stop = enter_node(boxes, k, p, v, a, path, best)
        if start < inf and near[k] != skipped:
            t, e = touch(corners, near[k], p, v, a, radius, start, stop)
            if t < best or (t == best and found < 0):
                best, found, normal = t, near[k], e
    return (best, normal, found) if found >= 0 else (inf, normal, -1)

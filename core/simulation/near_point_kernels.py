# SPDX-License-Identifier: GPL-3.0-or-later
"""The points about a block on the ground, looked up once for several steps. Compiled kernels.

They are those near the way that it is about to take, kept in a tuple `close` of three: their places in the tree, and of
those that it met last their numbers in this list; their coordinates (3, `MOST_CLOSE`), so that all are looked through
at once; and what is known of them (`KNOWN`): how many they are, −1 for none looked up or too many; the start of the way
and the way (three coordinates each); how many it met last, and where; how many radii of the way are
looked up the next time, 0 where so many points are about that the tree is as quick.
"""

from math import inf, sqrt

from ..compiled import borrowing as kernel
from ..terrain.point_kernels import inlined, middle

WAY, ASIDE = 2.5, 0.1
"""How many radii of the way are looked up, and how far beside it the block may get until it looks again."""
LEAST_WAY = 0.5
MOST_CLOSE, KNOWN = 1024, 12


@kernel
def collect_points(tree, stack, p, way, reach, close):  # type: ignore[no-untyped-def]
    """Fill `close` with the points within `reach` of a way from p."""
    nodes, first, count, points, _ = tree
    places, coordinates, known = close
    length = way[0] * way[0] + way[1] * way[1] + way[2] * way[2]
    over = 1.0 / length if length > 0.0 else 0.0
    known[0] = -1.0
    for k in range(3):
        known[1 + k], known[4 + k] = p[k], way[k]
    found = 0
    stack[0] = 0
    top = 1
    while top:
        top -= 1
        node = stack[top]
        x, y, z = middle(nodes, node)
        x, y, z = x - p[0], y - p[1], z - p[2]
        t = min(max((x * way[0] + y * way[1] + z * way[2]) * over, 0.0), 1.0)
        dx, dy, dz = x - t * way[0], y - t * way[1], z - t * way[2]
        far = reach + nodes[node, 12]
        if dx * dx + dy * dy + dz * dz > far * far:
            continue
        nx, ny, nz = nodes[node, 6], nodes[node, 7], nodes[node, 8]
        height, rise = nx * p[0] + ny * p[1] + nz * p[2], nx * way[0] + ny * way[1] + nz * way[2]
        if height + min(rise, 0.0) - reach > nodes[node, 10] or height + max(rise, 0.0) + reach < nodes[node, 9]:
            continue
        if count[node] == 0:
            stack[top], stack[top + 1] = first[node], first[node] + 1
            top += 2
            continue
        for i in range(first[node], first[node] + count[node]):
            x, y, z = points[i, 0] - p[0], points[i, 1] - p[1], points[i, 2] - p[2]
            t = min(max((x * way[0] + y * way[1] + z * way[2]) * over, 0.0), 1.0)
            dx, dy, dz = x - t * way[0], y - t * way[1], z - t * way[2]
            if dx * dx + dy * dy + dz * dz > reach * reach:
                continue
            if found == MOST_CLOSE:
                return
            places[0, found] = i
            for k in range(3):
                coordinates[k, found] = points[i, k]
            found += 1
    known[0] = found


@inlined
def look_ahead(tree, stack, p, v, radius, reach, close):  # type: ignore[no-untyped-def]
    """See that the points within `reach` of p are known, and with them those on the way ahead; or else none."""
    known = close[2]
    if known[11] == 0.0 or is_about(p, radius, close):
        return
    speed = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    while known[11] > 0.0:
        f = known[11] * radius / speed if speed > 0.0 else 0.0
        collect_points(tree, stack, p, (f * v[0], f * v[1], f * v[2]), reach + ASIDE * radius, close)
        if known[0] >= 0.0:
            break
        known[11] = 0.5 * known[11] if known[11] > LEAST_WAY else 0.0


@inlined
def is_about(p, radius, close):  # type: ignore[no-untyped-def]
    """Whether all points that a block at p may touch are known."""
    known = close[2]
    if known[0] < 0.0:
        return False
    x, y, z = p[0] - known[1], p[1] - known[2], p[2] - known[3]
    length = known[4] * known[4] + known[5] * known[5] + known[6] * known[6]
    t = x * known[4] + y * known[5] + z * known[6]
    t = min(max(t / length, 0.0), 1.0) if length > 0.0 else 0.0
    x, y, z = x - t * known[4], y - t * known[5], z - t * known[6]
    return x * x + y * y + z * z <= (ASIDE * radius) ** 2


@inlined
def knows(close, p, far):  # type: ignore[no-untyped-def]
    """Whether p is no further than that from where points were met last."""
    known = close[2]
    x, y, z = p[0] - known[8], p[1] - known[9], p[2] - known[10]
    return known[0] >= 0.0 and x * x + y * y + z * z <= far * far


@kernel
def forget(close):  # type: ignore[no-untyped-def]
    """Nothing is known of another block's points."""
    known = close[2]
    known[0], known[11] = -1.0, WAY
    known[8] = known[9] = known[10] = inf


@inlined
def meet(p, reach, close):  # type: ignore[no-untyped-def]
    """Which of the points are within `reach` of a place: their numbers in the list, noted in `close`."""
    places, coordinates, known = close
    square, met = reach * reach, 0
    for i in range(int(known[0])):
        x, y, z = p[0] - coordinates[0, i], p[1] - coordinates[1, i], p[2] - coordinates[2, i]
        places[1, met] = i
        met += x * x + y * y + z * z < square
    known[7] = met
    known[8], known[9], known[10] = p[0], p[1], p[2]
    return met

# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiled kernels over triangles: the spatial index, rays, closest points, neighbours across edges.

A tree is the plain tuple ``(bounds, first, count, corners)`` of `index.TriangleIndex.tree`: ``bounds`` (k, 6) low and
high corner of a node's box; a leaf holds the triangles ``first[i] : first[i] + count[i]``, an inner node has
``count`` 0 and its children are ``first[i]`` and ``first[i] + 1``; ``corners`` (m, 3, 3) are the triangles in the order
of the leaves. A traversal works on a ``stack`` of `STACK_SIZE` that its caller allocates once. Everything is float64.
"""

import numpy as np

from ..compiled import borrowing, kernel

LEAF_TRIANGLES = 4
BINS = 16
DEEP = 48
"""Below this depth nodes are halved by count, which bounds the depth of any tree."""
STACK_SIZE = 128
BOX_MARGIN = 1.0 + 4e-15
"""Widens a ray's interval in a box by more than its rounding error, so that no box is missed."""


@kernel
def build_tree(corners, bounds, first, count, order):  # type: ignore[no-untyped-def]
    """Fill the nodes and the order of the triangles, by the surface area heuristic; returns the number of nodes."""
    m = corners.shape[0]
    # The boxes are sorted along with the order: passes over memory in sequence are what makes this quick.
    boxes = np.empty((m, 6))
    for i in range(m):
        order[i] = i
        for a in range(3):
            boxes[i, a] = min(corners[i, 0, a], corners[i, 1, a], corners[i, 2, a])
            boxes[i, a + 3] = max(corners[i, 0, a], corners[i, 1, a], corners[i, 2, a])
    todo = np.zeros((STACK_SIZE, 4), np.int64)
    todo[0, 2] = m
    pending, nodes = 1, 1
    bins, bin_count, cost_right = np.empty((BINS, 6)), np.empty(BINS, np.int64), np.empty(BINS)
    box, centre = np.empty(6), np.empty(6)
    while pending:
        pending -= 1
        node, start, stop, depth = todo[pending, 0], todo[pending, 1], todo[pending, 2], todo[pending, 3]
        box[:3], box[3:], centre[:3], centre[3:] = np.inf, -np.inf, np.inf, -np.inf
        for i in range(start, stop):
            for a in range(3):
                low, high = boxes[i, a], boxes[i, a + 3]
                box[a], box[a + 3] = min(box[a], low), max(box[a + 3], high)
                centre[a], centre[a + 3] = min(centre[a], low + high), max(centre[a + 3], low + high)
        bounds[node] = box
        if stop - start <= LEAF_TRIANGLES:
            first[node], count[node] = start, stop - start
            continue
        axis = 0
        for a in range(1, 3):
            if centre[a + 3] - centre[a] > centre[axis + 3] - centre[axis]:
                axis = a
        base, extent = centre[axis], centre[axis + 3] - centre[axis]
        middle = (start + stop) // 2
        if extent > 1e-280 and depth < DEEP:
            scale = BINS * (1.0 - 1e-9) / extent
            bins[:, :3], bins[:, 3:], bin_count[:] = np.inf, -np.inf, 0
            for i in range(start, stop):
                b = int((boxes[i, axis] + boxes[i, axis + 3] - base) * scale)
                bin_count[b] += 1
                for a in range(3):
                    bins[b, a] = min(bins[b, a], boxes[i, a])
                    bins[b, a + 3] = max(bins[b, a + 3], boxes[i, a + 3])
            best, best_cost = -1, np.inf
            for side in range(2):
                box[:3], box[3:] = np.inf, -np.inf
                total = 0
                for k in range(BINS - 1):
                    b = BINS - 1 - k if side == 0 else k
                    total += bin_count[b]
                    for a in range(3):
                        box[a], box[a + 3] = min(box[a], bins[b, a]), max(box[a + 3], bins[b, a + 3])
                    cost = np.inf
                    if total:
                        x, y, z = box[3] - box[0], box[4] - box[1], box[5] - box[2]
                        cost = (x * y + y * z + z * x) * total
                    if side == 0:
                        cost_right[b] = cost
                    elif cost + cost_right[b + 1] < best_cost:
                        best, best_cost = b, cost + cost_right[b + 1]
            left, right = start, stop - 1
            while best >= 0 and left <= right:
                if int((boxes[left, axis] + boxes[left, axis + 3] - base) * scale) <= best:
                    left += 1
                else:
                    order[left], order[right] = order[right], order[left]
                    for a in range(6):
                        boxes[left, a], boxes[right, a] = boxes[right, a], boxes[left, a]
                    right -= 1
            if start < left < stop:
                middle = left
        first[node], count[node] = nodes, 0
        for side in range(2):
            todo[pending, 0], todo[pending, 3] = nodes + side, depth + 1
            todo[pending, 1] = start if side == 0 else middle
            todo[pending, 2] = middle if side == 0 else stop
            pending += 1
        nodes += 2
    return nodes


@kernel
def enter_box(bounds, node, ox, oy, oz, ix, iy, iz, limit):  # type: ignore[no-untyped-def]
    """Distance at which a ray enters a node's box, inf when it misses it or enters beyond ``limit``."""
    a, b = (bounds[node, 0] - ox) * ix, (bounds[node, 3] - ox) * ix
    near, far = min(a, b), max(a, b)
    a, b = (bounds[node, 1] - oy) * iy, (bounds[node, 4] - oy) * iy
    near, far = max(near, min(a, b)), min(far, max(a, b))
    a, b = (bounds[node, 2] - oz) * iz, (bounds[node, 5] - oz) * iz
    near, far = max(near, min(a, b), 0.0), min(far, max(a, b)) * BOX_MARGIN
    return near if near <= far and near <= limit * BOX_MARGIN else np.inf


@kernel
def inverse(component):  # type: ignore[no-untyped-def]
    """1 / component, finite for a zero, so that no box test meets 0 times infinity."""
    return 1.0 / component if abs(component) > 1e-290 else 1e290


@kernel
def along_ray(corners, i, origin, kx, ky, kz, sx, sy, sz):  # type: ignore[no-untyped-def]
    """Where along a ray triangle ``i`` is hit [m], NaN when it is not: axes and shear as `nearest_hit` says."""
    az = corners[i, 0, kz] - origin[kz]
    bz = corners[i, 1, kz] - origin[kz]
    cz = corners[i, 2, kz] - origin[kz]
    ax, ay = corners[i, 0, kx] - origin[kx] - sx * az, corners[i, 0, ky] - origin[ky] - sy * az
    bx, by = corners[i, 1, kx] - origin[kx] - sx * bz, corners[i, 1, ky] - origin[ky] - sy * bz
    cx, cy = corners[i, 2, kx] - origin[kx] - sx * cz, corners[i, 2, ky] - origin[ky] - sy * cz
    u, v, w = cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax
    if (u < 0.0 or v < 0.0 or w < 0.0) and (u > 0.0 or v > 0.0 or w > 0.0):
        return np.nan
    det = u + v + w
    if det == 0.0:
        return np.nan
    return sz * (u * az + v * bz + w * cz) / det


@borrowing
def push_children(stack, top, left, near_left, near_right):  # type: ignore[no-untyped-def]
    """Put what a ray meets of two nodes, `left` and the next, onto a stack, the nearer on top; returns its height."""
    if near_left <= near_right:  # branches, which the processor foresees: choices by number take half as long again
        if near_right < np.inf:
            stack[top] = left + 1
            top += 1
        if near_left < np.inf:
            stack[top] = left
            top += 1
    else:
        if near_left < np.inf:
            stack[top] = left
            top += 1
        stack[top] = left + 1
        top += 1
    return top


@borrowing
def nearest_hit(tree, stack, origin, direction, limit):  # type: ignore[no-untyped-def]
    """First triangle along a ray: (distance, place in the leaves' order), (inf, -1) when there is none up to ``limit``.

    Watertight intersection of Woop, Benthin & Wald 2013 (JCGT 2(1)), two-sided: neighbouring triangles evaluate
    their common edge with the same numbers, so that no ray slips between them. ``direction`` has length 1.
    """
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
    best, found = limit, -1
    top = 0
    if enter_box(bounds, 0, ox, oy, oz, ix, iy, iz, best) < np.inf:
        stack[0] = 0
        top = 1
    while top:
        top -= 1
        node = stack[top]
        if count[node]:
            for i in range(first[node], first[node] + count[node]):
                t = along_ray(corners, i, origin, kx, ky, kz, sx, sy, sz)
                if t >= 0.0 and (t < best or (t == best and found < 0)):
                    best, found = t, i
            continue
        left = first[node]
        near_left = enter_box(bounds, left, ox, oy, oz, ix, iy, iz, best)
        near_right = enter_box(bounds, left + 1, ox, oy, oz, ix, iy, iz, best)
        top = push_children(stack, top, left, near_left, near_right)
    return (best, found) if found >= 0 else (np.inf, -1)


@kernel
def box_distance2(bounds, node, x, y, z):  # type: ignore[no-untyped-def]
    """Squared distance from a point to a node's box, 0 inside."""
    dx = max(bounds[node, 0] - x, 0.0, x - bounds[node, 3])
    dy = max(bounds[node, 1] - y, 0.0, y - bounds[node, 4])
    dz = max(bounds[node, 2] - z, 0.0, z - bounds[node, 5])
    return dx * dx + dy * dy + dz * dz


@kernel
def closest_on_triangle(corners, i, x, y, z):  # type: ignore[no-untyped-def]
    """The point of triangle ``i`` that is closest to (x, y, z): Ericson 2005, Real-Time Collision Detection, 5.1.5."""
    ax, ay, az = corners[i, 0, 0], corners[i, 0, 1], corners[i, 0, 2]
    bx, by, bz = corners[i, 1, 0] - ax, corners[i, 1, 1] - ay, corners[i, 1, 2] - az
    cx, cy, cz = corners[i, 2, 0] - ax, corners[i, 2, 1] - ay, corners[i, 2, 2] - az
    px, py, pz = x - ax, y - ay, z - az
    d1, d2 = bx * px + by * py + bz * pz, cx * px + cy * py + cz * pz
    bb, bc, cc = bx * bx + by * by + bz * bz, bx * cx + by * cy + bz * cz, cx * cx + cy * cy + cz * cz
    d3, d4, d5, d6 = d1 - bb, d2 - bc, d1 - bc, d2 - cc
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    v, w = 0.0, 0.0
    if d1 <= 0.0 and d2 <= 0.0:
        pass
    elif d3 >= 0.0 and d4 <= d3:
        v = 1.0
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        v = d1 / (d1 - d3)
    elif d6 >= 0.0 and d5 <= d6:
        w = 1.0
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        w = d2 / (d2 - d6)
    elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        v = 1.0 - w
    else:
        v, w = vb / (va + vb + vc), vc / (va + vb + vc)
    return ax + v * bx + w * cx, ay + v * by + w * cy, az + v * bz + w * cz


@kernel
def nearest_point(tree, stack, point, limit):  # type: ignore[no-untyped-def]
    """Closest point on the triangles within ``limit``: (x, y, z, squared distance, place), place -1 when none."""
    bounds, first, count, corners = tree
    x, y, z = point[0], point[1], point[2]
    best, found = limit * limit, -1
    qx, qy, qz = np.nan, np.nan, np.nan
    stack[0] = 0
    top = 1
    while top:
        top -= 1
        node = stack[top]
        if box_distance2(bounds, node, x, y, z) > best:
            continue
        if count[node]:
            for i in range(first[node], first[node] + count[node]):
                tx, ty, tz = closest_on_triangle(corners, i, x, y, z)
                distance2 = (tx - x) ** 2 + (ty - y) ** 2 + (tz - z) ** 2
                if distance2 < best or (distance2 == best and found < 0):
                    best, found = distance2, i
                    qx, qy, qz = tx, ty, tz
            continue
        left = first[node]
        nearer = left
        if box_distance2(bounds, left + 1, x, y, z) < box_distance2(bounds, left, x, y, z):
            nearer = left + 1
        stack[top], stack[top + 1] = 2 * left + 1 - nearer, nearer
        top += 2
    return qx, qy, qz, best, found


@kernel
def cast_many(tree, origins, directions, limit, distance, place, start, stop):  # type: ignore[no-untyped-def]
    stack = np.empty(STACK_SIZE, np.int64)
    for i in range(start, stop):
        distance[i], place[i] = nearest_hit(tree, stack, origins[i], directions[i], limit)


@kernel
def closest_many(tree, points, limit, closest, distance, place, start, stop):  # type: ignore[no-untyped-def]
    stack = np.empty(STACK_SIZE, np.int64)
    for i in range(start, stop):
        x, y, z, distance2, found = nearest_point(tree, stack, points[i], limit)
        closest[i, 0], closest[i, 1], closest[i, 2] = x, y, z
        distance[i] = np.sqrt(distance2) if found >= 0 else np.inf
        place[i] = found


@kernel
def edge_neighbours(faces, vertex_count):  # type: ignore[no-untyped-def]
    """The face across each edge (m, 3), from corner e to e + 1; -1 at borders, -2 where three or more faces meet."""
    m = faces.shape[0]
    neighbours = np.full((m, 3), -1, np.int32)
    # Edges in buckets of their lower end, a counting sort: linear, and a bucket holds only a handful.
    start = np.zeros(vertex_count + 2, np.int32)
    for f in range(m):
        for e in range(3):
            start[min(faces[f, e], faces[f, (e + 1) % 3]) + 2] += 1
    for v in range(vertex_count):
        start[v + 2] += start[v + 1]
    edges, other = np.empty(3 * m, np.int32), np.empty(3 * m, np.int32)
    for f in range(m):
        for e in range(3):
            a, b = faces[f, e], faces[f, (e + 1) % 3]
            place = start[min(a, b) + 1]
            start[min(a, b) + 1] += 1
            edges[place], other[place] = 3 * f + e, max(a, b)
    for v in range(vertex_count):
        low, high = start[v], start[v + 1]
        if high - low > 64:
            # The hub of a fan has a bucket as large as the mesh: sorting keeps it from quadratic time.
            by_end = np.argsort(other[low:high])
            edges[low:high], other[low:high] = edges[low:high][by_end], other[low:high][by_end]
        for j in range(low, high):
            if edges[j] < 0:
                continue
            partner, met = -1, 1
            for k in range(j + 1, high):
                if other[k] == other[j]:
                    partner, met = k, met + 1
                elif high - low > 64:
                    break
            if met == 2:
                f, g = edges[j], edges[partner]
                neighbours[f // 3, f % 3], neighbours[g // 3, g % 3] = g // 3, f // 3
                edges[partner] = -1
            elif met > 2:
                for k in range(j, high):
                    if other[k] == other[j]:
                        neighbours[edges[k] // 3, edges[k] % 3] = -2
                        if k > j:
                            edges[k] = -1
                    elif high - low > 64:
                        break
    return neighbours


@kernel
def flood_winding(faces, neighbours, component, flipped):  # type: ignore[no-untyped-def]
    """Label connected faces and say which must be turned to agree with the first of their component.

    Returns the number of components and of edges at which no winding agrees (a Möbius strip has some).
    """
    m = faces.shape[0]
    component[:] = -1
    stack = np.empty(m, np.int32)
    components, contradictions = 0, 0
    for seed in range(m):
        if component[seed] >= 0:
            continue
        component[seed], flipped[seed] = components, False
        stack[0] = seed
        top = 1
        while top:
            top -= 1
            f = stack[top]
            for e in range(3):
                g = neighbours[f, e]
                if g < 0:
                    continue
                a, b = faces[f, e], faces[f, (e + 1) % 3]
                same = False
                for h in range(3):
                    same = same or (faces[g, h] == a and faces[g, (h + 1) % 3] == b)
                turned = flipped[f] != same
                if component[g] < 0:
                    component[g], flipped[g] = components, turned
                    stack[top] = g
                    top += 1
                elif flipped[g] != turned:
                    contradictions += 1
        components += 1
    return components, contradictions // 2

# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiled kernels over points: their spatial index, the nearest point, how dense they are, heights above them.

A tree is the plain tuple ``(nodes, first, count, points, spacing)`` of `cloud.PointIndex.tree`: ``first`` and ``count``
as in `kernels`, and ``points`` (k, 3) in the order of the leaves. It has one member more than a tree of triangles, so
that compiled code can tell them apart by their type.

A row of ``nodes`` (n, 16) has the low and high corner of a box; the two planes that its points are between, across the
direction in which they spread least: their normal, no longer than one, and the lowest and highest product of it with a
point; how far the points are from the middle of the box, along those planes and in all. These are in single precision,
rounded outwards. ``first`` and ``count`` are the last columns, so that a node is one line of the processor's cache.
"""

from functools import partial
from math import acos, cos, pi, sqrt

import numpy as np

from ..compiled import borrowing, kernel
from .kernels import STACK_SIZE, box_distance2

inlined = partial(borrowing, inline=True)

LEAF_POINTS = 16
SPREAD_POINTS = 32
"""So many points of a node, or up to twice as many, tell in which direction they spread least."""
COINCIDENT = 1e-6
"""Points within so little of where others are expected are one point that is stored several times."""
SHORTER = 1.0 - 1e-6
FARTHER = 3.0
LEAST_PLANE = 8
STEEP = 4.0
"""A column of points belongs to one surface as far as this slope."""


@kernel
def build_point_tree(points, nodes, links, order):  # type: ignore[no-untyped-def]
    """Sort points into the nodes of a tree, halved by count along their longest side; returns the number of nodes."""
    for i in range(points.shape[0]):
        order[i] = i
    todo = np.zeros((STACK_SIZE, 3), np.int64)
    todo[0, 2] = points.shape[0]
    pending, used = 1, 1
    while pending:
        pending -= 1
        node, start, stop = todo[pending, 0], todo[pending, 1], todo[pending, 2]
        axis, longest = 0, -1.0
        for a in range(3):
            low, high = np.inf, -np.inf
            for i in range(start, stop):
                low, high = min(low, points[i, a]), max(high, points[i, a])
            nodes[node, a], nodes[node, a + 3] = below(low), -below(-high)
            if high - low > longest:
                axis, longest = a, high - low
        _enclose(points, start, stop, nodes, node)
        if stop - start <= LEAF_POINTS:
            links[node, 0], links[node, 1] = start, stop - start
            continue
        middle = (start + stop) // 2
        _divide(points, order, start, stop - 1, middle, axis)
        links[node, 0], links[node, 1] = used, 0
        todo[pending, 0], todo[pending, 1], todo[pending, 2] = used, start, middle
        todo[pending + 1, 0], todo[pending + 1, 1], todo[pending + 1, 2] = used + 1, middle, stop
        pending += 2
        used += 2
    return used


@borrowing
def below(value):  # type: ignore[no-untyped-def]
    """A number in single precision that is less."""
    return np.nextafter(np.float32(value), np.float32(-np.inf))


@borrowing
def _enclose(points, start, stop, nodes, node):  # type: ignore[no-untyped-def]
    """Fill the planes and the distances of a node. Any normal would do; that of some of its points is as good."""
    step = max(1, (stop - start) // SPREAD_POINTS)
    n, x, y, z = 0.0, 0.0, 0.0, 0.0
    for i in range(start, stop, step):
        n, x, y, z = n + 1.0, x + points[i, 0], y + points[i, 1], z + points[i, 2]
    x, y, z = x / n, y / n, z / n
    xx, yy, zz, xy, yz, zx = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(start, stop, step):
        u, v, w = points[i, 0] - x, points[i, 1] - y, points[i, 2] - z
        xx, yy, zz = xx + u * u, yy + v * v, zz + w * w
        xy, yz, zx = xy + u * v, yz + v * w, zx + w * u
    u, v, w = least_direction(xx, yy, zz, xy, yz, zx)
    nodes[node, 6], nodes[node, 7], nodes[node, 8] = SHORTER * u, SHORTER * v, SHORTER * w
    u, v, w = nodes[node, 6], nodes[node, 7], nodes[node, 8]
    low, high = np.inf, -np.inf
    for i in range(start, stop):
        height = u * points[i, 0] + v * points[i, 1] + w * points[i, 2]
        low, high = min(low, height), max(high, height)
    nodes[node, 9], nodes[node, 10] = below(low), -below(-high)
    size = sqrt(u * u + v * v + w * w)
    u, v, w = u / size, v / size, w / size
    x, y, z = middle(nodes, node)
    wide, far = 0.0, 0.0
    for i in range(start, stop):
        dx, dy, dz = points[i, 0] - x, points[i, 1] - y, points[i, 2] - z
        far = max(far, dx * dx + dy * dy + dz * dz)
        height = u * dx + v * dy + w * dz
        dx, dy, dz = dx - height * u, dy - height * v, dz - height * w
        wide = max(wide, dx * dx + dy * dy + dz * dz)
    nodes[node, 11], nodes[node, 12] = -below(-sqrt(wide)), -below(-sqrt(far))


@inlined
def middle(nodes, node):  # type: ignore[no-untyped-def]
    """Of a node's box."""
    return (
        0.5 * (nodes[node, 0] + nodes[node, 3]),
        0.5 * (nodes[node, 1] + nodes[node, 4]),
        0.5 * (nodes[node, 2] + nodes[node, 5]),
    )


@borrowing
def least_direction(xx, yy, zz, xy, yz, zx):  # type: ignore[no-untyped-def]
    """The unit direction in which points of these second moments spread least; upwards where it is not one.

    The least root of the characteristic polynomial (Smith 1961, Eigenvalues of a symmetric 3 × 3 matrix) and the
    longest cross product of two rows of the moments less that root.
    """
    mean = (xx + yy + zz) / 3.0
    xx, yy, zz = xx - mean, yy - mean, zz - mean
    size = sqrt((xx * xx + yy * yy + zz * zz + 2.0 * (xy * xy + yz * yz + zx * zx)) / 6.0)
    if size == 0.0:
        return 0.0, 0.0, 1.0
    det = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * zx) + zx * (xy * yz - yy * zx)
    half = min(max(0.5 * det / (size * size * size), -1.0), 1.0)
    root = 2.0 * size * cos((acos(half) + 2.0 * pi) / 3.0)
    xx, yy, zz = xx - root, yy - root, zz - root
    ax, ay, az = xy * yz - zx * yy, zx * xy - xx * yz, xx * yy - xy * xy
    bx, by, bz = xy * zz - zx * yz, zx * zx - xx * zz, xx * yz - xy * zx
    cx, cy, cz = yy * zz - yz * yz, yz * zx - xy * zz, xy * yz - yy * zx
    a, b, c = ax * ax + ay * ay + az * az, bx * bx + by * by + bz * bz, cx * cx + cy * cy + cz * cz
    if b > a:
        a, ax, ay, az = b, bx, by, bz
    if c > a:
        a, ax, ay, az = c, cx, cy, cz
    if a == 0.0:
        return 0.0, 0.0, 1.0
    a = sqrt(a)
    return ax / a, ay / a, az / a


@borrowing
def _divide(points, order, low, high, middle, axis):  # type: ignore[no-untyped-def]
    """Hoare's selection: what is before `middle` is not above it along the axis, what follows not below."""
    while low < high:
        pivot = points[(low + high) // 2, axis]
        i, j = low, high
        while i <= j:
            while points[i, axis] < pivot:
                i += 1
            while points[j, axis] > pivot:
                j -= 1
            if i <= j:
                for a in range(3):
                    points[i, a], points[j, a] = points[j, a], points[i, a]
                order[i], order[j] = order[j], order[i]
                i += 1
                j -= 1
        if middle <= j:
            high = j
        elif middle >= i:
            low = i
        else:
            return


@borrowing
def nearest(tree, stack, p, limit):  # type: ignore[no-untyped-def]
    """The nearest point nearer than ``limit``: (squared distance, place), place −1 when none."""
    bounds, first, count, points, _ = tree
    best, found = limit * limit, -1
    stack[0] = 0
    top = 1
    while top:
        top -= 1
        node = stack[top]
        if box_distance2(bounds, node, p[0], p[1], p[2]) >= best:
            continue
        if count[node]:
            for i in range(first[node], first[node] + count[node]):
                x, y, z = points[i, 0] - p[0], points[i, 1] - p[1], points[i, 2] - p[2]
                square = x * x + y * y + z * z
                if square < best:
                    best, found = square, i
            continue
        left = first[node]
        one = box_distance2(bounds, left, p[0], p[1], p[2])
        other = box_distance2(bounds, left + 1, p[0], p[1], p[2])
        nearer = left if one <= other else left + 1
        if max(one, other) < best:
            stack[top] = 2 * left + 1 - nearer
            top += 1
        if min(one, other) < best:
            stack[top] = nearer
            top += 1
    return best, found


@borrowing
def within(tree, stack, p, reach):  # type: ignore[no-untyped-def]
    """How many points are within `reach` of a place."""
    bounds, first, count, points, _ = tree
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
                x, y, z = points[i, 0] - p[0], points[i, 1] - p[1], points[i, 2] - p[2]
                if x * x + y * y + z * z <= square:
                    found += 1
            continue
        stack[top], stack[top + 1] = first[node], first[node] + 1
        top += 2
    return found


@kernel
def spacings(tree, places, enough, reach, result):  # type: ignore[no-untyped-def]
    """√(area of a disc / points in it) about each place, the disc grown until it holds `enough`."""
    stack = np.empty(STACK_SIZE, np.int64)
    for k in range(places.shape[0]):
        radius = reach
        p = (places[k, 0], places[k, 1], places[k, 2])
        found = within(tree, stack, p, radius)
        while found < enough and found < tree[3].shape[0]:
            radius *= 1.3
            found = within(tree, stack, p, radius)
        while found > 4 * enough and radius > COINCIDENT * reach:
            radius *= 0.7
            found = within(tree, stack, p, radius)
        result[k] = radius * np.sqrt(np.pi / found)


@borrowing
def _plan_distance2(bounds, node, x, y):  # type: ignore[no-untyped-def]
    dx = max(bounds[node, 0] - x, 0.0, x - bounds[node, 3])
    dy = max(bounds[node, 1] - y, 0.0, y - bounds[node, 4])
    return dx * dx + dy * dy


@borrowing
def next_height(tree, stack, p, reach, side):  # type: ignore[no-untyped-def]
    """Height of the next point below (`side` −1) or above (1) a place, within `reach` in plan; NaN when none."""
    bounds, first, count, points, _ = tree
    best = np.inf
    stack[0] = 0
    top = 1
    while top:
        top -= 1
        node = stack[top]
        low = side * ((bounds[node, 5] if side < 0.0 else bounds[node, 2]) - p[2])
        high = side * ((bounds[node, 2] if side < 0.0 else bounds[node, 5]) - p[2])
        if low >= best or high < 0.0 or _plan_distance2(bounds, node, p[0], p[1]) > reach * reach:
            continue
        if count[node]:
            for i in range(first[node], first[node] + count[node]):
                away = side * (points[i, 2] - p[2])
                if 0.0 <= away < best:
                    x, y = points[i, 0] - p[0], points[i, 1] - p[1]
                    if x * x + y * y <= reach * reach:
                        best = away
            continue
        stack[top], stack[top + 1] = first[node], first[node] + 1
        top += 2
    return p[2] + side * best if best < np.inf else np.nan


@borrowing
def plane_height(tree, stack, p, reach, low, high):  # type: ignore[no-untyped-def]
    """At a place, the height of the plane fitted to the points within `reach` in plan, between two heights.

    The fit is held level by a part of the reach, so that it is the mean height where points are few or in a line.
    """
    bounds, first, count, points, _ = tree
    n, x, y, z, xx, xy, yy, xz, yz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    stack[0] = 0
    top = 1
    while top:
        top -= 1
        node = stack[top]
        if bounds[node, 5] < low or bounds[node, 2] > high:
            continue
        if _plan_distance2(bounds, node, p[0], p[1]) > reach * reach:
            continue
        if count[node]:
            for i in range(first[node], first[node] + count[node]):
                u, v, w = points[i, 0] - p[0], points[i, 1] - p[1], points[i, 2] - p[2]
                if u * u + v * v <= reach * reach and low <= points[i, 2] <= high:
                    n += 1.0
                    x, y, z = x + u, y + v, z + w
                    xx, xy, yy = xx + u * u, xy + u * v, yy + v * v
                    xz, yz = xz + u * w, yz + v * w
            continue
        stack[top], stack[top + 1] = first[node], first[node] + 1
        top += 2
    x, y, z = x / n, y / n, z / n
    held = (0.05 * reach) ** 2
    xx, xy, yy = xx / n - x * x + held, xy / n - x * y, yy / n - y * y + held
    xz, yz = xz / n - x * z, yz / n - y * z
    det = xx * yy - xy * xy
    slope_x, slope_y = (xz * yy - yz * xy) / det, (yz * xx - xz * xy) / det
    return p[2] + z - slope_x * x - slope_y * y


@kernel
def heights_many(tree, places, reach, result, start, stop):  # type: ignore[no-untyped-def]
    """Clearance of places over the points below, negative under points with none below, NaN beside them.

    Points are looked for within `reach` in plan, and where there are none within `FARTHER` times that.
    """
    stack = np.empty(STACK_SIZE, np.int64)
    for k in range(start, stop):
        p = (places[k, 0], places[k, 1], places[k, 2])
        result[k] = np.nan
        for far in (reach, FARTHER * reach):
            below = next_height(tree, stack, p, far, -1.0)
            if not np.isnan(below):
                result[k] = p[2] - plane_height(tree, stack, p, far, below - STEEP * far, p[2] + far)
                break
            above = next_height(tree, stack, p, far, 1.0)
            if not np.isnan(above):
                result[k] = p[2] - plane_height(tree, stack, p, far, p[2], above + STEEP * far)
                break


@kernel
def nearest_many(tree, places, distance, place, start, stop):  # type: ignore[no-untyped-def]
    stack = np.empty(STACK_SIZE, np.int64)
    for k in range(start, stop):
        square, place[k] = nearest(tree, stack, (places[k, 0], places[k, 1], places[k, 2]), np.inf)
        distance[k] = np.sqrt(square)


@borrowing
def moments(tree, stack, p, reach):  # type: ignore[no-untyped-def]
    """Of the points within `reach` of a place, as differences to it: how many; sums; sums of products."""
    nodes, first, count, points, _ = tree
    n, x, y, z, square = 0, 0.0, 0.0, 0.0, reach * reach
    xx, yy, zz, xy, yz, zx = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    stack[0] = 0
    top = 1
    while top:
        top -= 1
        node = stack[top]
        if box_distance2(nodes, node, p[0], p[1], p[2]) > square:
            continue
        if count[node] == 0:
            stack[top], stack[top + 1] = first[node], first[node] + 1
            top += 2
            continue
        for i in range(first[node], first[node] + count[node]):
            u, v, w = points[i, 0] - p[0], points[i, 1] - p[1], points[i, 2] - p[2]
            if u * u + v * v + w * w <= square:
                n, x, y, z = n + 1, x + u, y + v, z + w
                xx, yy, zz = xx + u * u, yy + v * v, zz + w * w
                xy, yz, zx = xy + u * v, yz + v * w, zx + w * u
    return n, x, y, z, xx, yy, zz, xy, yz, zx


@kernel
def planes_many(tree, places, reach, normals, areas, start, stop):  # type: ignore[no-untyped-def]
    """Fill the upward normals (n, 3) of the planes of the points about places, and the area (n,) of each such point.

    They are those within `reach`, or up to `FARTHER` times that where they would be fewer than `LEAST_PLANE`; NaN where
    they still are.
    """
    stack = np.empty(STACK_SIZE, np.int64)
    for k in range(start, stop):
        p, far = (places[k, 0], places[k, 1], places[k, 2]), reach
        n, x, y, z, xx, yy, zz, xy, yz, zx = moments(tree, stack, p, far)
        while n < LEAST_PLANE and far < FARTHER * reach:
            far *= 1.5
            n, x, y, z, xx, yy, zz, xy, yz, zx = moments(tree, stack, p, far)
        normals[k, 0] = normals[k, 1] = normals[k, 2] = areas[k] = np.nan
        if n < LEAST_PLANE:
            continue
        x, y, z = x / n, y / n, z / n
        u, v, w = least_direction(
            xx / n - x * x, yy / n - y * y, zz / n - z * z, xy / n - x * y, yz / n - y * z, zx / n - z * x
        )
        up = 1.0 if w >= 0.0 else -1.0
        normals[k, 0], normals[k, 1], normals[k, 2] = up * u, up * v, up * w
        areas[k] = pi * far * far / n

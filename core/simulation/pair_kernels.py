# SPDX-License-Identifier: GPL-3.0-or-later
"""The tree of triangles as flights look at it: the two children of a node in one row. Compiled kernels.

A row of `pairs` (k, 32) has for each child, from `SECOND` on for the second, the low and high corner of its box, a unit
vector, and the least and greatest height of its triangles along that. The vector is the mean normal of the triangles:
slopes are thin along it, however steep, and a block that flies over them is not near. The numbers are single precision,
rounded outwards, so that a row is 128 bytes, two lines of the processor's cache. `children` is the same memory as whole
numbers: in `CODES` and the next place each child's row; or −1 − 8 f − n of a leaf with n triangles from f on.
"""

from math import inf, sqrt

import numpy as np

from ..compiled import kernel

ROW, SECOND, CODES = 32, 11, 22


@kernel
def below(value):  # type: ignore[no-untyped-def]
    """The greatest single that is not above a double."""
    single = np.float32(value)
    return single if np.float64(single) <= value else np.nextafter(single, np.float32(-inf))


@kernel
def above(value):  # type: ignore[no-untyped-def]
    """The least single that is not below a double."""
    single = np.float32(value)
    return single if np.float64(single) >= value else np.nextafter(single, np.float32(inf))


@kernel
def fill_pairs(bounds, first, count, corners, pairs, children):  # type: ignore[no-untyped-def]
    """Fill the rows from a tree of triangles; a tree that is one leaf has a row without a second child."""
    nodes = first.size
    row = np.empty(nodes, np.int32)
    rows = 0
    for node in range(nodes):
        if count[node] == 0:
            row[node], rows = rows, rows + 1
        else:
            row[node] = -1 - 8 * first[node] - count[node]
    start, stop, normals = np.empty(nodes, np.int32), np.empty(nodes, np.int32), np.zeros((nodes, 3))
    for node in range(nodes - 1, -1, -1):  # children stand behind their parent
        if count[node]:
            start[node], stop[node] = first[node], first[node] + count[node]
            for i in range(start[node], stop[node]):
                _add_normal(corners, i, normals[node])
        else:
            left = first[node]
            start[node] = min(start[left], start[left + 1])
            stop[node] = max(stop[left], stop[left + 1])
            for axis in range(3):
                normals[node, axis] = normals[left, axis] + normals[left + 1, axis]
    if count[0]:
        pairs[0, :] = np.nan  # nothing is in a box without numbers
        _fill_child(bounds, 0, corners, start[0], stop[0], normals[0], pairs[0])
        children[0, CODES], children[0, CODES + 1] = row[0], row[0]
    for node in range(nodes):
        if count[node] == 0:
            for side in range(2):
                child = first[node] + side
                own = pairs[row[node], SECOND * side : SECOND * (side + 1)]
                _fill_child(bounds, child, corners, start[child], stop[child], normals[child], own)
                children[row[node], CODES + side] = row[child]


@kernel
def _add_normal(corners, i, total):  # type: ignore[no-untyped-def]
    """Add the upward area vector of triangle i."""
    a, b, c = corners[i, 0], corners[i, 1], corners[i, 2]
    x = (b[1] - a[1]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[1] - a[1])
    y = (b[2] - a[2]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[2] - a[2])
    z = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    side = 1.0 if z >= 0.0 else -1.0
    total[0] += side * x
    total[1] += side * y
    total[2] += side * z


@kernel
def _fill_child(bounds, node, corners, start, stop, normal, out):  # type: ignore[no-untyped-def]
    for axis in range(3):
        out[axis], out[axis + 3] = below(bounds[node, axis]), above(bounds[node, axis + 3])
    size = sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
    for axis in range(3):
        out[6 + axis] = np.float32(normal[axis] / size) if size > 0.0 else np.float32(0.0)
    x, y, z = np.float64(out[6]), np.float64(out[7]), np.float64(out[8])
    low, high = inf, -inf
    for i in range(start, stop):
        for corner in range(3):
            height = x * corners[i, corner, 0] + y * corners[i, corner, 1] + z * corners[i, corner, 2]
            low, high = min(low, height), max(high, height)
    out[9], out[10] = below(low), above(high)

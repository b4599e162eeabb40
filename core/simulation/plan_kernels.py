# SPDX-License-Identifier: GPL-3.0-or-later
"""The terrain's triangles in plan, for paths that are followed from one to the next: compiled kernels.

A row of `plan` (m, 12), in the order of the index's leaves, has x, y of the three corners, counter-clockwise in plan;
the plane z = gx x + gy y + c as gx, gy, c; and the row across each edge, from corner e to e + 1: −1 where there is none
on the other side in plan (borders, folds, walls). gx is NaN where another triangle may be above or below.
"""

from math import inf, nan

import numpy as np

from ..compiled import borrowing, kernel
from .facet_kernels import NOWHERE
from .pair_kernels import CODES, SECOND

LAYERS = 1e-6
"""Areas that differ by this part of a bin, and overlaps of this part of its side, are none."""


@kernel
def fill_plan(corners, face, neighbours, place, plan):  # type: ignore[no-untyped-def]
    """Fill the rows; see `facet_kernels.link` for the parameters."""
    for i in range(len(corners)):
        a, b, c = corners[i, 0], corners[i, 1], corners[i, 2]
        turn = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        second, third = (1, 2) if turn >= 0.0 else (2, 1)
        for axis in range(2):
            plan[i, axis] = corners[i, 0, axis]
            plan[i, 2 + axis], plan[i, 4 + axis] = corners[i, second, axis], corners[i, third, axis]
        ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        wx, wy, wz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        gx, gy = nan, nan
        if turn != 0.0:
            gx, gy = (uz * wy - wz * uy) / turn, (wz * ux - uz * wx) / turn
        plan[i, 6], plan[i, 7], plan[i, 8] = gx, gy, a[2] - gx * a[0] - gy * a[1]
        for e in range(3):
            there = neighbours[face[i], e]
            to = e if turn >= 0.0 else 2 - e
            plan[i, 9 + to] = -1.0
            if there < 0:
                continue
            j = place[there]
            p, q = corners[i, e], corners[i, (e + 1) % 3]
            own = corners[i, (e + 2) % 3]
            mine = (q[0] - p[0]) * (own[1] - p[1]) - (q[1] - p[1]) * (own[0] - p[0])
            other = 0.0  # the neighbour's corner off the edge is that farthest from the line through it
            for k in range(3):
                r = corners[j, k]
                side = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
                if abs(side) > abs(other):
                    other = side
            if mine * other < 0.0:
                plan[i, 9 + to] = j
            elif mine * other > 0.0:
                plan[i, 6] = nan


@borrowing
def _clipped(line, sign, n, x, y, work, axis):  # type: ignore[no-untyped-def]
    """Cut a polygon (n corners in x, y) at a line of one coordinate; returns how many corners are left."""
    left = 0
    values = x if axis == 0 else y
    for k in range(n):
        j = (k + 1) % n
        here, there = sign * (values[k] - line), sign * (values[j] - line)
        if here <= 0.0:
            work[0, left], work[1, left] = x[k], y[k]
            left += 1
        if (here < 0.0 < there) or (there < 0.0 < here):
            part = here / (here - there)
            work[0, left], work[1, left] = x[k] + part * (x[j] - x[k]), y[k] + part * (y[j] - y[k])
            left += 1
    for k in range(left):
        x[k], y[k] = work[0, k], work[1, k]
    return left


@borrowing
def _apart(plan, i, j, slack):  # type: ignore[no-untyped-def]
    """Whether an edge of triangle i has all of triangle j on its other side, in plan."""
    for e in range(3):
        f = 2 * e + 2 if e < 2 else 0
        ax, ay = plan[i, 2 * e], plan[i, 2 * e + 1]
        ex, ey = plan[i, f] - ax, plan[i, f + 1] - ay
        most = -inf
        for k in range(3):
            most = max(most, ex * (plan[j, 2 * k + 1] - ay) - ey * (plan[j, 2 * k] - ax))
        if most <= slack * (abs(ex) + abs(ey)):
            return True
    return False


@kernel
def mark_layers(plan, size, x0, y0, areas, held):  # type: ignore[no-untyped-def]
    """Make gx NaN of triangles that may be above or below others.

    Parameters
    ----------
    size, x0, y0 : of bins, and their corner; areas, held : (rows, columns) zeros, work space.

    Notes
    -----
    In a bin that is covered without a gap by as much area as it has, nothing is on top of anything. Where there is more
    area, all are marked. Where there is less, at borders, triangles are compared with each other.
    """
    x, y, work, bin_area = np.empty(12), np.empty(12), np.empty((2, 12)), size * size
    listed, slack = np.empty(0, np.int32), LAYERS * size
    for turn in range(4):
        if turn == 2:
            total = 0
            for row in range(areas.shape[0]):
                for column in range(areas.shape[1]):
                    some = held[row, column]
                    held[row, column] = total
                    total += some
            listed = np.empty(total, np.int32)
        for i in range(len(plan)):
            low_x, high_x = min(plan[i, 0], plan[i, 2], plan[i, 4]), max(plan[i, 0], plan[i, 2], plan[i, 4])
            low_y, high_y = min(plan[i, 1], plan[i, 3], plan[i, 5]), max(plan[i, 1], plan[i, 3], plan[i, 5])
            first_x, last_x = np.int64((low_x - x0) / size), np.int64((high_x - x0) / size)
            first_y, last_y = np.int64((low_y - y0) / size), np.int64((high_y - y0) / size)
            for row in range(first_y, last_y + 1):
                for column in range(first_x, last_x + 1):
                    if turn == 0:
                        areas[row, column] += _area_in(
                            plan, i, x0 + column * size, y0 + row * size, size, first_x < last_x, first_y < last_y,
                            x, y, work,
                        )  # fmt: skip
                        continue
                    if areas[row, column] > (1.0 + LAYERS) * bin_area:
                        plan[i, 6] = nan
                    elif areas[row, column] < (1.0 - LAYERS) * bin_area:
                        if turn == 1:
                            held[row, column] += 1
                        elif turn == 2:
                            listed[held[row, column]] = i
                            held[row, column] += 1
                        else:
                            begin = held[row, column - 1] if column else (held[row - 1, -1] if row else 0)
                            for k in range(begin, held[row, column]):
                                j = listed[k]
                                if j != i and not (_apart(plan, i, j, slack) or _apart(plan, j, i, slack)):
                                    plan[i, 6] = nan


@borrowing
def _area_in(plan, i, west, south, size, cut_x, cut_y, x, y, work):  # type: ignore[no-untyped-def]
    """How much of triangle i is in a bin."""
    n = 3
    for k in range(3):
        x[k], y[k] = plan[i, 2 * k], plan[i, 2 * k + 1]
    if cut_x:
        n = _clipped(west, -1.0, n, x, y, work, 0)
        n = _clipped(west + size, 1.0, n, x, y, work, 0)
    if cut_y:
        n = _clipped(south, -1.0, n, x, y, work, 1)
        n = _clipped(south + size, 1.0, n, x, y, work, 1)
    area = 0.0
    for k in range(2, n):
        area += (x[k - 1] - x[0]) * (y[k] - y[0]) - (y[k - 1] - y[0]) * (x[k] - x[0])
    return 0.5 * area


@borrowing
def triangle_below(tree, stack, x, y, z):  # type: ignore[no-untyped-def]
    """The triangle that is vertically below a place, −1 where there is none: see `height_kernels.height_below`."""
    corners, pairs, children = tree[3], tree[4], tree[5]
    best, found, top = inf, NOWHERE, 1
    stack[0] = 0
    while top:
        top -= 1
        code = stack[top]
        if code >= 0:
            for side in range(2):
                at = SECOND * side
                if (
                    pairs[code, at] <= x <= pairs[code, at + 3]
                    and pairs[code, at + 1] <= y <= pairs[code, at + 4]
                    and pairs[code, at + 2] <= z
                    and pairs[code, at + 5] >= z - best
                ):
                    stack[top] = children[code, CODES + side]
                    top += 1
            continue
        first, count = (-1 - code) // 8, (-1 - code) % 8
        for i in range(first, first + count):
            az, bz, cz = corners[i, 0, 2] - z, corners[i, 1, 2] - z, corners[i, 2, 2] - z
            ax, ay = corners[i, 0, 0] - x, corners[i, 0, 1] - y
            bx, by = corners[i, 1, 0] - x, corners[i, 1, 1] - y
            cx, cy = corners[i, 2, 0] - x, corners[i, 2, 1] - y
            u, v, w = cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax
            if (u < 0.0 or v < 0.0 or w < 0.0) and (u > 0.0 or v > 0.0 or w > 0.0):
                continue
            det = u + v + w
            if det == 0.0:
                continue
            down = -(u * az + v * bz + w * cz) / det
            if 0.0 <= down < best:
                best, found = down, i
    return found

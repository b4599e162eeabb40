# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiled kernels over polygons in plan: what is inside, and the parts of triangles within."""

import numpy as np

from ..compiled import kernel

MOST_CORNERS = 8
"""A triangle cut by four half-planes has seven corners at most."""


@kernel
def inside_many(edges, points, result, start, stop):  # type: ignore[no-untyped-def]
    """Whether points (n, 2) are inside of the rings whose edges (e, 4) are given, by the even–odd rule."""
    low, high = edges[:, 0].min(), edges[:, 0].max()
    for i in range(start, stop):
        x, y = points[i, 0], points[i, 1]
        inside = False
        if low <= x <= high:
            for e in range(edges.shape[0]):
                y0, y1 = edges[e, 1], edges[e, 3]
                if (y0 > y) != (y1 > y) and x < edges[e, 0] + (edges[e, 2] - edges[e, 0]) * (y - y0) / (y1 - y0):
                    inside = not inside
        result[i] = inside


@kernel
def _side(a, b, c):  # type: ignore[no-untyped-def]
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


@kernel
def first_crossing(edges):  # type: ignore[no-untyped-def]
    """Two edges (e, 4) that cross each other between their ends, (−1, −1) when none do."""
    for i in range(edges.shape[0]):
        a, b = edges[i, :2], edges[i, 2:]
        for j in range(i):
            c, d = edges[j, :2], edges[j, 2:]
            if max(c[0], d[0]) < min(a[0], b[0]) or max(a[0], b[0]) < min(c[0], d[0]):
                continue
            if _side(a, b, c) * _side(a, b, d) < 0.0 and _side(c, d, a) * _side(c, d, b) < 0.0:
                return j, i
    return -1, -1


@kernel
def _height_over(piece, which, x, y):  # type: ignore[no-untyped-def]
    """How far a point is within one of the four sides of a trapezoid: above or at zero for the lower and the left one,
    above zero for the others."""
    if which == 0:
        return y - piece[0]
    if which == 1:
        return piece[1] - y
    part = (y - piece[0]) / (piece[1] - piece[0])
    if which == 2:
        return x - (piece[2] + (piece[3] - piece[2]) * part)
    return piece[4] + (piece[5] - piece[4]) * part - x


@kernel
def _cut(piece, which, corners, count, kept):  # type: ignore[no-untyped-def]
    """Sutherland and Hodgman's step: the corners of what is within one side; how many."""
    found = 0
    closed = which == 0 or which == 2
    for k in range(count):
        a, b = corners[k], corners[(k + 1) % count]
        f, g = _height_over(piece, which, a[0], a[1]), _height_over(piece, which, b[0], b[1])
        if f > 0.0 or (closed and f == 0.0):
            kept[found] = a
            found += 1
        crosses = (f > 0.0 and g < 0.0) or (f < 0.0 and g > 0.0) if closed else (f > 0.0) != (g > 0.0)
        if crosses:
            part = f / (f - g)
            for axis in range(3):
                kept[found, axis] = a[axis] + part * (b[axis] - a[axis])
            found += 1
    return found


@kernel
def clip(corners, pieces, order):  # type: ignore[no-untyped-def]
    """The parts of triangles (m, 3, 3) over trapezoids in plan, as triangles.

    Parameters
    ----------
    pieces : (t, 6) y from, y to, x of the left side at both, x of the right side at both; by their first column.
    order : (t,) the greatest second column of this and all before.

    Returns
    -------
    parts : (p, 3, 3). source : (p,) the triangle that each is of.
    """
    parts, source, total = np.empty((1024, 3, 3)), np.empty(1024, np.int64), 0
    work, other = np.empty((MOST_CORNERS + 2, 3)), np.empty((MOST_CORNERS + 2, 3))
    for i in range(corners.shape[0]):
        low_x, high_x = corners[i, :, 0].min(), corners[i, :, 0].max()
        low_y, high_y = corners[i, :, 1].min(), corners[i, :, 1].max()
        for t in range(np.searchsorted(order, low_y), pieces.shape[0]):
            piece = pieces[t]
            if piece[0] > high_y:
                break
            if piece[1] < low_y or max(piece[4], piece[5]) < low_x or min(piece[2], piece[3]) > high_x:
                continue
            work[:3] = corners[i]
            count = 3
            for which in range(4):
                count = _cut(piece, which, work, count, other)
                work, other = other, work
                if count < 3:
                    break
            for k in range(1, count - 1):
                if total == source.size:
                    more, of = np.empty((2 * total, 3, 3)), np.empty(2 * total, np.int64)
                    more[:total], of[:total] = parts, source
                    parts, source = more, of
                parts[total, 0], parts[total, 1], parts[total, 2] = work[0], work[k], work[k + 1]
                source[total] = i
                total += 1
    return parts[:total].copy(), source[:total].copy()

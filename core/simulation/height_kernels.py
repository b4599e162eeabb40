# SPDX-License-Identifier: GPL-3.0-or-later
"""How high flights come above a terrain of triangles: compiled kernels."""

from math import inf

import numpy as np

from ..compiled import borrowing, kernel
from ..terrain.kernels import STACK_SIZE
from .pair_kernels import CODES, SECOND

LEVEL = 0.05
"""A mean normal that points up less than this gives no bound on heights."""
COVERED = 32
"""Where another surface is between a flight and a triangle, that part of the flight is looked at so often."""


@borrowing
def height_below(tree, stack, x, y, z, limit):  # type: ignore[no-untyped-def]
    """How far the next triangle is vertically below a place, inf where there is none within `limit`.

    A ray downwards (`terrain.kernels.nearest_hit`), which needs no more of a box than whether the place is over it.
    """
    corners, pairs, children = tree[3], tree[4], tree[5]
    best, found, top = limit, False, 1
    stack[0] = 0
    while top:
        top -= 1
        code = stack[top]
        if code >= 0:
            nearer, pushed = -inf, -1
            for side in range(2):
                at = SECOND * side
                if not (
                    pairs[code, at] <= x <= pairs[code, at + 3]
                    and pairs[code, at + 1] <= y <= pairs[code, at + 4]
                    and pairs[code, at + 2] <= z
                    and pairs[code, at + 5] >= z - best
                ):
                    continue
                stack[top] = children[code, CODES + side]
                if pushed >= 0 and pairs[code, at + 5] < nearer:  # the higher one first
                    stack[top], stack[pushed] = stack[pushed], stack[top]
                nearer, pushed = pairs[code, at + 5], top
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
            if 0.0 <= down <= best:
                best, found = down, True
    return best if found else inf


@borrowing
def _most(c, b, a, start, stop):  # type: ignore[no-untyped-def]
    """When c + b t − ½ a t² is greatest from start to stop, and how much that is."""
    t = min(max(b / a, start), stop)
    return t, c + (b - 0.5 * a * t) * t


@borrowing
def _bound(pairs, code, side, x, y, z, vx, vy, vz, gravity, duration):  # type: ignore[no-untyped-def]
    """No point of a flight is higher above the triangles of a child than this."""
    at = SECOND * side
    start, stop = 0.0, duration
    for low, high, p, v in (
        (pairs[code, at], pairs[code, at + 3], x, vx),
        (pairs[code, at + 1], pairs[code, at + 4], y, vy),
    ):
        if v > 0.0:
            start, stop = max(start, (low - p) / v), min(stop, (high - p) / v)
        elif v < 0.0:
            start, stop = max(start, (high - p) / v), min(stop, (low - p) / v)
        elif not low <= p <= high:
            return -inf
    if not start <= stop:
        return -inf
    most = _most(z, vz, gravity, start, stop)[1] - pairs[code, at + 2]
    nx, ny, nz = pairs[code, at + 6], pairs[code, at + 7], pairs[code, at + 8]
    if nz > LEVEL:
        over = _most(nx * x + ny * y + nz * z, nx * vx + ny * vy + nz * vz, nz * gravity, start, stop)[1]
        most = min(most, (over - pairs[code, at + 9]) / nz)
    return most


@borrowing
def _over(corners, i, x, y, vx, vy, duration):  # type: ignore[no-untyped-def]
    """From when to when a flight is over triangle i; and the plane c + gx x + gy y of that."""
    ax, ay, az = corners[i, 0, 0], corners[i, 0, 1], corners[i, 0, 2]
    bx, by, bz = corners[i, 1, 0] - ax, corners[i, 1, 1] - ay, corners[i, 1, 2] - az
    cx, cy, cz = corners[i, 2, 0] - ax, corners[i, 2, 1] - ay, corners[i, 2, 2] - az
    det = bx * cy - by * cx
    if det == 0.0:
        return inf, -inf, 0.0, 0.0, 0.0
    px, py = x - ax, y - ay
    u, u1 = (px * cy - py * cx) / det, (vx * cy - vy * cx) / det
    w, w1 = (bx * py - by * px) / det, (bx * vy - by * vx) / det
    start, stop = 0.0, duration
    for here, rate in ((u, u1), (w, w1), (1.0 - u - w, -u1 - w1)):
        if rate > 0.0:
            start = max(start, -here / rate)
        elif rate < 0.0:
            stop = min(stop, -here / rate)
        elif here < 0.0:
            return inf, -inf, 0.0, 0.0, 0.0
    gx, gy = (bz * cy - cz * by) / det, (cz * bx - bz * cx) / det
    return start, stop, az - gx * ax - gy * ay, gx, gy


@borrowing
def flight_height(tree, stack, bounds, below, p, v, gravity, duration, best):  # type: ignore[no-untyped-def]
    """The greatest height of a flight above what is vertically below it, or `best` where that is more.

    Parameters
    ----------
    stack, bounds, below : work space of `STACK_SIZE`: whole numbers, numbers, whole numbers.
    p, v : at its start.

    Notes
    -----
    Above one triangle the height is a parabola in time, whose greatest value is known; whatever cannot be higher than
    the best so far is left out. What another surface hides from a flight does not count.
    """
    corners, pairs, children = tree[3], tree[4], tree[5]
    x, y, z = p
    vx, vy, vz = v
    stack[0], bounds[0], top = 0, inf, 1
    while top:
        top -= 1
        if bounds[top] <= best:
            continue
        code = stack[top]
        if code >= 0:
            first = _bound(pairs, code, 0, x, y, z, vx, vy, vz, gravity, duration)
            second = _bound(pairs, code, 1, x, y, z, vx, vy, vz, gravity, duration)
            left, right = np.int64(children[code, CODES]), np.int64(children[code, CODES + 1])
            if first > second:
                first, second, left, right = second, first, right, left
            if first > best:
                stack[top], bounds[top] = left, first
                top += 1
            if second > best:
                stack[top], bounds[top] = right, second
                top += 1
            continue
        begin, count = (-1 - code) // 8, (-1 - code) % 8
        for i in range(begin, begin + count):
            start, stop, c, gx, gy = _over(corners, i, x, y, vx, vy, duration)
            if not start <= stop:
                continue
            t, height = _most(z - c - gx * x - gy * y, vz - gx * vx - gy * vy, gravity, start, stop)
            if height <= max(best, 0.0):
                continue
            place = x + vx * t, y + vy * t, z + (vz - 0.5 * gravity * t) * t
            if height_below(tree, below, *place, (1.0 - 1e-9) * height) == inf:
                best = height
                continue
            for k in range(COVERED + 1):
                t = start + (stop - start) * k / COVERED
                place = x + vx * t, y + vy * t, z + (vz - 0.5 * gravity * t) * t
                height = height_below(tree, below, *place, inf)
                if best < height < inf:
                    best = height
    return best


@kernel
def greatest_heights(  # type: ignore[no-untyped-def]
    tree, begin, position, velocity, gravity, duration, heights, start, stop
):
    """Fill `heights` (n,) with the greatest height of each run, −inf where there is none.

    Parameters
    ----------
    begin : (n + 1,) where the flights of each run begin.
    position, velocity, duration : (k, 3) at the start of a flight through nothing, and (k,) [s].
    """
    stack, bounds, below = np.empty(STACK_SIZE, np.int64), np.empty(STACK_SIZE), np.empty(STACK_SIZE, np.int64)
    for run in range(start, stop):
        heights[run] = -inf
        if begin[run] == begin[run + 1]:
            continue
        longest = begin[run] + np.argmax(duration[begin[run] : begin[run + 1]])
        for k in range(begin[run] - 1, begin[run + 1]):
            i = longest if k < begin[run] else k  # the longest first: few of the others are looked at for long
            if k == longest:
                continue
            p, v = (position[i, 0], position[i, 1], position[i, 2]), (velocity[i, 0], velocity[i, 1], velocity[i, 2])
            heights[run] = flight_height(tree, stack, bounds, below, p, v, gravity, duration[i], heights[run])

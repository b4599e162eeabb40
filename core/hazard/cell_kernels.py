# SPDX-License-Identifier: GPL-3.0-or-later
"""The passages of runs through cells, along their exact parabolas: compiled kernels.

A run is followed from piece to piece: a flight is a parabola, with drag the chain of parabolas that the simulation
followed, a step on the ground has a constant acceleration. In plan a piece is straight (steps on the ground are cut
until they are so to `STRAIGHT_M`). Along it the cell changes at borders of cells, and the plane of the terrain at edges
of triangles (`plan_kernels`): between two such places the height above the terrain is a parabola in time, whose
greatest value is known, and the greatest speed is at one of the two. Nothing is sampled. Where triangles lie on top of
each other the index is asked instead (`height_kernels`).
"""

from math import ceil, floor, inf, isnan, nan, sqrt

import numpy as np

from ..compiled import borrowing
from ..simulation.drag_kernels import DRAG_CHANGE, with_drag
from ..simulation.height_kernels import flight_height
from ..simulation.plan_kernels import triangle_below
from ..simulation.record_kernels import ON_GROUND

STRAIGHT_M = 0.001
"""A step on the ground is nowhere farther than this from the straight line in plan that it is taken for."""
MOST_CUTS = 100
BEYOND_M = 1e-6
"""Behind a border of the terrain, what is below is looked for so far on."""
MOST_AT_ONCE = 64
"""Triangles around one place; after so many the path is lost, and found again in the next cell."""
COLUMNS = 4
"""Of values: speed, kinetic energy, that of translation, height; NaN where there is no terrain below."""


@borrowing
def _square(v, a, k, gravity, t):  # type: ignore[no-untyped-def]
    """The square of the speed, in a flight with drag that of the simulation."""
    if k > 0.0:
        v, t = with_drag(v, k, gravity, t)[1], 0.0
    x, y, z = v[0] + a[0] * t, v[1] + a[1] * t, v[2] + a[2] * t
    return x * x + y * y + z * z


@borrowing
def _moment(part, length, speed, gain, duration):  # type: ignore[no-untyped-def]
    """When a part of the way in plan is done: at a speed that changes by `gain` in a second."""
    if gain == 0.0:
        return part * duration
    way = part * length
    root = sqrt(max(speed * speed + 2.0 * gain * way, 0.0))
    below = speed + root
    return min(2.0 * way / below, duration) if below > 0.0 else 0.0


@borrowing
def _exit(plan, tri, p, dx, dy, now):  # type: ignore[no-untyped-def]
    """When a straight way in plan leaves a triangle, as a part of it, and over which edge."""
    best, edge = inf, 0
    for e in range(3):
        f = 2 * e + 2 if e < 2 else 0
        ax, ay = plan[tri, 2 * e], plan[tri, 2 * e + 1]
        ex, ey = plan[tri, f] - ax, plan[tri, f + 1] - ay
        rate = ex * dy - ey * dx
        if rate < 0.0:
            there = (ey * (p[0] - ax) - ex * (p[1] - ay)) / rate
            if there < best:
                best, edge = there, e
    return max(best, now), edge


@borrowing
def _border(p, d, low, size, cell):  # type: ignore[no-untyped-def]
    """When a straight way leaves a row or column of cells, as a part of it."""
    if d > 0.0:
        return max((low + (cell + 1) * size - p) / d, 0.0)
    if d < 0.0:
        return max((low + cell * size - p) / d, 0.0)
    return inf


@borrowing
def _stays(plan, tri, x, y, column, row, west, south, size):  # type: ignore[no-untyped-def]
    """Whether a place is in a cell and over a triangle: so is the straight way there from another such place."""
    x0, y0 = west + column * size, south + row * size
    if not (x0 <= x < x0 + size and y0 <= y < y0 + size):
        return False
    ax, ay, bx, by, cx, cy = plan[tri, 0], plan[tri, 1], plan[tri, 2], plan[tri, 3], plan[tri, 4], plan[tri, 5]
    return (
        (bx - ax) * (y - ay) >= (by - ay) * (x - ax)
        and (cx - bx) * (y - by) >= (cy - by) * (x - bx)
        and (ax - cx) * (y - cy) >= (ay - cy) * (x - cx)
    )


@borrowing
def _among_layers(tree, stack, bounds, below, p, v, a, start, stop, best):  # type: ignore[no-untyped-def]
    """The greatest height of a part of a piece where triangles lie on top of each other, or there are none."""
    fall = max(-a[2], 1e-9)  # a way that bends upwards is on the ground, and short
    t = stop - start
    here = (
        p[0] + (v[0] + 0.5 * a[0] * start) * start,
        p[1] + (v[1] + 0.5 * a[1] * start) * start,
        p[2] + (v[2] + 0.5 * a[2] * start) * start,
    )
    middle = 0.5 * (start + stop)
    speed = (v[0] + a[0] * middle, v[1] + a[1] * middle, v[2] + a[2] * middle + 0.5 * fall * t)
    return flight_height(tree, stack, bounds, below, here, speed, fall, t, best)


@borrowing
def walk(  # type: ignore[no-untyped-def]
    west, south, size, columns, rows, plan, tree, order, begin, what, time, position, v2, omega2, v1, omega1,
    half_mass, half_inertia, drag, gravity, seen, known, keys, values, count, stack, bounds, below,
):  # fmt: skip
    """The passages of runs; returns how many runs have them all, and how many passages these are.

    It makes no arrays: what counts references to arrays would do so at each turn of the loop.

    Parameters
    ----------
    west, south, size, columns, rows : of the cells.
    plan, tree : the terrain's triangles in plan, and its index.
    order : (n,) of the runs; begin : (n + 1,) where the records of each begin.
    what … omega1 : (k, …) the records.
    half_mass, half_inertia, drag : (n,) of the runs: energies are these times squares; ½ρC_D A/m [1/m].
    seen : (cells,) work space: of runs that were followed before, their numbers from 1 to `known`, or 0.
    keys, values : to be filled from `count` on, up to the last run that has room: (p,) the cell, row · columns +
        column, −1 − cell for the first passage of a run; (p, 4) see `COLUMNS`.
    stack, bounds, below : (`STACK_SIZE`,) work space.
    """
    for number in range(len(order)):
        run, stamp, before = order[number], np.int32(known + number + 1), count
        first, last = begin[run], begin[run + 1] - 1
        if last < first:
            continue
        p = (position[first, 0], position[first, 1], position[first, 2])
        column, row = np.int64(floor((p[0] - west) / size)), np.int64(floor((p[1] - south) / size))
        tri = triangle_below(tree, stack, p[0], p[1], p[2])
        mass, inertia, k = half_mass[run], half_inertia[run], drag[run]
        square, energy, height, gx, gy, c0 = 0.0, 0.0, -inf, 0.0, 0.0, nan
        if tri >= 0:
            gx, gy, c0 = plan[tri, 6], plan[tri, 7], plan[tri, 8]
            height = p[2] - c0 - gx * p[0] - gy * p[1]
            if isnan(height):
                height = _among_layers(tree, stack, bounds, below, p, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0, -inf)
        for i in range(first, last + 1):
            p, v = (position[i, 0], position[i, 1], position[i, 2]), (v2[i, 0], v2[i, 1], v2[i, 2])
            spin = inertia * (omega2[i, 0] ** 2 + omega2[i, 1] ** 2 + omega2[i, 2] ** 2)
            s = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
            square, energy = max(square, s), max(energy, mass * s + spin)
            left = time[i + 1] - time[i] if i < last else 0.0
            if not left > 0.0:
                continue
            flies = what[i] != ON_GROUND and what[i + 1] != ON_GROUND
            a, part, gain_of_spin, air = (0.0, 0.0, -gravity), left, 0.0, k
            if not flies:
                air = 0.0
                each, half = 1.0 / left, 0.5 * left
                a = ((v1[i + 1, 0] - v[0]) * each, (v1[i + 1, 1] - v[1]) * each, (v1[i + 1, 2] - v[2]) * each)
                way = (position[i + 1, 0] - p[0], position[i + 1, 1] - p[1], position[i + 1, 2] - p[2])
                v = (way[0] * each - a[0] * half, way[1] * each - a[1] * half, way[2] * each - a[2] * half)
                then = inertia * (omega1[i + 1, 0] ** 2 + omega1[i + 1, 1] ** 2 + omega1[i + 1, 2] ** 2)
                gain_of_spin = (then - spin) * each
                square_way = way[0] * way[0] + way[1] * way[1]
                bend = (a[0] * way[1] - a[1] * way[0]) * left * left / (8.0 * STRAIGHT_M)
                if bend * bend > square_way > 0.0:
                    part = left / min(ceil(sqrt(abs(bend) / sqrt(square_way))), MOST_CUTS)
            while left > 0.0:
                duration, then_v = min(part, left), v
                if air > 0.0:
                    horizon = DRAG_CHANGE / (k * sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) + 1e-3)
                    moved, then_v = with_drag(v, k, gravity, horizon)
                    f = 2.0 / (horizon * horizon)
                    a = (
                        f * (moved[0] - v[0] * horizon),
                        f * (moved[1] - v[1] * horizon),
                        f * (moved[2] - v[2] * horizon),
                    )
                    duration = min(horizon, left)
                left = left - duration if duration < left * (1.0 - 1e-9) else 0.0
                half = 0.5 * duration
                dx, dy = (v[0] + a[0] * half) * duration, (v[1] + a[1] * half) * duration
                if tri < 0:
                    tri = triangle_below(tree, stack, p[0], p[1], p[2])
                    c0 = nan
                    if tri >= 0:
                        gx, gy, c0 = plan[tri, 6], plan[tri, 7], plan[tri, 8]
                c, b, f = p[2] - c0 - gx * p[0] - gy * p[1], v[2] - gx * v[0] - gy * v[1], a[2] - gx * a[0] - gy * a[1]
                if (
                    tri >= 0
                    and not isnan(c)
                    and _stays(plan, tri, p[0] + dx, p[1] + dy, column, row, west, south, size)
                ):
                    height = max(height, c, c + (b + 0.5 * f * duration) * duration)
                    if b > 0.0 > b + f * duration:
                        height = max(height, c - 0.5 * b * b / f)
                    s, spin = _square(v, a, air, gravity, duration), spin + gain_of_spin * duration
                    square, energy = max(square, s), max(energy, mass * s + spin)
                    p = (p[0] + dx, p[1] + dy, p[2] + (v[2] + a[2] * half) * duration)
                    v = then_v if flies else (v[0] + a[0] * duration, v[1] + a[1] * duration, v[2] + a[2] * duration)
                    continue
                length, speed, gain = sqrt(dx * dx + dy * dy), 0.0, 0.0
                if (a[0] != 0.0 or a[1] != 0.0) and length > 0.0:
                    speed = max((v[0] * dx + v[1] * dy) / length, 0.0)
                    gain = 2.0 * (length / duration - speed) / duration
                at_x, at_y = _border(p[0], dx, west, size, column), _border(p[1], dy, south, size, row)
                step_x, step_y = size / abs(dx), size / abs(dy)
                now, start, at_once = 0.0, 0.0, 0
                at_edge, edge = (inf, 0) if tri < 0 else _exit(plan, tri, p, dx, dy, now)
                while True:
                    border = min(at_x, at_y)
                    then = min(border, at_edge, 1.0)
                    stop = duration if then >= 1.0 else _moment(then, length, speed, gain, duration)
                    if not isnan(c):
                        height = max(height, c + (b + 0.5 * f * start) * start, c + (b + 0.5 * f * stop) * stop)
                        if b + f * start > 0.0 > b + f * stop:
                            height = max(height, c - 0.5 * b * b / f)
                    else:
                        height = _among_layers(tree, stack, bounds, below, p, v, a, start, stop, height)
                    now, start = then, stop
                    if then >= 1.0:
                        break
                    if at_edge < border:
                        there = np.int64(plan[tri, 9 + edge])
                        at_once = at_once + 1 if at_edge <= now else 0
                        if there < 0 and length > 0.0:
                            beyond = now + BEYOND_M / length
                            t = _moment(min(beyond, 1.0), length, speed, gain, duration)
                            there = triangle_below(
                                tree, stack, p[0] + beyond * dx, p[1] + beyond * dy, p[2] + (v[2] + 0.5 * a[2] * t) * t
                            )
                        tri = np.int64(-1) if there == tri or at_once > MOST_AT_ONCE else there
                    else:
                        s = _square(v, a, air, gravity, stop)
                        now_spin = spin + gain_of_spin * stop
                        square, energy = max(square, s), max(energy, mass * s + now_spin)
                        if 0 <= column < columns and 0 <= row < rows:
                            if count == len(keys):
                                return number, before
                            cell = row * columns + column
                            keys[count] = cell if seen[cell] == stamp else -1 - cell
                            seen[cell] = stamp
                            values[count, 0], values[count, 1] = sqrt(square), energy
                            values[count, 2], values[count, 3] = mass * square, height if height > -inf else nan
                            count += 1
                        square, energy, height = s, mass * s + now_spin, -inf
                        if at_x <= border + 1e-12:
                            column += 1 if dx > 0.0 else -1
                            at_x += step_x
                        if at_y <= border + 1e-12:
                            row += 1 if dy > 0.0 else -1
                            at_y += step_y
                        if tri < 0:
                            place = (
                                p[0] + now * dx, p[1] + now * dy, p[2] + (v[2] + 0.5 * a[2] * stop) * stop
                            )  # fmt: skip
                            tri = triangle_below(tree, stack, place[0], place[1], place[2])
                        elif at_edge > now:
                            continue
                    at_edge, edge = (inf, 0) if tri < 0 else _exit(plan, tri, p, dx, dy, now)
                    c0 = nan
                    if tri >= 0:
                        gx, gy, c0 = plan[tri, 6], plan[tri, 7], plan[tri, 8]
                    c, b = p[2] - c0 - gx * p[0] - gy * p[1], v[2] - gx * v[0] - gy * v[1]
                    f = a[2] - gx * a[0] - gy * a[1]
                s, spin = _square(v, a, air, gravity, duration), spin + gain_of_spin * duration
                square, energy = max(square, s), max(energy, mass * s + spin)
                p = (p[0] + dx, p[1] + dy, p[2] + (v[2] + a[2] * half) * duration)
                v = then_v if flies else (v[0] + a[0] * duration, v[1] + a[1] * duration, v[2] + a[2] * duration)
        if 0 <= column < columns and 0 <= row < rows:
            if count == len(keys):
                return number, before
            cell = row * columns + column
            keys[count] = cell if seen[cell] == stamp else -1 - cell
            seen[cell] = stamp
            values[count, 0], values[count, 1] = sqrt(square), energy
            values[count, 2], values[count, 3] = mass * square, height if height > -inf else nan
            count += 1
    return len(order), count

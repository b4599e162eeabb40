# SPDX-License-Identifier: GPL-3.0-or-later
"""Blocks that meet stems: compiled kernels, exact on the parabola.

A stem is a vertical cylinder; a block meets it where the distance of its centre from the axis, in plan, becomes the sum
of both radii. In plan a flight is straight: the place is that of a line and a circle. `against_stem` has what the hit
does. The stems lie in square cells, and a way looks into those that it comes near.
"""

from math import ceil, floor, inf, sqrt
from typing import Any

import numpy as np

from ..compiled import borrowing as kernel
from .contact_kernels import last_root

PARTS = 5
"""Members of what `trees.in_cells` makes; an empty tuple stands for no trees, and compiles to nothing."""
X, Y, RADIUS, FOOT, TOP, ENERGY = range(6)
"""Columns of a stem; the last is the most energy that it takes away [J]."""
GRAZE = 0.9999
"""A block whose centre passes a stem farther from the axis than this part of both radii does not meet it."""
MOST_FALLEN = 64
"""Of so many stems that gave way to it a block knows; of more the last ones."""
SAG_M = 0.01
"""On the ground a bent way is taken for chords that are no farther than this from it."""
MOST_CHORDS = 100
LOW, HIGH, MIDDLE, SLOPE = -0.046, 0.98, 0.58, 8.007
"""Of the part of its greatest energy loss that a stem takes, as `taken` has it."""


@kernel
def taken(offset):  # type: ignore[no-untyped-def]
    """The part 0…1 of the greatest loss of energy that a hit beside the axis takes: 0 is central, 1 the stem's side."""
    share = LOW + (HIGH - LOW) / (1.0 + 10.0 ** ((MIDDLE - offset) * -SLOPE))
    return max(share, 0.0)


@kernel
def _stood(fallen, tree):  # type: ignore[no-untyped-def]
    standing = True
    for i in range(1, min(fallen[0], MOST_FALLEN) + 1):
        standing = standing and fallen[i] != tree
    return standing


@kernel
def let_fall(fallen, tree):  # type: ignore[no-untyped-def]
    """Remember a stem that gave way: this block does not meet it again."""
    fallen[1 + fallen[0] % MOST_FALLEN] = tree
    fallen[0] += 1


@kernel
def _moment(way, speed, gain):  # type: ignore[no-untyped-def]
    """When a way in plan is done, at a speed that changes by `gain` in a second."""
    if gain == 0.0:
        return way / speed
    return 2.0 * way / (speed + sqrt(max(speed * speed + 2.0 * gain * way, 0.0)))


@kernel
def first_stem(stems, fallen, p, v, a, radius, until):  # type: ignore[no-untyped-def]
    """The first stem that a sphere meets on the parabola p + v t + ½ a t² before `until`: (t, row), row −1 for none.

    a : in plan along v, as gravity and drag are.
    """
    speed = sqrt(v[0] * v[0] + v[1] * v[1])
    if not (speed > 0.0 and until > 0.0):
        return until, -1
    cells, counts, begin, stem, number = stems
    ux, uy = v[0] / speed, v[1] / speed
    gain = a[0] * ux + a[1] * uy
    whole = (speed + 0.5 * gain * until) * until
    reach, size = radius + cells[3], cells[2]
    major, minor = (0, 1) if abs(ux) >= abs(uy) else (1, 0)
    um, uo = (ux, uy) if major == 0 else (uy, ux)
    pm, po = p[major] - cells[major], p[minor] - cells[minor]
    low, high = min(pm, pm + um * whole) - reach, max(pm, pm + um * whole) + reach
    first: Any = max(np.int64(floor(low / size)), 0)
    last: Any = min(np.int64(floor(high / size)), counts[major] - 1)
    best, t, found = inf, until, -1
    for step in range(last - first + 1):
        i = first + step if um > 0.0 else last - step
        one, other = (i * size - reach - pm) / um, ((i + 1) * size + reach - pm) / um
        start, stop = max(min(one, other), 0.0), min(max(one, other), whole)
        if start > stop:
            continue
        if start > best:
            break
        y0, y1 = po + uo * start, po + uo * stop
        j0: Any = max(np.int64(floor((min(y0, y1) - reach) / size)), 0)
        j1: Any = min(np.int64(floor((max(y0, y1) + reach) / size)), counts[minor] - 1)
        for j in range(j0, j1 + 1):
            cell = j * counts[0] + i if major == 0 else i * counts[0] + j
            for k in range(begin[cell], begin[cell + 1]):
                dx, dy = stem[k, X] - p[0], stem[k, Y] - p[1]
                both = radius + stem[k, RADIUS]
                along, across = dx * ux + dy * uy, dy * ux - dx * uy
                if along <= 1e-9 * both or abs(across) >= GRAZE * both:
                    continue
                way = max(along - sqrt(both * both - across * across), 0.0)
                if way >= best or way > whole:
                    continue
                then = _moment(way, speed, gain)
                z = p[2] + (v[2] + 0.5 * a[2] * then) * then
                if z < stem[k, FOOT] - both:  # below on a slope it still meets the stem
                    continue
                if z > stem[k, TOP]:  # it may come down to the stem's height before it has passed the axis
                    if a[2] >= 0.0:
                        continue
                    then = last_root(p[2] - stem[k, TOP], v[2], a[2])
                    way = (speed + 0.5 * gain * then) * then
                    if way >= best or way >= along or then > until:
                        continue
                if _stood(fallen, number[k]):
                    best, t, found = way, then, k
    return t, found


@kernel
def stem_on_way(stems, fallen, p, control, q, radius):  # type: ignore[no-untyped-def]
    """The first stem that a sphere meets on its way on the ground, a parabola from p to q between two tangents.

    Parameters
    ----------
    control : where the tangents meet; for a straight way anywhere on it.

    Returns
    -------
    row : −1 for none. place : of the centre there. way : the direction, not its length, of the motion there.
    """
    bow = (p[0] - 2.0 * control[0] + q[0], p[1] - 2.0 * control[1] + q[1], p[2] - 2.0 * control[2] + q[2])
    sag = 0.25 * sqrt(bow[0] * bow[0] + bow[1] * bow[1] + bow[2] * bow[2])
    chords = min(max(ceil(sqrt(sag / SAG_M)), 1), MOST_CHORDS)
    here, straight = p, (0.0, 0.0, 0.0)
    for i in range(chords):
        s = (i + 1.0) / chords
        r = 1.0 - s
        there = q
        if i + 1 < chords:
            there = (
                r * r * p[0] + 2.0 * r * s * control[0] + s * s * q[0],
                r * r * p[1] + 2.0 * r * s * control[1] + s * s * q[1],
                r * r * p[2] + 2.0 * r * s * control[2] + s * s * q[2],
            )
        way = (there[0] - here[0], there[1] - here[1], there[2] - here[2])
        t, row = first_stem(stems, fallen, here, way, straight, radius, 1.0)
        if row >= 0:
            return row, (here[0] + t * way[0], here[1] + t * way[1], here[2] + t * way[2]), way
        here = there
    return -1, q, straight


@kernel
def round_stem(stem, k, p, q, radius):  # type: ignore[no-untyped-def]
    """Whether a block that leans on a stem at p goes round it on its way to q: then where, and in which direction.

    It does where a hit in that direction takes no energy.
    """
    both = radius + stem[k, RADIUS]
    nx, ny = (p[0] - stem[k, X]) / both, (p[1] - stem[k, Y]) / both
    wx, wy = q[0] - p[0], q[1] - p[1]
    turn, flat = nx * wy - ny * wx, sqrt(wx * wx + wy * wy)
    dx, dy = q[0] - stem[k, X], q[1] - stem[k, Y]
    d = sqrt(dx * dx + dy * dy)
    if not (d > 0.0 and taken(abs(turn) / flat) == 0.0):
        return False, p, (0.0, 0.0, 0.0)
    mx, my = dx / d, dy / d
    there = (stem[k, X] + both * mx, stem[k, Y] + both * my, q[2])
    return True, there, (-my, mx, 0.0) if turn > 0.0 else (my, -mx, 0.0)


@kernel
def against_stem(stem, k, p, v, w, radius, mass):  # type: ignore[no-untyped-def]
    """What a stem does to a block that meets it.

    The stem takes away ½mv² down to nothing, or the part `taken` of the most that it can. It gives way where the energy
    of the motion towards its axis, ½m(v·n)², is more than that most: then the impulse is along n and the block goes on,
    turned away from the axis. Else it stands, and the block leaves along its side, rising or falling as steeply as
    before. The spin is slowed as much as the block.

    Returns
    -------
    v, w : after. n : horizontal, from the axis to the centre. stands : whether the stem does.
    """
    dx, dy = p[0] - stem[k, X], p[1] - stem[k, Y]
    d, flat = sqrt(dx * dx + dy * dy), sqrt(v[0] * v[0] + v[1] * v[1])
    zero = (0.0, 0.0, 0.0)
    if flat == 0.0:
        return zero, zero, (dx / d, dy / d, 0.0) if d > 0.0 else (1.0, 0.0, 0.0), True
    nx, ny = (dx / d, dy / d) if d > 0.0 else (-v[0] / flat, -v[1] / flat)
    towards = -(v[0] * nx + v[1] * ny)
    tx, ty = v[0] + towards * nx, v[1] + towards * ny
    side = sqrt(tx * tx + ty * ty)
    square = flat * flat + v[2] * v[2]
    offset = side / flat * d / (radius + stem[k, RADIUS])
    lost = min(2.0 * taken(offset) * stem[k, ENERGY] / mass, square)
    kept = sqrt(max(1.0 - lost / square, 0.0))
    spin = (kept * w[0], kept * w[1], kept * w[2])
    if 0.5 * mass * towards * towards > stem[k, ENERGY]:
        left = sqrt(max(towards * towards - lost, 0.0))
        return (tx - left * nx, ty - left * ny, v[2]), spin, (nx, ny, 0.0), False
    if side > 1e-12 * flat:
        tx, ty = tx / side, ty / side
    else:
        tx, ty = -ny, nx
    return (kept * flat * tx, kept * flat * ty, kept * v[2]), spin, (nx, ny, 0.0), True

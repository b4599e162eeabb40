# SPDX-License-Identifier: GPL-3.0-or-later
"""What lies about each triangle, for a block that rolls or slides on it: compiled kernels.

It is kept in a tuple `facets` of six, in the order of the leaves:

- the triangle across each edge (m, 3), from corner e to e + 1, −1 where a block is not taken over it;
- the bend there (m, 3), tan(θ/2) of the angle θ by which the ground rises beyond, negative where it falls;
- what a sphere is clear of (m, 4), which is looked up when a block is first on the triangle;
- the curvature (m, 4) [1/m] of the surface of which the triangles are samples, xx, xy and yy of a quadratic form in the
  horizontal parts of a direction, and the noise of the bends around [rad];
- the crease (m, 3) [rad], the part of each bend that is a sharp edge;
- the lean (m, 3), how much of each bend the surface has turned at the edge itself, by the mean normals of its ends.

Curvature and crease are those of the surface at the scale of the block: see `block_scale`.

An edge is a crease as far as it bends more than the mesh around does. The normals of the corners opposite the edge
(means over the triangles around) lean by a and b from those of their triangles: by θ/2 each on a sampled arc, by
nothing at an edge between two planes. So the crease is √(θ² − 4 (a² + b²) − ν²), or 0, with the noise ν of the bends
around; of a crest `SLIGHT` to `DISTINCT`, a part of it. The rest of the bend is curvature.

What a sphere is clear of is

- the radius of the largest sphere that, wherever it touches the triangle, meets no triangle without a common corner;
  negative where it is exact, else it is at least that; 0 where it was not looked up;
- for each corner, how many radii the contact must be from it for a sphere not to meet the triangles around the corner,
  those across the edges left out.

Whether a sphere is clear depends on the triangles alone, whichever sphere was looked up before, in whichever thread:
each number is known or 0, a thread that finds a 0 looks up all four, and a triangle that is too far to be looked at
limits no sphere that is as small as the one that asked.
"""

from math import atan, atan2, inf, sqrt
from typing import Any

import numpy as np

from ..compiled import borrowing as kernel

GENTLE = 0.2679
"""tan(θ/2) of the bends that a block is taken over at once, 30°: beyond, an edge is a corner or a crest."""
SLIGHT, DISTINCT = 0.0873, 0.2618
"""A crest up to 5° is taken for one that is rounded between the samples, one from 15° on for a sharp one [rad]."""
OWN = 3.0
"""Weight of a triangle's own curvature beside that of each of the three around."""
LEVEL = 0.05
"""Vertical part of a normal below which a triangle is a wall."""
NONE = 1e-30
"""A radius of nothing that is known."""
NOWHERE: Any = np.int64(-1)
"""No triangle. Kernels that are given a plain −1 are compiled for that number, and once more for all others."""
BEYOND = 1.5
"""Look for somewhat larger spheres than the one that asks."""


@kernel
def dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def corner(corners, i, k):  # type: ignore[no-untyped-def]
    return corners[i, k, 0], corners[i, k, 1], corners[i, k, 2]


@kernel
def minus(a, b):  # type: ignore[no-untyped-def]
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel
def cross(a, b):  # type: ignore[no-untyped-def]
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def upward(corners, i):  # type: ignore[no-untyped-def]
    """The normal of triangle i that does not point down."""
    a = corner(corners, i, 0)
    m = cross(minus(corner(corners, i, 1), a), minus(corner(corners, i, 2), a))
    size = sqrt(dot(m, m))
    if m[2] < 0.0:
        size = -size
    return m[0] / size, m[1] / size, m[2] / size


@kernel
def bend_angle(bend):  # type: ignore[no-untyped-def]
    """θ [rad] of tan(θ/2)."""
    return 2.0 * atan(bend)


@kernel
def _tilt(normals, v, out, n):  # type: ignore[no-untyped-def]
    """By how much the normal at a vertex leans from n towards `out` [rad]."""
    m = (normals[v, 0], normals[v, 1], normals[v, 2])
    return atan2(dot(m, out), dot(m, n))


@kernel
def link(corners, face, neighbours, place, faces, normals, across, bend, lean, excess, width):  # type: ignore[no-untyped-def]
    """Fill `across`, `bend`, `lean`, and what creases and curvature follow from.

    Parameters
    ----------
    face : (m,) behind each triangle in the order of the leaves; place : (m,) of each face in that order.
    neighbours : (m, 3) of the faces, negative where there is none, or more than one.
    faces, normals : (m, 3) vertices of each face; (n, 3) upward normals of the vertices, of any length.
    excess : (m, 3) θ² − 4 (a² + b²) of each edge. width : (m, 3) of the triangle across it [m], 0 where there is none.
    """
    for i in range(len(corners)):
        n = upward(corners, i)
        for e in range(3):
            across[i, e], bend[i, e], lean[i, e], excess[i, e], width[i, e] = -1, 0.0, 0.0, 0.0, 0.0
            other = neighbours[face[i], e]
            if other < 0:
                continue
            j = np.int64(place[other])
            start, end = corner(corners, i, e), corner(corners, i, (e + 1) % 3)
            apex = 0
            while apex < 3 and (corner(corners, j, apex) == start or corner(corners, j, apex) == end):
                apex += 1
            if apex == 3:
                continue
            along, way = minus(end, start), minus(corner(corners, j, apex), start)
            out = cross(n, along)
            size = sqrt(dot(along, along))
            out = (out[0] / size, out[1] / size, out[2] / size)
            if dot(minus(corner(corners, i, (e + 2) % 3), start), out) > 0.0:
                out = (-out[0], -out[1], -out[2])
            rise, run = dot(way, n), dot(way, out)
            whole = sqrt(rise * rise + run * run)
            bend[i, e] = rise / (whole + run) if whole + run > 1e-6 * whole else 1e6
            turn = bend_angle(bend[i, e])
            ends = _tilt(normals, faces[face[i], e], out, n) + _tilt(normals, faces[face[i], (e + 1) % 3], out, n)
            lean[i, e] = min(max(-0.5 * ends / turn, 0.0), 1.0) if turn != 0.0 else 0.0
            before = _tilt(normals, faces[face[i], (e + 2) % 3], out, n)
            beyond = _tilt(normals, faces[other, apex], out, n)
            excess[i, e] = turn * turn - 4.0 * (before * before + (turn + beyond) * (turn + beyond))
            width[i, e] = min(whole, -dot(minus(corner(corners, i, (e + 2) % 3), start), out))
            if n[2] > LEVEL and (n[2] * run - out[2] * rise) > LEVEL * whole:
                across[i, e] = j


@kernel
def measure(corners, bend, width, sums):  # type: ignore[no-untyped-def]
    """Fill (m, 4) sums of each triangle: its area, and over its edges length times 1, the bend and its size [rad].

    A bend of `DISTINCT` or more is an edge of the ground, whatever is around: it counts as so much.
    """
    for i in range(len(corners)):
        n, base = upward(corners, i), corner(corners, i, 0)
        area = 0.5 * abs(dot(cross(minus(corner(corners, i, 1), base), minus(corner(corners, i, 2), base)), n))
        sums[i, 0], sums[i, 1], sums[i, 2], sums[i, 3] = area, 0.0, 0.0, 0.0
        for e in range(3):
            if width[i, e] > 0.0 and n[2] > LEVEL:
                along, turn = minus(corner(corners, i, (e + 1) % 3), corner(corners, i, e)), bend_angle(bend[i, e])
                size = sqrt(dot(along, along))
                sums[i, 1] += size
                turn = min(max(turn, -DISTINCT), DISTINCT)
                sums[i, 2], sums[i, 3] = sums[i, 2] + size * turn, sums[i, 3] + size * abs(turn)


@kernel
def curve(corners, bend, excess, width, noise, curvature, crease):  # type: ignore[no-untyped-def]
    """Fill `crease`, and the `curvature` of each triangle by itself.

    The curvatures at a triangle's three edges, each across its edge, add up to that of the surface: exactly for a
    quadratic one that is sampled on a grid. A wall has none.

    Parameters
    ----------
    noise : (m,) of the bends around [rad].
    """
    for i in range(len(corners)):
        n = upward(corners, i)
        xx = xy = yy = 0.0
        for e in range(3):
            crease[i, e] = 0.0
            if width[i, e] == 0.0:
                continue
            turn = bend_angle(bend[i, e])
            sharp = sqrt(max(excess[i, e] - noise[i] * noise[i], 0.0))
            if turn < 0.0:
                x = min(max((sharp - SLIGHT) / (DISTINCT - SLIGHT), 0.0), 1.0)
                sharp *= -x * x * (3.0 - 2.0 * x)
            crease[i, e] = sharp
            if n[2] > LEVEL:
                k = (turn - sharp) / width[i, e]
                along = minus(corner(corners, i, (e + 1) % 3), corner(corners, i, e))
                out, size = cross(along, n), dot(along, along)
                x, y = out[0] - out[2] * n[0] / n[2], out[1] - out[2] * n[1] / n[2]
                xx, xy, yy = xx + k * x * x / size, xy + k * x * y / size, yy + k * y * y / size
        curvature[i, 0], curvature[i, 1], curvature[i, 2] = xx, xy, yy


@kernel
def spread(across, own, around, coherent, noise, curvature):  # type: ignore[no-untyped-def]
    """Fill `curvature` from that of the triangles by themselves, with their neighbours, and of all around; and noise.

    Parameters
    ----------
    own, around : (m, 3) of each by itself; mean at the scale of the block.
    coherent : (m,) how far the bends around are those of a surface, 0 to 1: the share of the first.
    """
    for i in range(len(across)):
        for k in range(3):
            total, weight = OWN * own[i, k], OWN
            for e in range(3):
                j = across[i, e]
                if j >= 0:
                    total, weight = total + own[j, k], weight + 1.0
            curvature[i, k] = around[i, k] + coherent[i] * (total / weight - around[i, k])
        curvature[i, 3] = noise[i]


@kernel
def convexity(facets, i, v):  # type: ignore[no-untyped-def]
    """How much the surface about triangle i bends down along v: its curvature [1/m] times |v|²."""
    h = facets[3]
    return max(-(h[i, 0] * v[0] * v[0] + 2.0 * h[i, 1] * v[0] * v[1] + h[i, 2] * v[1] * v[1]), 0.0)


@kernel
def _greatest_cosine(w, a, b):  # type: ignore[no-untyped-def]
    """Between a direction and those from one to another."""
    m = cross(a, b)
    if dot(cross(a, w), m) > 0.0 and dot(cross(w, b), m) > 0.0:
        return sqrt(max(1.0 - dot(w, m) ** 2 / dot(m, m), 0.0))
    return max(dot(w, a), dot(w, b))


@kernel
def _directions(corners, i, k):  # type: ignore[no-untyped-def]
    """From a corner of a triangle to the others, of length 1."""
    here = corner(corners, i, k)
    a, b = minus(corner(corners, i, (k + 1) % 3), here), minus(corner(corners, i, (k + 2) % 3), here)
    p, q = 1.0 / sqrt(dot(a, a)), 1.0 / sqrt(dot(b, b))
    return (a[0] * p, a[1] * p, a[2] * p), (b[0] * q, b[1] * q, b[2] * q)


@kernel
def _around_corner(corners, i, at, j, there, n):  # type: ignore[no-untyped-def]
    """How many radii a sphere on triangle i must touch it from a corner so that it does not meet triangle j there.

    A sphere that touches at f, so far from the corner, meets a point q of the other, at the height h over the triangle,
    where |q − f|² < 2 r h. With unit vectors u to f and w to q that is least at f = r w·n/(1 − w·u).
    """
    a, b = _directions(corners, i, at)
    c, d = _directions(corners, j, there)
    if dot(c, n) <= 1e-9 and dot(d, n) <= 1e-9:
        return 0.0
    cosine = max(
        max(_greatest_cosine(a, c, d), _greatest_cosine(b, c, d)),
        max(_greatest_cosine(c, a, b), _greatest_cosine(d, a, b)),
    )
    m = cross(c, d)
    steep = sqrt(max(1.0 - dot(m, n) ** 2 / dot(m, m), 0.0))
    return steep / max(1.0 - cosine, 1e-9)


@kernel
def _beyond(corners, i, j, n):  # type: ignore[no-untyped-def]
    """How far triangle j lies beyond one of the edges of triangle i at least, seen along n."""
    most = 0.0
    for e in range(3):
        start = corner(corners, i, e)
        out = cross(minus(corner(corners, i, (e + 1) % 3), start), n)
        size = sqrt(dot(out, out))
        if size > 0.0:
            side = -size if dot(minus(corner(corners, i, (e + 2) % 3), start), out) > 0.0 else size
            least = inf
            for k in range(3):
                least = min(least, dot(minus(corner(corners, j, k), start), out) / side)
            most = max(most, least)
    return most


@kernel
def _apart(corners, i, j):  # type: ignore[no-untyped-def]
    """How far two triangles are from each other at least: along one of the axes."""
    most = 0.0
    for axis in range(3):
        a, b, c = corners[i, 0, axis], corners[i, 1, axis], corners[i, 2, axis]
        d, e, f = corners[j, 0, axis], corners[j, 1, axis], corners[j, 2, axis]
        most = max(most, max(min(min(a, b), c) - max(max(d, e), f), min(min(d, e), f) - max(max(a, b), c)))
    return most


@kernel
def _look_about(tree, stack, facets, i, radius):  # type: ignore[no-untyped-def]
    """Look up what a sphere on triangle i is clear of; returns the first of the four numbers."""
    bounds, first, count, corners = tree[:4]
    across, _, clear = facets[:3]
    asked = np.float32(BEYOND * radius)
    reach = 2.0 * (1.0 + 1e-5) * asked
    n = upward(corners, i)
    base = corner(corners, i, 0)
    flat = 1e-9 * sqrt(dot(minus(corner(corners, i, 1), base), minus(corner(corners, i, 1), base)))
    low_x = min(min(corners[i, 0, 0], corners[i, 1, 0]), corners[i, 2, 0]) - reach
    low_y = min(min(corners[i, 0, 1], corners[i, 1, 1]), corners[i, 2, 1]) - reach
    low_z = min(min(corners[i, 0, 2], corners[i, 1, 2]), corners[i, 2, 2]) - reach
    high_x = max(max(corners[i, 0, 0], corners[i, 1, 0]), corners[i, 2, 0]) + reach
    high_y = max(max(corners[i, 0, 1], corners[i, 1, 1]), corners[i, 2, 1]) + reach
    high_z = max(max(corners[i, 0, 2], corners[i, 1, 2]), corners[i, 2, 2]) + reach
    limit = inf
    around = (0.0, 0.0, 0.0)
    stack[0] = 0
    top = 1
    while top:
        top -= 1
        node = stack[top]
        if (
            bounds[node, 0] > high_x or bounds[node, 3] < low_x or bounds[node, 1] > high_y
            or bounds[node, 4] < low_y or bounds[node, 2] > high_z or bounds[node, 5] < low_z
        ):  # fmt: skip
            continue
        if not count[node]:
            stack[top], stack[top + 1] = first[node], first[node] + 1
            top += 2
            continue
        for j in range(first[node], first[node] + count[node]):
            rise, shared, at, there = 0.0, 0, NOWHERE, NOWHERE
            for k in range(3):
                q = corner(corners, j, k)
                for own in range(3):
                    if corner(corners, i, own) == q:
                        shared, at, there = shared + 1, own, k
                        break
                else:
                    rise = max(rise, dot(minus(q, base), n))
            if j == i or shared == 3 or rise <= flat:
                continue
            if shared == 0:
                gap = max(_beyond(corners, i, j, n), _beyond(corners, j, i, n))
                limit = min(limit, max(gap * gap / (2.0 * rise), 0.5 * max(gap, _apart(corners, i, j))))
            elif shared == 1:
                c = _around_corner(corners, i, at, j, there, n)
                around = (
                    max(around[0], c) if at == 0 else around[0],
                    max(around[1], c) if at == 1 else around[1],
                    max(around[2], c) if at == 2 else around[2],
                )
            elif j != across[i, 0] and j != across[i, 1] and j != across[i, 2]:
                limit = 0.0
    found = np.float32(max(limit * (1.0 - 1e-6), NONE))
    for k in range(3):
        clear[i, k + 1] = max(around[k] * (1.0 + 1e-6), NONE)
    clear[i, 0] = asked if found >= asked else -found
    return clear[i, 0]


@kernel
def is_clear(tree, stack, facets, i, p, q, sag, radius):  # type: ignore[no-untyped-def]
    """Whether a sphere on triangle i meets no others than those across its edges.

    Parameters
    ----------
    p, q : the contact first and last. sag : how far the way between may be from a line.
    """
    corners, clear = tree[3], facets[2]
    limit = clear[i, 0]
    if 0.0 <= limit < radius or clear[i, 1] == 0.0 or clear[i, 2] == 0.0 or clear[i, 3] == 0.0:
        limit = _look_about(tree, stack, facets, i, radius)
    if abs(limit) < radius:
        return False
    way = minus(q, p)
    square = dot(way, way)
    for k in range(3):
        if clear[i, k + 1] > NONE:
            near = clear[i, k + 1] * radius + sag
            x = minus(corner(corners, i, k), p)
            along = dot(x, way)
            part = along / square if 0.0 < along < square else 1.0 if along >= square > 0.0 else 0.0
            x = (x[0] - part * way[0], x[1] - part * way[1], x[2] - part * way[2])
            if dot(x, x) < near * near:
                return False
    return True

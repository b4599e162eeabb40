# SPDX-License-Identifier: GPL-3.0-or-later
"""A block on the ground that comes to an edge between two triangles: compiled kernels.

Where the ground rises beyond, it touches the next triangle already, and goes on along that; a crease takes speed
(`corner_kernels`). Where it falls, it turns about the edge when it is slow, v² < g r for the part of v across, or when
the surface that the triangles are samples of holds it; else it leaves the ground, and its flight is followed over the
triangles that it passes to the one that it lands on. Bends of more than 30° and whatever else is near are left
to the steps of `motion_kernels`.
"""

from math import inf, sqrt

import numpy as np

from ..compiled import borrowing as kernel
from .contact_kernels import first_root
from .corner_kernels import angle_between, met, share_of_crease
from .facet_kernels import GENTLE, NOWHERE, convexity, corner, dot, is_clear, minus, upward
from .leg_kernels import AT_ANOTHER, ON_TRIANGLE

MOST_PASSED = 8
"""A hop passes no more triangles than this."""


@kernel
def _along(v, n):  # type: ignore[no-untyped-def]
    s = dot(v, n)
    return v[0] - s * n[0], v[1] - s * n[1], v[2] - s * n[2]


@kernel
def _inward(corners, i, edge, n):  # type: ignore[no-untyped-def]
    """A corner at an edge, and the direction from the edge into the triangle, of length 1."""
    start, end, third = corner(corners, i, edge), corner(corners, i, (edge + 1) % 3), corner(corners, i, (edge + 2) % 3)
    u, w = minus(end, start), minus(third, start)
    part = dot(u, w) / dot(u, u)
    k = (w[0] - part * u[0], w[1] - part * u[1], w[2] - part * u[2])
    size = 1.0 / sqrt(dot(k, k))
    return start, (k[0] * size, k[1] * size, k[2] * size)


@kernel
def _within(tree, facets, i, p, n, radius, but):  # type: ignore[no-untyped-def]
    """Whether a sphere at p that touches triangle i does so within it, and meets none that rises beyond its edges.

    but : a triangle across an edge that it may touch.
    """
    corners, across, bend = tree[3], facets[0], facets[1]
    for edge in range(3):
        start, k = _inward(corners, i, edge, n)
        h = dot(minus(p, start), k)
        if across[i, edge] != but and bend[i, edge] > 0.0:
            h -= radius * bend[i, edge]
        if h < -1e-9 * radius:
            return False
    return True


@kernel
def _foot(corners, i, p, n):  # type: ignore[no-untyped-def]
    """The place on the plane of triangle i that is next to p."""
    h = dot(minus(p, corner(corners, i, 0)), n)
    return p[0] - h * n[0], p[1] - h * n[1], p[2] - h * n[2]


@kernel
def _in_flight(p, v, gravity, t):  # type: ignore[no-untyped-def]
    """Place and velocity."""
    return (
        (p[0] + v[0] * t, p[1] + v[1] * t, p[2] + (v[2] - 0.5 * gravity * t) * t),
        (v[0], v[1], v[2] - gravity * t),
    )


@kernel
def onto(tree, facets, p, v, n, place, edge, radius, gravity, factor, mu, inertia, shortest):  # type: ignore[no-untyped-def]
    """From one triangle at once onto the one that rises beyond an edge and is touched.

    Parameters
    ----------
    inertia : see `met`. shortest : [s] a block that comes back sooner moves along the corner between both.

    Returns
    -------
    v, n, place : after it; at a crease with the loss of `met`.
    edge : `ON_TRIANGLE`; or `AT_ANOTHER` where nothing is changed.
    """
    j = np.int64(facets[0][place, edge])
    if j < 0 or facets[1][place, edge] > GENTLE:
        return v, n, place, AT_ANOTHER
    m = upward(tree[3], j)
    share = share_of_crease(facets, tree[3], place, j, v, n, angle_between(n, m))
    turned = met(v, n, m, inertia, share * share)
    speed = sqrt(dot(turned, turned))
    if speed == 0.0 or not _within(tree, facets, j, p, m, radius, place):
        return v, n, place, AT_ANOTHER
    down = factor * gravity * m[2]
    brake = mu * down / speed
    a = (
        down * m[0] - brake * turned[0],
        down * m[1] - brake * turned[1],
        down * m[2] - factor * gravity - brake * turned[2],
    )
    away, back = dot(turned, n), -dot(a, n)
    if away <= 0.0 or 2.0 * away < back * shortest:
        return v, n, place, AT_ANOTHER
    return turned, m, j, ON_TRIANGLE


@kernel
def _take_off(tree, facets, stack, contact, p, v, m, place, j, t, gravity, wide):  # type: ignore[no-untyped-def]
    """Whether a block that flies off over an edge is above the triangle j beyond it after a time, and meets no other.

    m : the normal of j. wide : the radius and how far it is above the ground.
    """
    q = _foot(tree[3], j, _in_flight(p, v, gravity, t)[0], m)
    return (
        is_clear(tree, stack, facets, place, contact, contact, 0.0, wide)
        and is_clear(tree, stack, facets, j, contact, q, 0.125 * gravity * t * t, wide)
        and _within(tree, facets, j, contact, m, wide, place)
        and _within(tree, facets, j, q, m, wide, place)
    )


@kernel
def keeps(facets, corners, i, j, v, n, m, radius, gravity, hop):  # type: ignore[no-untyped-def]
    """Whether a block stays on ground that falls away from triangle i to j, as the surface that they are samples of.

    It does where gravity bends its path as much as the surface is curved, v² ≤ g cosβ (R + r), and where the crease
    that is left between both sends it no higher than a hop.

    Parameters
    ----------
    n, m : normals of both. hop : [m].
    """
    square, pull = dot(v, v), gravity * max(m[2], 0.0)
    bends = 0.5 * (convexity(facets, i, v) + convexity(facets, j, v))
    if bends * (square - pull * radius) > pull * square:
        return False
    crossing = dot(v, m) * share_of_crease(facets, corners, i, j, v, n, angle_between(n, m))
    return crossing * crossing <= 2.0 * pull * hop


@kernel
def _on_surface(facets, corners, i, edge, p, v, n, m, radius):  # type: ignore[no-untyped-def]
    """Centre and velocity of a block that comes to an edge of triangle i, beyond which the normal is m, as they are on
    the surface that the triangles are samples of."""
    share = share_of_crease(facets, corners, i, facets[0][i, edge], v, n, angle_between(n, m))
    part = facets[5][i, edge] * (1.0 - share)
    k = (n[0] + part * (m[0] - n[0]), n[1] + part * (m[1] - n[1]), n[2] + part * (m[2] - n[2]))
    size = sqrt(dot(k, k))
    k = (k[0] / size, k[1] / size, k[2] / size)
    way = _along(v, k)
    s = sqrt(dot(v, v) / dot(way, way))
    return (
        (p[0] + radius * (k[0] - n[0]), p[1] + radius * (k[1] - n[1]), p[2] + radius * (k[2] - n[2])),
        (s * way[0], s * way[1], s * way[2]),
    )


@kernel
def turns_about(tree, facets, i, e, v, radius, gravity):  # type: ignore[no-untyped-def]
    """Whether a block turns about the edge or corner of triangle i that it touches, with the normal e of the contact.

    At a crease it turns about one place, which it leaves where v² > g r; at a border there is nothing beyond. Within a
    triangle, and where the surface is curved, there is no such place.
    """
    corners = tree[3]
    m = upward(corners, i)
    if dot(e, m) > 1.0 - 1e-9:
        return True
    share = (
        1.0
        if min(min(facets[0][i, 0], facets[0][i, 1]), facets[0][i, 2]) < 0
        else share_of_crease(facets, corners, i, i, v, m, 0.0)
    )
    return share * share * dot(v, v) <= gravity * max(e[2], 0.0) * radius


@kernel
def over(tree, facets, stack, p, v, n, place, edge, radius, gravity, factor, mu, hop):  # type: ignore[no-untyped-def]
    """Over an edge beyond which the ground falls: about it, or in a hop.

    Parameters
    ----------
    factor, mu : part of gravity that accelerates; coefficient of friction.
    hop : [m] how high above the ground it may rise.

    Returns
    -------
    t, p, way : [s]; the centre after it, on the ground; the direction of the velocity.
    n, place : of the ground there; −1 where it flies off, with p and way of where it does, and the time from which on
        it has left the ground; and, with a time of 0, where steps have to follow.
    """
    corners, across, bend = tree[3], facets[0], facets[1]
    j = np.int64(across[place, edge])
    if j < 0 or bend[place, edge] < -GENTLE or dot(v, v) == 0.0:
        return 0.0, p, v, n, -1
    m = upward(corners, j)
    contact = (p[0] - radius * n[0], p[1] - radius * n[1], p[2] - radius * n[2])
    start, before = p, v
    stays = keeps(facets, corners, place, j, v, n, m, radius, gravity, hop)
    if not stays:
        p, v = _on_surface(facets, corners, place, edge, p, v, n, m, radius)
    rises, fall = dot(v, m), gravity * m[2]
    height = dot(minus(p, corner(corners, j, 0)), m) - radius
    square = rises * rises + 2.0 * fall * height
    if stays or square <= 0.0:
        wide = radius + hop
        if not (
            is_clear(tree, stack, facets, place, contact, contact, 0.0, wide)
            and is_clear(tree, stack, facets, j, contact, contact, 0.0, wide)
        ):
            return 0.0, p, v, n, -1
        q = (contact[0] + radius * m[0], contact[1] + radius * m[1], contact[2] + radius * m[2])
        way = minus(q, start)
        ds, square = sqrt(dot(way, way)), dot(v, v)
        if square <= 2.0 * factor * gravity * (way[2] + mu * n[2] * ds):
            return 0.0, p, v, n, -1  # it comes to rest on the edge
        return ds / sqrt(square), q, _along(before, m), m, j
    if square > 2.0 * fall * hop:
        t = (rises - sqrt(square - fall * hop)) / fall  # when it is half a hop high
        good = _take_off(tree, facets, stack, contact, p, v, m, place, j, t, gravity, radius + hop)
        return t if good else 0.0, p, v, n, -1
    total, came = 0.0, place
    for _ in range(MOST_PASSED):
        # The foot of the block is on the edge from `came` to j; height and rises are those over the plane of j.
        square = rises * rises + 2.0 * fall * height
        if square <= 0.0 or square > 2.0 * fall * hop:
            break
        land = (rises + sqrt(square)) / fall
        leave, at = inf, 0
        for e in range(3):
            if across[j, e] == came:
                continue
            start, k = _inward(corners, j, e, m)
            h = dot(minus(p, start), k)
            if h < radius * max(bend[j, e], 0.0):
                return 0.0, p, v, n, -1
            t = first_root(h, dot(v, k), -gravity * k[2])
            if t < leave:
                leave, at = t, e
        t = min(land, leave)
        q, way = _in_flight(p, v, gravity, t)
        if not is_clear(
            tree, stack, facets, j, _foot(corners, j, p, m), _foot(corners, j, q, m), 0.125 * gravity * t * t,
            radius + hop,
        ):  # fmt: skip
            break
        if land <= leave:
            if not _within(tree, facets, j, q, m, radius, NOWHERE):
                break
            return total + t, q, _along(way, m), m, j
        rises_beyond, came, j = bend[j, at] > 0.0, j, np.int64(across[j, at])
        if j < 0 or abs(bend[came, at]) > GENTLE:
            break
        m = upward(corners, j)
        height, rises, fall = dot(minus(q, corner(corners, j, 0)), m) - radius, dot(way, m), gravity * m[2]
        if height < 0.0:  # it has landed on that before
            square = rises * rises + 2.0 * fall * height
            if not (rises_beyond and rises < 0.0 and square <= 2.0 * fall * hop):
                break
            t += (rises + sqrt(square)) / fall
            q, way = _in_flight(p, v, gravity, t)
            contact = _foot(corners, j, q, m)
            if not (
                t > 0.0
                and _within(tree, facets, j, q, m, radius, came)
                and is_clear(tree, stack, facets, j, contact, contact, 0.0, radius + hop)
            ):
                break
            return total + t, q, _along(way, m), m, j
        total, p, v = total + t, q, way
    return 0.0, p, v, n, -1

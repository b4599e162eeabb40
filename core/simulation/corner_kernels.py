# SPDX-License-Identifier: GPL-3.0-or-later
"""A rolling or sliding block that meets a second plane: compiled kernels.

A sphere that rolls on one plane with the speed v and meets another that rises by the angle T beyond loses what drives
it into the second plane, and rolls on along that. Its angular momentum about the new contact stays, so that

    v' = v (cos T + c)/(1 + c)

with the inertia c m r², c = 0 for a block that slides. The part of the velocity along the edge between both stays. The
loss goes with T²: n edges of T/n lose 1/n of it, and a concave arc on which the sphere touches one place takes nothing.
"""

from math import acos, sqrt

from ..compiled import borrowing as kernel
from .facet_kernels import bend_angle, corner, cross, dot, minus

FREE = 0.0524
"""A turn of the normal within one step up to this [rad], 3°, is a surface that bends; a larger one is looked at in
shorter steps."""
WALL, UPRIGHT = 0.7854, 1.5708
"""From 45° on the second plane is met more and more as the impact model has it, from 90° on entirely [rad]."""
STRAIGHT = 1e-7
"""Sine of the angle between two planes that are one."""
AROUND_CORNER = 3.0
"""So many edges are between two triangles with a corner in common."""
FUZZY = 0.0873
"""By so much the normals turn that are fitted to points [rad], 5°, for their noise."""


@kernel
def angle_between(n, m):  # type: ignore[no-untyped-def]
    return acos(min(max(dot(n, m), -1.0), 1.0))


@kernel
def between(a, b, part):  # type: ignore[no-untyped-def]
    """From a vector to another."""
    return a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1]), a[2] + part * (b[2] - a[2])


@kernel
def met(v, n, m, inertia, part):  # type: ignore[no-untyped-def]
    """The velocity along a plane that a block meets, of the normal m.

    Parameters
    ----------
    v, n : along the plane before, and its normal. inertia : c of c m r² for a block that rolls, 0 for one that slides.
    part : of the loss that is due, as a power.
    """
    t = cross(n, m)
    sine = sqrt(dot(t, t))
    if sine < STRAIGHT:
        return v
    t = (t[0] / sine, t[1] / sine, t[2] / sine)
    ahead = cross(t, m)
    kept = max((dot(n, m) + inertia) / (1.0 + inertia), 0.0) ** part
    edgewise, crossing = dot(v, t), kept * dot(v, cross(t, n))
    return (
        edgewise * t[0] + crossing * ahead[0],
        edgewise * t[1] + crossing * ahead[1],
        edgewise * t[2] + crossing * ahead[2],
    )


@kernel
def beyond_noise(turn, noise):  # type: ignore[no-untyped-def]
    """Which part of a turn [rad] is none of a noise: √(1 − (noise/turn)²), or 0."""
    return sqrt(1.0 - (noise / turn) ** 2) if turn > noise else 0.0


@kernel
def _have_a_corner_in_common(corners, i, j):  # type: ignore[no-untyped-def]
    for k in range(3):
        for e in range(3):
            if corner(corners, i, k) == corner(corners, j, e):
                return True
    return False


@kernel
def share_of_crease(facets, corners, i, j, v, n, turn):  # type: ignore[no-untyped-def]
    """Which part of a turn of the normal from triangle i to j is a crease of the surface, 0 to 1.

    It is that of the edge between both. Else the contact has jumped over what is between: all but the noise of the
    bends around, and, where both have a corner in common, but what as many edges bend as are between there, each as
    those of triangle i that v crosses. Of a triangle and itself it is the part of its bends.
    """
    across, bend, _, curvature, crease, _ = facets
    bends = creases = weights = 0.0
    if not _have_a_corner_in_common(corners, i, j):
        return beyond_noise(turn, curvature[i, 3])
    for e in range(3):
        if bend[i, e] == 0.0:
            continue
        angle, part = abs(bend_angle(bend[i, e])), abs(crease[i, e])
        if across[i, e] == j:
            return part / angle
        along = minus(corner(corners, i, (e + 1) % 3), corner(corners, i, e))
        crossing = dot(v, cross(along, n))
        weight = crossing * crossing / dot(along, along)
        bends, creases, weights = bends + weight * angle, creases + weight * part, weights + weight
    if bends == 0.0:
        return 1.0
    if i == j:
        return min(creases / bends, 1.0)
    return beyond_noise(turn, max(curvature[i, 3], AROUND_CORNER * max(bends - creases, 0.0) / weights))


@kernel
def share_of_wall(turn):  # type: ignore[no-untyped-def]
    """How much of an impact a second plane is that rises by an angle, 0 to 1."""
    x = min(max((turn - WALL) / (UPRIGHT - WALL), 0.0), 1.0)
    return x * x * (3.0 - 2.0 * x)

# SPDX-License-Identifier: GPL-3.0-or-later
"""One door for the motion to what blocks fall on: triangles, points, or both. Compiled kernels.

A tree of triangles has six members: `bounds, first, count, corners` of the terrain's index, `pairs, children` of
`pair_kernels`. One of points has five, and a pair of both two: numba leaves out the branches that the length rules out,
so that each ground has code of its own. Places in the points of a pair follow those in its triangles.
"""

import numpy as np

from ..compiled import borrowing, kernel
from ..terrain.kernels import nearest_point
from ..terrain.point_kernels import nearest
from . import contact_kernels, point_kernels


@borrowing
def first_contact(tree, stack, times, p, v, a, radius, limit):  # type: ignore[no-untyped-def]
    """The first contact of a sphere with the ground before `limit`: see `contact_kernels.first_contact`."""
    if len(tree) == 5:
        return point_kernels.first_contact(tree, stack, times, p, v, a, radius, limit)
    if len(tree) == 6:
        return contact_kernels.first_contact(tree, stack, times, p, v, a, radius, limit)
    t, n, place = contact_kernels.first_contact(tree[0], stack, times, p, v, a, radius, limit)
    u, m, other = point_kernels.first_contact(tree[1], stack, times, p, v, a, radius, min(t, limit))
    if other >= 0 and u < t:
        return u, m, tree[0][3].shape[0] + other
    return t, n, place


@borrowing
def is_in(tree, stack, p, radius):  # type: ignore[no-untyped-def]
    """Whether a sphere at p is in the ground."""
    if len(tree) == 5:
        return nearest(tree, stack, p, radius)[1] >= 0
    if len(tree) == 6:
        return nearest_point(tree[:4], stack, p, radius)[4] >= 0
    return nearest_point(tree[0][:4], stack, p, radius)[4] >= 0 or nearest(tree[1], stack, p, radius)[1] >= 0


@kernel
def box(tree):  # type: ignore[no-untyped-def]
    """(6,) low and high corners of the ground [m]."""
    if len(tree) > 2:
        return tree[0][0, :6].astype(np.float64)
    whole = tree[0][0][0].astype(np.float64)
    for a in range(3):
        whole[a] = min(whole[a], tree[1][0][0, a])
        whole[a + 3] = max(whole[a + 3], tree[1][0][0, a + 3])
    return whole

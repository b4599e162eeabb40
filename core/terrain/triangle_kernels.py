# SPDX-License-Identifier: GPL-3.0-or-later
"""What is read off the triangles of a terrain, one after the other. Compiled kernels."""

import numpy as np

from ..compiled import kernel


@kernel
def wind(plan, faces, longest2):  # type: ignore[no-untyped-def]
    """Turn faces (m, 3) over points in plan (n, 2) counter-clockwise; returns the sum of their areas.

    longest2 : (m,) filled with the square of the longest edge; infinite where the three points lie on a line.
    """
    area = 0.0
    for i in range(len(faces)):
        a, b, c = faces[i, 0], faces[i, 1], faces[i, 2]
        ux, uy, vx, vy = (
            plan[b, 0] - plan[a, 0],
            plan[b, 1] - plan[a, 1],
            plan[c, 0] - plan[a, 0],
            plan[c, 1] - plan[a, 1],
        )
        wx, wy = plan[c, 0] - plan[b, 0], plan[c, 1] - plan[b, 1]
        twice = ux * vy - uy * vx
        if twice < 0.0:
            faces[i, 0], faces[i, 2] = c, a
        area += 0.5 * abs(twice)
        longest2[i] = max(ux * ux + uy * uy, vx * vx + vy * vy, wx * wx + wy * wy) if twice != 0.0 else np.inf
    return area


@kernel
def examine(vertices, faces, flat, degenerate):  # type: ignore[no-untyped-def]
    """Fill `degenerate` (m,): as flat as `flat` of the square of its longest edge; see `cleaning.examine_faces`.

    Returns
    -------
    x, y, z : of twice the total vector area. up, down : whether any face does.
    """
    x, y, z, up, down = 0.0, 0.0, 0.0, False, False
    for i in range(len(faces)):
        a, b, c = vertices[faces[i, 0]], vertices[faces[i, 1]], vertices[faces[i, 2]]
        u0, u1, u2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        v0, v1, v2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        w0, w1, w2 = c[0] - b[0], c[1] - b[1], c[2] - b[2]
        n0, n1, n2 = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
        longest2 = max(u0 * u0 + u1 * u1 + u2 * u2, v0 * v0 + v1 * v1 + v2 * v2, w0 * w0 + w1 * w1 + w2 * w2)
        degenerate[i] = n0 * n0 + n1 * n1 + n2 * n2 <= (flat * longest2) ** 2
        x, y, z, up, down = x + n0, y + n1, z + n2, up or n2 > 0.0, down or n2 < 0.0
    return x, y, z, up, down


@kernel
def heights_in(cell, z, low, high):  # type: ignore[no-untyped-def]
    """Lower `low` and raise `high` (c,) to the heights z (n,) of the points in each cell (n,)."""
    for i in range(len(z)):
        k = cell[i]
        low[k], high[k] = min(low[k], z[i]), max(high[k], z[i])

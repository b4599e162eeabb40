# SPDX-License-Identifier: GPL-3.0-or-later
"""How high flights come above a terrain of triangles: compiled kernels."""

import numpy as np

from ..compiled import kernel
from ..terrain.kernels import STACK_SIZE, nearest_hit

DOWN = (0.0, 0.0, -1.0)


@kernel
def greatest_heights(  # type: ignore[no-untyped-def]
    tree, position, velocity, gravity, duration, moments, more_than, heights, start, stop
):
    """Fill `heights` with the greatest height of each flight at some moments, −inf where it is not above `more_than`.

    Parameters
    ----------
    position, velocity : (n, 3) at the start of a flight through nothing.
    duration, moments : (n,) [s], and at how many moments it is looked at, those of its ends among them.

    Notes
    -----
    A look down no farther than the greatest height so far tells that a moment is not higher: few have to look on.
    """
    stack, place, down = np.empty(STACK_SIZE, np.int64), np.empty(3), np.array(DOWN)
    for i in range(start, stop):
        step, best, found = duration[i] / (moments[i] - 1), more_than[i], False
        for k in range(moments[i]):
            t = k * step
            place[0] = position[i, 0] + velocity[i, 0] * t
            place[1] = position[i, 1] + velocity[i, 1] * t
            place[2] = position[i, 2] + velocity[i, 2] * t - 0.5 * gravity * t * t
            if best >= 0.0 and nearest_hit(tree, stack, place, down, best)[1] >= 0:
                continue
            height, below = nearest_hit(tree, stack, place, down, np.inf)
            if below >= 0 and height > best:
                best, found = height, True
        heights[i] = best if found else -np.inf

# SPDX-License-Identifier: GPL-3.0-or-later
"""Which runs come near screens. Compiled kernels."""

from ..compiled import kernel


@kernel
def near_boxes(run, position, boxes, near):  # type: ignore[no-untyped-def]
    """Set `near` (n,) for runs with two moments between which a box (s, 4) in plan is touched: x, y least and most."""
    for i in range(1, run.size):
        r = run[i]
        if r != run[i - 1] or near[r]:
            continue
        x0, x1, y0, y1 = position[i - 1, 0], position[i, 0], position[i - 1, 1], position[i, 1]
        if x0 > x1:
            x0, x1 = x1, x0
        if y0 > y1:
            y0, y1 = y1, y0
        for k in range(boxes.shape[0]):
            if x1 >= boxes[k, 0] and y1 >= boxes[k, 1] and x0 <= boxes[k, 2] and y0 <= boxes[k, 3]:
                near[r] = True
                break

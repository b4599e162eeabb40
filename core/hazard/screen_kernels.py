# SPDX-License-Identifier: GPL-3.0-or-later
"""Which ways of runs come near screens. Compiled kernels."""

from ..compiled import borrowing


@borrowing
def near_boxes(run, position, boxes, found):  # type: ignore[no-untyped-def]
    """Fill `found` (k,) with records from which the way to the next touches a box (s, 4) in plan: x, y least and most.

    Returns how many there are.
    """
    count = 0
    for i in range(1, run.size):
        if run[i] != run[i - 1]:
            continue
        x0, x1, y0, y1 = position[i - 1, 0], position[i, 0], position[i - 1, 1], position[i, 1]
        if x0 > x1:
            x0, x1 = x1, x0
        if y0 > y1:
            y0, y1 = y1, y0
        for k in range(boxes.shape[0]):
            if x1 >= boxes[k, 0] and y1 >= boxes[k, 1] and x0 <= boxes[k, 2] and y0 <= boxes[k, 3]:
                found[count] = i - 1
                count += 1
                break
    return count

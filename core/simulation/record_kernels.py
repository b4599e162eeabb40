# SPDX-License-Identifier: GPL-3.0-or-later
"""What is written down of the motion of blocks. Compiled kernels."""

import numpy as np

from ..compiled import borrowing, kernel

RELEASED, IMPACT, ON_GROUND, FLIES_OFF, ENDED, TREE = 0, 1, 2, 3, 4, 5
"""What a record is about."""
ENDS_ONLY, IMPACTS, ALL = 0, 1, 2
"""What is recorded beside release and end: nothing; impacts, where blocks fly off, the first step on the ground each
time; all."""
COLUMNS = 22
"""run, what, time; centre; velocity, spin after; velocity, spin before; normal; place in the tree."""


@kernel
def grown(rows):  # type: ignore[no-untyped-def]
    """The records with room for as many again."""
    more = np.empty((2 * rows.shape[0], rows.shape[1]))
    more[: rows.shape[0]] = rows
    return more


@borrowing
def write(rows, k, run, what, time, p, v, w, v1, w1, n, place):  # type: ignore[no-untyped-def]
    """Fill record k."""
    rows[k, 0], rows[k, 1], rows[k, 2] = run, what, time
    for axis in range(3):
        rows[k, 3 + axis], rows[k, 6 + axis], rows[k, 9 + axis] = p[axis], v[axis], w[axis]
        rows[k, 12 + axis], rows[k, 15 + axis], rows[k, 18 + axis] = v1[axis], w1[axis], n[axis]
    rows[k, 21] = place


@kernel
def in_turn(moments, begin, rows):  # type: ignore[no-untyped-def]
    """Put the records of some runs where those of each begin among all."""
    place, last = 0, -1.0
    for i in range(len(moments)):
        if moments[i, 0] != last:
            last = moments[i, 0]
            place = begin[np.int64(last)]
        rows[place] = moments[i]
        place += 1

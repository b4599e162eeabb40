# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiled: how groups of items would differ by rank if the items changed places at random."""

import numpy as np

from ..compiled import kernel
from ..simulation.chance_kernels import HALF, WORD, philox


@kernel
def fill_exchanged(seed, first, group, start, counts, sums, groups, found):  # type: ignore[no-untyped-def]
    """Fill `found` (B, V) with Σ S²/n over the groups, for each random exchange of the items' groups.

    Parameters
    ----------
    seed, first : of the random numbers, and the number of the first exchange.
    group : (u,) number of each item's group, from 0.
    start : (s + 1,) the items start[i] … start[i + 1] change places with each other.
    counts : (u,) how many values each item holds.
    sums : (u, V) the sums of their ranks, for V quantities.
    """
    items, quantities = sums.shape
    key = np.uint64(seed)
    drawn = np.empty(items, dtype=np.intp)
    number = np.empty(groups)
    total = np.empty((groups, quantities))
    for b in range(found.shape[0]):
        drawn[:] = group
        exchange = np.uint64(first + b)
        for s in range(start.size - 1):
            low = start[s]
            for i in range(start[s + 1] - 1, low, -1):
                word, _, _, _ = philox(exchange, np.uint64(i), np.uint64(0), np.uint64(0), key & WORD, key >> HALF)
                other = low + np.intp((word * np.uint64(i - low + 1)) >> HALF)
                drawn[i], drawn[other] = drawn[other], drawn[i]
        number[:] = 0.0
        total[:] = 0.0
        for i in range(items):
            g = drawn[i]
            number[g] += counts[i]
            for v in range(quantities):
                total[g, v] += sums[i, v]
        found[b] = 0.0
        for g in range(groups):
            for v in range(quantities):
                found[b, v] += total[g, v] * total[g, v] / number[g]

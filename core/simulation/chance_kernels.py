# SPDX-License-Identifier: GPL-3.0-or-later
"""Random numbers as a function of (seed, run, impact, draw): Philox4x32-10 (Salmon et al. 2011, SC11).

The same for any number of threads, batches and orders; one more run, or one more impact, changes no other number.
"""

import numpy as np

from ..compiled import borrowing, kernel

ROUNDS = 10
MULTIPLY_0, MULTIPLY_1 = np.uint64(0xD2511F53), np.uint64(0xCD9E8D57)
WEYL_0, WEYL_1 = np.uint64(0x9E3779B9), np.uint64(0xBB67AE85)
WORD = np.uint64(0xFFFFFFFF)
HALF = np.uint64(32)
TOP, BOTTOM = np.uint64(5), np.uint64(6)
SCALE = 1.0 / 9007199254740992.0

BLOCK, ATTITUDE, PARAMETERS, PLACE = 0xFFFF0000, 0xFFFF0001, 0xFFFF0002, 0xFFFF1000
"""In place of the number of an impact, which never reaches them: chance of a run before it begins. Of its block, of its
attitude, of its parameters where these are drawn, and of its place at the first, second, … attempt."""


@borrowing
def philox(c0, c1, c2, c3, k0, k1):  # type: ignore[no-untyped-def]
    """Four words of 32 bits from a counter of four and a key of two, all held in uint64."""
    for _ in range(ROUNDS):
        one, two = MULTIPLY_0 * c0, MULTIPLY_1 * c2
        c0, c1, c2, c3 = (two >> HALF) ^ c1 ^ k0, two & WORD, (one >> HALF) ^ c3 ^ k1, one & WORD
        k0, k1 = (k0 + WEYL_0) & WORD, (k1 + WEYL_1) & WORD
    return c0, c1, c2, c3


@borrowing
def fill_uniform(seed, run, impact, values):  # type: ignore[no-untyped-def]
    """Fill `values` with uniform numbers of 53 bits, 0 ≤ u < 1: those of one impact of one run."""
    key, number = np.uint64(seed), np.uint64(run)
    for block in range((values.size + 1) // 2):
        a, b, c, d = philox(number & WORD, number >> HALF, np.uint64(impact), np.uint64(block), key & WORD, key >> HALF)
        values[2 * block] = ((a >> TOP) * 67108864.0 + (b >> BOTTOM)) * SCALE
        if 2 * block + 1 < values.size:
            values[2 * block + 1] = ((c >> TOP) * 67108864.0 + (d >> BOTTOM)) * SCALE


@kernel
def fill_runs(seed, runs, impact, values):  # type: ignore[no-untyped-def]
    """Fill the rows of `values` (n, k): the uniform numbers of one impact of each of the runs (n,), from 0."""
    for i in range(values.shape[0]):
        fill_uniform(seed, runs[i], impact, values[i])

# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiled kernel of the robust slope."""

from ..compiled import kernel


@kernel
def count_inversions(values, room):  # type: ignore[no-untyped-def]
    """The pairs i < j with values[i] > values[j], by merge sort: `values` (n,) gets sorted, `room` (n,) is scratch."""
    n, found, width = values.size, 0, 16
    for start in range(0, n, width):  # short stretches by insertion
        for i in range(start + 1, min(start + width, n)):
            value, j = values[i], i
            while j > start and values[j - 1] > value:
                values[j] = values[j - 1]
                j -= 1
            values[j] = value
            found += i - j
    source, target = values, room
    while width < n:
        for start in range(0, n, 2 * width):
            middle, end = min(start + width, n), min(start + 2 * width, n)
            i, j = start, middle
            for k in range(start, end):
                if j >= end or (i < middle and source[i] <= source[j]):
                    target[k] = source[i]
                    i += 1
                else:
                    target[k] = source[j]
                    found += middle - i
                    j += 1
        source, target = target, source
        width *= 2
    return found

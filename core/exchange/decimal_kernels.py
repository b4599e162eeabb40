# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers and words as the bytes of a table's rows: compiled kernels."""

import numpy as np

from ..compiled import kernel

MOST_DIGITS = 9e15
"""Up to here every whole number is a double."""
ZERO, POINT, MINUS, COMMA, LINE = 48, 46, 45, 44, 10
LONGEST = 24
"""Bytes of the longest number with what follows it."""
BILLION = 1_000_000_000
POWERS = np.array([10.0**k for k in range(10)])
PAIRS = np.frombuffer("".join(f"{k:02d}" for k in range(100)).encode(), np.uint8)


@kernel
def _digits_of(value):  # type: ignore[no-untyped-def]
    """How many digits a whole number below 10⁹ has."""
    size = 1
    while size < 9 and value >= POWERS[size]:
        size += 1
    return size


@kernel
def _write_small(out, k, value, size):  # type: ignore[no-untyped-def]
    """Write the last `size` digits of a whole number below 10⁹ from place k on; returns the place behind them."""
    i = k + size
    while i - 2 >= k:
        rest = value // np.uint32(100)
        pair = 2 * np.intp(value - rest * np.uint32(100))
        i -= 2
        out[i], out[i + 1] = PAIRS[pair], PAIRS[pair + 1]
        value = rest
    if i > k:
        out[k] = ZERO + np.uint8(value % np.uint32(10))
    return k + size


@kernel
def _write_whole(out, k, value):  # type: ignore[no-untyped-def]
    """Write a whole number from place k on; returns the place behind it."""
    if value < np.uint64(BILLION):
        small = np.uint32(value)
        return _write_small(out, k, small, _digits_of(small))
    high = value // np.uint64(BILLION)
    top = np.uint32(high)
    k = _write_small(out, k, top, _digits_of(top))
    return _write_small(out, k, np.uint32(value - high * np.uint64(BILLION)), 9)


@kernel
def write_rows(cells, decimals, words, starts, out):  # type: ignore[no-untyped-def]
    """Fill `out` with the text of n rows; returns how many bytes, −1 for a number that has too many digits.

    Parameters
    ----------
    cells : (c, n) numbers, NaN for an empty cell; of a column of words which one.
    decimals : (c,) of each column, up to 9; −1 for words.
    words : bytes of all words, one behind the other; `starts` (w + 1,) where each begins.
    """
    columns, rows = cells.shape
    k = 0
    for i in range(rows):
        for j in range(columns):
            value = cells[j, i]
            if decimals[j] < 0:
                word = int(value)
                for b in range(starts[word], starts[word + 1]):
                    out[k] = words[b]
                    k += 1
            elif value == value:
                size = abs(value)
                power = POWERS[decimals[j]]
                if not size * power < MOST_DIGITS:
                    return -1
                whole = np.uint64(size)
                part = np.uint32((size - whole) * power + 0.5)
                if part >= power:
                    whole, part = whole + np.uint64(1), np.uint32(0)
                if value < 0.0 and (whole or part):
                    out[k] = MINUS
                    k += 1
                k = _write_whole(out, k, whole)
                if decimals[j]:
                    out[k] = POINT
                    k = _write_small(out, k + 1, part, decimals[j])
            out[k] = COMMA
            k += 1
        out[k - 1] = LINE
    return k

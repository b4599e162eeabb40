# SPDX-License-Identifier: GPL-3.0-or-later
"""Plain separated text to numbers: compiled kernels (Lemire 2021, Number parsing at a gigabyte per second).

A decimal of at most 19 digits, w · 10^q, is a product of two whole numbers of which the upper bits are enough: for
−27 ≤ q ≤ 55 the 128 bits of 10^q always tell how it is rounded. What is beyond that is left to the caller.
"""

import numpy as np

from ..compiled import kernel
from .shortest_kernels import LEAST_POWER, POWERS, _upper

COMMA, LINE, RETURN, SPACE, TAB = 44, 10, 13, 32, 9
PLUS, MINUS, POINT, ZERO, NINE, UPPER_E, LOWER_E = 43, 45, 46, 48, 57, 69, 101
LEAST_Q, MOST_Q, MOST_DIGITS = -27, 55, 19
ONE, TWO, THREE, TEN = np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(10)
TOP, HIDDEN, PRECISE = np.uint64(63), np.uint64(1 << 52), np.uint64(0x1FF)
EMPTY, NUMBER, HARD, TEXT = 0, 1, 2, 3


@kernel
def rounded(w, q):  # type: ignore[no-untyped-def]
    """The bits of the double that is nearest to w · 10^q, ties to even; w from 1 on, q from −27 to 55."""
    lead = 0
    while not w >> TOP:
        w <<= ONE
        lead += 1
    power = POWERS[q - LEAST_POWER]
    high, low = _upper(w, power[0]), w * power[0]
    if high & PRECISE == PRECISE:
        more = _upper(w, power[1])
        low += more
        if more > low:
            high += ONE
    upper = high >> TOP
    shift = upper + np.uint64(9)
    mantissa = high >> shift
    raised = ((217706 * q) >> 16) + 63 + np.int64(upper) - lead + 1023
    if low <= ONE and -4 <= q <= 23 and mantissa & THREE == ONE and mantissa << shift == high:
        mantissa &= ~ONE
    mantissa = (mantissa + (mantissa & ONE)) >> ONE
    if mantissa >= TWO * HIDDEN:
        mantissa = HIDDEN
        raised += 1
    return (np.uint64(raised) << np.uint64(52)) | (mantissa & ~HIDDEN)


@kernel
def _number(data, k, end):  # type: ignore[no-untyped-def]
    """(kind, bits) of a cell: empty, a number, one that is left to the caller, or text."""
    while k < end and (data[k] == SPACE or data[k] == TAB):
        k += 1
    while end > k and (data[end - 1] == SPACE or data[end - 1] == TAB):
        end -= 1
    nothing = np.uint64(0)
    if k == end:
        return EMPTY, nothing
    negative = data[k] == MINUS
    if negative or data[k] == PLUS:
        k += 1
    w, q, digits, seen, point = nothing, 0, 0, False, False
    while k < end:
        sign = data[k]
        if ZERO <= sign <= NINE:
            seen = True
            if digits or sign != ZERO:
                digits += 1
                if digits <= MOST_DIGITS:
                    w = w * TEN + np.uint64(sign - ZERO)
            if point:
                q -= 1
        elif sign == POINT and not point:
            point = True
        else:
            break
        k += 1
    if not seen:
        return TEXT, nothing
    if k < end:
        if data[k] != LOWER_E and data[k] != UPPER_E:
            return TEXT, nothing
        k += 1
        falling = k < end and data[k] == MINUS
        if k < end and (falling or data[k] == PLUS):
            k += 1
        if k == end or end - k > 4:
            return TEXT, nothing
        power = 0
        while k < end:
            if not ZERO <= data[k] <= NINE:
                return TEXT, nothing
            power = 10 * power + int(data[k]) - ZERO
            k += 1
        q += -power if falling else power
    bits = nothing
    if digits:
        if digits > MOST_DIGITS or not LEAST_Q <= q <= MOST_Q:
            return HARD, nothing
        bits = rounded(w, q)
    return NUMBER, bits | (ONE << TOP) if negative else bits


@kernel
def count_rows(data, begins, columns, longest):  # type: ignore[no-untyped-def]
    """Where rows begin, and behind the last one its end; −1 where they are not all of so many cells, or one is empty.

    A carriage return before a new line is part of neither row. ``longest`` is the most bytes of a row.
    """
    n, k, end = 0, 0, data.size
    while k < end:
        begins[n] = k
        cells, filled = 1, False
        while k < end and data[k] != LINE:
            if data[k] == COMMA:
                cells += 1
            elif data[k] != SPACE and data[k] != TAB and data[k] != RETURN:
                filled = True
            k += 1
        if cells != columns or not filled or k - begins[n] > longest:
            return -1
        k += 1
        n += 1
    begins[n] = k
    return n


@kernel
def read_numbers(data, begins, start, stop, bits, kinds, hard):  # type: ignore[no-untyped-def]
    """Fill the bits (columns, n) of the numbers of some rows.

    Parameters
    ----------
    kinds : (columns, 2) of these rows: 1 where a column has text, and how many cells are empty. A column with text is
        not read further.
    hard : (h, 2) row and column of the numbers that are left to the caller; returns how many, −1 for too many.
    """
    nan = np.uint64(0x7FF8000000000000)
    many = 0
    for i in range(start, stop):
        k, end = begins[i], begins[i + 1] - 1
        if data[end - 1] == RETURN:
            end -= 1
        for j in range(bits.shape[0]):
            first = k
            while k < end and data[k] != COMMA:
                k += 1
            if not kinds[j, 0]:
                kind, value = _number(data, first, k)
                bits[j, i] = value if kind == NUMBER else nan
                if kind == TEXT:
                    kinds[j, 0] = 1
                elif kind == EMPTY:
                    kinds[j, 1] += 1
                elif kind == HARD:
                    if many == hard.shape[0]:
                        return -1
                    hard[many, 0], hard[many, 1] = i, j
                    many += 1
            k += 1
    return many


@kernel
def cell_ends(data, begins, column, columns, ends):  # type: ignore[no-untyped-def]
    """Fill (n, 2) where the cells of a column begin and end, sought from the nearer end of each row."""
    for i in range(ends.shape[0]):
        left, right = begins[i], begins[i + 1] - 1
        if right > left and data[right - 1] == RETURN:
            right -= 1
        if 2 * column < columns:
            skip = column
            while skip:
                skip -= data[left] == COMMA
                left += 1
            ends[i, 0] = left
            while left < right and data[left] != COMMA:
                left += 1
            ends[i, 1] = left
        else:
            skip = columns - 1 - column
            while skip:
                right -= 1
                skip -= data[right] == COMMA
            ends[i, 1] = right
            while right > left and data[right - 1] != COMMA:
                right -= 1
            ends[i, 0] = right


@kernel
def joined(data, ends, between, out):  # type: ignore[no-untyped-def]
    """Copy cells one behind the other, with a byte between them; returns how many bytes."""
    k = 0
    for i in range(ends.shape[0]):
        for b in range(ends[i, 0], ends[i, 1]):
            out[k] = data[b]
            k += 1
        out[k] = between
        k += 1
    return k - 1

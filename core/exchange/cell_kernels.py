# SPDX-License-Identifier: GPL-3.0-or-later
"""Plain separated text to numbers: compiled kernels (Lemire 2021, Number parsing at a gigabyte per second).

A decimal of at most 19 digits, w · 10^q, is a product of two whole numbers of which the upper bits are enough: for
−27 ≤ q ≤ 55 the 128 bits of 10^q always tell how it is rounded. What is beyond that is left to the caller.
"""

import numpy as np

from ..compiled import borrowing, kernel
from .shortest_kernels import LEAST_POWER, POWERS, _upper

COMMA, LINE, RETURN, SPACE, TAB, FIRST_SEPARATOR = 44, 10, 13, 32, 9, 28
PLUS, MINUS, POINT, ZERO, NINE, UPPER_E, LOWER_E = 43, 45, 46, 48, 57, 69, 101
LEAST_Q, MOST_Q, MOST_DIGITS = -27, 55, 19
ONE, TWO, THREE, TEN = np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(10)
TOP, HIDDEN, PRECISE = np.uint64(63), np.uint64(1 << 52), np.uint64(0x1FF)
EMPTY, NUMBER, HARD, TEXT = 0, 1, 2, 3
NOTHING, HUNDRED_MILLION = np.uint64(0), np.uint64(10**8)
EIGHT = tuple(np.uint64(b) for b in range(1, 8))
EIGHT_BITS, HALF_BYTE, SIXTEEN, HALF_WORD = np.uint64(8), np.uint64(4), np.uint64(16), np.uint64(32)
UPPER, SIXES, THREES = np.uint64(0xF0F0F0F0F0F0F0F0), np.uint64(0x0606060606060606), np.uint64(0x3333333333333333)
ZEROS, PAIR = np.uint64(0x3030303030303030), np.uint64(0x000000FF000000FF)
BY_MILLION, BY_HUNDRED = np.uint64(100 + (1000000 << 32)), np.uint64(1 + (10000 << 32))


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


@borrowing
def _eight(data, k):  # type: ignore[no-untyped-def]
    """Eight bytes from place k on as one whole number, the first one lowest; compiled to a single load."""
    k = np.uint64(k)
    word = np.uint64(data[k])
    for b in EIGHT:
        word |= np.uint64(data[k + b]) << (EIGHT_BITS * b)
    return word


@borrowing
def _eight_digits(data, k):  # type: ignore[no-untyped-def]
    """(whether eight bytes are all digits, their number): pairs, fours and eights at once (Lemire 2021)."""
    word = _eight(data, k)
    digits = (word & UPPER) | (((word + SIXES) & UPPER) >> HALF_BYTE) == THREES
    word -= ZEROS
    word = word * TEN + (word >> EIGHT_BITS)
    return digits, ((word & PAIR) * BY_MILLION + ((word >> SIXTEEN) & PAIR) * BY_HUNDRED) >> HALF_WORD


@borrowing
def _digits(data, k, w):  # type: ignore[no-untyped-def]
    """(the place behind the digits from place k on, w with them behind it); a row's end stops it."""
    last = data.size - 8
    while k <= last:
        digits, number = _eight_digits(data, k)
        if not digits:
            break
        w = w * HUNDRED_MILLION + number
        k += 8
    while ZERO <= data[k] <= NINE:
        w = w * TEN + np.uint64(data[k] - ZERO)
        k += 1
    return k, w


@borrowing
def _short_number(data, k):  # type: ignore[no-untyped-def]
    """(place, bits) behind a cell with what nearly all are, −1 for any other.

    That is digits of which at most 19 count, perhaps a sign before them and a point among them.
    """
    negative = data[k] == MINUS
    k += negative
    begin = k
    k, w = _digits(data, k, NOTHING)
    whole, places = k - begin, 0
    if data[k] == POINT:
        point = k
        k += 1
        if w == NOTHING:
            while data[k] == ZERO:
                k += 1
        counted = k
        k, w = _digits(data, k, w)
        places = k - point - 1
        many = k - counted + whole
    else:
        many = whole
    ended = data[k] == COMMA or data[k] == LINE or data[k] == RETURN
    if not ended or whole + places == 0 or many > MOST_DIGITS or places > -LEAST_Q:
        return -1, NOTHING
    bits = rounded(w, -places) if w else NOTHING
    return k, bits | (ONE << TOP) if negative else bits


@kernel
def read_rows(data, start, stop, row, longest, begins, bits, kinds, hard):  # type: ignore[no-untyped-def]
    """Fill where the rows between two bytes begin, and the bits (columns, n) of their numbers.

    A carriage return before a new line is part of neither row.

    Parameters
    ----------
    row : number of the first one.
    longest : most bytes of a row.
    kinds : (columns, 2) of these rows: 1 where a column has text, and how many cells are empty. A column with text is
        not read further.
    hard : (h, 2) row and column of the numbers that are left to the caller.

    Returns
    -------
    How many of those, −1 for too many; −2 where a row has another number of cells, is empty, or too long.
    """
    nan = np.uint64(0x7FF8000000000000)
    many, columns, k = 0, bits.shape[0], start
    while k < stop:
        begins[row] = k
        filled = False
        for j in range(columns):
            if data[k] == COMMA or data[k] == LINE:
                kind, value, end = EMPTY, nan, k
            elif kinds[j, 0]:
                kind, value, end = TEXT, nan, -1
            else:
                kind = NUMBER
                end, value = _short_number(data, k)
            if end < 0:
                end = k
                while data[end] != COMMA and data[end] != LINE:
                    filled |= data[end] != SPACE and data[end] != TAB and data[end] != RETURN
                    end += 1
                if kind != TEXT:
                    kind, value = _number(data, k, end - (data[end - 1] == RETURN))
            elif kind == NUMBER:
                filled = True
                end += data[end] == RETURN
            if kind == TEXT:
                kinds[j, 0] = 1
            else:
                bits[j, row] = value if kind == NUMBER else nan
            if kind == EMPTY:
                kinds[j, 1] += 1
            elif kind == HARD:
                if many == hard.shape[0]:
                    many = -1
                if many >= 0:
                    hard[many, 0], hard[many, 1] = row, j
                    many += 1
            k = end + 1
            if (data[end] == LINE) != (j == columns - 1):
                return -2
        if not filled or k - 1 - begins[row] > longest:
            return -2
        row += 1
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
    """Copy cells one behind the other without the blanks around them, with a byte between them; returns how many bytes.

    Blanks are those of `str.strip` that are a byte.
    """
    k = 0
    for i in range(ends.shape[0]):
        start, stop = ends[i, 0], ends[i, 1]
        while start < stop and _is_blank(data[start]):
            start += 1
        while start < stop and _is_blank(data[stop - 1]):
            stop -= 1
        for b in range(start, stop):
            out[k] = data[b]
            k += 1
        out[k] = between
        k += 1
    return k - 1


@borrowing
def _is_blank(sign):  # type: ignore[no-untyped-def]
    return sign <= SPACE and (sign == SPACE or TAB <= sign <= RETURN or sign >= FIRST_SEPARATOR)

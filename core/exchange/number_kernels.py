# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiled kernels that split comma-separated text and read its numbers, correctly rounded or not at all."""

import numpy as np

from ..compiled import kernel

NUMBER, EMPTY, UNSURE = 0, 1, 2
"""What `read_numbers` found in a cell; what is unsure is left to Python."""
COMMA, NEWLINE, BLANK, TAB, RETURN = 44, 10, 32, 9, 13
ZERO, NINE, POINT, MINUS, PLUS, LOWER_E, UPPER_E = 48, 57, 46, 45, 43, 101, 69
MOST_DIGITS, LARGEST_EXACT = 19, 2**53
"""Digits that fit into 64 bits; whole numbers up to here are exact in double precision."""
POWERS = 10.0 ** np.arange(23)
"""The powers of ten that are exact in double precision."""
SPLITTER = 2.0**27 + 1.0
DOUBT = 2.0**-40
"""Above the relative error of the second part of a quotient."""


@kernel
def find_cells(data, first, starts):  # type: ignore[no-untyped-def]
    """Fill `starts` (rows, columns + 1) with where cells start, from byte `first`; a cell ends before the next start.

    Returns the number of rows, or −1 when a row has another number of cells, or none.
    """
    rows, columns = starts.shape[0], starts.shape[1] - 1
    row, column, at, size = 0, 0, first, data.shape[0]
    if at < size:
        starts[0, 0] = at
    while at < size:
        code = data[at]
        if code in (COMMA, NEWLINE):
            column += 1
            if column > columns or row >= rows:
                return -1
            starts[row, column] = at + 1
            if code == NEWLINE:
                if column != columns:
                    return -1
                row, column = row + 1, 0
                if at + 1 < size:
                    if row >= rows:
                        return -1
                    starts[row, 0] = at + 1
        at += 1
    if size and data[size - 1] != NEWLINE:
        column += 1
        if column != columns or row >= rows:
            return -1
        starts[row, column] = size + 1
        row += 1
    return row


@kernel
def read_numbers(data, begin, end, values, kinds):  # type: ignore[no-untyped-def]
    """Fill `values` (n,) and `kinds` (n,) from the cells ``data[begin[i] : end[i] - 1]``; NaN where not a number."""
    for i in range(begin.shape[0]):
        a, b = np.int64(begin[i]), np.int64(end[i]) - 1
        while a < b and is_blank(data[a]):
            a += 1
        while b > a and is_blank(data[b - 1]):
            b -= 1
        values[i] = np.nan
        kinds[i] = EMPTY
        if a < b:
            values[i], kinds[i] = number(data, a, b)


@kernel
def is_blank(code):  # type: ignore[no-untyped-def]
    """Whether it is a space, a tab or a carriage return."""
    return code in (BLANK, TAB, RETURN)


@kernel
def number(data, a, b):  # type: ignore[no-untyped-def]
    """Value and kind of ``data[a:b]``, which is a decimal number or unsure."""
    negative = data[a] == MINUS
    if negative or data[a] == PLUS:
        a += 1
    digits, fraction, seen_point, mantissa = 0, 0, False, np.uint64(0)
    while a < b and ((ZERO <= data[a] <= NINE) or (data[a] == POINT and not seen_point)):
        if data[a] == POINT:
            seen_point = True
        else:
            mantissa = mantissa * np.uint64(10) + np.uint64(data[a] - ZERO)
            digits += 1 if digits or data[a] != ZERO else 0
            fraction += 1 if seen_point else 0
        a += 1
    some = mantissa > 0 or (data[a - 1] == ZERO) or (seen_point and fraction > 0)
    exponent = 0
    if some and a < b and (data[a] == LOWER_E or data[a] == UPPER_E):
        a += 1
        below = a < b and data[a] == MINUS
        if below or (a < b and data[a] == PLUS):
            a += 1
        from_here = a
        while a < b and ZERO <= data[a] <= NINE and exponent < 10000:
            exponent = exponent * 10 + (data[a] - ZERO)
            a += 1
        some = a > from_here
        exponent = -exponent if below else exponent
    exponent -= fraction
    if not some or a < b or digits > MOST_DIGITS or abs(exponent) >= POWERS.shape[0]:
        return np.nan, UNSURE
    value, kind = scaled(mantissa, exponent)
    return (-value if negative else value), kind


@kernel
def scaled(mantissa, exponent):  # type: ignore[no-untyped-def]
    """mantissa · 10^exponent, correctly rounded, or unsure.

    A long mantissa is divided in two parts (Dekker 1971): the sum is rounded right unless it is next to a half (Ziv's
    test).
    """
    if mantissa <= np.uint64(LARGEST_EXACT):
        exact = float(mantissa)
        return (exact * POWERS[exponent] if exponent >= 0 else exact / POWERS[-exponent]), NUMBER
    if exponent > 0:
        return np.nan, UNSURE
    high = float(mantissa)
    whole = np.uint64(high)
    low = float(mantissa - whole) if mantissa >= whole else -float(whole - mantissa)
    power = POWERS[-exponent]
    first = high / power
    product = first * power
    a1 = first * SPLITTER
    a1 = a1 - (a1 - first)
    a2 = first - a1
    b1 = power * SPLITTER
    b1 = b1 - (b1 - power)
    b2 = power - b1
    error = ((a1 * b1 - product) + a1 * b2 + a2 * b1) + a2 * b2
    second = (((high - product) - error) + low) / power
    value = first + second
    if first + second * (1.0 + DOUBT) != value or first + second * (1.0 - DOUBT) != value:
        return np.nan, UNSURE
    return value, NUMBER

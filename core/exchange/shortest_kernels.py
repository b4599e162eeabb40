# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers as the shortest text that reads back as the same number: compiled kernels (Giulietti 2020, Schubfach).

A double c · 2^q stands for all numbers nearer to it than to its neighbours. Its interval is scaled by a power of ten so
that, in quarters of a unit, its ends and middle are whole but for a rest that only matters as zero or not (rounding to
odd): then one or two comparisons find the decimal with fewest digits within, nearest to the number itself.
"""

import numpy as np

from ..compiled import kernel

LEAST_POWER, MOST_POWER = -292, 324
LONGEST = 25
"""Bytes of the longest number with what follows it: −1.2345678901234567e−300."""
MINUS, POINT, ZERO, EXPONENT, PLUS, BETWEEN = 45, 46, 48, 101, 43, 10
LOW, HALF = np.uint64(0xFFFFFFFF), np.uint64(32)
NONE, ONE, TWO, FOUR, TEN = np.uint64(0), np.uint64(1), np.uint64(2), np.uint64(4), np.uint64(10)
FORTY, HUNDRED = np.uint64(40), np.uint64(100)
HIDDEN = np.uint64(1 << 52)
MANTISSA, BEHIND, SIGN = np.uint64((1 << 52) - 1), np.uint64(52), np.uint64(63)
PAIRS = np.frombuffer("".join(f"{k:02d}" for k in range(100)).encode(), np.uint8)


def _powers() -> np.ndarray:
    """(k, 2) upper and lower 64 bits of 10^k, rounded up to 128 bits."""
    rows = []
    for power in range(LEAST_POWER, MOST_POWER + 1):
        if power >= 0:
            shift = (10**power).bit_length() - 128
            scaled = 10**power << -shift if shift <= 0 else -(-(10**power) >> shift)
        else:
            below = 10**-power
            shift = 127 + below.bit_length()
            scaled = -(-(1 << shift) // below)
        rows.append((scaled >> 64, scaled & 0xFFFFFFFFFFFFFFFF))
    return np.array(rows, dtype=np.uint64)


POWERS = _powers()


@kernel
def _upper(a, b):  # type: ignore[no-untyped-def]
    """The upper 64 bits of a product."""
    a_low, a_high, b_low, b_high = a & LOW, a >> HALF, b & LOW, b >> HALF
    crossed = a_high * b_low + ((a_low * b_low) >> HALF)
    middle = a_low * b_high + (crossed & LOW)
    return a_high * b_high + (crossed >> HALF) + (middle >> HALF)


@kernel
def _scaled(high, low, value):  # type: ignore[no-untyped-def]
    """A power of ten times a value, without its last 128 bits, odd where they are not nothing."""
    rest = high * value
    total = rest + _upper(low, value)
    whole = _upper(high, value) + (ONE if total < rest else NONE)
    return whole | (ONE if total > ONE else NONE)


@kernel
def _decimal(mantissa, raised):  # type: ignore[no-untyped-def]
    """(digits, power): a double above zero, from the bits of its mantissa and of its exponent, is digits · 10^power."""
    c, q = (mantissa | HIDDEN, raised - 1075) if raised else (mantissa, -1074)
    if -53 < q <= 0 and not c & ((ONE << np.uint64(-q)) - ONE):
        return c >> np.uint64(-q), 0
    nearer_below = mantissa == NONE and raised > 1
    power = (q * 1262611 - (524031 if nearer_below else 0)) >> 22
    shift = np.uint64(q + ((-power * 1741647) >> 19) + 1)
    high, low = POWERS[-power - LEAST_POWER, 0], POWERS[-power - LEAST_POWER, 1]
    middle = _scaled(high, low, (FOUR * c) << shift)
    least = _scaled(high, low, (FOUR * c - (ONE if nearer_below else TWO)) << shift)
    greatest = _scaled(high, low, (FOUR * c + TWO) << shift)
    if c & ONE:  # the ends belong to the neighbours
        least, greatest = least + ONE, greatest - ONE
    digits = middle >> TWO
    if digits >= TEN:
        fewer = digits // TEN
        below, above = least <= FORTY * fewer, FORTY * fewer + FORTY <= greatest
        if below != above:
            return fewer + (ONE if above else NONE), power + 1
    below, above = least <= FOUR * digits, FOUR * digits + FOUR <= greatest
    if below != above:
        return digits + (ONE if above else NONE), power
    half = FOUR * digits + TWO
    up = middle > half or (middle == half and digits & ONE != NONE)
    return digits + (ONE if up else NONE), power


@kernel
def _write_digits(out, k, value, size):  # type: ignore[no-untyped-def]
    """Write a whole number of so many digits from place k on."""
    i = k + size
    while i - 2 >= k:
        rest = value // HUNDRED
        pair = 2 * np.intp(value - rest * HUNDRED)
        i -= 2
        out[i], out[i + 1] = PAIRS[pair], PAIRS[pair + 1]
        value = rest
    if i > k:
        out[k] = ZERO + np.uint8(value)


@kernel
def _write_number(out, k, digits, power):  # type: ignore[no-untyped-def]
    """Write digits · 10^power as Python writes it from place k on; returns the place behind it."""
    while digits % TEN == NONE:
        digits //= TEN
        power += 1
    size, left = 1, digits // TEN
    while left:
        size += 1
        left //= TEN
    point = size + power
    if point < -3 or point > 16:
        _write_digits(out, k + 1, digits, size)
        out[k] = out[k + 1]
        k += 1
        if size > 1:
            out[k] = POINT
            k += size
        out[k] = EXPONENT
        out[k + 1] = MINUS if point < 1 else PLUS
        raised = abs(point - 1)
        places = 2 if raised < 100 else 3
        _write_digits(out, k + 2, np.uint64(raised), places)
        return k + 2 + places
    if point <= 0:
        for i in range(k, k + 2 - point):
            out[i] = ZERO
        out[k + 1] = POINT
        _write_digits(out, k + 2 - point, digits, size)
        return k + 2 - point + size
    if power >= 0:
        _write_digits(out, k, digits, size)
        k += size
        for _ in range(power):
            out[k] = ZERO
            k += 1
        out[k], out[k + 1] = POINT, ZERO
        return k + 2
    _write_digits(out, k + 1, digits, size)
    for i in range(k, k + point):
        out[i] = out[i + 1]
    out[k + point] = POINT
    return k + size + 1


@kernel
def write_double(out, k, bits):  # type: ignore[no-untyped-def]
    """Write a double, given by its bits, from place k on; returns the place behind it. NaN is nothing."""
    mantissa = bits & MANTISSA
    raised = np.int64((bits >> BEHIND) & np.uint64(0x7FF))
    if raised == 0x7FF and mantissa:
        return k
    if bits >> SIGN:
        out[k] = MINUS
        k += 1
    if raised == 0x7FF:
        out[k], out[k + 1], out[k + 2] = 105, 110, 102
        return k + 3
    if raised == 0 and mantissa == NONE:
        out[k], out[k + 1], out[k + 2] = ZERO, POINT, ZERO
        return k + 3
    digits, power = _decimal(mantissa, raised)
    return _write_number(out, k, digits, power)


@kernel
def write_shortest(bits, out):  # type: ignore[no-untyped-def]
    """Write n doubles, given by their bits (n,), each on a line; returns how many bytes. NaN is an empty line."""
    k = 0
    for i in range(bits.size):
        k = write_double(out, k, bits[i])
        out[k] = BETWEEN
        k += 1
    return k

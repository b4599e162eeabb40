# SPDX-License-Identifier: GPL-3.0-or-later
"""Elliptic functions and integrals as compiled kernels, for rotation without torque.

Jacobi's functions by the arithmetic-geometric mean (Abramowitz and Stegun 1964, 16.4), the integrals in Carlson's
symmetric forms by duplication (Carlson 1995, Numerical Algorithms 10, 13–26). All take the complement m1 = 1 − m, which
near 1 − m = 0 has the digits that m has lost.
"""

from math import asin, cos, sin, sqrt

import numpy as np

from ..compiled import kernel

LEVELS = 40
NEAR = 2e-3
"""Arguments of a symmetric integral that are so near to each other serve its series, to 1e-16."""


@kernel
def jacobi(v, m1):  # type: ignore[no-untyped-def]
    """(am, sn, cn, dn) of v for the parameter m = 1 − m1, 0 < m1 ≤ 1; am goes on growing with v."""
    part = np.empty(LEVELS)
    a, b, level = 1.0, sqrt(m1), 0
    while abs(a - b) > 1e-16 * a and level < LEVELS:
        mean = 0.5 * (a + b)
        part[level] = 0.5 * (a - b) / mean
        a, b, level = mean, sqrt(a * b), level + 1
    am = 2.0**level * a * v
    for k in range(level - 1, -1, -1):
        am = 0.5 * (am + asin(part[k] * sin(am)))
    s, c = sin(am), cos(am)
    return am, s, c, sqrt(c * c + m1 * s * s)


@kernel
def carlson_rf(x, y, z):  # type: ignore[no-untyped-def]
    """R_F(x, y, z) for arguments of zero or more, at most one of them zero."""
    while True:
        mean = (x + y + z) / 3.0
        if max(abs(x - mean), abs(y - mean), abs(z - mean)) < NEAR * mean:
            break
        p, q, r = sqrt(x), sqrt(y), sqrt(z)
        more = p * q + q * r + r * p
        x, y, z = 0.25 * (x + more), 0.25 * (y + more), 0.25 * (z + more)
    a, b = 1.0 - x / mean, 1.0 - y / mean
    c = -a - b
    e2, e3 = a * b - c * c, a * b * c
    return (1.0 - e2 / 10.0 + e3 / 14.0 + e2 * e2 / 24.0 - 3.0 * e2 * e3 / 44.0) / sqrt(mean)


@kernel
def carlson_rc(x, y):  # type: ignore[no-untyped-def]
    """R_C(x, y) = R_F(x, y, y) for x of zero or more and y above zero."""
    while True:
        mean = (x + 2.0 * y) / 3.0
        s = (y - mean) / mean
        if abs(s) < NEAR:
            break
        more = 2.0 * sqrt(x) * sqrt(y) + y
        x, y = 0.25 * (x + more), 0.25 * (y + more)
    return (1.0 + s * s * (0.3 + s * (1.0 / 7.0 + s * (0.375 + s * 9.0 / 22.0)))) / sqrt(mean)


@kernel
def carlson_rj(x, y, z, p):  # type: ignore[no-untyped-def]
    """R_J(x, y, z, p) for arguments of zero or more, at most one of the first three zero, p above zero."""
    total, scale = 0.0, 1.0
    apart = (p - x) * (p - y) * (p - z)
    while True:
        mean = (x + y + z + 2.0 * p) / 5.0
        if max(abs(x - mean), abs(y - mean), abs(z - mean), abs(p - mean)) < NEAR * mean:
            break
        f, g, h, k = sqrt(x), sqrt(y), sqrt(z), sqrt(p)
        more = f * g + g * h + h * f
        product = (k + f) * (k + g) * (k + h)
        total += scale / product * carlson_rc(1.0, 1.0 + apart / (product * product))
        x, y, z, p = 0.25 * (x + more), 0.25 * (y + more), 0.25 * (z + more), 0.25 * (p + more)
        scale, apart = 0.25 * scale, apart / 64.0
    a, b, c = 1.0 - x / mean, 1.0 - y / mean, 1.0 - z / mean
    d = -0.5 * (a + b + c)
    e2 = a * b + b * c + c * a - 3.0 * d * d
    e3 = a * b * c + 2.0 * e2 * d + 4.0 * d * d * d
    e4 = (2.0 * a * b * c + e2 * d + 3.0 * d * d * d) * d
    e5 = a * b * c * d * d
    series = (
        1.0
        - 3.0 * e2 / 14.0
        + e3 / 6.0
        + 9.0 * e2 * e2 / 88.0
        - 3.0 * e4 / 22.0
        - 9.0 * e2 * e3 / 52.0
        + 3.0 * e5 / 26.0
    )
    return scale * series / (mean * sqrt(mean)) + 6.0 * total


@kernel
def third_kind(n, s, c, m1):  # type: ignore[no-untyped-def]
    """Legendre's Π(n; φ | 1 − m1) from s = sin φ and c = cos φ ≥ 0, for n ≤ 0."""
    x, y = c * c, c * c + m1 * s * s
    square = s * s
    return s * (carlson_rf(x, y, 1.0) + n / 3.0 * square * carlson_rj(x, y, 1.0, 1.0 - n * square))

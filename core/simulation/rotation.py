# SPDX-License-Identifier: GPL-3.0-or-later
"""The rotation of a rigid block in free flight, exact for any time: no steps, energy and angular momentum are kept.

Without torque Euler's equations are solved by Jacobi's elliptic functions, in the block's own axes

    ω1 = a cn(u)    ω2 = b sn(u)    ω3 = c dn(u)    u = u0 + p t

with the axes named so that the spin stays on one side of the third, that of the greatest or the smallest moment. The
angular momentum L stands still in space; about it the third axis precesses by (van Zon and Schofield 2007, Journal of
Computational Physics 225, 145–164)

    φ = L [t/I3 + (1/I1 − 1/I3) ∫ dt / (1 − n sn² u)]        n = I3 (I2 − I1) / (I1 (I2 − I3)) ≤ 0

an integral of the third kind.
"""

from math import atan2, cos, pi, sin, sqrt

from ..compiled import kernel
from .elliptic_kernels import jacobi, third_kind

SAME = 1e-9
"""Moments that differ by less than this part are one."""
ABOUT_AXIS = 1e-28
"""The square of the spin's part across an axis below which the block spins steadily about it."""
LEAST_M1 = 1e-290


@kernel
def _sum(a, x, b, y, c, z):  # type: ignore[no-untyped-def]
    return a * x[0] + b * y[0] + c * z[0], a * x[1] + b * y[1] + c * z[1], a * x[2] + b * y[2] + c * z[2]


@kernel
def _turned_about(w, angle, x):  # type: ignore[no-untyped-def]
    """A vector turned about a unit axis."""
    s, c = sin(angle), cos(angle)
    k = (1.0 - c) * (w[0] * x[0] + w[1] * x[1] + w[2] * x[2])
    across = (w[1] * x[2] - w[2] * x[1], w[2] * x[0] - w[0] * x[2], w[0] * x[1] - w[1] * x[0])
    return _sum(c, x, s, across, k, w)


@kernel
def _integral(n, s, c, m1):  # type: ignore[no-untyped-def]
    """Π at the angle of (s, c), −π…π, and how many half turns of it are whole integrals."""
    if c >= 0.0:
        return third_kind(n, s, c, m1), 0.0
    return third_kind(n, -s, -c, m1), 1.0 if s >= 0.0 else -1.0


@kernel
def turn(moments, axes, spin, t):  # type: ignore[no-untyped-def]
    """Axes and spin of a block after a flight of t.

    Parameters
    ----------
    moments : three, of inertia, in any unit.
    axes : three unit vectors, right-handed: where the axes of these moments point.
    spin : ω [rad/s], in the same frame.
    t : [s].

    Returns
    -------
    axes, spin : as given, at the end.
    """
    low, middle, high = 0, 1, 2
    if moments[middle] < moments[low]:
        low, middle = middle, low
    if moments[high] < moments[middle]:
        middle, high = high, middle
    if moments[middle] < moments[low]:
        low, middle = middle, low
    along = (
        spin[0] * axes[0][0] + spin[1] * axes[0][1] + spin[2] * axes[0][2],
        spin[0] * axes[1][0] + spin[1] * axes[1][1] + spin[2] * axes[1][2],
        spin[0] * axes[2][0] + spin[1] * axes[2][1] + spin[2] * axes[2][2],
    )
    whole = along[0] * along[0] + along[1] * along[1] + along[2] * along[2]
    if whole == 0.0 or t == 0.0:
        return axes, spin
    # L² − 2 E I of the middle axis says whether the spin circles about the axis of the greatest moment.
    about_high = (
        moments[high] * (moments[high] - moments[middle]) * along[high] * along[high]
        >= moments[low] * (moments[middle] - moments[low]) * along[low] * along[low]
    )
    if moments[middle] - moments[low] <= SAME * moments[middle]:
        about_high = True
    elif moments[high] - moments[middle] <= SAME * moments[middle]:
        about_high = False
    one, three = (low, high) if about_high else (high, low)
    i1, i2, i3 = moments[one], moments[middle], moments[three]
    w1, w2, w3 = along[one], along[middle], along[three]
    same = abs(i3 - i1) <= SAME * i1
    if same or w1 * w1 + w2 * w2 <= ABOUT_AXIS * whole:
        size = sqrt(whole)
        w, angle = (spin[0] / size, spin[1] / size, spin[2] / size), size * t
        turned = (
            _turned_about(w, angle, axes[0]), _turned_about(w, angle, axes[1]), _turned_about(w, angle, axes[2])
        )  # fmt: skip
        return turned, spin

    # Right-handed in their new order: an axis may be turned round, its moment is the same.
    hand = 1.0 if (middle - one) % 3 == 1 else -1.0
    w1 *= hand
    e1 = (hand * axes[one][0], hand * axes[one][1], hand * axes[one][2])
    e2, e3 = axes[middle], axes[three]
    d1 = i2 * (i2 - i1) * w2 * w2 + i3 * (i3 - i1) * w3 * w3
    d3 = i1 * (i1 - i3) * w1 * w1 + i2 * (i2 - i3) * w2 * w2
    a = sqrt(d3 / (i1 * (i1 - i3)))
    c = sqrt(d1 / (i3 * (i3 - i1))) * (1.0 if w3 >= 0.0 else -1.0)
    b = sqrt(d3 / (i2 * (i2 - i3))) * (1.0 if (w3 >= 0.0) == (i3 > i2) else -1.0)
    s0, c0 = w2 / b, w1 / a
    size = sqrt(s0 * s0 + c0 * c0)
    s0, c0 = s0 / size, c0 / size
    pace = sqrt(max(d1 * (i3 - i2) / (i1 * i2 * i3), 0.0))
    n = min(i3 * (i2 - i1) / (i1 * (i2 - i3)), 0.0)
    v = pace * t
    s, k, integral, d0, d = s0, c0, t / (1.0 - n * s0 * s0), 0.0, 0.0
    if v > 1e-12:
        d2 = i1 * (i1 - i2) * w1 * w1 + i3 * (i3 - i2) * w3 * w3
        m1 = min(max(d2 * (i1 - i3) / (d1 * (i2 - i3)), LEAST_M1), 1.0)
        d0 = sqrt(c0 * c0 + m1 * s0 * s0)
        am, sv, cv, dv = jacobi(v, m1)
        below = c0 * c0 + s0 * s0 * dv * dv
        s, k = (s0 * cv * dv + sv * c0 * d0) / below, (c0 * cv - s0 * d0 * sv * dv) / below
        size = sqrt(s * s + k * k)
        s, k = s / size, k / size
        d = sqrt(k * k + m1 * s * s)
        # The angle at the end goes on from the one at the start; am(u0 + v) − am(u0) is within π/2 of am(v).
        first, half0 = _integral(n, s0, c0, m1)
        last, half = _integral(n, s, k, m1)
        rounds = 2.0 * round((am + atan2(s0, c0) - atan2(s, k)) / (2.0 * pi))
        halves = rounds + half - half0
        integral = last - first
        if halves != 0.0:
            integral += 2.0 * halves * third_kind(n, 1.0, 0.0, m1)
        integral /= pace
    l1, l2, l3 = i1 * a * c0, i2 * b * s0, i3 * (c * d0 if v > 1e-12 else w3)
    flat, whole = sqrt(l1 * l1 + l2 * l2), sqrt(l1 * l1 + l2 * l2 + l3 * l3)
    node = _sum(-l2 / flat, e1, l1 / flat, e2, 0.0, e3)
    momentum = _sum(l1 / whole, e1, l2 / whole, e2, l3 / whole, e3)
    angle = whole * (t / i3 + (1.0 / i1 - 1.0 / i3) * integral)
    x = _turned_about(momentum, angle, node)
    y = (
        momentum[1] * x[2] - momentum[2] * x[1],
        momentum[2] * x[0] - momentum[0] * x[2],
        momentum[0] * x[1] - momentum[1] * x[0],
    )
    w1, w2 = a * k, b * s
    w3 = c * d if v > 1e-12 else w3
    l1, l2, l3 = i1 * w1, i2 * w2, i3 * w3
    flat, whole = sqrt(l1 * l1 + l2 * l2), sqrt(l1 * l1 + l2 * l2 + l3 * l3)
    e1 = _sum(-l2 / flat, x, -l1 * l3 / (flat * whole), y, l1 / whole, momentum)
    e2 = _sum(l1 / flat, x, -l2 * l3 / (flat * whole), y, l2 / whole, momentum)
    e3 = _sum(0.0, x, flat / whole, y, l3 / whole, momentum)
    now = _sum(w1, e1, w2, e2, w3, e3)
    e1 = (hand * e1[0], hand * e1[1], hand * e1[2])
    if one == 0:
        turned = (e1, e2, e3) if middle == 1 else (e1, e3, e2)
    elif one == 1:
        turned = (e2, e1, e3) if middle == 0 else (e3, e1, e2)
    else:
        turned = (e2, e3, e1) if middle == 0 else (e3, e2, e1)
    return turned, now


@kernel
def drawn_axes(u):  # type: ignore[no-untyped-def]
    """Three axes of a direction of chance from three uniform numbers, all rotations alike (Shoemake 1992)."""
    a, b = sqrt(1.0 - u[0]), sqrt(u[0])
    f, g = 2.0 * pi * u[1], 2.0 * pi * u[2]
    x, y, z, w = a * sin(f), a * cos(f), b * sin(g), b * cos(g)
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w)),
        (2.0 * (x * y - z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + x * w)),
        (2.0 * (x * z + y * w), 2.0 * (y * z - x * w), 1.0 - 2.0 * (x * x + y * y)),
    )

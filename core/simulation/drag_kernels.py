# SPDX-License-Identifier: GPL-3.0-or-later
"""Flight with drag: a step of it, which a parabola through both ends stands for. Compiled kernels."""

from math import sqrt

from ..compiled import borrowing

DRAG_CHANGE = 0.005
"""With drag, the speed changes by less than this part on one parabola."""


@borrowing
def slowed(v, drag, gravity):  # type: ignore[no-untyped-def]
    """The acceleration by gravity and drag."""
    k = drag * sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    return -k * v[0], -k * v[1], -k * v[2] - gravity


@borrowing
def with_drag(v, drag, gravity, h):  # type: ignore[no-untyped-def]
    """Displacement and velocity after a time h, by a step of Runge and Kutta's fourth order."""
    a = slowed(v, drag, gravity)
    v2 = (v[0] + 0.5 * h * a[0], v[1] + 0.5 * h * a[1], v[2] + 0.5 * h * a[2])
    b = slowed(v2, drag, gravity)
    v3 = (v[0] + 0.5 * h * b[0], v[1] + 0.5 * h * b[1], v[2] + 0.5 * h * b[2])
    c = slowed(v3, drag, gravity)
    v4 = (v[0] + h * c[0], v[1] + h * c[1], v[2] + h * c[2])
    d = slowed(v4, drag, gravity)
    s = h / 6.0
    return (
        (
            s * (v[0] + 2.0 * (v2[0] + v3[0]) + v4[0]),
            s * (v[1] + 2.0 * (v2[1] + v3[1]) + v4[1]),
            s * (v[2] + 2.0 * (v2[2] + v3[2]) + v4[2]),
        ),
        (
            v[0] + s * (a[0] + 2.0 * (b[0] + c[0]) + d[0]),
            v[1] + s * (a[1] + 2.0 * (b[1] + c[1]) + d[1]),
            v[2] + s * (a[2] + 2.0 * (b[2] + c[2]) + d[2]),
        ),
    )

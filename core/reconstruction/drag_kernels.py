# SPDX-License-Identifier: GPL-3.0-or-later
"""Flight with drag and its derivatives, compiled: the equation of motion together with its variational equations."""

import numpy as np

from ..compiled import kernel

STATE = 36
"""Displacement (3), velocity (3), and the derivatives (3, 5) of either by the three start velocities, k and g."""
STEP = 0.01
"""Largest product of a step and the rate at which drag changes the velocity: 1e-10 of the way after Runge–Kutta."""
LEAST_STEPS = 2
NEWTON_STEPS = 30
MET = 1e-11
"""The flight joins its ends to this part of their distance."""


@kernel
def _slope(y, drag, gravity, dy):  # type: ignore[no-untyped-def]
    vx, vy, vz = y[3], y[4], y[5]
    speed = np.sqrt(vx * vx + vy * vy + vz * vz)
    dy[0], dy[1], dy[2] = vx, vy, vz
    dy[3] = -drag * speed * vx
    dy[4] = -drag * speed * vy
    dy[5] = -drag * speed * vz - gravity
    inverse = drag / speed if speed > 0.0 else 0.0
    for j in range(5):
        sx, sy, sz = y[21 + j], y[26 + j], y[31 + j]
        dy[6 + j], dy[11 + j], dy[16 + j] = sx, sy, sz
        along = (vx * sx + vy * sy + vz * sz) * inverse
        dy[21 + j] = -drag * speed * sx - along * vx
        dy[26 + j] = -drag * speed * sy - along * vy
        dy[31 + j] = -drag * speed * sz - along * vz
    dy[24] -= speed * vx
    dy[29] -= speed * vy
    dy[34] -= speed * vz
    dy[35] -= 1.0


@kernel
def _start(velocity, y):  # type: ignore[no-untyped-def]
    y[:] = 0.0
    for i in range(3):
        y[3 + i] = velocity[i]
        y[21 + 6 * i] = 1.0


@kernel
def _advance(y, duration, drag, gravity, work):  # type: ignore[no-untyped-def]
    """Classical Runge–Kutta of the fourth order, in place."""
    speed = np.sqrt(y[3] * y[3] + y[4] * y[4] + y[5] * y[5])
    rate = abs(drag) * (speed + gravity * abs(duration)) + np.sqrt(abs(drag) * gravity)
    steps = int(max(LEAST_STEPS, np.ceil(abs(duration) * rate / STEP)))
    h = duration / steps
    a, b, c, d, z = work[0], work[1], work[2], work[3], work[4]
    for _ in range(steps):
        _slope(y, drag, gravity, a)
        for i in range(STATE):
            z[i] = y[i] + 0.5 * h * a[i]
        _slope(z, drag, gravity, b)
        for i in range(STATE):
            z[i] = y[i] + 0.5 * h * b[i]
        _slope(z, drag, gravity, c)
        for i in range(STATE):
            z[i] = y[i] + h * c[i]
        _slope(z, drag, gravity, d)
        for i in range(STATE):
            y[i] += h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i])


@kernel
def join_ends(displacement, duration, drag, gravity, velocity, ends):  # type: ignore[no-untyped-def]
    """Start velocities (k, 3) of the flights that join two points, and the states (k, 36) at their ends.

    `velocity` comes with the first guess; a flight that is not found leaves NaN in `ends`.
    """
    work = np.empty((5, STATE))
    matrix = np.empty((3, 3))
    for f in range(len(duration)):
        y = ends[f]
        scale = 1e-3 + np.abs(displacement[f]).sum()
        found = False
        for _ in range(NEWTON_STEPS):
            _start(velocity[f], y)
            _advance(y, duration[f], drag[f], gravity[f], work)
            miss = displacement[f] - y[:3]
            size = np.abs(miss).sum()
            if not np.isfinite(size):
                break
            if size <= MET * scale:
                found = True
                break
            for i in range(3):
                for j in range(3):
                    matrix[i, j] = y[6 + 5 * i + j]
            velocity[f] += np.linalg.solve(matrix, miss)
        if not found:
            y[:] = np.nan


@kernel
def states_along(which, elapsed, velocity, drag, gravity, states):  # type: ignore[no-untyped-def]
    """States (q, 36) of the flights `which` (q,) after `elapsed` (q,); quickest when both ascend."""
    work = np.empty((5, STATE))
    for row in range(len(which)):
        f, y = which[row], states[row]
        begin = 0.0
        if row > 0 and which[row - 1] == f and 0.0 <= elapsed[row - 1] <= elapsed[row]:
            y[:] = states[row - 1]
            begin = elapsed[row - 1]
        else:
            _start(velocity[f], y)
        if elapsed[row] != begin:
            _advance(y, elapsed[row] - begin, drag[f], gravity[f], work)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Flight with drag, compiled: the equation of motion, and with it its variational equations where they are asked for.

Dormand and Prince's method of order 8, each step as long as its error allows. A state begins with the displacement (3)
and the velocity (3); one of length `STATE` goes on with the derivatives (3, 5) of either by the three start velocities,
k and g.
"""

import numpy as np
from scipy.integrate import DOP853

from ..compiled import kernel

MOTION, STATE = 6, 36
STAGES, SHARES, ERRORS = np.array(DOP853.A, order="C"), np.array(DOP853.B, order="C"), np.stack([DOP853.E3, DOP853.E5])
STEP_ERROR_M = 1e-11
"""Of the displacement in one step, and of what the velocity's error makes of it during the whole flight."""
FIRST_STEP = 0.1
"""Largest product of the first step and the rate at which drag changes the velocity."""
MOST_STEPS = 2_000
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
    if len(y) == MOTION:
        return
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
    y[3:MOTION] = velocity
    if len(y) == STATE:
        for i in range(3):
            y[21 + 6 * i] = 1.0


@kernel
def _trial(y, step, drag, gravity, reach, slopes, trial):  # type: ignore[no-untyped-def]
    """Fill `trial` with the state after one step; its error in parts of what is allowed."""
    stages = len(SHARES)
    for stage in range(stages + 1):
        trial[:] = y
        for other in range(stage):
            share = step * (STAGES[stage, other] if stage < stages else SHARES[other])
            if share != 0.0:
                for i in range(len(y)):
                    trial[i] += share * slopes[other, i]
        if stage < stages:
            _slope(trial, drag, gravity, slopes[stage])
    third, fifth = 0.0, 0.0
    for i in range(MOTION):
        size = abs(step) * (1.0 if i < 3 else reach) / STEP_ERROR_M
        low, high = 0.0, 0.0
        for stage in range(stages):
            low += ERRORS[0, stage] * slopes[stage, i]
            high += ERRORS[1, stage] * slopes[stage, i]
        third, fifth = third + (size * low) ** 2, fifth + (size * high) ** 2
    return fifth / np.sqrt(fifth + 0.01 * third) if fifth > 0.0 else fifth


@kernel
def _advance(y, duration, drag, gravity, work):  # type: ignore[no-untyped-def]
    """Move a state on by a time, which may be negative; NaN where steps vanish or exceed `MOST_STEPS`."""
    slopes, trial = work[:-1], work[-1]
    left, reach = duration, abs(duration)
    rate = abs(drag) * np.sqrt(y[3] * y[3] + y[4] * y[4] + y[5] * y[5]) + np.sqrt(abs(drag) * gravity)
    step = left / np.ceil(max(abs(left) * rate / FIRST_STEP, 1.0))
    for _ in range(MOST_STEPS):
        if left == 0.0 or left - step == left or not np.isfinite(step):
            break
        error = _trial(y, step, drag, gravity, reach, slopes, trial)
        if error <= 1.0:
            y[:] = trial
            left = 0.0 if step == left else left - step
        factor = 0.9 * error**-0.125 if error > 0.0 else 5.0
        step *= min(max(factor, 0.2), 5.0) if np.isfinite(error) else 0.2
        if abs(step) > abs(left):
            step = left
    if left != 0.0:
        y[:] = np.nan


@kernel
def join_ends(displacement, duration, drag, gravity, velocity, ends):  # type: ignore[no-untyped-def]
    """Start velocities (k, 3) of the flights that join two points, and the states (k, 36) at their ends.

    `velocity` comes with the first guess; a flight that is not found leaves NaN in `ends`.
    """
    work = np.empty((len(SHARES) + 1, STATE))
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
    """States (q, 6) or (q, 36) of the flights `which` (q,) after `elapsed` (q,); quickest when both ascend."""
    work = np.empty((len(SHARES) + 1, states.shape[1]))
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

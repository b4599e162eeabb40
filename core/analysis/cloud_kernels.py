# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiled kernels over clouds of restituted velocities, seen as points (v_N2, v_T2, θ_dev) in scaled axes."""

import math

import numpy as np

from ..compiled import kernel


@kernel
def points_of(v2, v1, normal, scale, points):  # type: ignore[no-untyped-def]
    """Fill `points` (R, m, 3) with |v_N2|, |v_T2| and θ_dev, each divided by its scale."""
    for run in range(v2.shape[0]):
        for i in range(v2.shape[1]):
            x, y, z = v2[run, i, 0], v2[run, i, 1], v2[run, i, 2]
            a, b, c = v1[i, 0], v1[i, 1], v1[i, 2]
            n0, n1, n2 = normal[i, 0], normal[i, 1], normal[i, 2]
            along = x * n0 + y * n1 + z * n2
            t0, t1, t2 = x - along * n0, y - along * n1, z - along * n2
            c0, c1, c2 = b * z - c * y, c * x - a * z, a * y - b * x
            turned = math.atan2(math.sqrt(c0 * c0 + c1 * c1 + c2 * c2), a * x + b * y + c * z)
            points[run, i, 0] = abs(along) / scale[0]
            points[run, i, 1] = math.sqrt(t0 * t0 + t1 * t1 + t2 * t2) / scale[1]
            points[run, i, 2] = turned / scale[2]


@kernel
def energy_scores(points, target, scores):  # type: ignore[no-untyped-def]
    """Fill `scores` (m,) with E|X − Y| − ½E|X − X′| of `points` (R, m, 3) against `target` (K, m, 3)."""
    runs, m = points.shape[0], points.shape[1]
    for i in range(m):
        apart = 0.0
        for run in range(runs):
            for k in range(target.shape[0]):
                apart += distance(points[run, i], target[k, i])
        scores[i] = apart / (runs * target.shape[0]) - own_scatter(points, i)


@kernel
def own_scatter(points, i):  # type: ignore[no-untyped-def]
    """½E|X − X′| of impact i, without bias; 0 for one run."""
    runs, apart = points.shape[0], 0.0
    if runs < 2:
        return 0.0
    for run in range(runs):
        for other in range(run):
            apart += distance(points[run, i], points[other, i])
    return apart / (runs * (runs - 1))


@kernel
def own_scatters(points, scatters):  # type: ignore[no-untyped-def]
    """Fill `scatters` (m,) with `own_scatter`."""
    for i in range(points.shape[1]):
        scatters[i] = own_scatter(points, i)


@kernel
def distance(a, b):  # type: ignore[no-untyped-def]
    """|a − b| of two points (3,)."""
    return np.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)

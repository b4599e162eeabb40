# SPDX-License-Identifier: GPL-3.0-or-later
"""The loop over impacts and replicates, in plain Python that compiles as it stands."""

from math import nan
from typing import Any

from .triples import dot


def drive(
    model: Any,
    velocity: Any,
    normal: Any,
    start: Any,
    follows: Any,
    radius: Any,
    mass: Any,
    parameters: Any,
    draws: Any,
    omega1: Any,
    v2: Any,
    omega2: Any,
) -> None:
    """Fill `omega1`, `v2` and `omega2`, each (replicates, n, 3), with what a model makes of n impacts.

    Parameters
    ----------
    model : compiled.
    velocity, normal, start : (n, 3) incident velocity, unit normal, and angular velocity where no impact is followed.
    follows : (n,) row, before this one, of the impact whose ω2 is the incident ω1 here; −1 for `start`.
    radius, mass : (n,).
    parameters : (k,) in the order of the model's table.
    draws : (replicates, n, d) uniform numbers; NaN for the mean.

    Notes
    -----
    A block that does not approach the ground (v1·n ≥ 0, or NaN) has no impact: NaN. So has every impact that follows.
    """
    for replicate in range(draws.shape[0]):
        for i in range(velocity.shape[0]):
            v = (velocity[i, 0], velocity[i, 1], velocity[i, 2])
            n = (normal[i, 0], normal[i, 1], normal[i, 2])
            before = follows[i]
            if before < 0:
                w = (start[i, 0], start[i, 1], start[i, 2])
            else:
                w = (omega2[replicate, before, 0], omega2[replicate, before, 1], omega2[replicate, before, 2])
            after, spin = (nan, nan, nan), (nan, nan, nan)
            if dot(v, n) < 0.0:
                after, spin = model(v, n, w, radius[i], mass[i], parameters, draws[replicate, i])
            for axis in range(3):
                omega1[replicate, i, axis] = w[axis]
                v2[replicate, i, axis] = after[axis]
                omega2[replicate, i, axis] = spin[axis]

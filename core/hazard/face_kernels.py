# SPDX-License-Identifier: GPL-3.0-or-later
"""The contacts of runs with faces: compiled kernels."""

from math import sqrt

import numpy as np

from ..compiled import kernel
from ..simulation.record_kernels import IMPACT, ON_GROUND, TREE


@kernel
def contacts(  # type: ignore[no-untyped-def]
    run, what, face, v2, omega2, v1, omega1, half_mass, half_inertia, seen, known, keys, values
):
    """Fill keys (k,) and values (k, 3) with the contacts of k records, as `cell_kernels.walk` does; returns how many.

    Parameters
    ----------
    run … omega1 : the records.
    half_mass, half_inertia : (n,) of the runs: energies are these times squares.
    seen : (faces,) work space: of runs that were looked at before, their numbers from 1 to `known`, or 0.
    """
    count = 0
    for i in range(len(run)):
        if face[i] < 0 or (what[i] != IMPACT and what[i] != ON_GROUND):
            continue
        mass, inertia, stamp = half_mass[run[i]], half_inertia[run[i]], np.int32(known + run[i] + 1)
        square = v1[i, 0] ** 2 + v1[i, 1] ** 2 + v1[i, 2] ** 2
        energy = mass * square + inertia * (omega1[i, 0] ** 2 + omega1[i, 1] ** 2 + omega1[i, 2] ** 2)
        if what[i] == ON_GROUND:
            then = v2[i, 0] ** 2 + v2[i, 1] ** 2 + v2[i, 2] ** 2
            spin = inertia * (omega2[i, 0] ** 2 + omega2[i, 1] ** 2 + omega2[i, 2] ** 2)
            square, energy = max(square, then), max(energy, mass * then + spin)
            last = i - 2 if what[i - 1] == TREE else i - 1
            before = what[last] == ON_GROUND or (what[last] == IMPACT and last == i - 1)
            if before and face[last] == face[i] and run[last] == run[i]:  # it has not left the face
                k = count - 1
                values[k, 0], values[k, 1] = max(values[k, 0], sqrt(square)), max(values[k, 1], energy)
                values[k, 2] = max(values[k, 2], mass * square)
                continue
        keys[count] = face[i] if seen[face[i]] == stamp else -1 - face[i]
        seen[face[i]] = stamp
        values[count, 0], values[count, 1], values[count, 2] = sqrt(square), energy, mass * square
        count += 1
    return count

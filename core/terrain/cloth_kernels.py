# SPDX-License-Identifier: GPL-3.0-or-later
"""A cloth that falls onto a floor of cells, compiled."""

from ..compiled import borrowing

STEP = 0.65
"""Of time, as in the paper."""
GRAVITY = 0.2
"""[m per step²], before the step."""
DAMPING = 0.99
STILL_M = 0.005
"""The cloth is at rest when no free particle moves further in a step [m]."""


@borrowing
def settle(cloth, before, held, floor, single, steps):  # type: ignore[no-untyped-def]
    """Let a cloth (rows, columns) of particles fall for some steps, or until it is at rest; whether it is.

    ``before`` are the heights a step earlier, ``held`` the particles that lie on the ``floor``: all three are changed.
    ``single`` is the part of the difference to a held neighbour that a particle makes up for in a step; between two
    free ones each takes half of that.
    """
    rows, columns = cloth.shape
    fall = GRAVITY * STEP * STEP
    for _ in range(steps):
        for i in range(rows):
            for j in range(columns):
                if not held[i, j]:
                    here = cloth[i, j]
                    cloth[i, j] = here + DAMPING * (here - before[i, j]) - fall
                    before[i, j] = here
        # Pairs along one axis at a time, even ones before odd ones, so that the order of particles does not show.
        for along in range(2):
            for odd in range(2):
                for i in range(odd if along == 0 else 0, rows - 1 if along == 0 else rows, 2 if along == 0 else 1):
                    first = odd if along == 1 else 0
                    for j in range(first, columns - 1 if along == 1 else columns, 2 if along == 1 else 1):
                        k, m = (i + 1, j) if along == 0 else (i, j + 1)
                        apart = cloth[k, m] - cloth[i, j]
                        if held[i, j]:
                            if not held[k, m]:
                                cloth[k, m] -= single * apart
                        elif held[k, m]:
                            cloth[i, j] += single * apart
                        else:
                            cloth[i, j] += 0.5 * single * apart
                            cloth[k, m] -= 0.5 * single * apart
        most = 0.0
        for i in range(rows):
            for j in range(columns):
                if not held[i, j]:
                    if cloth[i, j] <= floor[i, j]:
                        cloth[i, j] = floor[i, j]
                        held[i, j] = True
                    else:
                        most = max(most, abs(cloth[i, j] - before[i, j]))
        if most < STILL_M:
            return True
    return False

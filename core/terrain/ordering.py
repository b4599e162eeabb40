# SPDX-License-Identifier: GPL-3.0-or-later
"""An order of places in plan in which near ones follow each other."""

import numpy as np
from numpy.typing import NDArray

from ..vectors import Array


def along_curve(places: Array) -> NDArray[np.uint32]:
    """(n,) where places (n, 2) are on a curve that keeps near ones together.

    That is Morton's order: the bits of both coordinates, one after the other.
    """
    low = places.min(axis=0)
    cell = ((places - low) * (0xFFFF / max(float((places - low).max()), 1e-9))).astype(np.uint32)
    for shift, mask in ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555)):
        cell = (cell | (cell << np.uint32(shift))) & np.uint32(mask)
    curve: NDArray[np.uint32] = cell[:, 0] | (cell[:, 1] << np.uint32(1))
    return curve

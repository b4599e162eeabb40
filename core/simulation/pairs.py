# SPDX-License-Identifier: GPL-3.0-or-later
"""The index of triangles in the form in which flights look at it."""

import numpy as np
from numpy.typing import NDArray

from ..terrain.index import TriangleIndex


def make_pairs(index: TriangleIndex) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """`pairs` and `children` of `pair_kernels`: one memory, whose rows begin where two lines of the cache do."""
    from .pair_kernels import ROW, fill_pairs

    rows = max(1, len(index.count) // 2)
    memory = np.empty((rows + 1) * ROW, np.int32)
    begin = -memory.ctypes.data % (4 * ROW) // 4
    children = memory[begin : begin + rows * ROW].reshape(rows, ROW)
    pairs = children.view(np.float32)
    fill_pairs(*index.tree, pairs, children)
    return pairs, children

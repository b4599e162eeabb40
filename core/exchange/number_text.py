# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers as the shortest text that reads back as the same number."""

import numpy as np

COMPILED = 4000
"""Fewer numbers are written before compiled code is loaded."""


def shortest_texts(values: np.ndarray) -> list[str]:
    """(n,) floats, each as Python writes it; empty where it is NaN."""
    if values.size < COMPILED:
        return ["" if value != value else repr(value) for value in values.tolist()]
    from .shortest_kernels import LONGEST, write_shortest

    values = np.ascontiguousarray(values, dtype=np.float64)
    out = np.empty(values.size * LONGEST, np.uint8)
    size = write_shortest(values.view(np.uint64), out)
    return out[:size].tobytes().decode("ascii").split("\n")[:-1]

# SPDX-License-Identifier: GPL-3.0-or-later
"""Heights over a grid as triangles, for tests."""

from collections.abc import Callable

import numpy as np
from rockfall.core.georeference import GlobalShift
from rockfall.core.terrain.surface import Surface


def sheet(x: np.ndarray, y: np.ndarray, height: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> Surface:
    """Two triangles a cell of the lines x (m,) and y (n,), with the heights of a function of both (n, m)."""
    x, y = np.meshgrid(x, y)
    i = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (part.ravel() for part in (i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Surface(
        np.stack([x, y, height(x, y)], axis=-1).reshape(-1, 3), faces.astype(np.int32), GlobalShift(), "sheet"
    )

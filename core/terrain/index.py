# SPDX-License-Identifier: GPL-3.0-or-later
"""The one spatial index: a tree of boxes over the triangles, in plain arrays.

Rays, closest points and simulation walk the same tree with the helpers in `kernels`.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..errors import RockfallError
from ..vectors import Array

type Tree = tuple[Array, NDArray[np.int32], NDArray[np.int32], Array]


@dataclass(frozen=True, eq=False)
class TriangleIndex:
    """Bounding volume hierarchy over m triangles.

    Attributes
    ----------
    bounds : (k, 6) low and high corners of the nodes' boxes [m].
    first, count : (k,) triangles of a leaf; or the first of two children and 0.
    corners : (m, 3, 3) the triangles in the order of the leaves [m].
    face : (m,) the surface's face behind each of `corners`.
    """

    bounds: Array
    first: NDArray[np.int32]
    count: NDArray[np.int32]
    corners: Array
    face: NDArray[np.int32]

    @cached_property
    def tree(self) -> Tree:
        """What the kernels take."""
        return self.bounds, self.first, self.count, self.corners


def build_index(vertices: Array, faces: NDArray[np.int32]) -> TriangleIndex:
    """Build the index of triangles, by the surface area heuristic.

    Raises
    ------
    RockfallError : there are no faces.
    """
    from . import kernels

    m = len(faces)
    if not m:
        raise RockfallError("A surface without faces has no spatial index.")
    corners = vertices[faces]
    bounds = np.empty((2 * m, 6))
    first, count, order = (np.empty(size, np.int32) for size in (2 * m, 2 * m, m))
    nodes = kernels.build_tree(corners, bounds, first, count, order)
    return TriangleIndex(bounds[:nodes].copy(), first[:nodes].copy(), count[:nodes].copy(), corners[order], order)

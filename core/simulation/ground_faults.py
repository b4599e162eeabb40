# SPDX-License-Identifier: GPL-3.0-or-later
"""What a terrain of triangles may have that no slope has, counted; how blocks meet it is said with each."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..terrain.surface import Surface
from ..vectors import Array

SPIKE = np.radians(75.0)
"""A vertex above, or below, all its neighbours is a spike when every triangle around it is steeper than this."""


@dataclass(frozen=True)
class GroundFaults:
    """Counts of a surface.

    Attributes
    ----------
    triangles : all of them.
    twice : triangles with the three corners of another. Blocks meet them as one.
    opposed_edges : edges whose two triangles have opposite winding. Blocks meet both sides of a triangle alike.
    branching_edges : edges of more than two triangles. Blocks meet each of the triangles.
    border_edges : edges of one triangle: the outline, and the rims of holes. Blocks fall over them, and through holes.
    spikes : vertices that stick out upward or downward, see `SPIKE`. Blocks meet them as they are.
    """

    triangles: int
    twice: int
    opposed_edges: int
    branching_edges: int
    border_edges: int
    spikes: int


def ground_faults(surface: Surface) -> GroundFaults:
    """Count them."""
    faces, neighbours = surface.faces, surface.neighbours
    return GroundFaults(
        len(faces),
        _twice(faces),
        _opposed(faces, neighbours),
        _branching(faces, neighbours),
        int((neighbours == -1).sum()),
        _spikes(surface.vertices, faces, surface.face_normals),
    )


def _twice(faces: NDArray[np.int32]) -> int:
    corners = np.sort(faces, axis=1).astype(np.uint64)
    count = np.uint64(int(faces.max(initial=0)) + 1)
    # Two of the corners as one whole number, and the third with it as another: both fit into 64 bits.
    first, pair = corners[:, 0], corners[:, 1] * count + corners[:, 2]
    order = np.lexsort((pair, first))
    same = (np.diff(first[order]) == 0) & (np.diff(pair[order]) == 0)
    return int(same.sum())


def _opposed(faces: NDArray[np.int32], neighbours: NDArray[np.int32]) -> int:
    """Edges that both their triangles pass in the same direction; each is seen from both."""
    seen = 0
    for edge in range(3):
        own = np.flatnonzero(neighbours[:, edge] >= 0)
        start, end = faces[own, edge], faces[own, (edge + 1) % 3]
        other = faces[neighbours[own, edge]]
        for place in range(3):
            seen += int(((other[:, place] == start) & (other[:, (place + 1) % 3] == end)).sum())
    return seen // 2


def _branching(faces: NDArray[np.int32], neighbours: NDArray[np.int32]) -> int:
    face, edge = np.nonzero(neighbours == -2)
    ends = np.sort(np.stack([faces[face, edge], faces[face, (edge + 1) % 3]], axis=1), axis=1)
    return len(np.unique(ends, axis=0))


def _spikes(vertices: Array, faces: NDArray[np.int32], normals: Array) -> int:
    count = len(vertices)
    flattest, least, most = np.zeros(count), np.full(count, np.inf), np.full(count, -np.inf)
    level = np.nan_to_num(np.abs(normals[:, 2]))
    height = vertices[:, 2]
    for corner in range(3):
        at = faces[:, corner]
        np.maximum.at(flattest, at, level)
        for other in (faces[:, (corner + 1) % 3], faces[:, (corner + 2) % 3]):
            np.minimum.at(least, at, height[other])
            np.maximum.at(most, at, height[other])
    used = np.isfinite(least)
    sticks_out = (height > most) | (height < least)
    return int((used & sticks_out & (flattest < np.cos(SPIKE))).sum())

# SPDX-License-Identifier: GPL-3.0-or-later
"""A coarse copy of a large mesh, quick to make and to draw. For eyes only: nothing is measured on it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..vectors import Array, norm
from .surface import face_cross_products

FACES_PER_CELL = 2.0
"""Triangles of a sheet for each cell of the grid that it passes through."""
TRIES = 4
CLOSE = 0.1
SAMPLE = 50_000
MOST_CELLS = 1 << 20
"""Along one axis, so that a cell's number fits in 64 bits."""


@dataclass(frozen=True, eq=False)
class Coarse:
    """A coarse mesh.

    Attributes
    ----------
    vertices : (n, 3) [m].
    faces : (m, 3) wound as the original's.
    values : (n, k) means of the original's values.
    """

    vertices: Array
    faces: NDArray[np.int32]
    values: NDArray[Any]


def decimate(vertices: Array, faces: NDArray[np.int32], most_faces: int, values: Any = None) -> Coarse:
    """Merge all vertices within a cell of a grid into their mean, and drop the triangles that collapse.

    Parameters
    ----------
    vertices, faces : (n, 3) [m], (m, 3).
    most_faces : about how many triangles to keep; a mesh that has no more is returned as it is.
    values : (n, k) or (n,) of the vertices, to be averaged.

    Raises
    ------
    InputError : a number of triangles that is not positive.

    Notes
    -----
    Vertex clustering (Rossignac & Borrel 1993) with means as representatives. Linear in the number of triangles; the
    size of the cells follows from the number that is wanted.
    """
    if most_faces < 1:
        raise InputError(f"A mesh cannot be reduced to {most_faces} triangles", advice="Keep at least one")
    attached = np.zeros((len(vertices), 0)) if values is None else np.asarray(values).reshape(len(vertices), -1)
    if len(faces) <= most_faces:
        return Coarse(vertices, faces, attached)
    cell, cells = _cells(vertices, _first_size(vertices, faces, most_faces), most_faces)
    corners = cell[faces]
    a, b, c = corners.T
    corners = corners[(a != b) & (b != c) & (c != a)]
    corners = corners[_first_of_each(corners, cells)]
    used = np.zeros(cells, np.bool_)
    used[corners] = True
    number = (np.cumsum(used) - 1).astype(np.int32)
    count = np.maximum(np.bincount(cell, minlength=cells), 1)

    def mean(columns: NDArray[Any]) -> NDArray[Any]:
        sums = [np.bincount(cell, columns[:, k], cells)[used] for k in range(columns.shape[1])]
        return np.stack(sums, axis=1) / count[used, None] if sums else np.zeros((int(used.sum()), 0))

    return Coarse(mean(vertices), number[corners], mean(attached))


def _first_size(vertices: Array, faces: NDArray[np.int32], most_faces: int) -> float:
    """Side of the cells [m], from the area of some of the triangles."""
    some = faces[:: max(1, len(faces) // SAMPLE)]
    area = float(norm(face_cross_products(vertices, some)).mean()) / 2 * len(faces)
    return max(float(np.sqrt(FACES_PER_CELL * area / most_faces)), 1e-9)


def _cells(vertices: Array, size: float, most_faces: int) -> tuple[NDArray[np.int64], int]:
    """(n,) number of each vertex's cell, and how many cells have vertices; smaller or larger cells until it fits."""
    low = vertices.min(axis=0)
    extent = float((vertices.max(axis=0) - low).max())
    wanted = most_faces / FACES_PER_CELL
    for _ in range(TRIES):
        size = max(size, extent / MOST_CELLS)
        grid = ((vertices - low) / size).astype(np.int64)
        rows = grid.max(axis=0) + 1
        key = (grid[:, 0] * rows[1] + grid[:, 1]) * rows[2] + grid[:, 2]
        found = np.unique(key)
        if abs(len(found) / wanted - 1) < CLOSE:
            break
        size *= float(np.sqrt(len(found) / wanted))
    return np.searchsorted(found, key), len(found)


def _first_of_each(corners: NDArray[np.int64], cells: int) -> NDArray[np.int64]:
    """Numbers of the triangles that are the first with their three corners, whichever way they turn."""
    ordered = np.sort(corners, axis=1)
    if cells >= 2_000_000:  # the number of a triangle would not fit in 64 bits
        return np.arange(len(corners))
    key = (ordered[:, 0] * cells + ordered[:, 1]) * cells + ordered[:, 2]
    _, first = np.unique(key, return_index=True)
    return np.sort(first)

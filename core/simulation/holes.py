# SPDX-License-Identifier: GPL-3.0-or-later
"""Holes of a surface in plan: what its borders enclose, other than the outline."""

import numpy as np

from ..compiled import in_chunks
from ..terrain.surface import Surface
from ..vectors import Array, Mask


def rims_of_holes(surface: Surface) -> Array:
    """(e, 4) x, y of both ends of all border edges [m], but for those of the outline.

    Notes
    -----
    Border edges that hang together are one line; the outline is the one that reaches farthest. A hole that touches it
    is a bay.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    face, edge = np.nonzero(surface.neighbours == -1)
    if not face.size:
        return np.empty((0, 4))
    start, end = surface.faces[face, edge], surface.faces[face, (edge + 1) % 3]
    used, places = np.unique(np.concatenate([start, end]), return_inverse=True)
    one, other = np.split(places, 2)
    links = coo_array((np.ones(face.size, np.bool_), (one, other)), shape=(used.size, used.size))
    count, line = connected_components(links, directed=False)
    plan = surface.vertices[used, :2]
    low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    np.minimum.at(low, line, plan)
    np.maximum.at(high, line, plan)
    outline = np.argmax(((high - low) ** 2).sum(axis=1))
    inner = line[one] != outline
    return np.hstack([plan[one[inner]], plan[other[inner]]])


def within_rims(rims: Array, places: Array) -> Mask:
    """(n,) whether places (n, 2) are within the rim of a hole, by the even–odd rule."""
    from .polygon_kernels import inside_many

    result = np.zeros(len(places), np.bool_)
    if len(rims):
        points = np.ascontiguousarray(places)
        in_chunks(lambda i, j: inside_many(rims, points, result, i, j), len(points))
    return result

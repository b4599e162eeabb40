# SPDX-License-Identifier: GPL-3.0-or-later
"""Several tiles of a terrain become one surface."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..georeference import GlobalShift
from ..vectors import Array, Mask
from .cloud import Cloud
from .scan_colours import joined_colours
from .surface import Surface

SAME_M = 1e-3
"""Border points of two tiles that are this close are the same point, as files and single precision round them."""
SAME_PART = 1e-5
"""They are never further apart than this part of the whole terrain, so that a small model is not welded shut."""


def moved[T: Surface | Cloud](terrain: T, shift: GlobalShift) -> T:
    """The same terrain in local coordinates of another shift."""
    offset = terrain.shift.vector - shift.vector
    if not offset.any():
        return terrain if terrain.shift == shift else replace(terrain, shift=shift)
    if isinstance(terrain, Cloud):
        return replace(terrain, points=terrain.points + offset, shift=shift)
    left_out = terrain.left_out + offset
    return replace(terrain, vertices=terrain.vertices + offset, left_out=left_out, shift=shift)


def join(surfaces: Sequence[Surface]) -> Surface:
    """One surface of several tiles, in the first one's shift; a single tile is returned as it is.

    Tiles that were cut from one mesh are sewn together again where their borders share points, so that normals and
    neighbourhoods reach across. Nothing is filled where tiles leave a gap, and tiles that overlap stay two sheets.

    Raises
    ------
    InputError : there is no tile.
    """
    if not surfaces:
        raise InputError("There is no terrain to join")
    if len(surfaces) == 1:
        return surfaces[0]
    tiles = [moved(surface, surfaces[0].shift) for surface in surfaces]
    starts = np.cumsum([0, *(len(tile.vertices) for tile in tiles)])
    vertices = np.concatenate([tile.vertices for tile in tiles])
    faces = np.concatenate([tile.faces + np.int32(start) for tile, start in zip(tiles, starts[:-1], strict=True)])
    same = _same_points(tiles, starts)
    colours, lost = joined_colours([(tile.colours, tile.name) for tile in tiles])
    vertices, faces, kept = _merged(vertices, faces, same)
    said = [f"{tile.name}: {sentence}" for tile in tiles for sentence in tile.summary]
    said.append(f"{len(tiles)} tiles are one surface of {len(faces):,} faces.")
    if sewn := int((~kept).sum()):
        said.append(f"Their borders share {sewn:,} points, which are one each.")
    if lost_faces := sum(len(tile.faces) for tile in tiles) - len(faces):
        said.append(f"Dropped {lost_faces:,} faces that were as narrow as the gap between the tiles.")
    said += [lost] if lost else []
    name, left_out = ", ".join(tile.name for tile in tiles), np.concatenate([tile.left_out for tile in tiles])
    return Surface(
        vertices, faces, tiles[0].shift, name, tuple(said), left_out, any(tile.turned for tile in tiles),
        None if colours is None else colours[kept],
    )  # fmt: skip


def _same_points(tiles: Sequence[Surface], starts: NDArray[np.int64]) -> NDArray[np.int64]:
    """(p, 2) numbers of border points that are one point of two tiles."""
    from scipy.spatial import cKDTree

    low = np.min([tile.bounds[0] for tile in tiles], axis=0)
    high = np.max([tile.bounds[1] for tile in tiles], axis=0)
    tolerance = min(SAME_M, SAME_PART * float((high - low).max()))
    number, owner, place = [], [], []
    for i, tile in enumerate(tiles):
        near = np.zeros(len(tile.vertices), np.bool_)
        for j, other in enumerate(tiles):
            if i != j:
                first, last = other.bounds + np.array([[-tolerance], [tolerance]])
                near |= ((tile.vertices >= first) & (tile.vertices <= last)).all(axis=1)
        which = np.flatnonzero(near & _on_border(tile)) if near.any() else np.empty(0, np.int64)
        number.append(which + starts[i])
        owner.append(np.full(len(which), i))
        place.append(tile.vertices[which])
    every, tile_of = np.concatenate(number), np.concatenate(owner)
    if len(every) < 2:
        return np.empty((0, 2), np.int64)
    pairs = cKDTree(np.concatenate(place)).query_pairs(tolerance, output_type="ndarray")
    return every[pairs[tile_of[pairs[:, 0]] != tile_of[pairs[:, 1]]]]


def _on_border(surface: Surface) -> Mask:
    border = np.zeros(len(surface.vertices), np.bool_)
    face, edge = np.nonzero(surface.neighbours == -1)
    border[surface.faces[face, edge]] = border[surface.faces[face, (edge + 1) % 3]] = True
    return border


def _merged(
    vertices: Array, faces: NDArray[np.int32], same: NDArray[np.int64]
) -> tuple[Array, NDArray[np.int32], Mask]:
    """Without the second of each pair of points; and which are kept."""
    kept = np.ones(len(vertices), np.bool_)
    if not len(same):
        return vertices, faces, kept
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    n = len(vertices)
    graph = coo_array((np.ones(len(same), np.bool_), (same[:, 0], same[:, 1])), shape=(n, n))
    _, group = connected_components(graph, directed=False)
    _, first = np.unique(group, return_index=True)
    kept[:] = False
    kept[first] = True
    number = (np.cumsum(kept) - 1).astype(np.int32)
    faces = number[first[group]][faces]
    real = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    return vertices[kept], faces[real], kept

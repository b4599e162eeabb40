# SPDX-License-Identifier: GPL-3.0-or-later
"""A cloud that was meshed in plan is meshed anew, in space, where it lies above itself."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..vectors import Array, Mask, norm
from .overhangs import CELL, Overhangs
from .sheet_planes import outward_normals, smoothed
from .sheets import surface_in_space
from .triangulation import MAX_EDGE_SPACINGS, Meshed

AROUND_CELLS = 2
"""So many cells about the overhangs are meshed in space at least."""
SEWN_CELLS = 8
"""Within so many more lies the border with the mesh in plan."""
BEYOND_CELLS = 4
"""So many more are looked at, so that nothing ends at the border."""
STEEP_CELLS, WALL_CELLS = 2.5, 25
"""The wall under an overhang belongs to it as far as this: columns higher than so many cells, within so many."""
REACH = WALL_CELLS + AROUND_CELLS + SEWN_CELLS + BEYOND_CELLS
UNMOVED = 1e-6
"""Points that went less far than this part of a cell are where they were."""
PIECE = 64
"""Pieces of fewer faces that hang together with nothing are no surface."""
MOST_POINTS = 1_000_000
"""Overhangs of more points are left as they are: their tetrahedra would take gigabytes."""


@dataclass(frozen=True, eq=False)
class _Place:
    """The points about some overhangs.

    Attributes
    ----------
    number : (k,) of the points in the cloud.
    inside, sewn : (k,) those that are meshed in space whatever happens, those between which the border may lie.
    lowest : (k,) those with nothing below them.
    """

    number: NDArray[np.int64]
    inside: Mask
    sewn: Mask
    lowest: Mask


def mesh_folds(points: Array, meshed: Meshed, overhangs: Overhangs, max_edge_m: float | None) -> tuple[Meshed, str]:
    """The mesh with its overhangs, and a sentence on them.

    Parameters
    ----------
    points : (n, 3) of the cloud.
    meshed : in plan, of `mesh_cloud`.
    max_edge_m : longest edge [m]; `MAX_EDGE_SPACINGS` times the mean point spacing when None.

    Notes
    -----
    Faces in plan are kept up to a border of edges that both meshes have, so that the whole is sewn, and no point away
    from overhangs moves. Beyond it are the faces in space.
    """
    limit = MAX_EDGE_SPACINGS * overhangs.cell_m / CELL if max_edge_m is None else max_edge_m
    n, moved = len(points), points.copy()
    in_plan = meshed.origin[meshed.faces]
    kept, in_space = np.ones(len(in_plan), np.bool_), []
    too_many = 0
    for cells in _groups(overhangs.cells):
        place = _place(points, cells, overhangs)
        if len(place.number) > MOST_POINTS:
            too_many = max(too_many, len(place.number))
            continue
        spots = smoothed(points[place.number], place.inside)
        normals = outward_normals(spots, place.lowest)
        faces = place.number[surface_in_space(spots, normals, limit)]
        replaced, new = _sewn(n, in_plan, faces, place)
        moved[place.number[place.inside]] = spots[place.inside]
        kept[replaced] = False
        in_space.append(new)
    if too_many:
        sentence = f"An overhang has {too_many:,} points, more than can be meshed in space ({MOST_POINTS:,})"
        return meshed, f"{sentence}: it is meshed in plan, as steep spikes. Thin the cloud, or cut it."
    new = np.concatenate(in_space)
    number = np.full(n, -1, np.int64)
    number[meshed.origin] = np.arange(len(meshed.origin))
    more = np.unique(new[number[new] < 0])
    number[more] = len(meshed.origin) + np.arange(len(more))
    origin = np.concatenate([meshed.origin, more])
    faces = np.concatenate([meshed.faces[kept], number[new].astype(np.int32)])
    way = norm(moved - points)
    way = way[way > UNMOVED * overhangs.cell_m]
    said = f"There {len(new):,} triangles are meshed in space, the rest in plan"
    if len(way):
        typical = 100 * float(np.median(way))
        said += f"; {len(way):,} points were moved by {typical:.2g} cm (median) onto the planes of their neighbours"
    return replace(meshed, points=moved[origin], faces=np.ascontiguousarray(faces), origin=origin), f"{said}."


def _groups(cells: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Cells (k, 2) of overhangs, those together whose surroundings touch."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    blocks, block = np.unique(cells // (2 * REACH + 1), axis=0, return_inverse=True)
    pairs = cKDTree(blocks).query_pairs(1.5, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs), np.bool_), (pairs[:, 0], pairs[:, 1])), shape=(len(blocks), len(blocks)))
    count, group = connected_components(graph, directed=False)
    return [cells[group[block.ravel()] == i] for i in range(count)]


def _place(points: Array, cells: NDArray[np.int64], overhangs: Overhangs) -> _Place:
    from scipy.ndimage import binary_dilation, binary_propagation

    low, high = cells.min(axis=0) - REACH, cells.max(axis=0) + REACH
    column = np.floor((points[:, :2] - overhangs.origin) / overhangs.cell_m).astype(np.int64)
    number = np.flatnonzero(((column >= low) & (column <= high)).all(axis=1))
    i, j = (column[number] - low).T
    shape = tuple(high - low + 1)
    bottom, top = np.full(shape, np.inf), np.full(shape, -np.inf)
    np.minimum.at(bottom, (i, j), points[number, 2])
    np.maximum.at(top, (i, j), points[number, 2])
    steep = top - bottom > STEEP_CELLS * overhangs.cell_m
    hung = np.zeros(shape, np.bool_)
    hung[tuple((cells - low).T)] = True
    square = np.ones((3, 3), np.bool_)

    def about(which: Mask, count: int) -> Mask:
        return np.asarray(binary_dilation(which, square, count))

    wall = binary_propagation(about(hung, 1), square, mask=(steep & about(hung, WALL_CELLS)) | about(hung, 1))
    inside = about(wall, AROUND_CELLS)
    sewn = about(inside, SEWN_CELLS)
    looked_at = about(sewn, BEYOND_CELLS)[i, j]
    number, i, j = number[looked_at], i[looked_at], j[looked_at]
    return _Place(number, inside[i, j], sewn[i, j], points[number, 2] < bottom[i, j] + overhangs.cell_m)


def _sewn(
    n: int, in_plan: NDArray[np.int64], in_space: NDArray[np.int64], place: _Place
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Numbers of the faces in plan that go, and the faces in space that come, of those of a place."""
    inside, sewn = np.zeros(n, np.bool_), np.zeros(n, np.bool_)
    inside[place.number[place.inside]] = sewn[place.number[place.sewn]] = True
    near = np.flatnonzero(sewn[in_plan].any(axis=1))
    plan = in_plan[near]
    plan_edges, space_edges = _edges(plan, n), _edges(in_space, n)
    common = np.intersect1d(_shared(plan_edges, n), _shared(space_edges, n), assume_unique=True)
    piece = _pieces(plan_edges, n, common)
    goes = np.zeros(int(piece.max()) + 1, np.bool_)
    goes[piece[inside[plan].any(axis=1)]] = True
    goes = goes[piece]
    ends = np.isin(plan_edges, common).reshape(-1, 3)
    border = np.setdiff1d(
        plan_edges.reshape(-1, 3)[goes[:, None] & ends], _turned(plan_edges.reshape(-1, 3)[goes].ravel(), n)
    )
    within = np.zeros(n, np.bool_)
    within[plan[goes]] = True
    meshed = np.zeros(n, np.bool_)
    meshed[in_plan] = True
    within |= inside & ~meshed
    comes = in_space[within[in_space].all(axis=1)]
    edges = _edges(comes, n)
    piece = _pieces(edges, n, np.concatenate([border, _turned(border, n)]))
    sizes = np.bincount(piece)
    large = sizes >= PIECE
    outer, inner = (np.isin(edges, which).reshape(-1, 3).any(axis=1) for which in (_turned(border, n), border))
    kept = large.copy()
    kept[piece[outer]] = False
    kept[piece[inner]] = True
    return near[goes], comes[kept[piece]]


def _edges(faces: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    """(3 m,) the edges of faces, each with its sense, as one number."""
    return (faces * n + np.roll(faces, -1, axis=1)).ravel()


def _turned(edges: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    return edges % n * n + edges // n


def _shared(edges: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    """Those edges along which two faces agree, and no third is."""
    single, count = np.unique(edges, return_counts=True)
    single = single[count == 1]
    return np.intersect1d(single, _turned(single, n), assume_unique=True)


def _pieces(edges: NDArray[np.int64], n: int, apart: NDArray[np.int64]) -> NDArray[np.int64]:
    """(m,) the piece of each face: faces are together over every edge that is not one of those that part them."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    face = np.arange(len(edges)) // 3
    joins = ~np.isin(edges, apart)
    either = np.minimum(edges, _turned(edges, n))
    _, edge = np.unique(either[joins], return_inverse=True)
    m, k = len(edges) // 3, int(edge.max(initial=-1)) + 1
    graph = coo_array((np.ones(len(edge), np.bool_), (face[joins], m + edge)), shape=(m + k, m + k))
    return connected_components(graph, directed=False)[1][:m].astype(np.int64)

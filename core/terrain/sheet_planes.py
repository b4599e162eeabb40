# SPDX-License-Identifier: GPL-3.0-or-later
"""Planes of a cloud's sheets: the scanner's noise taken out of its points, normals that agree from point to point."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..vectors import Array, Mask, dot

AROUND = 16
"""So many points make the plane of a point."""
TIMES = 2
"""So often points are moved onto planes, which are fitted anew each time."""
CREASE = 3.0
"""A plane that its points leave by so many times (squared) what is usual lies over a crease; and a point that is so
many times the usual away from a plane is not of it."""
FLAT = 0.15
"""Points are moved onto a plane when they leave it by less than this part (squared) of how they spread along it."""
LEVEL, ON_THE_GROUND = 0.5, 0.2
"""Points whose normals have a larger part up or down tell which; a sheet with a smaller part of such points on the
ground hangs."""
NEXT = 10
"""Normals are carried over to so many neighbours."""
CHUNK = 50_000


@dataclass(frozen=True, eq=False)
class _Planes:
    """Plane of each of n points: normal and middle (n, 3), mean squared distance across it and along it [m²], and the
    points (n, `AROUND`) that make it."""

    normal: Array
    middle: Array
    across: Array
    along: Array
    near: NDArray[np.int32]


def smoothed(points: Array, which: Mask) -> Array:
    """The same points (n, 3), those of a mask moved onto the planes of their neighbours.

    A point at a crease is moved onto the best of the planes beside it that it lies on, or stays: a plane over both
    sides would round the crease.
    """
    for _ in range(TIMES):
        planes = _planes(points)
        usual = float(np.median(planes.across))
        best, meant = np.arange(len(points)), planes.across <= CREASE * usual
        creased = np.flatnonzero(which & ~meant)
        for start in range(0, len(creased), CHUNK):
            part = creased[start : start + CHUNK]
            near = planes.near[part]
            away2 = dot(points[part, None] - planes.middle[near], planes.normal[near]) ** 2
            cost = np.where(away2 < CREASE**2 * usual, planes.across[near], np.inf)
            best[part] = near[np.arange(len(part)), cost.argmin(axis=1)]
            meant[part] = np.isfinite(cost.min(axis=1))
        meant &= which & (planes.across[best] < FLAT * planes.along[best])
        normal = planes.normal[best]
        away = np.where(meant, dot(points - planes.middle[best], normal), 0.0)
        points = points - away[:, None] * normal
    return points


def outward_normals(points: Array, lowest: Mask) -> Array:
    """Normals (n, 3) of a cloud's sheets, out of the ground.

    Parameters
    ----------
    lowest : (n,) points with nothing below them.

    Notes
    -----
    The sense is carried from neighbour to neighbour, first where normals are most alike (Hoppe et al. 1992: along a
    minimum spanning tree), so over walls and the edges of roofs. What lies below everything faces up; a sheet that
    lies above others altogether, with nothing that connects them, is the underside of what was not seen from above.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree

    planes = _planes(points)
    n, normal, near = len(points), planes.normal, planes.near[:, 1 : NEXT + 1]
    one, other = np.repeat(np.arange(n), near.shape[1]), near.ravel()
    unlike = 1.0 + 1e-6 - np.abs(dot(normal[one], normal[other]))
    _, sheet = connected_components(coo_array((unlike, (one, other)), shape=(n, n)), directed=False)
    _, roots = np.unique(sheet, return_index=True)
    rows, columns = np.r_[one, np.full(len(roots), n)], np.r_[other, roots]
    graph = coo_array((np.r_[unlike, np.ones(len(roots))], (rows, columns)), shape=(n + 1, n + 1))
    order, before = breadth_first_order(minimum_spanning_tree(graph.tocsr()), n, directed=False)
    order = order[1:]
    before = before[order]
    same = np.ones(len(order), np.bool_)
    inner = before < n
    same[inner] = dot(normal[order[inner]], normal[before[inner]]) >= 0
    sense = [True] * (n + 1)
    for point, parent, kept in zip(order.tolist(), before.tolist(), same.tolist(), strict=True):
        sense[point] = sense[parent] == kept
    normal = np.where(np.array(sense[:n])[:, None], normal, -normal)
    level = np.abs(normal[:, 2]) > LEVEL
    facing = np.sign(normal[:, 2]) * level
    below, total = np.bincount(sheet, level & lowest), np.bincount(sheet, level)
    up = np.where(below > ON_THE_GROUND * total, np.bincount(sheet, facing * lowest), -np.bincount(sheet, facing))
    return np.where((up < 0)[sheet][:, None], -normal, normal)


def _planes(points: Array) -> _Planes:
    from scipy.spatial import cKDTree

    n = len(points)
    count = min(AROUND, n)
    tree = cKDTree(points)
    found = _Planes(np.empty((n, 3)), np.empty((n, 3)), np.empty(n), np.empty(n), np.empty((n, count), np.int32))
    for start in range(0, n, CHUNK):
        part = slice(start, start + CHUNK)
        near = tree.query(points[part], k=count)[1]
        around = points[near]
        middle = around.mean(axis=1)
        away = around - middle[:, None]
        spread, directions = np.linalg.eigh(np.einsum("nki,nkj->nij", away, away))
        found.near[part], found.middle[part], found.normal[part] = near, middle, directions[:, :, 0]
        found.across[part], found.along[part] = np.maximum(spread[:, 0], 0.0) / count, spread[:, 1] / count
    return found

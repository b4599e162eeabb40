# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a cloud has overhangs: two sheets of it over one place in plan."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..georeference import GlobalShift
from ..vectors import Array, Mask, dot
from .cloud import build_point_index

CELL = 2.0
"""Side of the columns in which points are compared, in spacings."""
APART = 4.0
"""Two sheets are further apart than so many cells, so that a wall and the ground at its foot are not two."""
AROUND = 32
"""So many points make the plane of a sheet: enough that the scanner's noise does not make it thick."""
FLAT = 0.15
"""They are a sheet when they spread across it by less than this part (squared) of how they spread along it."""
SPARSE = 16
"""So many columns for each point are too many to have them all in memory."""
TOGETHER = 16
"""So many cells that touch each other are an overhang; single ones are branches and birds."""


@dataclass(frozen=True, eq=False)
class Overhangs:
    """Where a cloud lies above itself.

    Attributes
    ----------
    patches : number of separate places.
    area_m2 : in plan.
    share : part of the cloud's area in plan.
    height_m : greatest clearance between the two sheets.
    place : (3,) point on the upper sheet in the middle of the largest patch, local coordinates [m].
    cells : (k, 2) the columns in plan, counted from their origin.
    cell_m, origin : side of a column and, in local coordinates, corner of the first [m].
    """

    patches: int
    area_m2: float
    share: float
    height_m: float
    place: Array
    cells: NDArray[np.int64]
    cell_m: float
    origin: Array

    def sentence(self, shift: GlobalShift) -> str:
        """What a user has to know, with a place in survey coordinates."""
        x, y, _ = shift.to_survey(self.place)
        number = "an overhang" if self.patches == 1 else f"{self.patches:,} overhangs"
        where = "near" if self.patches == 1 else "the largest near"
        return (
            f"The cloud has {number} over {self.area_m2:,.3g} m² ({100 * self.share:.2g} % of its area in plan), up to "
            f"{self.height_m:.2g} m high, {where} ({x:.0f}, {y:.0f})."
        )


def find_overhangs(points: Array) -> Overhangs | None:
    """Overhangs of a cloud (n, 3) in local coordinates [m]; None when it has none.

    Notes
    -----
    Neighbours in height within a column of the cloud are two sheets when the points about each lie in a plane, and each
    of the two is far from the plane of the other. So a steep wall is one sheet, however high and with whatever holes;
    so are a wall and the ground at its foot; and leaves lie in no plane.
    """
    if len(points) < AROUND:
        return None
    spacing = build_point_index(points).spacing_m
    if not 0 < spacing < np.inf:
        return None
    cell = CELL * spacing
    cells = np.floor((points[:, :2] - points[:, :2].min(axis=0)) / cell).astype(np.int64)
    columns, high = _columns(cells, points[:, 2], APART * cell)
    order = high[np.lexsort((points[high, 2], cells[high, 1], cells[high, 0]))]
    cells, ordered = cells[order], points[order]
    same = (cells[1:] == cells[:-1]).all(axis=1)
    gaps = np.flatnonzero(same & (np.diff(ordered[:, 2]) > APART * cell))
    gaps = gaps[_two_sheets(points, ordered[gaps], ordered[gaps + 1], APART * cell)] if len(gaps) else gaps
    patch, sizes = _patches(cells[gaps])
    if not (sizes >= TOGETHER).any():
        return None
    kept = sizes[patch] >= TOGETHER
    gaps, patch = gaps[kept], patch[kept]
    upper = ordered[gaps + 1]
    in_largest = upper[patch == sizes.argmax()]
    middle = in_largest[np.abs(in_largest - np.median(in_largest, axis=0)).sum(axis=1).argmin()]
    hung = np.unique(cells[gaps], axis=0)
    return Overhangs(
        int((sizes >= TOGETHER).sum()),
        len(hung) * cell**2,
        len(hung) / columns,
        float((upper[:, 2] - ordered[gaps, 2]).max()),
        middle,
        hung,
        cell,
        points[:, :2].min(axis=0),
    )


def _columns(cells: NDArray[np.int64], z: Array, apart_m: float) -> tuple[int, NDArray[np.int64]]:
    """How many columns of cells (n, 2) have points; the points in those that reach over more than a height."""
    from .triangle_kernels import heights_in

    size = cells.max(axis=0) + 1
    number = cells[:, 0] * size[1] + cells[:, 1]
    if size.prod() > SPARSE * len(cells):  # a few points lie far off
        number = np.unique(number, return_inverse=True)[1]
    low = np.full(int(number.max()) + 1, np.inf)
    high = -low
    heights_in(number, z, low, high)
    return int((high >= low).sum()), np.flatnonzero((high - low > apart_m)[number])


def _two_sheets(points: Array, lower: Array, upper: Array, apart_m: float) -> Mask:
    """(k,) whether points one above the other belong to two sheets that are so far apart."""
    from scipy.spatial import cKDTree

    tree = cKDTree(points)

    def planes(places: Array) -> tuple[Array, Array, Mask]:
        around = points[tree.query(places, k=AROUND)[1]]
        middle = around.mean(axis=1)
        away = around - middle[:, None]
        spread, directions = np.linalg.eigh(np.einsum("nki,nkj->nij", away, away))
        return middle, directions[:, :, 0], spread[:, 0] < FLAT * spread[:, 1]

    (floor, floor_normal, floor_flat), (roof, roof_normal, roof_flat) = planes(lower), planes(upper)
    over_floor, under_roof = np.abs(dot(upper - floor, floor_normal)), np.abs(dot(lower - roof, roof_normal))
    return np.asarray(floor_flat & roof_flat & (over_floor > apart_m) & (under_roof > apart_m))


def _patches(cells: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(k,) the patch of cells that touch each other, corners included, to which each belongs; the cells in each."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    if not len(cells):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    single, number = np.unique(cells, axis=0, return_inverse=True)
    pairs = cKDTree(single).query_pairs(1.5, output_type="ndarray")
    n = len(single)
    graph = coo_array((np.ones(len(pairs), np.bool_), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    count, patch = connected_components(graph, directed=False)
    return patch[number.ravel()].astype(np.int64), np.bincount(patch, minlength=count)

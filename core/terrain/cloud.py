# SPDX-License-Identifier: GPL-3.0-or-later
"""The terrain as points alone: a cloud in local coordinates, its spatial index, its spacing, heights above it."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..compiled import as_rows, in_chunks
from ..errors import InputError, RockfallError
from ..georeference import GlobalShift
from ..vectors import Array

type PointTree = tuple[NDArray[np.float32], NDArray[np.int32], NDArray[np.int32], Array, float]

SAMPLES, ENOUGH = 2000, 12
"""The spacing is taken about so many points, from discs that hold so many."""
COLUMN = 2.0
"""The points below a place are those within so many spacings in plan."""

PLANE = 2.5
"""Points within so many spacings make a local plane: some twenty."""


@dataclass(frozen=True, eq=False)
class PointIndex:
    """Bounding volume hierarchy over k points.

    Attributes
    ----------
    nodes : (n, 16) see `point_kernels`.
    first, count : (n,) points of a leaf; or the first of two children and 0.
    points : (k, 3) in the order of the leaves [m].
    number : (k,) the cloud's point behind each of them.
    spacing_m : side of the square that a point has to itself on the surface [m]: the median; inf for a single point.
    """

    nodes: NDArray[np.float32]
    first: NDArray[np.int32]
    count: NDArray[np.int32]
    points: Array
    number: NDArray[np.int32]
    spacing_m: float

    @property
    def tree(self) -> PointTree:
        """What the kernels take."""
        return self.nodes, self.first, self.count, self.points, self.spacing_m


def build_point_index(points: Array) -> PointIndex:
    """Build the index of points.

    Raises
    ------
    RockfallError : there are no points.

    Notes
    -----
    The spacing is √(π R²/n) with the radius R of a ball about a point that holds n ≥ `ENOUGH` points, so that steep
    faces count as level ground does: the median over `SAMPLES` points.
    """
    from . import point_kernels

    k = len(points)
    if not k:
        raise RockfallError("A cloud without points has no spatial index.")
    nodes, links = _node_memory(2 * max(1, -(-k // (point_kernels.LEAF_POINTS // 2))))
    order, ordered = np.empty(k, np.int32), np.array(points, dtype=np.float64, order="C")
    used = point_kernels.build_point_tree(ordered, nodes, links, order)
    tree = nodes[:used], links[:used, 0], links[:used, 1]
    places = np.ascontiguousarray(ordered[:: max(1, k // SAMPLES)])
    spacing = np.full(len(places), np.inf)
    if k > 1:
        size = (tree[0][0, 3:6] - tree[0][0, :3]).astype(np.float64)
        reach = max(float(np.sqrt(max(size[0] * size[1], size.max() ** 2 * 1e-3) / k)), 1e-9)
        point_kernels.spacings((*tree, ordered, 0.0), places, min(ENOUGH, k), reach, spacing)
    return PointIndex(*tree, ordered, order, float(np.median(spacing)))


def _node_memory(size: int) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Nodes (size, 16) of a line of the processor's cache each, and the last two columns as whole numbers."""
    memory = np.empty(64 * size + 64, np.uint8)
    start = -memory.ctypes.data % 64
    nodes = memory[start : start + 64 * size].view(np.float32).reshape(-1, 16)
    return nodes, nodes.view(np.int32)[:, 14:]


@dataclass(frozen=True, eq=False)
class Cloud:
    """A terrain of points without a surface between them.

    Attributes
    ----------
    points : (k, 3) local coordinates [m].
    shift : from local to survey coordinates.
    name : of the file, for people.
    summary : what the reader did, in sentences.
    """

    points: Array
    shift: GlobalShift
    name: str
    summary: tuple[str, ...] = ()

    @cached_property
    def bounds(self) -> Array:
        """(2, 3) lowest and highest coordinates [m]."""
        return np.stack([self.points.min(axis=0), self.points.max(axis=0)])

    @cached_property
    def index(self) -> PointIndex:
        """The spatial index; built when first needed."""
        return build_point_index(self.points)

    @property
    def spacing_m(self) -> float:
        """Side of the square that a point has to itself on the surface [m]: the median over the cloud."""
        return self.index.spacing_m


def heights_above_points(cloud: Cloud, places: Any) -> Array:
    """Vertical clearance of (n, 3) places [m] over the points, (n,): NaN beside them in plan.

    Notes
    -----
    The next point below a place, within `COLUMN` spacings in plan (three times as far where there is none), tells which
    surface is meant; the height is counted from the plane fitted to the points of that column. A cloud does not
    tell what is inside: a place with points above it and none below is taken to be in the ground, and its height is
    negative, how far it has to rise to get out. Under an overhang the points of the floor are below, so it is in the
    open.

    Raises
    ------
    InputError : a coordinate that is not finite.
    """
    from . import point_kernels

    rows = _finite(places)
    result, reach = np.empty(len(rows)), COLUMN * cloud.spacing_m
    tree = cloud.index.tree
    in_chunks(lambda i, j: point_kernels.heights_many(tree, rows, reach, result, i, j), len(rows))
    return result


def local_planes(cloud: Cloud, places: Any) -> tuple[Array, Array]:
    """Normals (n, 3) of the cloud at places (n, 3) on it, and the area [m²] (n,) that a point has to itself there.

    Both of the points within `PLANE` spacings, or further where they are few; NaN where they are too few for a plane.
    A cloud does not tell which side is the open one: normals point upwards, so that nothing dips more than 90°.

    Raises
    ------
    InputError : a coordinate that is not finite.
    """
    from . import point_kernels

    rows = _finite(places)
    normals, areas = np.empty((len(rows), 3)), np.empty(len(rows))
    tree, reach = cloud.index.tree, PLANE * cloud.spacing_m
    in_chunks(lambda i, j: point_kernels.planes_many(tree, rows, reach, normals, areas, i, j), len(rows))
    return normals, areas


def nearest_points(cloud: Cloud, places: Any) -> tuple[Array, NDArray[np.int64]]:
    """(n,) distance [m] of places (n, 3) from the nearest point, and (n,) which.

    Raises
    ------
    InputError : a coordinate that is not finite.
    """
    from . import point_kernels

    rows = _finite(places)
    distance, place = np.empty(len(rows)), np.empty(len(rows), np.int64)
    tree = cloud.index.tree
    in_chunks(lambda i, j: point_kernels.nearest_many(tree, rows, distance, place, i, j), len(rows))
    return distance, cloud.index.number[place].astype(np.int64)


def _finite(places: Any) -> Array:
    rows = as_rows(places)
    wrong = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if wrong.size:
        raise InputError(f"The place {wrong[0]} is not finite: {rows[wrong[0]].tolist()}", advice="Leave it out")
    return rows

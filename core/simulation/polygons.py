# SPDX-License-Identifier: GPL-3.0-or-later
"""Polygons in plan, with holes: release areas and zones."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from ..compiled import in_chunks
from ..errors import InputError
from ..vectors import Array, Indices, Mask


@dataclass(frozen=True, eq=False)
class Polygon:
    """What is inside of an odd number of rings, in plan.

    Attributes
    ----------
    name : for people; several may share one.
    rings : each (k, 2), local [m]: outlines and holes, each closed by itself.
    number : of the feature in its file, from 1; 0 without one.

    Raises
    ------
    InputError : a ring of fewer than three places, a coordinate that is not finite, no area, rings that cross
        themselves or each other.
    """

    name: str
    rings: tuple[Array, ...]
    number: int = 0

    def __post_init__(self) -> None:
        from .polygon_kernels import first_crossing

        what = f"The polygon {self.name}" if self.name else "The polygon"
        for ring in self.rings:
            if not np.isfinite(ring).all():
                raise InputError(f"{what} has a coordinate that is not finite", advice="Correct it")
            if len(np.unique(ring, axis=0)) < 3:
                raise InputError(f"{what} has fewer than three corners", advice="Give at least three different places")
        if not self.rings or not self.area_m2 > 1e-12 * float(np.square(np.ptp(self.edges[:, :2], axis=0)).sum()):
            raise InputError(f"{what} has no area: its corners are on a line", advice="Give corners around an area")
        if first_crossing(self.edges)[0] >= 0:
            raise InputError(f"{what} crosses itself", advice="Give the corners in their order around the area")

    @cached_property
    def edges(self) -> Array:
        """(e, 4) x, y of both ends of all sides that have a length."""
        sides = [np.hstack([ring, np.roll(ring, -1, axis=0)]) for ring in self.rings]
        every = np.concatenate(sides)
        return np.ascontiguousarray(every[(every[:, :2] != every[:, 2:]).any(axis=1)])

    @cached_property
    def pieces(self) -> Array:
        """(t, 6) the trapezoids between all heights of corners that make it up; see `polygon_kernels.clip`."""
        edges = self.edges[self.edges[:, 1] != self.edges[:, 3]]
        upward = edges[:, 1] < edges[:, 3]
        x0, x1 = np.where(upward, edges[:, 0], edges[:, 2]), np.where(upward, edges[:, 2], edges[:, 0])
        y0, y1 = np.minimum(edges[:, 1], edges[:, 3]), np.maximum(edges[:, 1], edges[:, 3])
        pace = (x1 - x0) / (y1 - y0)
        heights = np.unique(self.edges[:, [1, 3]])
        found = []
        for low, high in pairwise(heights.tolist()):
            over = np.flatnonzero((y0 <= low) & (y1 >= high))
            left, right = (x0[over] + pace[over] * (height - y0[over]) for height in (low, high))
            sides = over[np.argsort(left + right, kind="stable")]
            ends = {int(edge): (a, b) for edge, a, b in zip(over, left, right, strict=True)}
            for one, other in zip(sides[0::2].tolist(), sides[1::2].tolist(), strict=True):
                found.append((low, high, *ends[one], *ends[other]))
        return np.array(found).reshape(-1, 6)

    @cached_property
    def area_m2(self) -> float:
        """In plan."""
        pieces = self.pieces
        widths = (pieces[:, 4] - pieces[:, 2]) + (pieces[:, 5] - pieces[:, 3])
        return float((widths / 2 * (pieces[:, 1] - pieces[:, 0])).sum())

    def contains(self, points: Array) -> Mask:
        """(n,) whether places (n, 2) are inside."""
        from .polygon_kernels import inside_many

        places, result = np.ascontiguousarray(points), np.empty(len(points), np.bool_)
        in_chunks(lambda i, j: inside_many(self.edges, places, result, i, j), len(places))
        return result

    def clipped(self, corners: Array) -> tuple[Array, Indices]:
        """The parts of triangles (m, 3, 3) over the polygon, as triangles (p, 3, 3), and which (p,) they are of.

        Notes
        -----
        A vertical triangle has parts as any other.
        """
        from .polygon_kernels import clip

        parts, source = clip(np.ascontiguousarray(corners), self.pieces, np.maximum.accumulate(self.pieces[:, 1]))
        return parts, source.astype(np.intp)

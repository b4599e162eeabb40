# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces with any number of corners → triangles: fans of convex ones, clipped ears of all others."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..vectors import Array, Mask

AT_ONCE = 1 << 16
"""Polygons that are examined together: their corners take some hundred bytes each."""
STRAIGHT = 1e-7
"""Sine of the turn at a corner below which it lies on a straight edge: rounding of survey coordinates is smaller."""
FLAT = 1e-3
"""Corners of a flat polygon are nearer to its plane than this part of its size (the root of its area)."""
SAME_AREA = 1e-6
"""Triangles of a polygon that does not cross itself have its area, but for this part."""


@dataclass(frozen=True, eq=False)
class Triangles:
    """Triangles of polygons, those of each in its place.

    Attributes
    ----------
    faces : (m, 3) numbers of vertices; two less than corners for each polygon, degenerate where there are fewer.
    polygon : (m,) number of the polygon that each is a part of.
    notes : sentences for the summary.
    """

    faces: NDArray[np.int32]
    polygon: NDArray[np.int64]
    notes: tuple[str, ...]


def triangles_of(points: Array, corners: NDArray[np.integer], counts: Sequence[int] | NDArray[np.integer]) -> Triangles:
    """Cut polygons into triangles in the plane of each.

    A convex polygon becomes a fan about its first corner: a quadrilateral is cut from its first to its third. Any other
    one, also with a corner on a straight edge, loses one ear after the other (Held 2001, FIST; mapbox earcut).

    Parameters
    ----------
    points : (n, 3) vertices [m].
    corners : numbers of vertices, those of the first polygon, then those of the second …; all exist.
    counts : (k,) corners of each polygon. Those with less than three have no triangle.
    """
    each: NDArray[np.int64] = np.asarray(counts, dtype=np.int64)
    corners = np.asarray(corners)
    if (each == 3).all():
        return Triangles(corners.astype(np.int32, copy=False).reshape(-1, 3), np.arange(len(each)), ())
    many = np.maximum(each - 2, 0)
    starts, first = np.cumsum(each) - each, np.cumsum(many) - many
    polygon = np.arange(len(each)).repeat(many)
    turn = np.arange(len(polygon)) - first[polygon]
    faces = corners[starts[polygon][:, None] + np.stack([0 * turn, turn + 1, turn + 2], axis=1)].astype(np.int32)
    more = np.flatnonzero(each > 3)
    found = _Found()
    for begin in range(0, len(more), AT_ONCE):
        part = more[begin : begin + AT_ONCE]
        own = np.arange(each[part].sum()) - (np.cumsum(each[part]) - each[part]).repeat(each[part])
        around = corners[starts[part].repeat(each[part]) + own]
        with np.errstate(all="ignore"):
            shapes = _shapes(points[around], each[part])
        found.bent += int((shapes.off > FLAT * shapes.size).sum())
        found.most_bent_m = max(found.most_bent_m, float(shapes.off.max(initial=0.0)))
        ends = np.cumsum(each[part])
        for i in np.flatnonzero(~shapes.convex).tolist():
            ring = around[ends[i] - each[part[i]] : ends[i]]
            at = first[part[i]]
            with np.errstate(all="ignore"):
                ears, crosses = _ears(points[ring], shapes.normal[i])
            found.concave += 1
            found.crossing += crosses
            if ears is not None:
                faces[at : at + many[part[i]]] = ring[0]  # degenerate unless there is a triangle for it
                faces[at : at + len(ears)] = ring[ears]
    return Triangles(faces, polygon, found.sentences(len(more)))


@dataclass
class _Found:
    concave: int = 0
    crossing: int = 0
    bent: int = 0
    most_bent_m: float = 0.0

    def sentences(self, polygons: int) -> tuple[str, ...]:
        """What to say of so many polygons with more than three corners."""
        said = []
        if self.concave:
            said.append(
                f"Faces with more than three corners: {polygons:,}. Cut ear by ear, because they are not convex "
                f"or have corners on straight edges: {self.concave:,}."
            )
        if self.crossing:
            said.append(
                f"Faces that cross themselves or have no area: {self.crossing:,}. "
                "Their triangles may overlap or leave a gap."
            )
        if self.bent:
            said.append(
                f"Faces with more than three corners that are not flat: {self.bent:,} of {polygons:,}, with corners "
                f"up to {self.most_bent_m:.2g} m from their plane. Their triangles are one of several surfaces."
            )
        return tuple(said)


@dataclass(frozen=True, eq=False)
class _Shapes:
    """Of polygons: unit normals (k, 3), whether each is convex without straight corners (k,), its size (k,) and the
    greatest distance of a corner from its plane (k,).
    """

    normal: Array
    convex: Mask
    size: Array
    off: Array


def _shapes(corners: Array, counts: NDArray[np.int64]) -> _Shapes:
    """Of polygons whose corners (sum of counts, 3) follow each other."""
    starts = np.cumsum(counts) - counts
    own = corners - np.add.reduceat(corners, starts).repeat(counts, axis=0) / counts.repeat(counts)[:, None]
    after = np.arange(1, len(corners) + 1)
    after[starts + counts - 1] = starts
    edge = own[after] - own
    total = np.add.reduceat(np.cross(own, own[after]), starts)  # Newell: twice the vector area
    area2 = np.linalg.norm(total, axis=1)
    normal = np.where(area2[:, None] > 0, total / area2[:, None], 0.0)
    along = normal.repeat(counts, axis=0)
    following = edge[after]
    sine = (np.cross(edge, following) * along).sum(axis=1)  # at the corner behind each edge
    cosine = (edge * following).sum(axis=1)
    lengths = np.linalg.norm(edge, axis=1)
    left = sine > STRAIGHT * lengths * lengths[after]
    turned = np.add.reduceat(np.arctan2(sine, cosine), starts)
    convex = np.logical_and.reduceat(left, starts) & (turned < 3 * np.pi)  # a star turns left as well, but twice round
    off = np.maximum.reduceat(np.abs((own * along).sum(axis=1)), starts)
    return _Shapes(normal, convex, np.sqrt(area2 / 2), off)


def _ears(corners: Array, normal: Array) -> tuple[NDArray[np.int64] | None, bool]:
    """(k, 3) triangles of one polygon (n, 3), None where it has no plane; and whether it crosses itself."""
    import mapbox_earcut

    if not normal.any():
        return None, True
    axis = np.eye(3)[np.argmin(np.abs(normal))]
    across = np.cross(normal, axis)
    across /= np.linalg.norm(across)
    local = corners - corners[0]
    plan = np.ascontiguousarray(np.stack([local @ across, local @ np.cross(normal, across)], axis=1))
    if not np.isfinite(plan).all():
        return None, True
    found = mapbox_earcut.triangulate_float64(plan, np.array([len(plan)], np.uint32)).astype(np.int64).reshape(-1, 3)
    a, b, c = (plan[found[:, k]] for k in range(3))
    doubled = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    after = np.roll(plan, -1, axis=0)
    own = float((plan[:, 0] * after[:, 1] - plan[:, 1] * after[:, 0]).sum())
    return found, abs(float(np.abs(doubled).sum()) - abs(own)) > SAME_AREA * abs(own)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The terrain: one triangle mesh in local coordinates, whatever it came from."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..georeference import GlobalShift
from ..vectors import Array, cross, norm, unit
from .index import TriangleIndex, build_index

CLOSED = 0.01
"""A surface that spans less than this part of its own area counts as closed."""


@dataclass(frozen=True, eq=False)
class Surface:
    """A triangulated terrain.

    Attributes
    ----------
    vertices : (n, 3) local coordinates [m].
    faces : (m, 3) int32, counter-clockwise seen from outside the ground.
    shift : from local to survey coordinates.
    name : of the file, for people.
    summary : what the reader did, in sentences.
    left_out : (k, 3) points of the cloud that the ground filter took for vegetation [m].
    turned : the file has y up; what came with it may have so too.
    colours : (n, 3) sRGB of the vertices, as scanned; None when there are none.
    """

    vertices: Array
    faces: NDArray[np.int32]
    shift: GlobalShift
    name: str
    summary: tuple[str, ...] = ()
    left_out: Array = field(default_factory=lambda: np.empty((0, 3)))
    turned: bool = False
    colours: NDArray[np.uint8] | None = None

    @cached_property
    def _cross(self) -> Array:
        """(m, 3) twice the vector area of each face [m²]."""
        return face_cross_products(self.vertices, self.faces)

    @cached_property
    def face_normals(self) -> Array:
        """(m, 3) unit normals, out of the ground; NaN for a face without area."""
        return unit(self._cross)

    @cached_property
    def face_areas(self) -> Array:
        """(m,) [m²]."""
        return norm(self._cross) / 2

    @cached_property
    def vertex_vector_areas(self) -> Array:
        """(n, 3) a third of the vector areas of the faces around each vertex [m²]."""
        corners, count = self.faces.ravel(), len(self.vertices)
        total = [np.bincount(corners, np.repeat(self._cross[:, axis], 3), count) for axis in range(3)]
        return np.stack(total, axis=1) / 6

    @cached_property
    def vertex_normals(self) -> Array:
        """(n, 3) unit normals: the area-weighted mean over the faces around; NaN for a vertex without a face."""
        return unit(self.vertex_vector_areas)

    @cached_property
    def mean_spacing_m(self) -> float:
        """Mean spacing of the points [m]: the side of the square that each vertex has to itself.

        Notes
        -----
        The area is the one that the surface spans (the length of its total vector area), since vegetation and noise
        multiply the area of the triangles but not the spacing of the points; of an all but closed surface (a
        boulder) it is the area of the triangles.
        """
        spanned, total = float(norm(self._cross.sum(axis=0))) / 2, float(self.face_areas.sum())
        return float(np.sqrt((spanned if spanned > CLOSED * total else total) / len(self.vertices)))

    @cached_property
    def bounds(self) -> Array:
        """(2, 3) lowest and highest coordinates [m]."""
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @cached_property
    def index(self) -> TriangleIndex:
        """The spatial index of the faces; built when first needed."""
        return build_index(self.vertices, self.faces)

    @cached_property
    def neighbours(self) -> NDArray[np.int32]:
        """(m, 3) the face across each edge (corner e to e + 1); -1 at a border, -2 where three or more faces meet."""
        from . import kernels

        return kernels.edge_neighbours(self.faces, len(self.vertices))


def face_cross_products(vertices: Array, faces: NDArray[np.int32]) -> Array:
    """(m, 3) twice the vector area of each face [m²], its direction after the right-hand rule."""
    a = vertices[faces[:, 0]]
    return cross(vertices[faces[:, 1]] - a, vertices[faces[:, 2]] - a)

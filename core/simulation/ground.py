# SPDX-License-Identifier: GPL-3.0-or-later
"""What blocks fall on: the terrain, structures that stand on it, and zones with parameters of their own."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..terrain.index import TriangleIndex, build_index
from ..terrain.joining import moved
from ..terrain.surface import Surface, face_cross_products
from ..vectors import Array, Mask

TERRAIN = 0
"""The owner of the terrain's faces; structures follow from 1."""


@dataclass(frozen=True, eq=False)
class Ground:
    """m triangles that a block can meet.

    Attributes
    ----------
    terrain : the surface without structures, for heights.
    vertices, faces : (n, 3) local [m] and (m, 3) of terrain and structures together.
    owner : (m,) `TERRAIN`, or 1 + the place in `structures`.
    zone : (m,) place in `zones`.
    structures, zones : names.
    flat : how many triangles without area were left out.
    """

    terrain: Surface
    vertices: Array
    faces: NDArray[np.int32]
    owner: NDArray[np.int32]
    zone: NDArray[np.int32]
    structures: tuple[str, ...] = ()
    zones: tuple[str, ...] = ("terrain",)
    flat: int = 0

    @cached_property
    def index(self) -> TriangleIndex:
        """The spatial index of all triangles; the terrain's own where nothing was added."""
        if self.faces is self.terrain.faces:
            return self.terrain.index
        return build_index(self.vertices, self.faces)


def make_ground(
    terrain: Surface,
    structures: Mapping[str, Surface] | None = None,
    zone: NDArray[np.integer] | None = None,
    zones: Sequence[str] = ("terrain",),
) -> Ground:
    """Terrain and structures as one set of triangles.

    Parameters
    ----------
    structures : name → surface; they take part in the first zone.
    zone : (m,) place in `zones` of each of the terrain's faces; None puts all in the first.

    Raises
    ------
    InputError : zones that do not cover the faces, a structure that is nowhere near the terrain.

    Notes
    -----
    Both sides of a triangle stop a block, whatever its winding. Triangles without area are left out, since their
    neighbours cover the same ground. A border is an edge over which blocks fall.
    """
    structures = structures or {}
    if zone is None:
        zone = np.zeros(len(terrain.faces), np.int32)
    if zone.shape != (len(terrain.faces),) or (zone.size and not 0 <= zone.min() <= zone.max() < len(zones)):
        raise InputError("The zones do not fit the terrain", advice="Give each face the number of one of the zones")
    names = tuple(structures)
    parts = [moved(structures[name], terrain.shift) for name in names]
    low, high = terrain.bounds
    for name, part in zip(names, parts, strict=True):
        if (part.bounds[1] < low).any() or (part.bounds[0][:2] > high[:2]).any():
            raise InputError(
                f"The structure {name} stands nowhere near the terrain",
                file=part.name,
                advice="Give it in the coordinates of the terrain",
            )
    vertices, faces, owner, whole = terrain.vertices, terrain.faces, np.zeros(len(zone), np.int32), zone
    if parts:
        starts = np.cumsum([len(terrain.vertices), *(len(part.vertices) for part in parts)])
        vertices = np.concatenate([terrain.vertices, *(part.vertices for part in parts)])
        shifted = [part.faces + np.int32(start) for part, start in zip(parts, starts[:-1], strict=True)]
        faces = np.concatenate([terrain.faces, *shifted])
        owner = np.repeat(np.arange(len(parts) + 1, dtype=np.int32), [len(zone), *(len(part.faces) for part in parts)])
        whole = np.concatenate([zone, np.zeros(len(faces) - len(zone), zone.dtype)])
    solid: Mask = np.asarray(face_cross_products(vertices, faces).any(axis=1))
    if not solid.all():
        faces, owner, whole = faces[solid], owner[solid], whole[solid]
    return Ground(
        terrain, vertices, faces, owner, whole.astype(np.int32), names, tuple(zones), int(solid.size - solid.sum())
    )

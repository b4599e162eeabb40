# SPDX-License-Identifier: GPL-3.0-or-later
"""Structures on the terrain: where a place is along and up them, on which side, and which block they hold."""

from dataclasses import dataclass

import numpy as np

from ..terrain.cloud import Cloud, nearest_points
from ..terrain.raycast import closest_points
from ..terrain.surface import Surface
from ..vectors import Array, Indices, norm
from .ground import Ground

TOUCHES = 0.01
"""A block at rest whose surface is as near to a structure as this part of its radius is held by it."""
DUE_NORTH = 1e-9
"""A main direction whose eastern part is less than this runs from south to north."""


@dataclass(frozen=True, eq=False)
class StructureFrame:
    """The main directions of a structure: along it horizontally, and up.

    Attributes
    ----------
    along : (3,) unit, horizontal: in plan the first principal axis of its area, towards the east (or due north).
    centre : (3,) of its area, local [m].
    start_m : of its western end, along · place [m].
    lowest_m : height of its lowest vertex or point [m].

    Notes
    -----
    The vertical main plane contains the centre and the main direction. The axis is that of the area and not of the
    vertices, so that it does not depend on how the structure is divided into triangles. Of a
    cloud it is that of the points.
    """

    along: Array
    centre: Array
    start_m: float
    lowest_m: float

    def along_m(self, places: Array) -> Array:
        """(n,) distance of places (n, 3) from its western end, along it [m]."""
        distance: Array = places @ self.along - self.start_m
        return distance

    def across_m(self, places: Array) -> Array:
        """(n,) distance of places (n, 3) from the vertical main plane, positive on the left of `along` [m]."""
        distance: Array = (places - self.centre) @ np.array([-self.along[1], self.along[0], 0.0])
        return distance


def structure_frame(ground: Ground, structure: int) -> StructureFrame:
    """The frame of a structure by its place in `ground.structures`."""
    part = structure_part(ground, structure)
    corners = part.vertices[part.faces] if isinstance(part, Surface) else part.points[:, None]
    area = part.face_areas if isinstance(part, Surface) else np.ones(len(corners))
    centre = (area[:, None] * corners.mean(axis=1)).sum(axis=0) / area.sum()
    plan = corners[:, :, :2] - centre[:2]
    total = plan.sum(axis=1)
    moments = np.einsum("m,mik,mil->kl", area, plan, plan) + np.einsum("m,mk,ml->kl", area, total, total)
    x, y = np.linalg.eigh(moments)[1][:, -1]
    if x < -DUE_NORTH or (abs(x) <= DUE_NORTH and y < 0):
        x, y = -x, -y
    along = np.array([x, y, 0.0])
    places = corners.reshape(-1, 3)
    return StructureFrame(along, centre, float((places @ along).min()), float(places[:, 2].min()))


def structure_part(ground: Ground, structure: int) -> Surface | Cloud:
    """The triangles, or the points, of one structure."""
    own = ground.owner == structure + 1
    name, size = ground.structures[structure], len(ground.faces)
    if own[:size].any():
        return Surface(ground.vertices, ground.faces[own[:size]], ground.shift, name)
    return Cloud(ground.points[own[size:]], ground.shift, name)


def heights_up(ground: Ground, frame: StructureFrame, places: Array) -> Array:
    """(n,) height of places on a structure above its foot [m].

    The foot is the terrain vertically below the place or, where there is none, the height of the lowest vertex.
    """
    height = ground.heights_above(places)
    return np.where(np.isnan(height), places[:, 2] - frame.lowest_m, height)


def held_by(ground: Ground, centre: Array, radius_m: Array) -> Indices:
    """(n,) place in `ground.structures` of what a sphere at rest touches, the nearest of several; −1 for none."""
    held, nearest = np.full(len(centre), -1), np.full(len(centre), np.inf)
    reach = (1 + TOUCHES) * radius_m
    for structure in range(len(ground.structures)):
        part = structure_part(ground, structure)
        places = part.vertices[np.unique(part.faces)] if isinstance(part, Surface) else part.points
        outside = np.maximum(places.min(axis=0) - centre, centre - places.max(axis=0))
        near = np.flatnonzero(norm(np.maximum(outside, 0.0)) <= reach)
        if isinstance(part, Surface):
            distance = closest_points(part, centre[near]).distance
        else:
            distance = nearest_points(part, centre[near])[0]
        touches = (distance <= reach[near]) & (distance < nearest[near])
        held[near[touches]], nearest[near[touches]] = structure, distance[touches]
    return held

# SPDX-License-Identifier: GPL-3.0-or-later
"""What blocks fall on: the terrain, structures that stand on it, and zones with parameters of their own."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..georeference import GlobalShift
from ..remarks import Remark
from ..terrain.cloud import Cloud, PointIndex, build_point_index, heights_above_points, nearest_points
from ..terrain.index import TriangleIndex, build_index
from ..terrain.joining import moved
from ..terrain.raycast import cast_rays, closest_points, heights_above
from ..terrain.surface import Surface, face_cross_products
from ..vectors import Array, Mask
from .block_scale import at_scale
from .ground_faults import GroundFaults, ground_faults
from .holes import rims_of_holes
from .pairs import make_pairs

Contact = Literal["mesh", "points"]
CONTACTS: tuple[Contact, ...] = ("mesh", "points")
"""What of the terrain blocks meet: its triangles, where a cloud is meshed in plan; or points alone."""

MOST_BINS = 4000
"""Along one side, in which triangles that lie on top of each other are looked for."""
TERRAIN = 0
"""The owner of the terrain's elements; structures follow from 1."""
FEWEST = 2.0
"""A block whose radius is less than so many spacings of points hangs on single ones, or falls between them.

Down one slope of points and of triangles, the median run-outs were 0.9 and 117 m at a radius of 1 spacing, 20 and 118 m
at 1.5, 117 and 119 m at 2, 120 and 121 m at 3.
"""


@dataclass(frozen=True, eq=False)
class Ground:
    """m triangles and k points that a block can meet: the elements of the ground, triangles first.

    Attributes
    ----------
    terrain : without structures, for heights.
    vertices, faces : (n, 3) local [m] and (m, 3) of terrain and structures together.
    points : (k, 3) local [m] of the terrain and the structures that are clouds.
    owner : (m + k,) `TERRAIN`, or 1 + the place in `structures`.
    zone : (m + k,) place in `zones`.
    structures, zones : names.
    flat : how many triangles without area were left out.
    spacing_m : of the points, of each cloud among the terrain and the structures by name.
    remarks : what a user should know of its zones.
    """

    terrain: Surface | Cloud
    vertices: Array
    faces: NDArray[np.int32]
    points: Array
    owner: NDArray[np.int32]
    zone: NDArray[np.int32]
    structures: tuple[str, ...] = ()
    zones: tuple[str, ...] = ("terrain",)
    flat: int = 0
    spacing_m: Mapping[str, float] = field(default_factory=dict)
    remarks: tuple[Remark, ...] = ()

    @property
    def shift(self) -> GlobalShift:
        """From local to survey coordinates."""
        return self.terrain.shift

    @property
    def surface(self) -> Surface:
        """The terrain, where triangles of it are needed.

        Raises
        ------
        InputError : the terrain is a cloud of points.
        """
        if isinstance(self.terrain, Surface):
            return self.terrain
        raise InputError(
            "The terrain is a cloud of points, where a surface is needed",
            file=self.terrain.name,
            advice="Let blocks meet the surface (contact: mesh)",
        )

    @cached_property
    def index(self) -> TriangleIndex:
        """The spatial index of all triangles; the terrain's own where nothing was added."""
        if isinstance(self.terrain, Surface) and self.faces is self.terrain.faces:
            return self.terrain.index
        return build_index(self.vertices, self.faces)

    @cached_property
    def point_index(self) -> PointIndex:
        """The spatial index of all points, with the spacing of the coarsest cloud; the terrain's own if it is alone."""
        if isinstance(self.terrain, Cloud) and self.points is self.terrain.points:
            return self.terrain.index
        return replace(build_point_index(self.points), spacing_m=max(self.spacing_m.values()))

    @property
    def tree(self) -> Any:
        """What the kernels take: see `ground_kernels`."""
        if not len(self.faces):
            return self.point_index.tree
        triangles = (*self.index.tree, *self.pairs)
        return (triangles, self.point_index.tree) if len(self.points) else triangles

    @cached_property
    def pairs(self) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        """The nodes of the index as flights look at them: see `pair_kernels`."""
        return make_pairs(self.index)

    @cached_property
    def terrain_tree(self) -> Any:
        """What kernels take of the terrain's triangles without structures.

        Raises
        ------
        InputError : the terrain is a cloud of points.
        """
        index = self.surface.index
        return (*index.tree, *(self.pairs if index is self.index else make_pairs(index)))

    @cached_property
    def plan(self) -> Array:
        """(m, 12) the terrain's triangles in plan, without structures: see `plan_kernels`.

        Raises
        ------
        InputError : the terrain is a cloud of points.
        """
        from ..terrain.kernels import edge_neighbours
        from .plan_kernels import fill_plan, mark_layers

        surface, index = self.surface, self.surface.index
        m = len(surface.faces)
        place = np.empty(m, np.int32)
        place[index.face] = np.arange(m, dtype=np.int32)
        plan = np.empty((m, 12))
        neighbours = edge_neighbours(surface.faces, len(surface.vertices))
        fill_plan(index.corners, index.face, neighbours, place, plan)
        low, high = surface.bounds[:, :2]
        size = max(2.0 * float(np.sqrt(np.prod(high - low) / m)), float((high - low).max()) / MOST_BINS)
        columns, rows = (np.floor((high - low) / size).astype(np.intp) + 1).tolist()
        mark_layers(plan, size, low[0], low[1], np.zeros((rows, columns)), np.zeros((rows, columns), np.int64))
        return plan

    @cached_property
    def facets(self) -> Any:
        """What lies about each triangle, for blocks that roll, whatever their size: `across`, `bend`, `clear` and
        `lean` of `facet_kernels`; empty with points."""
        across, bend, lean = self._linked()[:3]
        return across, bend, np.zeros((len(across), 4), np.float32), lean

    def _linked(self) -> tuple[Any, Any, Any, Any, Any]:
        """See `facet_kernels.link`."""
        m = 0 if len(self.points) else len(self.faces)
        across = np.empty((m, 3), np.int32)
        bend, lean, excess, width = (np.empty((m, 3), np.float32) for _ in range(4))
        if m:
            from ..terrain.kernels import edge_neighbours
            from .facet_kernels import link

            face = self.index.face
            place = np.empty(m, np.int32)
            place[face] = np.arange(m, dtype=np.int32)
            neighbours = edge_neighbours(self.faces, len(self.vertices))
            normals = self._vertex_normals
            link(self.index.corners, face, neighbours, place, self.faces, normals, across, bend, lean, excess, width)
        return across, bend, lean, excess, width

    def facets_at(self, steps: Iterable[int]) -> Any:
        """What kernels take of k sizes of blocks: curvature (k, m, 4) and crease (k, m, 3) between those of `facets`.

        steps : k numbers, see `block_scale.step_of`.
        """
        wanted = tuple(steps)
        found = self._at_steps.get(wanted)
        if found is None:
            across, bend, _, excess, width = self._linked()
            corners = self.index.corners if len(across) else np.empty((0, 3, 3))
            both = [at_scale(corners, (across, bend, excess, width), 2.0 ** (0.5 * one)) for one in wanted]
            found = np.stack([one for one, _ in both]), np.stack([one for _, one in both])
            self._at_steps.clear()  # one at a time: they are as large as the terrain
            self._at_steps[wanted] = found
        return *self.facets[:3], *found, self.facets[3]

    @cached_property
    def _at_steps(self) -> dict[tuple[int, ...], tuple[Any, Any]]:
        return {}

    @property
    def _vertex_normals(self) -> Array:
        """(n, 3) upward, each the sum of the areas around."""
        areas = face_cross_products(self.vertices, self.faces)
        areas = np.where(areas[:, 2:] < 0.0, -areas, areas)
        corner, size = self.faces.ravel(), len(self.vertices)
        return np.column_stack([np.bincount(corner, np.repeat(areas[:, k], 3), size) for k in range(3)])

    @cached_property
    def element(self) -> NDArray[np.int32]:
        """(m + k,) the element behind each place in the tree."""
        triangles = self.index.face if len(self.faces) else np.empty(0, np.int32)
        if not len(self.points):
            return triangles
        return np.concatenate([triangles, self.point_index.number + np.int32(len(self.faces))])

    @cached_property
    def zone_in_tree(self) -> NDArray[np.int32]:
        """(m + k,) place in `zones` of each place in the tree."""
        return self.zone[self.element] if len(self.zones) > 1 else np.zeros(len(self.zone), np.int32)

    @cached_property
    def faults(self) -> GroundFaults | None:
        """What is wrong with the terrain's triangles, counted; None where it is a cloud."""
        return ground_faults(self.terrain) if isinstance(self.terrain, Surface) else None

    @cached_property
    def rims(self) -> Array:
        """(e, 4) x, y of both ends of the edges around the terrain's holes; none where it is a cloud."""
        return rims_of_holes(self.terrain) if isinstance(self.terrain, Surface) else np.empty((0, 4))

    @property
    def highest_m(self) -> float:
        """Height of the highest vertex or point [m]."""
        return float(max(part[:, 2].max() for part in (self.vertices, self.points) if len(part)))

    def heights_above(self, places: Array) -> Array:
        """Vertical clearance of (n, 3) places [m] over the terrain, negative in the ground, NaN beside it.

        See `heights_above` for triangles, `heights_above_points` for points.
        """
        if isinstance(self.terrain, Cloud):
            return heights_above_points(self.terrain, places)
        return heights_above(self.terrain, places)

    def heights_in_flight(self, places: Array) -> Array:
        """Height of (n, 3) places of flying blocks over the terrain vertically below them [m], NaN where there is none.

        That they are in the open needs no look upward, and is so for triangles of any winding.
        """
        if isinstance(self.terrain, Cloud):
            return heights_above_points(self.terrain, places)
        height = cast_rays(self.terrain, places, (0, 0, -1)).distance
        return np.where(np.isfinite(height), height, np.nan)

    def distance(self, places: Array) -> Array:
        """(n,) [m] from the terrain's nearest triangle or point."""
        if isinstance(self.terrain, Cloud):
            return nearest_points(self.terrain, places)[0]
        return closest_points(self.terrain, places).distance

    def refuse_small(self, radius_m: Array) -> None:
        """Blocks that would hang on single points are no blocks for this ground.

        Raises
        ------
        InputError : a radius below `FEWEST` spacings of a cloud.
        """
        for name, spacing in self.spacing_m.items():
            few = int((radius_m < FEWEST * spacing).sum())
            if few:
                raise InputError(
                    f"The points of {name}, {spacing:.3g} m apart, are too few for {few} of {radius_m.size} blocks, "
                    f"which would hang on single points: the smallest has a diameter of {2 * radius_m.min():.3g} m",
                    advice=f"Blocks need {2 * FEWEST * spacing:.3g} m there, or these blocks a point every "
                    f"{radius_m.min() / FEWEST:.2g} m; or let them meet the surface (contact: mesh)",
                )


def element_places(terrain: Surface | Cloud) -> Array:
    """(m, 3) local [m]: the middle of each triangle, or each point."""
    if isinstance(terrain, Cloud):
        return terrain.points
    middles: Array = terrain.vertices[terrain.faces].mean(axis=1)
    return middles


def make_ground(
    terrain: Surface | Cloud,
    structures: Mapping[str, Surface | Cloud] | None = None,
    zone: NDArray[np.integer] | None = None,
    zones: Sequence[str] = ("terrain",),
) -> Ground:
    """Terrain and structures as one ground.

    Parameters
    ----------
    structures : name → surface or cloud; they take part in the first zone.
    zone : (m,) place in `zones` of each of the terrain's triangles or points; None puts all in the first.

    Raises
    ------
    InputError : zones that do not cover the terrain, a structure that is nowhere near the terrain, coordinates that are
        not finite.

    Notes
    -----
    Both sides of a triangle stop a block, whatever its winding. Triangles without area are left out, since their
    neighbours cover the same ground. A border is an edge over which blocks fall. Whatever else is wrong with triangles
    is met as it is, and counted: see `GroundFaults`.
    """
    names = tuple(structures or {})
    size = len(element_places(terrain))
    if zone is None:
        zone = np.zeros(size, np.int32)
    if zone.shape != (size,) or (zone.size and not 0 <= zone.min() <= zone.max() < len(zones)):
        raise InputError(
            "The zones do not fit the terrain", advice="Give each triangle or point the number of one of the zones"
        )
    parts = [terrain, *(moved(part, terrain.shift) for part in (structures or {}).values())]
    for name, part in zip(("terrain", *names), parts, strict=True):
        places = part.vertices if isinstance(part, Surface) else part.points
        lost = len(places) - int(np.isfinite(places).all(axis=1).sum())
        if lost:
            what = "vertices" if isinstance(part, Surface) else "points"
            raise InputError(
                f"The {name} has {lost} {what} whose coordinates are no numbers", file=part.name, advice="Remove them"
            )
    low, high = terrain.bounds
    for name, part in zip(names, parts[1:], strict=True):
        if (part.bounds[1] < low).any() or (part.bounds[0][:2] > high[:2]).any():
            raise InputError(
                f"The structure {name} stands nowhere near the terrain",
                file=part.name,
                advice="Give it in the coordinates of the terrain",
            )
    zone_of = [zone.astype(np.int32)] + [np.zeros(len(element_places(part)), np.int32) for part in parts[1:]]
    meshes = [(i, part) for i, part in enumerate(parts) if isinstance(part, Surface)]
    clouds = [(i, part) for i, part in enumerate(parts) if isinstance(part, Cloud)]
    owner = np.repeat([i for i, _ in meshes], [len(part.faces) for _, part in meshes])
    whole = _joined([zone_of[i] for i, _ in meshes], np.empty(0, np.int32))
    if len(meshes) == 1:
        vertices, faces = meshes[0][1].vertices, meshes[0][1].faces
    else:
        vertices = _joined([part.vertices for _, part in meshes], np.empty((0, 3)))
        starts = np.cumsum([0, *(len(part.vertices) for _, part in meshes)])
        shifted = [part.faces + np.int32(start) for (_, part), start in zip(meshes, starts, strict=False)]
        faces = _joined(shifted, np.empty((0, 3), np.int32))
    solid: Mask = np.asarray(face_cross_products(vertices, faces).any(axis=1))
    if not solid.all():
        faces, owner, whole = faces[solid], owner[solid], whole[solid]
    return Ground(
        terrain,
        vertices,
        faces,
        _joined([part.points for _, part in clouds], np.empty((0, 3))),
        np.concatenate([owner, *(np.full(len(part.points), i) for i, part in clouds)]).astype(np.int32),
        np.concatenate([whole, *(zone_of[i] for i, _ in clouds)]),
        names,
        tuple(zones),
        int(solid.size - solid.sum()),
        {("the terrain", *names)[i]: part.spacing_m for i, part in clouds},
    )


def _joined[T: np.ndarray](parts: Sequence[T], none: T) -> T:
    """The rows of all parts; of one part the part itself."""
    if len(parts) == 1:
        return parts[0]
    return np.concatenate(parts) if parts else none

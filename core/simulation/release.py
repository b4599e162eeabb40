# SPDX-License-Identifier: GPL-3.0-or-later
"""Where blocks start, and as what: n releases, one a block."""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property

import numpy as np

from ..compiled import in_chunks
from ..constants import ROCK_DENSITY_KGPM3
from ..errors import InputError
from ..impact_models.machinery.parameters import suggestion
from ..reconstruction.drag import Drag
from ..remarks import Remark
from ..terrain.cloud import Cloud
from ..terrain.misplaced import unit_hint
from ..vectors import Array, Indices, Mask, Names
from .block_shapes import ROUND, SHAPES, Shape, mean_inertia, principal_moments, volumes
from .ground import Ground

FAR_ABOVE_M = 100.0
"""A release higher above the terrain than this may be in another unit."""


@dataclass(frozen=True, eq=False)
class Releases:
    """n blocks before they fall. `make_releases` fills what is not said.

    Attributes
    ----------
    name : (n,) of the release; several blocks may share one.
    position : (n, 3) of the centre, local [m].
    velocity : (n, 3) [m/s].
    angular_velocity : (n, 3) [rad/s].
    shape : (n,) of `SHAPES`.
    axes_m : (n, 3) the diameters d1, d2, d3 of the solid.
    mass_kg : (n,).
    remarks : what a user should know of how they were placed.
    place : (n,) of the places that were stated or measured, which one it starts at: blocks of one place are not
        independent of one another. Where chance chose each block's place, as in an area, it is the block's own, and
        where nothing is said.

    Raises
    ------
    InputError : a number that is not finite, a size or mass that is not positive, an unknown shape, with the release.

    Notes
    -----
    The inertia is that of the block in motion: rolling, free rotation and the rotational energy of tables. An impact
    model that has an inertia of its own (a sphere's or a cube's) keeps it.
    """

    name: Names
    position: Array
    velocity: Array
    angular_velocity: Array
    shape: Names
    axes_m: Array
    mass_kg: Array
    remarks: tuple[Remark, ...] = ()
    place: Indices = field(default_factory=lambda: np.zeros(0, np.intp))

    def __post_init__(self) -> None:
        if not self.place.size:
            object.__setattr__(self, "place", np.arange(len(self.position)))
        for what, values in (("position", self.position), ("velocity", self.velocity), ("spin", self.angular_velocity)):
            self._refuse(np.asarray(~np.isfinite(values).all(axis=1)), f"The {what} is not a finite number")
        for what, sizes in (("diameter", self.axes_m), ("mass", self.mass_kg[:, None])):
            self._refuse(
                np.asarray(~(np.isfinite(sizes) & (sizes > 0)).all(axis=1)), f"The {what} is not a number above zero"
            )
        self._refuse(~np.isin(self.shape, SHAPES), f"The shape is none of {', '.join(SHAPES)}")

    def _refuse(self, wrong: Mask, problem: str) -> None:
        for i in np.flatnonzero(wrong)[:1].tolist():
            raise InputError(f"{problem} (release {self.name[i] or i + 1})", advice="Correct it and start again")

    def __len__(self) -> int:
        return len(self.position)

    @cached_property
    def diameter_m(self) -> Array:
        """(n,) of the sphere that meets the ground: the mean of the three."""
        first = self.axes_m[:, 0]
        return first + ((self.axes_m[:, 1] - first) + (self.axes_m[:, 2] - first)) / 3  # exact for a round block

    @property
    def radius_m(self) -> Array:
        """(n,) [m]."""
        return self.diameter_m / 2

    @cached_property
    def inertia(self) -> Array:
        """(n,) c of c m r², the mean of the three moments: 2/5 for a sphere, 2/3 for a cube."""
        return mean_inertia(self.shape, self.axes_m)

    @cached_property
    def principal_kgm2(self) -> Array:
        """(n, 3) moments of inertia about the axes of d1, d2 and d3."""
        return principal_moments(self.shape, self.axes_m, self.mass_kg)

    def drag_per_m(self, drag: Drag | None) -> Array:
        """(n,) ½ρC_D A/m [1/m], zeros without drag."""
        if drag is None:
            return np.zeros(len(self))
        return 0.5 * drag.air_density * drag.coefficient * np.pi / 4 * self.diameter_m**2 / self.mass_kg

    def take(self, rows: slice | Indices) -> "Releases":
        """Some of them."""
        columns = {one.name: getattr(self, one.name)[rows] for one in fields(self) if one.name != "remarks"}
        return replace(self, **columns)

    def with_remarks(self, *remarks: Remark) -> "Releases":
        """The same with more to say."""
        return replace(self, remarks=(*self.remarks, *remarks))


def join_releases(parts: Sequence[Releases]) -> Releases:
    """All blocks of several releases, in their order."""
    columns = [one.name for one in fields(Releases) if one.name != "remarks"]
    joined = {name: np.concatenate([getattr(one, name) for one in parts]) for name in columns}
    before = np.cumsum([0, *(int(one.place.max(initial=-1)) + 1 for one in parts)])
    joined["place"] = np.concatenate([one.place + k for one, k in zip(parts, before[:-1], strict=True)])
    return Releases(**joined, remarks=tuple(dict.fromkeys(remark for one in parts for remark in one.remarks)))


def stated_places(points: Array) -> Indices:
    """(n,) which of the different places in plan each of the points (n, 2 or 3) is at."""
    return np.unique(points[:, :2], axis=0, return_inverse=True)[1].ravel()


def make_releases(
    position: Array,
    *,
    name: Names | None = None,
    velocity: Array | None = None,
    angular_velocity: Array | None = None,
    diameter_m: Array | float = 0.35,
    axes_m: Array | None = None,
    shape: Names | Shape = "sphere",
    density_kgpm3: Array | float = ROCK_DENSITY_KGPM3,
    number: int = 1,
    place: Indices | None = None,
) -> Releases:
    """Releases, each `number` times.

    Parameters
    ----------
    diameter_m : (n,) or a number, of blocks without `axes_m` (n, 3). A sphere and a cube take the mean of three.
    place : (n,) see `Releases`; None for one each.

    Raises
    ------
    InputError : see `Releases`; the number is not positive.
    """
    if number < 1:
        raise InputError(f"{number} blocks cannot be released", advice="Release at least one from each place")
    n = len(position)
    zeros = np.zeros((n, 3))
    shapes = np.broadcast_to(np.asarray(shape, dtype=np.str_), n)
    for unknown in shapes[~np.isin(shapes, SHAPES)][:1].tolist():
        raise InputError(f"There is no shape {unknown!r}", advice=suggestion(unknown, SHAPES))
    if axes_m is None:
        axes = np.broadcast_to(np.asarray(diameter_m, dtype=np.float64)[..., None], (n, 3))
    else:
        even = np.isin(shapes, ROUND) & (axes_m != axes_m[:, :1]).any(axis=1)
        axes = np.where(even[:, None], axes_m.mean(axis=1, keepdims=True), axes_m)
    releases = Releases(
        np.full(n, "") if name is None else name,
        position,
        zeros if velocity is None else velocity,
        zeros if angular_velocity is None else angular_velocity,
        shapes,
        axes,
        np.broadcast_to(np.asarray(density_kgpm3, dtype=np.float64), n) * volumes(shapes, axes),
        place=np.arange(n) if place is None else place,
    )
    return releases if number == 1 else releases.take(np.repeat(np.arange(n), number))


def placed_on(ground: Ground, releases_xy: Array, diameter_m: Array) -> Array:
    """(n, 3) centres of spheres that touch the ground from above at places (n, 2).

    NaN where there is no ground below or above the place.

    Raises
    ------
    InputError : spheres too small for the points of the ground.
    """
    from .placing_kernels import drop_many

    ground.refuse_small(diameter_m / 2)
    tree, top = ground.tree, ground.highest_m
    places, radius = np.ascontiguousarray(releases_xy), np.ascontiguousarray(diameter_m / 2)
    heights = np.empty(len(places))
    in_chunks(lambda i, j: drop_many(tree, places, radius, top, heights, i, j), len(places))
    return np.column_stack([np.where(np.isnan(heights)[:, None], np.nan, places), heights])


def standing_on(ground: Ground, points: Array, normals: Array, diameter_m: Array) -> tuple[Array, Mask]:
    """Centres (n, 3) of spheres that touch the ground at points (n, 3) on it, on the side of the normals (n, 3).

    Returns
    -------
    centres : moved on, where the ground is too narrow for the sphere, until it touches and is nowhere in the ground.
    fits : (n,) false where there is no such place.

    Notes
    -----
    On a terrain of points, spheres come along the normals until they touch; they are not moved on.

    Raises
    ------
    InputError : spheres too small for the points of the ground.
    """
    from .placing_kernels import lean_many, stand_many

    radius = np.ascontiguousarray(diameter_m / 2)
    on_points = isinstance(ground.terrain, Cloud)
    if on_points:
        ground.refuse_small(radius)
    tree, put = (ground.tree, lean_many) if on_points else (ground.index.tree, stand_many)
    at, along = np.ascontiguousarray(points), np.ascontiguousarray(normals)
    centres, fits = np.empty((len(at), 3)), np.empty(len(at), np.bool_)
    in_chunks(lambda i, j: put(tree, at, along, radius, centres, fits, i, j), len(at))
    return centres, fits


def overlapping(ground: Ground, releases: Releases) -> Array:
    """(n,) how deep each sphere is in the ground [m]; 0 for one that is above it.

    Raises
    ------
    InputError : a release is beside the terrain, in plan, or far above it and at it in another unit.
    """
    height = ground.heights_above(releases.position)
    for i in np.flatnonzero(np.isnan(height))[:1].tolist():
        x, y, z = ground.terrain.shift.to_survey(releases.position[i : i + 1])[0]
        raise InputError(
            f"The release at {x:.2f}, {y:.2f}, {z:.2f} is beside the terrain",
            advice=unit_hint(releases.position, ground.terrain)
            or "Correct its place, or give a terrain that reaches so far",
        )
    if (height > FAR_ABOVE_M).any():
        hint = unit_hint(releases.position[height > FAR_ABOVE_M], ground.terrain)
        if hint:
            raise InputError(f"A release is {np.nanmax(height):,.0f} m above the terrain", advice=hint)
    away = ground.distance(releases.position)
    depth: Array = np.where(height < 0, releases.radius_m + away, np.maximum(releases.radius_m - away, 0.0))
    return depth

# SPDX-License-Identifier: GPL-3.0-or-later
"""Where blocks start, and as what: n releases, one a block."""

from dataclasses import dataclass

import numpy as np

from ..constants import ROCK_DENSITY_KGPM3
from ..errors import InputError
from ..reconstruction.drag import Drag
from ..vectors import Array, Mask, Names
from .ground import Ground

ABOVE_M = 1e-6
"""A block that is placed on the terrain starts so much above it."""
SPHERE_INERTIA = 2.0 / 5.0


@dataclass(frozen=True, eq=False)
class Releases:
    """n blocks before they fall.

    Attributes
    ----------
    name : (n,) of the release; several blocks may share one.
    position : (n, 3) of the centre, local [m].
    velocity : (n, 3) [m/s].
    angular_velocity : (n, 3) [rad/s].
    diameter_m : (n,) of the sphere that meets the ground.
    mass_kg : (n,).

    Raises
    ------
    InputError : a number that is not finite, a size or mass that is not positive, with the release.
    """

    name: Names
    position: Array
    velocity: Array
    angular_velocity: Array
    diameter_m: Array
    mass_kg: Array

    def __post_init__(self) -> None:
        for what, values in (("position", self.position), ("velocity", self.velocity), ("spin", self.angular_velocity)):
            self._refuse(np.asarray(~np.isfinite(values).all(axis=1)), f"The {what} is not a finite number")
        for what, sizes in (("diameter", self.diameter_m), ("mass", self.mass_kg)):
            self._refuse(~(np.isfinite(sizes) & (sizes > 0)), f"The {what} is not a number above zero")

    def _refuse(self, wrong: Mask, problem: str) -> None:
        for i in np.flatnonzero(wrong)[:1].tolist():
            raise InputError(f"{problem} (release {self.name[i] or i + 1})", advice="Correct it and start again")

    def __len__(self) -> int:
        return len(self.position)

    @property
    def radius_m(self) -> Array:
        """(n,) [m]."""
        return self.diameter_m / 2

    def drag_per_m(self, drag: Drag | None) -> Array:
        """(n,) ½ρC_D A/m [1/m], zeros without drag."""
        if drag is None:
            return np.zeros(len(self))
        return 0.5 * drag.air_density * drag.coefficient * np.pi / 4 * self.diameter_m**2 / self.mass_kg

    def take(self, rows: slice) -> "Releases":
        """Some of them."""
        return Releases(
            self.name[rows], self.position[rows], self.velocity[rows], self.angular_velocity[rows],
            self.diameter_m[rows], self.mass_kg[rows],
        )  # fmt: skip


def make_releases(
    position: Array,
    *,
    name: Names | None = None,
    velocity: Array | None = None,
    angular_velocity: Array | None = None,
    diameter_m: Array | float = 0.35,
    density_kgpm3: Array | float = ROCK_DENSITY_KGPM3,
    number: int = 1,
) -> Releases:
    """Releases of spheres, each `number` times.

    Raises
    ------
    InputError : see `Releases`; the number is not positive.
    """
    if number < 1:
        raise InputError(f"{number} blocks cannot be released", advice="Release at least one from each place")
    n = len(position)
    zeros = np.zeros((n, 3))
    diameter = np.broadcast_to(np.asarray(diameter_m, dtype=np.float64), n)
    density = np.broadcast_to(np.asarray(density_kgpm3, dtype=np.float64), n)
    columns = (
        np.full(n, "") if name is None else name,
        position,
        zeros if velocity is None else velocity,
        zeros if angular_velocity is None else angular_velocity,
        diameter,
        density * np.pi / 6 * diameter**3,
    )
    return Releases(*(np.repeat(column, number, axis=0) for column in columns))


def placed_on(ground: Ground, releases_xy: Array, diameter_m: Array) -> Array:
    """(n, 3) centres of spheres that touch the ground from above at places (n, 2).

    NaN where there is no ground below or above the place.
    """
    from ..terrain.kernels import STACK_SIZE
    from .contact_kernels import first_contact

    stack, times = np.empty(STACK_SIZE, np.int64), np.empty(STACK_SIZE)
    top = float(ground.vertices[:, 2].max())
    result = np.full((len(releases_xy), 3), np.nan)
    for i, (x, y) in enumerate(releases_xy.tolist()):
        radius = float(diameter_m[i]) / 2
        start = top + 2 * radius
        drop, _, place = first_contact(
            ground.index.tree, stack, times, (x, y, start), (0.0, 0.0, -1.0), (0.0, 0.0, 0.0), radius, np.inf
        )
        if place >= 0:
            result[i] = x, y, start - drop + ABOVE_M
    return result


def overlapping(ground: Ground, releases: Releases) -> Array:
    """(n,) how deep each sphere is in the ground [m]; 0 for one that is above it.

    Raises
    ------
    InputError : a release is beside the terrain, in plan.
    """
    from ..terrain.raycast import closest_points, heights_above

    height = heights_above(ground.terrain, releases.position)
    for i in np.flatnonzero(np.isnan(height))[:1].tolist():
        x, y, z = ground.terrain.shift.to_survey(releases.position[i : i + 1])[0]
        raise InputError(
            f"The release at {x:.2f}, {y:.2f}, {z:.2f} is beside the terrain",
            advice="Correct its place, or give a terrain that reaches so far",
        )
    away = closest_points(ground.terrain, releases.position).distance
    depth: Array = np.where(height < 0, releases.radius_m + away, np.maximum(releases.radius_m - away, 0.0))
    return depth

# SPDX-License-Identifier: GPL-3.0-or-later
"""Picks on the terrain: do they lie on it, and what is its normal there?"""

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError
from ..remarks import Remark
from ..vectors import Array, Mask, perpendicular
from .picks import Picks

if TYPE_CHECKING:
    from ..terrain.surface import Surface

FAR_M = 20.0
"""A pick on the ground that is further from the terrain than this cannot belong to it."""
FAR_IN_THE_AIR_M = 500.0
"""The same for picks that need not be on the ground (release, pass)."""
NOTICEABLE_M = 1.0
NOTICEABLE_DIAMETERS = 3.0
"""Picks further than both of these are mentioned."""
NEAR_BOX_M = 1000.0
LEAST_STEP = 0.05
"""Part of the normal's radius over which its change is looked at, at least."""


def check_placement(picks: Picks, surface: "Surface", diameter_m: Array) -> tuple[Remark, ...]:
    """Remarks on picks that lie off the terrain, about their trajectories.

    Parameters
    ----------
    picks : in the surface's frame.
    diameter_m : (n,) of the block of each pick [m].

    Raises
    ------
    InputError : picks and terrain do not overlap at all (other coordinates), or a pick lies far off the terrain.
    """
    from ..terrain.misplaced import unit_hint
    from ..terrain.raycast import closest_points

    if not len(picks):
        return ()
    _check_overlap(picks, surface)
    distance = closest_points(surface, picks.position).distance
    grounded = np.isin(picks.kind, ("impact", "contact", "stop", "takeoff")) & (picks.status != "discarded")
    limit = np.where(grounded, FAR_M, FAR_IN_THE_AIR_M)
    far = (distance > limit) & (picks.status != "discarded")
    if far.any():
        worst = int(np.argmax(np.where(far, distance / limit, 0.0)))
        others = f" ({int(far.sum()) - 1} more picks are as far off)" if far.sum() > 1 else ""
        raise picks.error(
            worst,
            f"The pick is {distance[worst]:.1f} m from the terrain{others}",
            unit_hint(picks.position, surface)
            or "Correct its coordinates, or discard it (status discarded); a point in the air is of kind pass",
        )
    off = grounded & (distance > np.maximum(NOTICEABLE_M, NOTICEABLE_DIAMETERS * diameter_m))
    remarks = []
    for i in np.flatnonzero(off):
        row = f" (row {picks.row[i]})" if picks.row[i] else ""
        text = f"The {picks.kind[i]} pick of trajectory {picks.trajectory[i]} at {picks.time_s[i]:.3f} s{row} lies "
        remarks.append(Remark(f"{text}{distance[i]:.1f} m off the terrain.", "warning", str(picks.trajectory[i])))
    return tuple(remarks)


def _check_overlap(picks: Picks, surface: "Surface") -> None:
    from ..terrain.misplaced import unit_hint

    low, high = surface.shift.to_survey(surface.bounds)
    position = picks.shift.to_survey(picks.position)
    first, last = position.min(axis=0), position.max(axis=0)
    if (first <= high)[:2].all() and (last >= low)[:2].all():
        return

    def fits(points: Array) -> bool:
        return bool(((points.min(axis=0) <= high) & (points.max(axis=0) >= low)).all())

    nearby = bool(((first <= high + NEAR_BOX_M) & (last >= low - NEAR_BOX_M)).all())
    if fits(position[:, [1, 0, 2]]):
        advice = "Swap the columns x_m and y_m"
    elif fits(position[:, [0, 2, 1]] * [1, -1, 1]) or fits(position[:, [0, 2, 1]]):
        advice = "The terrain seems to have another axis up: give it with --up"
    elif fits(surface.shift.to_survey(position)):
        advice = "The picks look like local coordinates: add the terrain's shift to them"
    elif hint := unit_hint(surface.shift.to_local(position), surface):
        advice = hint
    elif fits(position * 0.001):
        advice = "The picks look like millimetres: convert them to metres"
    elif nearby:
        advice = "They are neighbours: give the terrain of the whole slope, or correct the coordinates"
    else:
        advice = "Bring both to the same coordinate reference system (and the same shift)"
    raise InputError(
        f"The picks and the terrain {surface.name} do not overlap, they seem to be in different coordinate systems: "
        f"picks {_box(first, last)}, terrain {_box(low, high)}",
        file=picks.source or None,
        advice=advice,
    )


def _box(low: Array, high: Array) -> str:
    return ", ".join(f"{axis} {a:.1f}…{b:.1f} m" for axis, a, b in zip("xyz", low, high, strict=True))


@dataclass(frozen=True, eq=False)
class GroundNormals:
    """Normals at n picks.

    Attributes
    ----------
    normal : (n, 3) unit, out of the ground; NaN where unknown.
    radius_m : (n,) of the sphere in which the terrain normal was fitted [m]; NaN where the normal was given.
    spread : (n,) root mean square angle between the terrain's faces there and the fitted plane [rad]; NaN likewise.
    tilt : (n,) root mean square angle by which the plane itself may be off [rad]; NaN likewise.
    by_place : (n, 3, 3) change of the normal with the place [1/m], over the place's standard deviation; zero where the
        normal or the place is given without error.
    """

    normal: Array
    radius_m: Array
    spread: Array
    tilt: Array
    by_place: Array

    @classmethod
    def given(cls, normal: Array) -> "GroundNormals":
        """Normals (n, 3) that are not the terrain's."""
        n = len(normal)
        radius_m, spread, tilt = np.full((3, n), np.nan)
        return cls(normal.copy(), radius_m, spread, tilt, np.zeros((n, 3, 3)))

    def take(self, rows: Any) -> "GroundNormals":
        """Some of them."""
        return GroundNormals(*(getattr(self, one.name)[rows] for one in fields(self)))

    def with_rows(self, rows: Any, others: "GroundNormals") -> "GroundNormals":
        """These with some rows replaced."""
        made = GroundNormals(*(getattr(self, one.name).copy() for one in fields(self)))
        for one in fields(self):
            getattr(made, one.name)[rows] = getattr(others, one.name)
        return made


def pick_normals(
    picks: Picks, surface: "Surface | None", diameter_m: Array, radius_m: float | None, wanted: Mask
) -> GroundNormals:
    """The normals of picks: as given, else those of the terrain, where they are `wanted` (n,).

    Parameters
    ----------
    diameter_m, radius_m : see `terrain_normals`.
    """
    found = GroundNormals.given(picks.normal)
    bare = np.flatnonzero(np.isnan(picks.normal[:, 0]) & wanted)
    if surface is None or not bare.size:
        return found
    fitted = terrain_normals(surface, picks.position[bare], diameter_m[bare], radius_m, picks.sigma_position_m[bare])
    return found.with_rows(bare, fitted)


def terrain_normals(
    surface: "Surface", points: Array, diameter_m: Array, radius_m: float | None, sigma_m: Array | None = None
) -> GroundNormals:
    """Normals of the terrain at block scale.

    Parameters
    ----------
    points : (n, 3) local [m]; the sphere is set on the closest point of the terrain.
    diameter_m : (n,) of the block [m].
    radius_m : of the sphere; None takes `default_normal_radius` for each block.
    sigma_m : (n,) standard deviation of the points [m], for `by_place`; NaN or None where it is not known.
    """
    from ..terrain.orientation import block_scale_normals, default_normal_radius
    from ..terrain.raycast import closest_points

    found = GroundNormals.given(np.full_like(points, np.nan))
    normal, radius = found.normal, found.radius_m
    radius[:] = np.nan if radius_m is None else radius_m
    if not len(points):
        return found
    on_terrain = closest_points(surface, points).point
    if radius_m is None:
        for diameter in np.unique(diameter_m):
            radius[diameter_m == diameter] = default_normal_radius(surface, float(diameter))
    for used in np.unique(radius):
        rows = radius == used
        fitted = block_scale_normals(surface, on_terrain[rows], float(used))
        normal[rows], found.spread[rows] = fitted.normal, np.radians(fitted.spread_deg)
        found.tilt[rows] = np.radians(fitted.tilt_deg)
        if sigma_m is not None:
            loose = np.flatnonzero(rows & (np.nan_to_num(sigma_m) > 0) & np.isfinite(normal[:, 0]))
            found.by_place[loose] = _by_place(surface, on_terrain[loose], normal[loose], float(used), sigma_m[loose])
    return found


def _by_place(surface: "Surface", points: Array, normal: Array, radius_m: float, sigma_m: Array) -> Array:
    """(n, 3, 3) change of the normals with the place along the ground, between one deviation to either side [1/m]."""
    from ..terrain.orientation import normals_beside

    change = np.zeros((len(points), 3, 3))
    if not len(points):
        return change
    step = np.maximum(sigma_m, LEAST_STEP * radius_m)[:, None]
    directions = perpendicular(normal)
    beside = np.concatenate([points + sign * step * direction for direction in directions for sign in (1, -1)])
    found = np.split(normals_beside(surface, beside, radius_m, np.tile(normal, (4, 1))), 4)
    for direction, there, back in zip(directions, found[::2], found[1::2], strict=True):
        slope = np.nan_to_num((there - back) / (2 * step))
        change += slope[:, :, None] * direction[:, None, :]
    return change

# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays, closest points and heights above the terrain, on the surface's spatial index; exact in float64."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import as_rows, in_chunks
from ..errors import InputError
from ..vectors import Array, Mask, norm
from .surface import Surface


@dataclass(frozen=True, eq=False)
class RayHits:
    """First hits of n rays.

    Attributes
    ----------
    distance : (n,) from the origin [m], inf when missed.
    face : (n,) of the surface, -1 when missed.
    point : (n, 3) local coordinates [m], NaN when missed.
    """

    distance: Array
    face: NDArray[np.int32]
    point: Array


@dataclass(frozen=True, eq=False)
class ClosestPoints:
    """Closest points of the surface to n points.

    Attributes
    ----------
    point : (n, 3) on the surface, local coordinates [m]; NaN when nothing is within the maximum distance.
    face : (n,) -1 when nothing.
    distance : (n,) [m], inf when nothing.
    """

    point: Array
    face: NDArray[np.int32]
    distance: Array


class Hit(NamedTuple):
    """Of one ray, or the closest point.

    Attributes
    ----------
    distance : from the origin or the point [m].
    face : of the surface.
    point : (3,) on the surface, local coordinates [m].
    """

    distance: float
    face: int
    point: Array


def cast_rays(surface: Surface, origins: Any, directions: Any, max_distance: float = np.inf) -> RayHits:
    """First hit of each ray, on either side of a face.

    A ray through an edge or a vertex that faces share hits one of them: there is no gap between neighbours.

    Parameters
    ----------
    origins, directions : (n, 3) or (3,) [m]; one of either serves all of the other. Directions may have any length.
    max_distance : how far to look [m].

    Raises
    ------
    InputError : a coordinate that is not finite, a direction of length zero, lengths that do not match.
    """
    from . import kernels

    start, towards = _rays(origins, directions)
    n = len(start)
    distance, place = np.empty(n), np.empty(n, np.int64)
    tree, limit = surface.index.tree, float(max_distance)
    in_chunks(lambda i, j: kernels.cast_many(tree, start, towards, limit, distance, place, i, j), n)
    hit = place >= 0
    face = np.where(hit, surface.index.face[place], np.int32(-1))
    point = np.full((n, 3), np.nan)
    point[hit] = start[hit] + distance[hit, None] * towards[hit]
    return RayHits(distance, face, point)


def cast_ray(surface: Surface, origin: Any, direction: Any, max_distance: float = np.inf) -> Hit | None:
    """First hit of one ray, None without one: `cast_rays` for who follows a mouse.

    Parameters
    ----------
    origin, direction : (3,) [m]; the direction may have any length.

    Raises
    ------
    InputError : as `cast_rays`.
    """
    from . import ray_kernels

    (x, y, z), (u, v, w) = _three(origin, "origin"), _three(direction, "direction")
    index = surface.index
    distance, face, *point = ray_kernels.first_hit(index.tree, index.face, x, y, z, u, v, w, float(max_distance))
    if face == ray_kernels.REFUSED:
        _rays(origin, direction)
    return Hit(distance, face, np.array(point)) if face >= 0 else None


def any_hit(surface: Surface, origins: Any, directions: Any, max_distance: Any = np.inf) -> Mask:
    """Whether each ray hits the surface at all, (n,): for what is seen or lies in the shade.

    Parameters
    ----------
    origins, directions : as `cast_rays`.
    max_distance : how far to look [m], for all rays or (n,) for each.

    Raises
    ------
    InputError : as `cast_rays`.
    """
    from . import ray_kernels

    start, towards = _rays(origins, directions)
    n = len(start)
    limits = np.ascontiguousarray(np.broadcast_to(np.asarray(max_distance, dtype=np.float64), n))
    tree, hit = surface.index.tree, np.empty(n, np.bool_)
    in_chunks(lambda i, j: ray_kernels.any_many(tree, start, towards, limits, hit, i, j), n)
    return hit


def closest_point(surface: Surface, point: Any, max_distance: float = np.inf) -> Hit | None:
    """The closest point of the surface to one point (3,) [m], None without one that near.

    Raises
    ------
    InputError : a coordinate that is not finite.
    """
    from . import ray_kernels

    x, y, z = _three(point, "point")
    index = surface.index
    distance, face, *found = ray_kernels.closest(index.tree, index.face, x, y, z, float(max_distance))
    if face == ray_kernels.REFUSED:
        _finite_rows(point, "point")
    return Hit(distance, face, np.array(found)) if face >= 0 else None


def closest_points(surface: Surface, points: Any, max_distance: float = np.inf) -> ClosestPoints:
    """The closest point of the surface to each of (n, 3) points [m].

    Raises
    ------
    InputError : a coordinate that is not finite.
    """
    from . import kernels

    query = _finite_rows(points, "point")
    n = len(query)
    point, distance, place = np.empty((n, 3)), np.empty(n), np.empty(n, np.int64)
    tree, limit = surface.index.tree, float(max_distance)
    in_chunks(lambda i, j: kernels.closest_many(tree, query, limit, point, distance, place, i, j), n)
    return ClosestPoints(point, np.where(place >= 0, surface.index.face[place], np.int32(-1)), distance)


def heights_above(surface: Surface, points: Any) -> Array:
    """Vertical clearance of (n, 3) points [m] over the terrain, (n,): negative in the ground, NaN off the terrain.

    Notes
    -----
    On overhangs a vertical line meets several sheets. The nearest one above or below tells whether the point is in
    the open (the sheet shows its outer side) or in the ground. In the open, the height is counted from the next sheet
    below, so that under an overhang it is the height over the floor; in the ground, to the next sheet above, which
    is how far the point has to rise to get out. Where that sheet is missing, the nearest one stands in for it.
    """
    query = _finite_rows(points, "point")
    down, up = cast_rays(surface, query, (0, 0, -1)), cast_rays(surface, query, (0, 0, 1))
    nearest_is_below = down.distance <= up.distance
    nearest_face = np.where(nearest_is_below, down.face, up.face)
    faces_up = surface.face_normals[nearest_face, 2] > 0
    in_the_open = nearest_is_below == faces_up
    nearest = np.minimum(down.distance, up.distance)
    height = np.where(
        in_the_open,
        np.where(np.isfinite(down.distance), down.distance, nearest),
        -np.where(np.isfinite(up.distance), up.distance, nearest),
    )
    return np.where(nearest_face >= 0, height, np.nan)


def _rays(origins: Any, directions: Any) -> tuple[Array, Array]:
    """(n, 3) origins and directions of length 1."""
    start, towards = _finite_rows(origins, "origin"), _finite_rows(directions, "direction")
    if len(start) != len(towards) and 1 not in (len(start), len(towards)):
        raise InputError(f"{len(start)} ray origins and {len(towards)} directions do not match")
    # Scaling first keeps very short and very long directions from under- or overflowing when squared.
    largest = np.abs(towards).max(axis=1, initial=0.0, keepdims=True)
    if (largest == 0).any():
        row = int(np.flatnonzero(largest[:, 0] == 0)[0])
        raise InputError(f"The direction of ray {row} has length zero", advice="Give a direction for each ray")
    towards = towards / largest
    towards /= norm(towards)[:, None]
    n = 0 if 0 in (len(start), len(towards)) else max(len(start), len(towards))
    whole = np.broadcast_to(start, (n, 3)), np.broadcast_to(towards, (n, 3))
    return np.ascontiguousarray(whole[0]), np.ascontiguousarray(whole[1])


def _three(numbers: Any, what: str) -> tuple[float, float, float]:
    try:
        x, y, z = numbers.tolist() if isinstance(numbers, np.ndarray) else numbers
        return float(x), float(y), float(z)
    except (TypeError, ValueError):
        raise InputError(f"The {what} needs three numbers, not {numbers!r}") from None


def _finite_rows(points: Any, what: str) -> Array:
    rows = as_rows(points)
    if rows.size == 0:
        return np.empty((0, 3))
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise InputError(f"{what.capitalize()}s have the shape {rows.shape}, where (n, 3) is needed")
    finite = np.isfinite(rows).all(axis=1)
    if not finite.all():
        row = int(np.flatnonzero(~finite)[0])
        raise InputError(f"The {what} {row} is not finite: {rows[row].tolist()}", advice="Leave out rows with NaN")
    return rows

# SPDX-License-Identifier: GPL-3.0-or-later
"""Single points from pixels: on the terrain from one view, in the air from several."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..camera.model import SIGMA_PX, Camera, Projection, project, project_with_derivatives, rays
from ..errors import InputError
from ..least_squares import damped_step, inverse
from ..terrain.raycast import cast_rays
from ..terrain.surface import Surface
from ..vectors import Array, Indices, Mask, across, cross, distance_to_ray, dot, norm, perpendicular, unit
from .placement import terrain_normals
from .refinement.ground_errors import normal_variance

GRAZING_DEG = 5.0
"""Between a ray and the terrain; below it a pixel covers metres of ground."""
ITERATIONS = 20
SETTLED_M = 1e-10
CONTACT_SETTLED_M = 1e-4
CONTACT_STEPS = 20


@dataclass(frozen=True, eq=False)
class TerrainPicks:
    """n pixels on the terrain.

    Attributes
    ----------
    point, normal : (n, 3) where the ray meets the terrain [m], and the normal of the face there; NaN when it misses.
    covariance : (n, 3, 3) of the point [m²]: of the pixel, and of the pose and the terrain as far as these are given.
    ellipse : (n, 2, 3) half axes of its ellipse of one standard deviation in the plane of the face, the longer one
        first [m].
    grazing : (n,) angle between the ray and the terrain [rad].
    warning : n sentences, empty where all is well.
    """

    point: Array
    normal: Array
    covariance: Array
    ellipse: Array
    grazing: Array
    warning: tuple[str, ...]


def pick_on_terrain(
    camera: Camera,
    pixels: Array,
    surface: Surface,
    sigma_px: Array | float = SIGMA_PX,
    *,
    position: Array | None = None,
    rotation: Array | None = None,
    pose_covariance: Array | None = None,
    sigma_terrain_m: float = 0.0,
) -> TerrainPicks:
    """Where the rays through pixels meet the terrain first.

    Parameters
    ----------
    pixels : (n, 2) [px].
    sigma_px : (n,) standard deviation of u and of v [px].
    position, rotation : (n, 3) and (n, 3, 3), a pose for each pixel instead of the camera's own.
    pose_covariance : (6, 6) or (n, 6, 6) of the poses: rotation vector [rad] about the axes of the camera in that
        picture, and position [m]; without it the poses are taken to be exact. (15, 15) or (n, 15, 15) with the lens, in
        the order of `INTRINSICS`.
    sigma_terrain_m : accuracy of the terrain, see `ground_errors.normal_variance`; 0 for an exact one.

    Notes
    -----
    First order: the point slides on the plane of its face, and where that plane is off, along the ray. At grazing
    angles a pixel covers metres of terrain, and the ray may as well meet the hump in front or the one behind: that is
    warned of below 5°.
    """
    pixel = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
    n = len(pixel)
    sigma = np.broadcast_to(np.asarray(sigma_px, dtype=np.float64), n)
    origin, direction = rays(camera, pixel, position=position, rotation=rotation)
    point, normal = np.full((n, 3), np.nan), np.full((n, 3), np.nan)
    seen = np.flatnonzero(np.isfinite(direction).all(axis=1))
    hits = cast_rays(surface, origin[seen], direction[seen])
    met = seen[hits.face >= 0]
    point[met], normal[met] = hits.point[hits.face >= 0], surface.face_normals[hits.face[hits.face >= 0]]
    grazing = np.arcsin(np.minimum(np.abs(dot(direction, normal)), 1.0))

    covariance, ellipse = np.full((n, 3, 3), np.nan), np.full((n, 2, 3), np.nan)
    if met.size:
        place = None if position is None else position[met]
        turn = None if rotation is None else rotation[met]
        seen_there = project_with_derivatives(camera, point[met], position=place, rotation=turn)
        by_point = seen_there.d_point
        along = unit(direction[met] - dot(direction[met], normal[met])[:, None] * normal[met])
        bare = ~np.isfinite(along[:, 0])  # looking straight down on the face: any axis does
        along = np.where(bare[:, None], perpendicular(normal[met])[0], along)
        plane = np.stack([along, cross(normal[met], along)], axis=2)
        on_plane = np.linalg.inv(by_point @ plane)  # pixels → the plane's two axes
        variance = (sigma[met, None, None] ** 2) * np.eye(2)
        if pose_covariance is not None:
            variance = variance + _by_pose(seen_there, pose_covariance, met, n)
        in_plane = on_plane @ variance @ np.swapaxes(on_plane, 1, 2)
        raised = normal[met][:, :, None] - plane @ on_plane @ by_point @ normal[met][:, :, None]  # along the ray
        uneven = normal_variance(sigma_terrain_m, normal[met])[:, None, None] * (raised @ np.swapaxes(raised, 1, 2))
        covariance[met] = plane @ in_plane @ np.swapaxes(plane, 1, 2) + uneven
        size, axes = np.linalg.eigh(np.swapaxes(plane, 1, 2) @ covariance[met] @ plane)
        half = np.sqrt(np.maximum(size, 0.0))[:, None, ::-1] * (plane @ axes)[:, :, ::-1]
        ellipse[met] = np.swapaxes(half, 1, 2)
    warnings = tuple(
        "The ray misses the terrain."
        if np.isnan(angle)
        else f"The ray grazes the terrain at {np.degrees(angle):.1f}°: its place is known to {norm(axes[0]):.1f} m."
        if angle < np.radians(GRAZING_DEG)
        else ""
        for angle, axes in zip(grazing, ellipse, strict=True)
    )
    return TerrainPicks(point, normal, covariance, ellipse, grazing, warnings)


def _by_pose(seen: Projection, pose_covariance: Array, rows: Indices, n: int) -> Array:
    """(k, 2, 2) of pixels from (6, 6) or (n, 6, 6) of poses, for the k rows of n that were projected [px²].

    With 15 in place of 6, the lens is in it, too.
    """
    matrix = np.asarray(pose_covariance, dtype=np.float64)
    poses = np.broadcast_to(matrix, (n, *matrix.shape[-2:]))[rows]
    by_pose = np.concatenate([seen.d_rotation, seen.d_position], axis=2)
    if matrix.shape[-1] > by_pose.shape[2]:
        by_pose = np.concatenate([by_pose, seen.d_intrinsics], axis=2)
    return np.asarray(by_pose @ poses @ np.swapaxes(by_pose, 1, 2))


def contact_points(
    surface: Surface, origins: Array, directions: Array, diameter_m: Array, normal_radius_m: float | None = None
) -> tuple[Array, Array]:
    """Where blocks touch the terrain, whose centres lie on rays; (n, 3) points and (n, 3) normals, NaN where missed.

    Parameters
    ----------
    origins, directions : (n, 3) of the rays.
    diameter_m : (n,) of the blocks.

    Notes
    -----
    The centre is a radius from the contact along the normal, so the contact lies where the ray, moved by that much into
    the ground, meets the terrain; the normal there is found by iteration. A grazing ray that never settles keeps the
    mean of its last two contacts.
    """
    hits = cast_rays(surface, origins, directions)
    point = hits.point.copy()
    normal = np.full_like(point, np.nan)
    going = np.flatnonzero(hits.face >= 0)
    for step in range(CONTACT_STEPS):
        if not going.size:
            break
        normal[going] = terrain_normals(surface, point[going], diameter_m[going], normal_radius_m).normal
        moved = origins[going] - diameter_m[going, None] / 2 * normal[going]
        found = cast_rays(surface, moved, directions[going]).point
        found = np.where(np.isnan(found), point[going], found)
        moving = norm(found - point[going]) > CONTACT_SETTLED_M
        point[going] = found if step < CONTACT_STEPS - 1 else (found + point[going]) / 2
        going = going[moving]
    return point, normal


@dataclass(frozen=True, eq=False)
class SpacePoints:
    """n points seen from several views at one time.

    Attributes
    ----------
    point : (n, 3) [m]; NaN where fewer than two views see it.
    covariance : (n, 3, 3) of the pixels, and of the poses as far as these are given [m²].
    miss_distance : (n,) root mean square distance of the rays from the point [m].
    residual_px : (v, n, 2) observed less projected [px]; NaN where not seen.
    """

    point: Array
    covariance: Array
    miss_distance: Array
    residual_px: Array


def triangulate(
    cameras: Sequence[Camera],
    pixels: Array,
    sigma_px: Array | float = SIGMA_PX,
    *,
    pose_covariances: Sequence[Array] | None = None,
) -> SpacePoints:
    """Points from their pixels in v views at one common time.

    Parameters
    ----------
    cameras : v, with their poses at that time.
    pixels : (v, n, 2) [px]; NaN where a view does not see the point.
    sigma_px : (v, n) or a number, standard deviation of u and of v [px].
    pose_covariances : v of (6, 6) or (15, 15), as of `pick_on_terrain`; those of different views are independent.

    Raises
    ------
    InputError : fewer than two views, or the shapes do not match.

    Notes
    -----
    The start is the point of least squared distances from the rays; then Gauss–Newton on the weighted squares of the
    pixels, which is the maximum of likelihood (Hartley & Sturm 1997). The poses are not estimated: their errors move
    the point as they move the pixels (consider parameters; Schmidt 1966).
    """
    pixel = np.asarray(pixels, dtype=np.float64)
    if len(cameras) < 2 or pixel.ndim != 3 or pixel.shape[::2] != (len(cameras), 2):
        raise InputError(
            f"{len(cameras)} views with pixels of the shape {pixel.shape} cannot be triangulated",
            advice="Give two views or more, and pixels (views, points, 2)",
        )
    v, n = pixel.shape[:2]
    sigma = np.broadcast_to(np.asarray(sigma_px, dtype=np.float64), (v, n))
    beams = [rays(camera, rows) for camera, rows in zip(cameras, pixel, strict=True)]
    origin, direction = np.stack([beam[0] for beam in beams]), np.stack([beam[1] for beam in beams])
    seen: Mask = np.asarray(np.isfinite(direction).all(axis=2))
    enough = np.flatnonzero(seen.sum(axis=0) >= 2)
    point = np.full((n, 3), np.nan)
    beside = np.where(seen[:, :, None, None], across(direction), 0.0)
    pull = np.einsum("vnij,vnj->vni", beside, np.where(seen[:, :, None], origin, 0.0)).sum(axis=0)
    point[enough] = np.linalg.solve(beside.sum(axis=0)[enough], pull[enough, :, None])[:, :, 0]

    information = np.zeros((n, 3, 3))
    residual = np.full((v, n, 2), np.nan)
    for _ in range(ITERATIONS):
        information[:], gradient = 0.0, np.zeros((n, 3))
        for i, camera in enumerate(cameras):
            use = enough[seen[i, enough]]
            found = project_with_derivatives(camera, point[use])
            residual[i, use] = pixel[i, use] - found.pixel
            slope = found.d_point / sigma[i, use, None, None]
            information[use] += np.swapaxes(slope, 1, 2) @ slope
            gradient[use] += np.einsum("nij,ni->nj", slope, residual[i, use] / sigma[i, use, None])
        good = enough[np.isfinite(information[enough]).all(axis=(1, 2))]
        step = damped_step(information[good], gradient[good])
        point[good] += step
        if not step.size or np.abs(step).max() < SETTLED_M:
            break
    covariance = np.full((n, 3, 3), np.nan)
    covariance[good] = inverse(information[good])
    for i, pose in enumerate(() if pose_covariances is None else pose_covariances):
        use = good[seen[i, good]]
        found = project_with_derivatives(cameras[i], point[use])
        gain = np.asarray(inverse(information[use]) @ np.swapaxes(found.d_point, 1, 2) / sigma[i, use, None, None] ** 2)
        covariance[use] += gain @ _by_pose(found, pose, use, n) @ np.swapaxes(gain, 1, 2)
    count = np.maximum(seen.sum(axis=0), 1)
    miss = np.sqrt(np.where(seen, distance_to_ray(point, origin, direction) ** 2, 0.0).sum(axis=0) / count)
    return SpacePoints(point, covariance, np.where(np.isfinite(point[:, 0]), miss, np.nan), residual)


def epipolar_curve(
    camera1: Camera,
    pixel: Array,
    camera2: Camera,
    near_m: float,
    far_m: float,
    surface: Surface | None = None,
    samples: int = 100,
) -> Array:
    """Where a pixel of one view may lie in another: the ray through it, projected, (k, 2) [px].

    Parameters
    ----------
    near_m, far_m : the part of the ray that is drawn, by distance from the first camera [m].
    surface : the ray ends on the terrain.
    samples : points along it, evenly spread over the inverse of the distance; those that the second camera cannot see
        are left out.

    Raises
    ------
    InputError : the distances do not ascend from above zero, or the pixel has no ray.
    """
    if not 0 < near_m < far_m:
        raise InputError(f"The ray cannot run from {near_m} m to {far_m} m", advice="Give 0 < near < far")
    origin, direction = rays(camera1, np.asarray(pixel, dtype=np.float64).reshape(1, 2))
    if not np.isfinite(direction).all():
        raise InputError("The pixel is outside of what the lens can see, so that it has no ray")
    end = far_m
    if surface is not None:
        end = min(far_m, float(cast_rays(surface, origin, direction).distance[0]))
        near_m = min(near_m, end)
    distance = 1 / np.linspace(1 / near_m, 1 / end, samples)
    curve = project(camera2, origin + distance[:, None] * direction)
    return curve[np.isfinite(curve).all(axis=1)]

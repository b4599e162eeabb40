# SPDX-License-Identifier: GPL-3.0-or-later
"""Between a region of the screen, the pixels of a video, and the world.

Blender's own rays are single precision and know no distortion. So only the rectangle that the picture fills on the
screen is asked of Blender; from its pixels on, the core computes. Pixels count from the top-left corner, v down.
"""

from dataclasses import dataclass

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from numpy.typing import ArrayLike

from ...core.camera.path import project_at, rays_at
from ...core.vectors import Array
from ..scene.footage import camera_paths, clocks, videos
from ..scene.storage import store

SAME_SHAPE = 1e-3


@dataclass(frozen=True)
class Rectangle:
    """Where a picture is in a region [px of the region, y up from its bottom left corner]."""

    left: float
    bottom: float
    width: float
    height: float


def image_rectangle(
    region: bpy.types.Region, rv3d: bpy.types.RegionView3D, scene: bpy.types.Scene, camera: bpy.types.Object
) -> Rectangle | None:
    """Where a camera's picture is on the screen; None when the view does not look through this camera.

    None also when the scene's render size has another shape than the video: `shape_agrees`.
    """
    if rv3d is None or rv3d.view_perspective != "CAMERA" or scene.camera != camera:
        return None
    if not videos.is_video(camera) or not shape_agrees(scene, camera):
        return None
    corners = [camera.matrix_world @ corner for corner in camera.data.view_frame(scene=scene)]
    seen = [location_3d_to_region_2d(region, rv3d, corner) for corner in corners]
    if any(point is None for point in seen):
        return None
    x, y = np.array(seen, dtype=np.float64).T
    rectangle = Rectangle(float(x.min()), float(y.min()), float(np.ptp(x)), float(np.ptp(y)))
    return rectangle if rectangle.width > 0 and rectangle.height > 0 else None


def shape_agrees(scene: bpy.types.Scene, camera: bpy.types.Object) -> bool:
    """Whether the scene's render size has the shape of the video; otherwise footage and terrain would not fit."""
    render, (width, height) = scene.render, videos.size_of(camera)
    x, y = camera.get(store.ASPECT, (1.0, 1.0))
    shape = render.resolution_x * render.pixel_aspect_x / (render.resolution_y * render.pixel_aspect_y)
    return abs(shape * (height * y) / (width * x) - 1) < SAME_SHAPE


def to_pixel(rectangle: Rectangle, size: tuple[int, int], region_xy: ArrayLike) -> Array:
    """Pixels (..., 2) of the video at places (..., 2) of the region."""
    place = np.asarray(region_xy, dtype=np.float64)
    u = (place[..., 0] - rectangle.left) / rectangle.width * size[0]
    v = (1 - (place[..., 1] - rectangle.bottom) / rectangle.height) * size[1]
    return np.stack([u, v], axis=-1)


def to_region(rectangle: Rectangle, size: tuple[int, int], uv: ArrayLike) -> Array:
    """Places (..., 2) in the region of pixels (..., 2) of the video."""
    pixel = np.asarray(uv, dtype=np.float64)
    x = rectangle.left + pixel[..., 0] / size[0] * rectangle.width
    y = rectangle.bottom + (1 - pixel[..., 1] / size[1]) * rectangle.height
    return np.stack([x, y], axis=-1)


def ray(scene: bpy.types.Scene, camera: bpy.types.Object, pixel: ArrayLike, common_s: ArrayLike) -> tuple[Array, Array]:
    """Rays through pixels (2,) or (n, 2) of the picture at common times, one or (n,).

    Returns origins and unit directions of the same shape (3,) or (n, 3), local [m]; NaN where a pixel has no ray.
    """
    pixels = np.asarray(pixel, dtype=np.float64)
    rows = pixels.reshape(-1, 2)
    origins, directions = rays_at(camera_paths.camera_path(camera), rows, _video_times(camera, common_s, rows))
    shape = (*pixels.shape[:-1], 3)
    return origins.reshape(shape), directions.reshape(shape)


def project(scene: bpy.types.Scene, camera: bpy.types.Object, points: ArrayLike, common_s: ArrayLike) -> Array:
    """Pixels (..., 2) of local points (..., 3) [m] at common times, one or (n,); NaN where they are not seen."""
    world = np.asarray(points, dtype=np.float64)
    rows = world.reshape(-1, 3)
    pixel = project_at(camera_paths.camera_path(camera), rows, _video_times(camera, common_s, rows))
    return pixel.reshape(*world.shape[:-1], 2)


def _video_times(camera: bpy.types.Object, common_s: ArrayLike, rows: Array) -> Array:
    times = clocks.clock_of(camera).to_video(np.asarray(common_s, dtype=np.float64).reshape(-1))
    return np.broadcast_to(times, (len(rows),))

# SPDX-License-Identifier: GPL-3.0-or-later
"""Between a 3-D view, the camera and the terrain: rays, and the camera that stands where a view looks from."""

from collections.abc import Sequence

import bpy
import numpy as np

from ....core.camera.blender_lens import pose_from_blender
from ....core.camera.model import Camera, with_intrinsics
from ....core.camera.path import rays_at
from ....core.errors import RockfallError
from ....core.terrain.raycast import cast_ray
from ....core.vectors import Array
from ...scene.footage import alignment, camera_paths, pairs, videos
from ...scene.storage import store
from ...scene.terrain import georeference, terrain

type Point = tuple[float, float, float]


def look_through(scene: bpy.types.Scene, camera: bpy.types.Object) -> None:
    """Make it the scene's camera, and the scene's pictures as large as the video's."""
    scene.camera = camera
    render = scene.render
    render.resolution_x, render.resolution_y = videos.size_of(camera)
    render.resolution_percentage = 100
    render.pixel_aspect_x, render.pixel_aspect_y = camera.get(store.ASPECT, (1.0, 1.0))


def point_at(scene: bpy.types.Scene, camera: bpy.types.Object, pixel: Sequence[float], frame: int) -> Point | None:
    """Where the ray of a pixel meets the terrain; None where it does not."""
    return meet(scene, *rays_at(camera_paths.camera_path(camera), [pixel], pairs.times_of(camera, [frame])))


def meet(scene: bpy.types.Scene, origin: Array, direction: Array) -> Point | None:
    """Where a ray meets the terrain, all its tiles in double precision; None where it does not, or without terrain."""
    surface = terrain.surface_of_scene(scene)
    if surface is None or not np.isfinite(direction).all():
        return None
    hit = cast_ray(surface, origin[0], direction[0])
    return tuple(hit.point.tolist()) if hit is not None else None


def free_ray(rv3d: bpy.types.RegionView3D, width: float, height: float, x: float, y: float) -> tuple[Array, Array]:
    """Origin and direction, (1, 3) each, of what is seen at a place of a region, in double precision.

    width, height, x, y : of the region and in it [px], y from below.
    """
    window, view = np.array(rv3d.window_matrix, dtype=np.float64), np.array(rv3d.view_matrix, dtype=np.float64)
    a, b = 2 * x / width - 1, 2 * y / height - 1
    if rv3d.is_perspective:
        origin = np.zeros(3)
        direction = np.array([(a + window[0, 2]) / window[0, 0], (b + window[1, 2]) / window[1, 1], -1.0])
    else:
        back = np.abs(view[:3, 3]).max() + 1e4  # in front of everything
        origin = np.array([(a - window[0, 3]) / window[0, 0], (b - window[1, 3]) / window[1, 1], back])
        direction = np.array([0.0, 0.0, -1.0])
    turn = view[:3, :3]
    return ((origin - view[:3, 3]) @ turn)[None], (direction @ turn)[None]


def seen_camera(
    scene: bpy.types.Scene, camera: bpy.types.Object, rv3d: bpy.types.RegionView3D, width: float, *, keep_focal: bool
) -> Camera:
    """A camera that stands where a 3-D view looks from, with the video's size.

    width : of the region [px]; unless the focal length is kept, the picture shows as much as the region's width.

    Raises
    ------
    RockfallError : the view has no perspective.
    """
    matrix = rv3d.view_matrix.inverted()
    if rv3d.view_perspective == "CAMERA" and scene.camera == camera:
        matrix, keep_focal = camera.matrix_world, True
    elif rv3d.view_perspective != "PERSP":
        raise RockfallError("This view has no perspective, so no camera sees it. Press Numpad 5 first.")
    position, rotation = pose_from_blender(np.array(matrix))
    lens, (w, h) = alignment.lens_of(camera), videos.size_of(camera)
    if not keep_focal:
        lens[:2] = float(rv3d.window_matrix[0][0]) * w / 2 * np.array([1.0, lens[1] / lens[0]])
    shift = georeference.read_shift(scene)
    return with_intrinsics(Camera(w, h, 1.0, 1.0, 0.0, 0.0, position=position, rotation=rotation, shift=shift), lens)

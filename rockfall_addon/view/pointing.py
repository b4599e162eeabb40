# SPDX-License-Identifier: GPL-3.0-or-later
"""The mouse in a 3-D view: what it points at on the terrain, and which pick is under it."""

from collections.abc import Sequence

import bpy
import numpy as np
from bpy_extras.view3d_utils import region_2d_to_origin_3d, region_2d_to_vector_3d
from mathutils import Vector

from ...core.camera.model import project
from ...core.errors import RockfallError
from ...core.vectors import Array
from ..scene.footage import camera_paths, clicks, pictures, videos
from ..scene.picks import picks, places
from ..scene.picks.places import Place
from ..scene.storage import store
from . import image_view

REACH_PX = 10.0
"""A pick is under the mouse within this [px at interface scale 1]."""


def camera_of(context: bpy.types.Context) -> bpy.types.Object | None:
    """The video's camera through which the 3-D view of the context looks; None in a free view."""
    space, region = context.space_data, context.region_data
    if space is None or space.type != "VIEW_3D" or region is None or region.view_perspective != "CAMERA":
        return None
    camera = space.camera if space.use_local_camera else context.scene.camera
    return camera if videos.is_video(camera) else None


def solved_camera_of(context: bpy.types.Context) -> bpy.types.Object | None:
    """`camera_of`, unless its pose is not known: then pixels are taken as in a free view."""
    camera = camera_of(context)
    return camera if camera is not None and camera_paths.is_solved(camera) else None


def pixel_at(context: bpy.types.Context, xy: Sequence[float]) -> Array | None:
    """(2,) pixel of the footage under a place of the region; None outside of the picture or in a free view."""
    camera = camera_of(context)
    if camera is None:
        return None
    rectangle = image_view.image_rectangle(context.region, context.region_data, context.scene, camera)
    if rectangle is None:
        return None
    size = videos.size_of(camera)
    pixel = image_view.to_pixel(rectangle, size, xy)
    return pixel if (pixel >= 0).all() and (pixel <= size).all() else None


def view_under(
    context: bpy.types.Context, x: int, y: int
) -> tuple[bpy.types.Area, bpy.types.Region, tuple[int, int]] | None:
    """The 3-D view under a place of the window, and the place in its region; None over panels and other editors."""
    for area in context.window.screen.areas:
        if area.type != "VIEW_3D" or not _inside(area, x, y):
            continue
        for region in area.regions:
            if region.type != "WINDOW" and region.width > 1 and region.height > 1 and _inside(region, x, y):
                return None
        region = next(region for region in area.regions if region.type == "WINDOW")
        return area, region, (x - region.x, y - region.y)
    return None


def _inside(part: bpy.types.Area | bpy.types.Region, x: int, y: int) -> bool:
    return part.x <= x < part.x + part.width and part.y <= y < part.y + part.height


def place_at(context: bpy.types.Context, xy: Sequence[float], name: str) -> Place:
    """Where a place of the region lies on the terrain, for the block of a trajectory.

    Raises
    ------
    RockfallError : the ray misses the terrain, or there is none.
    """
    camera, pixel = solved_camera_of(context), pixel_at(context, xy)
    if camera is not None:
        if pixel is None:
            raise RockfallError(_no_pixel(context, camera))
        return places.in_picture(context.scene, camera, pixel, name)
    origin = region_2d_to_origin_3d(context.region, context.region_data, Vector(xy))
    direction = region_2d_to_vector_3d(context.region, context.region_data, Vector(xy))
    return places.on_ray(context.scene, np.array(origin), np.array(direction), name)


def on_screen(context: bpy.types.Context, points: Array) -> Array:
    """Places of points (n, 3) in the region, (n, 2); NaN where they are not seen."""
    points = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    camera = solved_camera_of(context)
    if camera is not None:
        scene = context.scene
        rectangle = image_view.image_rectangle(context.region, context.region_data, scene, camera)
        if rectangle is not None:
            _, video_s = pictures.picture_time(scene, camera)
            pixels = project(pictures.posed(camera, video_s), points)
            return image_view.to_region(rectangle, videos.size_of(camera), pixels)
    matrix = np.array(context.region_data.perspective_matrix)
    clip = np.c_[points, np.ones(len(points))] @ matrix.T
    with np.errstate(divide="ignore", invalid="ignore"):
        spots = 0.5 + 0.5 * clip[:, :2] / clip[:, 3:]
    spots[~(clip[:, 3] > 0)] = np.nan
    return spots * [context.region.width, context.region.height]


def pick_at(context: bpy.types.Context, xy: Sequence[float], *, any_time: bool = False) -> bpy.types.Object | None:
    """The pick under a place of the region. In the footage those of its picture only, unless any_time."""
    scene, camera = context.scene, solved_camera_of(context)
    objects = picks.objects_of(scene)
    if camera is not None and not any_time:
        objects = pictures.in_this_picture(scene, camera)
    objects = [obj for obj in objects if obj.visible_get()]
    if not objects:
        return None
    spots = on_screen(context, np.array([list(obj[store.POSITION]) for obj in objects]))
    away = np.hypot(*(spots - np.asarray(xy, dtype=np.float64)).T)
    away[np.isnan(away)] = np.inf
    nearest = int(np.argmin(away))
    return objects[nearest] if away[nearest] <= REACH_PX * context.preferences.system.ui_scale else None


def handle_of(context: bpy.types.Context, obj: bpy.types.Object) -> tuple[float, float]:
    """Where a pick is held by the mouse, in the region: by what is clicked in the footage, else by its place."""
    place, camera = np.array(obj[store.POSITION], dtype=np.float64), solved_camera_of(context)
    if camera is not None and context.scene.rockfall_picking.aim == "CENTRE":
        seen = clicks.of(obj).get(camera[store.ID])
        rectangle = image_view.image_rectangle(context.region, context.region_data, context.scene, camera)
        if (
            seen is not None
            and seen.centre
            and rectangle is not None
            and obj in pictures.in_this_picture(context.scene, camera)
        ):
            x, y = image_view.to_region(rectangle, videos.size_of(camera), seen.pixel)
            return float(x), float(y)
        normal = np.array(obj.matrix_world.col[2].xyz, dtype=np.float64)
        radius = places.block_of(context.scene, obj[store.TRAJECTORY]).radius_m
        place = place + radius * normal / max(float(np.linalg.norm(normal)), 1e-9)
    x, y = on_screen(context, place)[0]
    return float(x), float(y)


def select(context: bpy.types.Context, obj: bpy.types.Object) -> None:
    """Make a pick the active and only selected object."""
    for other in context.selected_objects:
        if other != obj:
            other.select_set(False)
    obj.select_set(True)
    context.view_layer.objects.active = obj


def active_pick(context: bpy.types.Context) -> bpy.types.Object | None:
    """The selected pick."""
    layer = context.view_layer
    obj = layer.objects.active if layer is not None else None
    if obj is None or obj.get(store.ROLE) != store.PICK_ROLE or not store.is_own(obj) or store.TRAJECTORY not in obj:
        return None
    return obj


def _no_pixel(context: bpy.types.Context, camera: bpy.types.Object) -> str:
    if image_view.shape_agrees(context.scene, camera):
        return "This is outside of the picture. Click in it."
    width, height = videos.size_of(camera)
    return (
        f"The scene's render size has another shape than {camera.name}, so its pixels cannot be told. Look through the "
        f"camera again in the panel Videos, which sets it to {width} × {height}."
    )

# SPDX-License-Identifier: GPL-3.0-or-later
"""How the 3-D view shows the slope: relief, cavities and trajectories in their own colours, without a render."""

from collections.abc import Iterable, Iterator, Sequence
from math import radians

import bpy
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Quaternion, Vector

from ..scene.footage import videos
from ..scene.storage import store
from ..scene.terrain import terrain
from .workspace import free_part

AROUND = 1.15  # some air around what is framed
ASIDE_DEG = 25.0  # so that flights show beside each other and not one behind the other
HALF_SENSOR_MM = 36.0  # of Blender's free views, along the longer side
LEAST_DISTANCE_M = 0.5


def show_relief(context: bpy.types.Context, frame_all: bool = False) -> None:
    """Set every 3-D view of the window to the relief look; optionally look up the slope at all that is ours.

    A view through the footage stays there, if another one is free.
    """
    context.scene.view_settings.view_transform = "Standard"
    for space in (area.spaces.active for area in _views(context)):
        shading = space.shading
        shading.type, shading.light, shading.color_type = "SOLID", "FLAT", "VERTEX"
        shading.show_cavity, shading.cavity_type = True, "WORLD"  # the other kind breaks thin trails into dots
        shading.cavity_ridge_factor, shading.cavity_valley_factor = 0.2, 0.6
        shading.show_object_outline = False  # it covers trails that are one or two pixels wide
        shading.background_type, shading.background_color = "VIEWPORT", (0.055, 0.065, 0.08)
        space.overlay.show_floor = space.overlay.show_axis_x = space.overlay.show_axis_y = False
        space.overlay.show_relationship_lines = space.overlay.show_extras = False
        space.overlay.show_cursor = False
        space.clip_end = max(space.clip_end, 5000.0)
    if frame_all:
        frame(context, _ours(context.scene))


def frame(context: bpy.types.Context, objects: Iterable[bpy.types.Object], *, beside: bool = False) -> None:
    """Look up the slope at objects in every free 3-D view of the window; in all of them when none is free.

    beside : only in free views beside the one that is worked in, which stays as it is.
    """
    corners = [obj.matrix_world @ Vector(corner) for obj in objects for corner in obj.bound_box]
    if not corners:
        return
    rotation = _up_the_slope(context.scene)
    areas = list(_views(context))
    free = [area for area in areas if not _is_through_footage(context.scene, area.spaces.active)]
    for area in [area for area in free if area != context.area] if beside else free or areas:
        _look_at(area, corners, rotation)
        area.tag_redraw()


def is_seen(context: bpy.types.Context, point: Sequence[float]) -> bool:
    """Whether a point is within every free 3-D view beside the one that is worked in."""
    for area in _views(context):
        if area == context.area or _is_through_footage(context.scene, area.spaces.active):
            continue
        region = next(each for each in area.regions if each.type == "WINDOW")
        spot = location_3d_to_region_2d(region, area.spaces.active.region_3d, Vector(point))
        left, bottom, right, top = free_part(area, region)
        if spot is None or not (left < spot.x < right and bottom < spot.y < top):
            return False
    return True


def _look_at(area: bpy.types.Area, points: Sequence[Vector], rotation: Quaternion) -> None:
    """Fill what toolbar and sidebar leave free of a view with points, and some air around them."""
    view, region = area.spaces.active.region_3d, next(each for each in area.regions if each.type == "WINDOW")
    left, bottom, right, top = free_part(area, region)
    per_px = 2 * HALF_SENSOR_MM / area.spaces.active.lens / max(region.width, region.height, 1)  # at a distance of 1
    seen = [rotation.inverted() @ point for point in points]  # x to the right, y up, z towards the viewer
    low, high = (Vector(map(end, zip(*seen, strict=True))) for end in (min, max))
    middle = (low + high) / 2
    distance = AROUND * max(
        LEAST_DISTANCE_M,
        *(abs(p.x - middle.x) / (per_px * max(right - left, 1) / 2) + p.z - middle.z for p in seen),
        *(abs(p.y - middle.y) / (per_px * max(top - bottom, 1) / 2) + p.z - middle.z for p in seen),
    )
    aside = Vector((left + right - region.width, bottom + top - region.height, 0.0)) * (per_px * distance / 2)
    view.view_perspective, view.view_rotation = "PERSP", rotation
    view.view_location, view.view_distance = rotation @ (middle - aside), distance
    space = area.spaces.active
    space.clip_end = max(space.clip_end, 2 * (distance + high.z - low.z))


def _views(context: bpy.types.Context) -> Iterator[bpy.types.Area]:
    if context.window is not None:
        yield from (area for area in context.window.screen.areas if area.type == "VIEW_3D")


def _is_through_footage(scene: bpy.types.Scene, space: bpy.types.SpaceView3D) -> bool:
    camera = space.camera if space.use_local_camera else scene.camera
    return space.region_3d.view_perspective == "CAMERA" and videos.is_video(camera)


def _ours(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    grounds, flights = (store.with_role(scene, role) for role in (store.TERRAIN_ROLE, store.FLIGHTS_ROLE))
    return flights or grounds


def _up_the_slope(scene: bpy.types.Scene) -> Quaternion:
    """View rotation of somebody who stands below the slope, somewhat to the side, and looks up at it."""
    fall = terrain.downhill(scene)
    towards_viewer = Vector((fall.x, fall.y, 0.0)).normalized()
    towards_viewer.rotate(Quaternion((0.0, 0.0, 1.0), radians(ASIDE_DEG)))
    towards_viewer.z = 0.4
    return towards_viewer.to_track_quat("Z", "Y")

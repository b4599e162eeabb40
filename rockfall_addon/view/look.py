# SPDX-License-Identifier: GPL-3.0-or-later
"""How the 3-D view shows the slope: relief, cavities and trajectories in their own colours, without a render."""

from math import radians

import bpy
from mathutils import Quaternion, Vector

from ..scene import store, terrain

AROUND = 1.15  # some air around what is framed
ASIDE_DEG = 25.0  # so that flights show beside each other and not one behind the other


def show_relief(context: bpy.types.Context, frame_all: bool = False) -> None:
    """Set every 3-D view of the window to the relief look; optionally look up the slope at all that is ours."""
    context.scene.view_settings.view_transform = "Standard"
    if context.window is None:
        return
    for area in context.window.screen.areas:
        if area.type != "VIEW_3D":
            continue
        space = area.spaces.active
        shading = space.shading
        shading.type, shading.light, shading.color_type = "SOLID", "FLAT", "VERTEX"
        shading.show_cavity, shading.cavity_type = True, "WORLD"  # the other kind breaks thin trails into dots
        shading.cavity_ridge_factor, shading.cavity_valley_factor = 0.2, 0.6
        shading.show_object_outline = False
        shading.background_type, shading.background_color = "VIEWPORT", (0.055, 0.065, 0.08)
        space.overlay.show_floor = space.overlay.show_axis_x = space.overlay.show_axis_y = False
        space.overlay.show_relationship_lines = space.overlay.show_extras = False
        space.overlay.show_cursor = False
        space.clip_end = max(space.clip_end, 5000.0)
        if frame_all:
            space.region_3d.view_perspective = "PERSP"
            space.region_3d.view_rotation = _up_the_slope(context.scene)
            _frame(context, area, _ours(context.scene))


def _ours(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    terrain, flights = (store.with_role(scene, role) for role in (store.TERRAIN_ROLE, store.FLIGHTS_ROLE))
    return flights or terrain


def _up_the_slope(scene: bpy.types.Scene) -> Quaternion:
    """View rotation of somebody who stands below the slope, somewhat to the side, and looks up at it."""
    fall = terrain.downhill(scene)
    towards_viewer = Vector((fall.x, fall.y, 0.0)).normalized()
    towards_viewer.rotate(Quaternion((0.0, 0.0, 1.0), radians(ASIDE_DEG)))
    towards_viewer.z = 0.4
    return towards_viewer.to_track_quat("Z", "Y")


def _frame(context: bpy.types.Context, area: bpy.types.Area, objects: list[bpy.types.Object]) -> None:
    """Frame objects and leave the selection as it was."""
    selected, active = list(context.selected_objects), context.view_layer.objects.active
    for obj in context.view_layer.objects:
        obj.select_set(obj in objects)
    region = next(r for r in area.regions if r.type == "WINDOW")
    smooth, context.preferences.view.smooth_view = context.preferences.view.smooth_view, 0
    with context.temp_override(area=area, region=region):
        bpy.ops.view3d.view_selected()
    area.spaces.active.region_3d.view_distance *= AROUND
    context.preferences.view.smooth_view = smooth
    for obj in context.view_layer.objects:
        obj.select_set(obj in selected)
    context.view_layer.objects.active = active

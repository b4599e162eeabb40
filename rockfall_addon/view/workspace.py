# SPDX-License-Identifier: GPL-3.0-or-later
"""The window: which workspace is ours, and where the footage lies in a view through its camera."""

from collections.abc import Iterator
from math import sqrt
from pathlib import Path

import bpy

from ...core.errors import RockfallError
from ..scene.footage import camera_paths, footage_blend, videos
from ..scene.next_step import ALIGN_TOOL, PICK_TOOL
from ..scene.storage import store
from . import image_view

FILE = Path(__file__).parents[2] / "assets" / "workspace.blend"
NAME = "Rockfall"
"""Marks our workspace, which its owner may rename."""

MARGIN = 0.97  # share of the free part of the view that the picture fills
PROBE = 0.1


def is_open(context: bpy.types.Context) -> bool:
    """Whether the window shows our workspace."""
    return context.workspace is not None and store.WORKSPACE in context.workspace


def open_workspace(context: bpy.types.Context) -> bool:
    """Show our workspace; the one of this file if it has it, else a new one. Returns whether it is new.

    Raises
    ------
    RockfallError : its file is missing.
    """
    ours = next((each for each in bpy.data.workspaces if store.WORKSPACE in each), None)
    if ours is not None:
        context.window.workspace = ours
        return False
    if not FILE.is_file():
        raise RockfallError(f"{FILE.name} is missing from the extension. Install it again.")
    with context.temp_override(window=context.window):
        bpy.ops.workspace.append_activate(idname=NAME, filepath=str(FILE))
    return True


def camera_views(screen: bpy.types.Screen) -> Iterator[tuple[bpy.types.Area, bpy.types.Region]]:
    """The 3-D views that look through the scene's camera, and their regions."""
    for area in screen.areas:
        if area.type == "VIEW_3D" and area.spaces.active.region_3d.view_perspective == "CAMERA":
            yield area, next(region for region in area.regions if region.type == "WINDOW")


def show_tab(screen: bpy.types.Screen) -> bool:
    """Turn the open sidebars of 3-D views and graphs to our tab; a file does not keep which was shown.

    Returns whether all were at it before: an area that has just changed its type forgets it when it is drawn.
    """
    stays = True
    for area in screen.areas:
        ours = area.type == "VIEW_3D" or area.ui_type.startswith(NAME)
        if not ours or not area.spaces.active.show_region_ui:
            continue
        for region in area.regions:
            if region.type != "UI":
                continue
            stays = stays and region.active_panel_category == NAME
            if region.active_panel_category != "UNSUPPORTED":  # until it is drawn
                region.active_panel_category = NAME
                region.tag_redraw()
    return stays


def look_through_footage(scene: bpy.types.Scene, screen: bpy.types.Screen) -> None:
    """Look through the active video's camera in the largest 3-D view."""
    camera, largest = videos.active_camera(scene), _largest_view(screen)
    if camera is not None and largest is not None:
        scene.camera = camera
        largest.spaces.active.region_3d.view_perspective = "CAMERA"


def take_tool(scene: bpy.types.Scene, screen: bpy.types.Screen) -> None:
    """With an aligned camera the next click is a pick, else half a pair. Needs the window in the context."""
    camera, largest = videos.active_camera(scene), _largest_view(screen)
    if camera is None or largest is None or bpy.context.mode != "OBJECT":
        return
    is_solved = camera_paths.is_solved(camera)
    if not is_solved and not store.has_role(scene, store.TERRAIN_ROLE):
        return
    if not is_solved:
        footage_blend.set_blend(camera, footage_blend.blend_of(camera))  # the terrain would hide it
    region = next(region for region in largest.regions if region.type == "WINDOW")
    with bpy.context.temp_override(area=largest, region=region):
        bpy.ops.wm.tool_set_by_id(name=PICK_TOOL if is_solved else ALIGN_TOOL)


def _largest_view(screen: bpy.types.Screen) -> bpy.types.Area | None:
    areas = [area for area in screen.areas if area.type == "VIEW_3D"]
    return max(areas, key=lambda area: area.width * area.height, default=None)


def fit_footage(scene: bpy.types.Scene, screen: bpy.types.Screen) -> None:
    """Make the active footage as large as each camera view allows beside its toolbar, sidebar and header."""
    if bpy.app.background:
        return  # where nothing is ever drawn, views have no size, and Blender crashes when it is asked for
    camera = videos.active_camera(scene)
    for area, region in camera_views(screen):
        view = area.spaces.active.region_3d
        view.view_camera_offset = (0.0, 0.0)
        here = _rectangle(region, view, scene, camera)
        if here is None:
            continue
        left, bottom, right, top = free_part(area, region)
        ratio = MARGIN * min((right - left) / here.width, (top - bottom) / here.height)
        view.view_camera_zoom = _zoom_of(_factor(view.view_camera_zoom) * ratio)
        here = _rectangle(region, view, scene, camera)
        view.view_camera_offset = (PROBE, PROBE)
        there = _rectangle(region, view, scene, camera)
        view.view_camera_offset = (
            PROBE * _ratio((left + right - here.width) / 2 - here.left, there.left - here.left),
            PROBE * _ratio((bottom + top - here.height) / 2 - here.bottom, there.bottom - here.bottom),
        )
        area.tag_redraw()


def _rectangle(
    region: bpy.types.Region, view: bpy.types.RegionView3D, scene: bpy.types.Scene, camera: bpy.types.Object | None
) -> image_view.Rectangle | None:
    view.update()
    return None if camera is None else image_view.image_rectangle(region, view, scene, camera)


def free_part(area: bpy.types.Area, region: bpy.types.Region) -> tuple[float, float, float, float]:
    """Left, bottom, right and top of what no other region covers [px of the region]."""
    left, bottom, right, top = 0, 0, region.width, region.height
    for other in area.regions:
        if other.type == "WINDOW" or other.width <= 1 or other.height <= 1:
            continue
        if other.type == "TOOLS":
            left = max(left, other.x + other.width - region.x)
        elif other.type == "UI":
            right = min(right, other.x - region.x)
        elif other.type in ("HEADER", "TOOL_HEADER") and other.y > region.y + region.height / 2:
            top = min(top, other.y - region.y)
    if right - left < region.width / 4 or top - bottom < region.height / 4:
        return 0, 0, region.width, region.height
    return left, bottom, right, top


def _factor(zoom: float) -> float:
    """Size of the camera's frame at a zoom of the view, as Blender has it."""
    return (sqrt(2.0) + zoom / 50.0) ** 2 / 4.0


def _zoom_of(factor: float) -> float:
    return min(600.0, max(-30.0, 50.0 * (sqrt(4.0 * factor) - sqrt(2.0))))


def _ratio(wanted: float, got: float) -> float:
    return wanted / got if got else 0.0

# SPDX-License-Identifier: GPL-3.0-or-later
"""Where in the window an editor of graphs is opened."""

import bpy

from .editor import IMPACTS, MOTION

SHARE = 0.4
"""Of a lone 3-D view, that the graphs take."""


def toggle(context: bpy.types.Context, tree: str) -> None:
    """Show graphs of a type in place of other graphs, in the free 3-D view, or beside the only one; where they are
    shown already, the 3-D view again."""
    areas = context.window.screen.areas
    shown = {area.ui_type: area for area in areas if area.ui_type in (IMPACTS, MOTION)}
    if tree in shown:
        shown[tree].ui_type = "VIEW_3D"
        return
    area = next(iter(shown.values()), None) or _free(context)
    area.ui_type = tree
    area.spaces.active.show_region_toolbar = area.spaces.active.show_region_ui = False


def show_largest(window: bpy.types.Window, tree: str, share: float) -> None:
    """Show graphs of a type, with their sidebar, in the largest 3-D view, or in a share of the only one."""
    areas = window.screen.areas
    views = [area for area in areas if area.type == "VIEW_3D"]
    area = max(views or areas, key=lambda one: one.width * one.height)
    if len(views) == 1:
        area = _beside(window, area, share)
    area.ui_type = tree
    area.spaces.active.show_region_toolbar, area.spaces.active.show_region_ui = False, True


def _free(context: bpy.types.Context) -> bpy.types.Area:
    """The smaller 3-D view, or a new area beside the only one."""
    areas = context.window.screen.areas
    views = sorted((area for area in areas if area.type == "VIEW_3D"), key=lambda area: area.width * area.height)
    if not views:
        views = [max(areas, key=lambda area: area.width * area.height)]
    return views[0] if len(views) > 1 else _beside(context.window, views[0], SHARE)


def _beside(window: bpy.types.Window, area: bpy.types.Area, share: float) -> bpy.types.Area:
    """Cut a share off an area; the new one."""
    before = set(window.screen.areas)
    with bpy.context.temp_override(window=window, area=area):
        bpy.ops.screen.area_split(direction="VERTICAL", factor=1 - share)
    return next((one for one in window.screen.areas if one not in before), area)

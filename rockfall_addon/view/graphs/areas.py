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


def _free(context: bpy.types.Context) -> bpy.types.Area:
    """The smaller 3-D view, or a new area beside the only one."""
    areas = context.window.screen.areas
    views = sorted((area for area in areas if area.type == "VIEW_3D"), key=lambda area: area.width * area.height)
    if not views:
        views = [max(areas, key=lambda area: area.width * area.height)]
    if len(views) > 1:
        return views[0]
    before = set(areas)
    with context.temp_override(window=context.window, area=views[0]):
        bpy.ops.screen.area_split(direction="VERTICAL", factor=1 - SHARE)
    return next((one for one in areas if one not in before), views[0])

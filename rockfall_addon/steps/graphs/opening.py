# SPDX-License-Identifier: GPL-3.0-or-later
"""Open the graphs: in the free part of the workspace, or beside the 3-D view."""

import bpy

from ...view.graphs import editor
from ...view.reporting import possible, reported

SHARE = 0.4
"""Of a lone 3-D view, that the graphs take."""


class ROCKFALL_OT_open_graphs(bpy.types.Operator):
    """Show the graphs of the impacts in the free view, or beside the 3-D view; again for the free view"""

    bl_idname = "rockfall.open_graphs"
    bl_label = "Graphs of Impacts"
    bl_options = {"REGISTER"}
    looks_only = True

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(cls, context.window is not None and not bpy.app.background, "There is no window")

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        areas = context.window.screen.areas
        shown = next((area for area in areas if area.ui_type == editor.IMPACTS), None)
        if shown is not None:
            shown.ui_type = "VIEW_3D"
            return {"FINISHED"}
        views = sorted((area for area in areas if area.type == "VIEW_3D"), key=lambda area: area.width * area.height)
        if not views:
            views = [max(areas, key=lambda area: area.width * area.height)]
        area = views[0]
        if len(views) == 1:
            before = set(areas)
            with context.temp_override(window=context.window, area=area):
                bpy.ops.screen.area_split(direction="VERTICAL", factor=1 - SHARE)
            area = next((one for one in areas if one not in before), area)
        area.ui_type = editor.IMPACTS
        area.spaces.active.show_region_toolbar = area.spaces.active.show_region_ui = False
        return {"FINISHED"}


CLASSES = (ROCKFALL_OT_open_graphs,)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Open the graphs: in the free part of the workspace, or beside the 3-D view."""

import bpy

from ...view.graphs import areas, editor
from ...view.reporting import possible, reported


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
        areas.toggle(context, editor.IMPACTS)
        return {"FINISHED"}


CLASSES = (ROCKFALL_OT_open_graphs,)

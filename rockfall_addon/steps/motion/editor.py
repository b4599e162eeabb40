# SPDX-License-Identifier: GPL-3.0-or-later
"""The type of editor that shows motion over time, and its header."""

import bpy

from ...scene.models import motion
from ...view.graphs import editor, motion_sheet


class RockfallMotionGraphs(bpy.types.NodeTree):
    """Speed, height, energy and residuals of tracks over the time that the scene plays"""

    bl_idname = editor.MOTION
    bl_label = "Rockfall Motion Graphs"
    bl_icon = "FCURVE"


class ROCKFALL_MT_motion_quantities(bpy.types.Menu):
    """What is shown over the time."""

    bl_idname = "ROCKFALL_MT_motion_quantities"
    bl_label = "Quantities"

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.prop(context.scene.rockfall_motion, "quantities", expand=True)


class ROCKFALL_MT_motion_export(bpy.types.Menu):
    """Files of the graphs."""

    bl_idname = "ROCKFALL_MT_motion_export"
    bl_label = "Export"

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.operator("rockfall.export_graphs", icon="EXPORT")


def draw_header(context: bpy.types.Context, layout: bpy.types.UILayout) -> None:
    """What is shown, and how the time is numbered."""
    settings = context.scene.rockfall_motion
    layout.menu("ROCKFALL_MT_motion_quantities")
    layout.menu("ROCKFALL_MT_motion_export")
    layout.separator_spacer()
    row = layout.row(align=True)
    row.prop(settings, "only_selected", text="", icon="RESTRICT_SELECT_OFF", toggle=True)
    row.prop(settings, "in_frames", toggle=True)
    layout.operator("rockfall.reset_graphs", text="", icon="HOME").graph = 0


CLASSES = (RockfallMotionGraphs, ROCKFALL_MT_motion_quantities, ROCKFALL_MT_motion_export)


def register() -> None:
    editor.add(
        editor.Content(
            editor.MOTION,
            "Motion",
            motion_sheet.draw,
            draw_header,
            motion_sheet.point,
            motion_sheet.set_limits,
            motion_sheet.reset,
        )
    )


def unregister() -> None:
    editor.remove(editor.MOTION)
    motion_sheet.forget()
    motion.forget()

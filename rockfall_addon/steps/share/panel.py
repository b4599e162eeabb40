# SPDX-License-Identifier: GPL-3.0-or-later
"""Exports."""

import bpy

from ...scene.storage import store
from ...view import job
from ...view.panel import RockfallPanel, State, paragraph


class ROCKFALL_PT_share(RockfallPanel, bpy.types.Panel):
    bl_label = "10  Share"
    bl_idname = "ROCKFALL_PT_share"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return any(store.has_role(context.scene, role) for role in (store.PICK_ROLE, store.TERRAIN_ROLE))

    @staticmethod
    def step_state(context: bpy.types.Context) -> State:
        return "ANY_TIME"

    def draw(self, context: bpy.types.Context) -> None:
        paragraph(context, self.layout, "Tables in survey coordinates, with units:")
        self.layout.operator("rockfall.export_tables", icon="EXPORT")
        self.layout.operator("rockfall.export_graphs", icon="EXPORT")
        self.layout.operator("rockfall.export_simulation", icon="EXPORT")
        self.layout.operator("rockfall.design_sheet", icon="TEXT")
        self.layout.operator("rockfall.export_project", icon="FILE_FOLDER")
        self.layout.separator()
        paragraph(context, self.layout, "For others to look at:")
        self.layout.operator("rockfall.export_web_page", icon="URL")
        self.layout.operator("rockfall.export_animation", icon="RENDER_ANIMATION")
        job.draw(context, self.layout, "share")


CLASSES = (ROCKFALL_PT_share,)

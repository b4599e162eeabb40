# SPDX-License-Identifier: GPL-3.0-or-later
"""Exports."""

import bpy

from ...scene import store
from ...view.panel import RockfallPanel, State, advise


class ROCKFALL_PT_share(RockfallPanel, bpy.types.Panel):
    bl_label = "10  Share"
    bl_idname = "ROCKFALL_PT_share"
    needs = store.PICK_ROLE

    @staticmethod
    def step_state(context: bpy.types.Context) -> State:
        return "READY"

    def draw(self, context: bpy.types.Context) -> None:
        advise(context, self.layout, True, "Tables in survey coordinates, with units.")
        self.layout.operator("rockfall.export_tables", icon="EXPORT")
        self.layout.operator("rockfall.export_project", icon="FILE_FOLDER")


CLASSES = (ROCKFALL_PT_share,)

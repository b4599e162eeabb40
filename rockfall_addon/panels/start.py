# SPDX-License-Identifier: GPL-3.0-or-later
"""What is above the steps: the way into the workspace."""

import bpy

from ..bridge import workspace
from .base import RockfallPanel


class ROCKFALL_PT_start(RockfallPanel, bpy.types.Panel):
    bl_label = "Start"
    bl_idname = "ROCKFALL_PT_start"
    bl_options = {"HIDE_HEADER"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return not workspace.is_open(context)

    def draw(self, context: bpy.types.Context) -> None:
        row = self.layout.row()
        row.scale_y = 1.4
        row.operator("rockfall.open_workspace", text="Open Workspace", icon="WORKSPACE")


CLASSES = (ROCKFALL_PT_start,)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The workspace: open it with one click, and fit the footage beside the sidebar."""

import bpy

from ...view import arranging, workspace
from ...view.reporting import InWindow, possible, reported


class ROCKFALL_OT_open_workspace(InWindow, bpy.types.Operator):
    """Open the workspace for rockfalls: the camera's view, a free view, the timeline, and the tab Rockfall"""

    bl_idname = "rockfall.open_workspace"
    bl_label = "Open Rockfall Workspace"

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        arranging.open_workspace(context)
        return {"FINISHED"}


class ROCKFALL_OT_fit_footage(bpy.types.Operator):
    """Make the footage as large as the view allows beside the toolbar and the sidebar"""

    bl_idname = "rockfall.fit_footage"
    bl_label = "Fit Footage"
    bl_options = {"REGISTER"}
    looks_only = True

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if bpy.app.background or context.window is None:
            cls.poll_message_set("There is no window")
            return False
        return possible(cls, any(workspace.camera_views(context.screen)), "Look through a camera first")

    def execute(self, context: bpy.types.Context) -> set[str]:
        workspace.fit_footage(context.scene, context.screen)
        return {"FINISHED"}


CLASSES = (ROCKFALL_OT_open_workspace, ROCKFALL_OT_fit_footage)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The workspace: open it with one click, and fit the footage beside the sidebar."""

import bpy

from ...scene import problems, store
from ...view import look, workspace
from ...view.reporting import possible, reported

AFTER_S = 0.3  # the areas of a new workspace get their sizes when they are drawn


class ROCKFALL_OT_open_workspace(bpy.types.Operator):
    """Open the workspace for rockfalls: the camera's view, a free view, the timeline, and the tab Rockfall"""

    bl_idname = "rockfall.open_workspace"
    bl_label = "Open Rockfall Workspace"
    bl_options = {"REGISTER"}
    looks_only = True

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(cls, context.window is not None and not bpy.app.background, "There is no window")

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        open_workspace(context)
        return {"FINISHED"}


class ROCKFALL_OT_fit_footage(bpy.types.Operator):
    """Make the footage as large as the view allows beside the toolbar and the sidebar"""

    bl_idname = "rockfall.fit_footage"
    bl_label = "Fit Footage"
    bl_options = {"REGISTER"}
    looks_only = True

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(
            cls,
            context.screen is not None and any(workspace.camera_views(context.screen)),
            "Look through a camera first",
        )

    def execute(self, context: bpy.types.Context) -> set[str]:
        workspace.fit_footage(context.scene, context.screen)
        return {"FINISHED"}


def open_workspace(context: bpy.types.Context, *, arrange: bool = False) -> None:
    """Show our workspace; nothing without a window.

    Parameters
    ----------
    arrange : look through the footage and frame the slope even in a workspace that was there already.

    Raises
    ------
    RockfallError : the file of the workspace is missing.
    """
    if bpy.app.background or context.window is None:
        return
    if workspace.open_workspace(context) or arrange:
        unregister()
        bpy.app.timers.register(_arrange, first_interval=AFTER_S)


@problems.guarded
def _arrange() -> None:
    """Once the areas are drawn: footage to the left, the slope to the right, and the tool of step 4 if it is time."""
    for window in bpy.context.window_manager.windows:
        if store.WORKSPACE not in window.workspace:
            continue
        workspace.show_tab(window.screen)
        with bpy.context.temp_override(window=window):
            if store.with_role(window.scene, store.TERRAIN_ROLE):
                look.show_relief(bpy.context, frame_all=True)
            workspace.look_through_footage(window.scene, window.screen)
            workspace.fit_footage(window.scene, window.screen)
            workspace.take_pick_tool(window.scene, window.screen)


def unregister() -> None:
    """Nothing of ours is to run any more."""
    if bpy.app.timers.is_registered(_arrange):
        bpy.app.timers.unregister(_arrange)


CLASSES = (ROCKFALL_OT_open_workspace, ROCKFALL_OT_fit_footage)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The workspace is opened and, once its areas are drawn, arranged: footage to the left, the slope to the right."""

import bpy

from ..scene import problems
from ..scene.storage import store
from . import look, workspace

AFTER_S = 0.3  # the areas of a new workspace get their sizes when they are drawn


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


def is_waiting() -> bool:
    """Whether the workspace is still to be arranged."""
    return bpy.app.timers.is_registered(_arrange)


@problems.guarded
def _arrange() -> None:
    """Footage to the left, the slope to the right, and the tool of step 3 or 4 if it is time."""
    for window in bpy.context.window_manager.windows:
        if store.WORKSPACE not in window.workspace:
            continue
        workspace.show_tab(window.screen)
        with bpy.context.temp_override(window=window):
            workspace.look_through_footage(window.scene, window.screen)
            if store.has_role(window.scene, store.TERRAIN_ROLE):
                look.show_relief(bpy.context, frame_all=True)
            workspace.fit_footage(window.scene, window.screen)
            workspace.take_tool(window.scene, window.screen)


def unregister() -> None:
    """Nothing of ours is to run any more."""
    if is_waiting():
        bpy.app.timers.unregister(_arrange)

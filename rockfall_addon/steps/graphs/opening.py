# SPDX-License-Identifier: GPL-3.0-or-later
"""Open the graphs: in the free part of the workspace, beside the 3-D view, or in a workspace of their own."""

import bpy

from ...scene import problems
from ...scene.storage import store
from ...view import look, workspace
from ...view.graphs import areas, editor
from ...view.reporting import InWindow, reported

OWN_SHARE = 0.62
"""Of a lone 3-D view, that the graphs take in a workspace of their own."""
NAME = "Graphs"
AFTER_S = 0.3  # a new workspace is shown when events are handled


class ROCKFALL_OT_open_graphs(InWindow, bpy.types.Operator):
    """Show the graphs of the impacts in the free view, or beside the 3-D view; again to have the view back"""

    bl_idname = "rockfall.open_graphs"
    bl_label = "Graphs of Impacts"

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        areas.toggle(context, editor.IMPACTS)
        return {"FINISHED"}


class ROCKFALL_OT_open_graphs_workspace(InWindow, bpy.types.Operator):
    """Open a workspace of their own for the graphs, with the parameters of the models beside them"""

    bl_idname = "rockfall.open_graphs_workspace"
    bl_label = "Open Graphs Workspace"

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        window = context.window
        ours = next((each for each in bpy.data.workspaces if store.GRAPHS_WORKSPACE in each), None)
        if ours is not None:
            window.workspace = ours
            return {"FINISHED"}
        known = set(bpy.data.workspaces)
        with context.temp_override(window=window):
            bpy.ops.workspace.duplicate()
        (new,) = set(bpy.data.workspaces) - known
        new.name, new[store.GRAPHS_WORKSPACE] = NAME, True
        if store.WORKSPACE in new:
            del new[store.WORKSPACE]
        window.workspace = new
        unregister()
        bpy.app.timers.register(_arrange, first_interval=AFTER_S)
        return {"FINISHED"}


@problems.guarded
def _arrange() -> None:
    """Once the new workspace is shown: graphs in the largest part, one 3-D view beside them."""
    for window in bpy.context.window_manager.windows:
        if store.GRAPHS_WORKSPACE not in window.workspace:
            continue
        for area in window.screen.areas:
            if area.ui_type == editor.IMPACTS:
                area.ui_type = "VIEW_3D"
        areas.show_largest(window, editor.IMPACTS, OWN_SHARE)
        if store.has_role(window.scene, store.TERRAIN_ROLE):
            with bpy.context.temp_override(window=window):
                look.show_relief(bpy.context, frame_all=True)
    bpy.app.timers.register(_show_tab, first_interval=AFTER_S)


@problems.guarded
def _show_tab() -> float | None:
    """Once the sidebars are drawn, and as long as the workspace is shown."""
    shown = [each.screen for each in bpy.context.window_manager.windows if store.GRAPHS_WORKSPACE in each.workspace]
    turned = [workspace.show_tab(screen) for screen in shown]
    return None if all(turned) else AFTER_S


def unregister() -> None:
    """Nothing of ours is to run any more."""
    for timer in (_arrange, _show_tab):
        if bpy.app.timers.is_registered(timer):
            bpy.app.timers.unregister(timer)


CLASSES = (ROCKFALL_OT_open_graphs, ROCKFALL_OT_open_graphs_workspace)

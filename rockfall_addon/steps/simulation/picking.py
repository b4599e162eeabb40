# SPDX-License-Identifier: GPL-3.0-or-later
"""Select a simulated run by clicking its path, or go through the runs one by one."""

import bpy
import numpy as np
from bpy.props import IntProperty

from ....core.vectors import Array
from ...scene.simulation import simulated_paths, simulation
from ...view import pointing
from ...view.reporting import possible, redraw, reported

REACH_PX = 12.0
"""A path is under the mouse within this [px at interface scale 1]."""


class ROCKFALL_OT_select_run(bpy.types.Operator):
    """Click a simulated path to see the numbers of its run; Esc or right click ends"""

    bl_idname = "rockfall.select_run"
    bl_label = "Select Run"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(cls, simulation.paths_of(context.scene), "Simulate first")

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        context.scene.rockfall_simulation.show_paths = True
        context.workspace.status_text_set("Click a simulated path.   Esc ends")
        context.window.cursor_modal_set("EYEDROPPER")
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type in ("ESC", "RIGHTMOUSE", "RET") and event.value == "PRESS":
            self.cancel(context)
            return {"FINISHED"}
        if event.type != "LEFTMOUSE" or event.value != "PRESS":
            return {"PASS_THROUGH"}
        view = pointing.view_under(context, event.mouse_x, event.mouse_y)
        if view is None:
            return {"PASS_THROUGH"}
        area, region, xy = view
        with context.temp_override(area=area, region=region, region_data=area.spaces.active.region_3d):
            found = run_at(bpy.context, xy)
        if found is None:
            self.report({"INFO"}, "There is no path under the mouse.")
        else:
            select(context.scene, *found)
        redraw(context)
        return {"RUNNING_MODAL"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Another file was opened meanwhile, or a person has ended it."""
        context.workspace.status_text_set(None)
        context.window.cursor_modal_restore()


class ROCKFALL_OT_next_run(bpy.types.Operator):
    """Select the next or previous run of the model"""

    bl_idname = "rockfall.next_run"
    bl_label = "Next Run"
    bl_options = {"INTERNAL", "UNDO"}

    step: IntProperty(default=1)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(cls, simulation.paths_of(context.scene), "Simulate first")

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.rockfall_simulation
        obj = simulation.selected_paths(context.scene) or simulation.paths_of(context.scene)[0]
        count = len(obj.data.curves)
        select(context.scene, simulation.model_of(obj), (settings.run - 1 + self.step) % count)
        return {"FINISHED"}


def select(scene: bpy.types.Scene, model: str, run: int) -> None:
    """Select a run, from 0."""
    settings = scene.rockfall_simulation
    settings.run_model, settings.run = model, run + 1


def run_at(context: bpy.types.Context, xy: tuple[float, float]) -> tuple[str, int] | None:
    """Model and run of the path that is nearest to a place of the region, of those within reach."""
    best, found = REACH_PX * context.preferences.system.ui_scale, None
    for obj in simulation.paths_of(context.scene):
        lines = simulated_paths.lines_of(obj)
        away = distances(pointing.on_screen(context, lines.position), lines.first, np.asarray(xy, dtype=np.float64))
        nearest = int(np.argmin(away)) if away.size else -1
        if nearest >= 0 and away[nearest] <= best:
            run = int(np.searchsorted(lines.first, nearest, side="right")) - 1
            best, found = float(away[nearest]), (lines.model, run)
    return found


def distances(spots: Array, first: Array, xy: Array) -> Array:
    """(m,) how far a place is from the line that begins at each of the points (m, 2); inf at the end of a path."""
    way = np.zeros_like(spots)
    way[:-1] = spots[1:] - spots[:-1]
    way[first[1:] - 1] = np.nan
    towards = xy - spots
    with np.errstate(divide="ignore", invalid="ignore"):
        part = np.clip((towards * way).sum(axis=1) / (way**2).sum(axis=1), 0.0, 1.0)
        away = np.hypot(*(towards - np.nan_to_num(part)[:, None] * way).T)
    return np.where(np.isfinite(away), away, np.inf)


CLASSES = (ROCKFALL_OT_select_run, ROCKFALL_OT_next_run)

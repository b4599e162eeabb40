# SPDX-License-Identifier: GPL-3.0-or-later
"""A click on a mark of the strip selects its pick and goes to its moment; dragging moves the pick in time."""

from math import floor

import bpy
import numpy as np

from ...scene.footage import sync, timing
from ...scene.picks import impact_rows, pick_names, picks
from ...scene.storage import store
from ...view import strip
from ...view.reporting import redraw

STILL = 4.0
"""The mouse may move this far while a mark is clicked, at interface scale 1 [px]."""
FINE = 0.1
APART_S = 1e-3
"""What a pick that is dragged keeps from its neighbours."""


class ROCKFALL_OT_press_in_strip(bpy.types.Operator):
    """Go to the pick under the mouse; drag it to move it in time (Shift: a tenth of the way, Ctrl: whole frames)"""

    bl_idname = "rockfall.press_in_strip"
    bl_label = "Go to or Retime Pick"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.space_data is not None and context.space_data.type == "DOPESHEET_EDITOR"

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        scene = context.scene
        found = strip.strip_of(context)
        self.identifier = strip.point(context, event.mouse_region_x, event.mouse_region_y)
        pick = picks.with_id(scene, self.identifier) if self.identifier else None
        if found is None or pick is None:
            return {"PASS_THROUGH"}
        self.before = scene.frame_current, scene.frame_subframe
        impact_rows.go_to(context, scene, pick)
        self.kept_s = self.time_s = float(pick[store.TIME])
        self.range_s = _between_neighbours(scene, pick)
        self.per_frame, self.start, self.x = found.per_frame, event.mouse_region_x, event.mouse_region_x
        self.dragged = False
        context.window_manager.modal_handler_add(self)
        redraw(context)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        pick = picks.with_id(context.scene, self.identifier)
        if pick is None:
            return self._ended(context, {"CANCELLED"})
        if event.type in ("ESC", "RIGHTMOUSE") and event.value == "PRESS":
            if self.dragged:
                self._move(context, pick, self.kept_s)
            context.scene.frame_set(self.before[0], subframe=self.before[1])
            return self._ended(context, {"CANCELLED"})
        if event.type == "MOUSEMOVE":
            self._drag(context, pick, event)
        elif event.type == "LEFTMOUSE" and event.value == "RELEASE":
            if self.dragged:
                self.report({"INFO"}, f"{pick[store.TRAJECTORY]}: {pick_names.word(pick)} at {pick[store.TIME]:.3f} s.")
            return self._ended(context, {"FINISHED"})
        return {"RUNNING_MODAL"}

    def cancel(self, context: bpy.types.Context) -> None:
        self._ended(context, {"CANCELLED"})

    def _drag(self, context: bpy.types.Context, pick: bpy.types.Object, event: bpy.types.Event) -> None:
        away, self.x = event.mouse_region_x - self.x, event.mouse_region_x
        if not self.dragged and abs(self.x - self.start) <= STILL * context.preferences.system.ui_scale:
            self.x -= away  # not yet a drag: what was moved so far counts when it becomes one
            return
        self.dragged = True
        rate = timing.frame_rate(context.scene)
        self.time_s += (FINE if event.shift else 1.0) * away / self.per_frame / rate
        time_s = self.time_s
        if event.ctrl:
            offset = timing.kept_offsets(context.scene).get(pick[store.TRAJECTORY], 0.0)
            time_s = round((time_s - offset) * rate) / rate + offset
        self._move(context, pick, float(np.clip(time_s, *self.range_s)))
        shift = (pick[store.TIME] - self.kept_s) * rate
        context.workspace.status_text_set(
            f"{pick[store.TIME]:.3f} s, {shift:+.2f} frames  |  Shift: finely  |  Ctrl: whole frames  |  Esc: as it was"
        )

    def _move(self, context: bpy.types.Context, pick: bpy.types.Object, time_s: float) -> None:
        scene = context.scene
        pick[store.TIME] = time_s
        sync.sync(scene, [pick[store.TRAJECTORY]])
        frame = pick.get(store.KEY_FRAME)
        if frame is not None:
            scene.frame_set(floor(frame), subframe=frame % 1)
        redraw(context)

    def _ended(self, context: bpy.types.Context, how: set[str]) -> set[str]:
        context.workspace.status_text_set(None)
        redraw(context)
        return how


class ROCKFALL_OT_point_in_strip(bpy.types.Operator):
    """Show the numbers of the pick under the mouse"""

    bl_idname = "rockfall.point_in_strip"
    bl_label = "Point in Strip"
    bl_options = {"INTERNAL"}
    looks_only = True

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        strip.point(context, event.mouse_region_x, event.mouse_region_y)
        return {"PASS_THROUGH"}


class ROCKFALL_OT_leave_strip(bpy.types.Operator):
    """The mouse is over no strip: its card is taken away"""

    bl_idname = "rockfall.leave_strip"
    bl_label = "Leave Strip"
    bl_options = {"INTERNAL"}
    looks_only = True

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return strip.is_pointed()

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        for area in context.screen.areas if context.screen else ():
            here = next((each for each in area.regions if each.type == "WINDOW"), None)
            if area.type == "DOPESHEET_EDITOR" and here is not None:
                x, y = event.mouse_x - here.x, event.mouse_y - here.y
                if 0 <= x < here.width and 0 <= y < here.height:
                    return {"PASS_THROUGH"}
        strip.point_nowhere()
        return {"PASS_THROUGH"}


def _between_neighbours(scene: bpy.types.Scene, pick: bpy.types.Object) -> tuple[float, float]:
    """The times that a pick may have without passing one of its trajectory [s]."""
    own = float(pick[store.TIME])
    times = [float(obj[store.TIME]) for obj in picks.objects_of(scene, [pick[store.TRAJECTORY]]) if obj != pick]
    low = max((time for time in times if time < own), default=-np.inf)
    high = min((time for time in times if time > own), default=np.inf)
    return low + APART_S, high - APART_S


CLASSES = (ROCKFALL_OT_press_in_strip, ROCKFALL_OT_point_in_strip, ROCKFALL_OT_leave_strip)

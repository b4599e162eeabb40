# SPDX-License-Identifier: GPL-3.0-or-later
"""A click in the motion graphs goes to its time and selects what is under the mouse; dragging moves the time."""

from math import floor, hypot

import bpy

from ...scene.footage import timing
from ...scene.picks import impact_rows
from ...scene.storage import store
from ...view.graphs import editor, motion_sheet
from ...view.reporting import redraw

STILL = 4.0
"""The mouse may move this far while a line is clicked, at interface scale 1 [px]."""


class ROCKFALL_OT_press_in_motion(bpy.types.Operator):
    """Go to the time under the mouse, dragging moves it on (Shift: between frames); a click on a line selects its
    trajectory, near an impact the impact"""

    bl_idname = "rockfall.press_in_motion"
    bl_label = "Go to Time in Motion Graphs"
    bl_options = {"UNDO"}
    looks_only = True

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return editor.shows(context, editor.MOTION) and editor.canvas_of(context) is not None

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        canvas = editor.canvas_of(context)
        editor.point(context, canvas, event.mouse_region_x, event.mouse_region_y)
        if event.type == "RIGHTMOUSE":  # the node editor's menu has nothing for these graphs
            return {"CANCELLED"}
        button = editor.button_at(canvas)
        if button is not None:
            module, name = button.operator.split(".")
            getattr(getattr(bpy.ops, module), name)("INVOKE_DEFAULT")
            return {"CANCELLED"}
        if canvas.part not in ("plot", "x", "title"):
            return {"PASS_THROUGH"}
        scene = context.scene
        self.canvas, self.hit, self.start = canvas, canvas.hit, canvas.pointer
        self.before = scene.frame_current, scene.frame_subframe
        self.dragged = False
        self._go(context, event)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type in ("ESC", "RIGHTMOUSE") and event.value == "PRESS":
            context.scene.frame_set(self.before[0], subframe=self.before[1])
            redraw(context)
            return {"CANCELLED"}
        if event.type == "MOUSEMOVE":
            away = hypot(event.mouse_region_x - self.start[0], event.mouse_region_y - self.start[1])
            self.dragged |= away > STILL * context.preferences.system.ui_scale
            self._go(context, event)
        elif event.type == "LEFTMOUSE" and event.value == "RELEASE":
            if self.hit is not None and not self.dragged:
                self._select(context)
            redraw(context)
            return {"FINISHED"}
        return {"RUNNING_MODAL"}

    def _go(self, context: bpy.types.Context, event: bpy.types.Event) -> None:
        scene = context.scene
        frame = motion_sheet.time_at(scene, self.canvas, event.mouse_region_x) * timing.frame_rate(scene)
        frame = frame if event.shift else float(round(frame))
        if frame != scene.frame_current + scene.frame_subframe:
            scene.frame_set(floor(frame), subframe=frame % 1)
        redraw(context)

    def _select(self, context: bpy.types.Context) -> None:
        scene, layer = context.scene, context.view_layer
        if self.hit.impact:
            obj = motion_sheet.pick_of(scene, self.hit.trajectory, self.hit.impact)
            if obj is not None:
                impact_rows.go_to(context, scene, obj)
                return
        for obj in list(layer.objects.selected):
            obj.select_set(False)
        for obj in store.with_role(scene, store.BLOCK_ROLE):
            if obj[store.TRAJECTORY] == self.hit.trajectory and obj.name in layer.objects:
                obj.select_set(True)
                layer.objects.active = obj


CLASSES = (ROCKFALL_OT_press_in_motion,)

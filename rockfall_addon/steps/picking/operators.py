# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 4: the tool that picks impacts in the footage and on the terrain."""

import bpy
from bpy.props import EnumProperty

from ....core.errors import RockfallError
from ...scene.footage import clicks, pictures, sightings
from ...scene.picks import picks, places
from ...scene.picks.trajectories import flights_of
from ...scene.storage import store
from ...view import look, pointing, tool_header
from ...view.reporting import possible, reported
from . import editing
from .properties import KINDS

TOOL = "rockfall.pick_tool"
FINE = 0.1
HINT = "Drag along the terrain  |  Shift: a tenth of the way  |  Release: done  |  Esc, right click: as it was"


def _in_3d_view(cls: type, context: bpy.types.Context) -> bool:
    if context.area is None or context.area.type != "VIEW_3D" or context.region_data is None:
        cls.poll_message_set("Works in the 3-D view")
        return False
    if context.mode != "OBJECT":
        cls.poll_message_set("Works in Object Mode")
        return False
    return True


class ROCKFALL_OT_drag_pick(bpy.types.Operator):
    """Pick the block where you click, or drag the pick under the mouse along the terrain; Shift moves it finely"""

    # The name tells the live rebuild that a person holds a pick: see scene.sync.DRAGGING.
    bl_idname = "rockfall.drag_pick"
    bl_label = "Pick or Move Impact"
    bl_options = {"REGISTER", "UNDO", "BLOCKING"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _in_3d_view(cls, context)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self._button, self._new, self._kept = event.type, False, None
        self._xy = self._mouse = self._press = (event.mouse_region_x, event.mouse_region_y)
        try:
            if not self._begin(context, any_time=event.ctrl):
                return {"FINISHED"}
        except RockfallError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        if event.value == "CLICK":
            return self._end(context)
        context.workspace.status_text_set(HINT)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        obj = picks.with_id(context.scene, self._identifier)
        if obj is None or event.type in {"ESC", "RIGHTMOUSE"}:
            return self._cancel(context, obj)
        if event.type in {"MOUSEMOVE", "INBETWEEN_MOUSEMOVE"}:
            part = FINE if event.shift else 1.0
            mouse = (event.mouse_region_x, event.mouse_region_y)
            self._xy = tuple(a + part * (b - c) for a, b, c in zip(self._xy, mouse, self._mouse, strict=True))
            self._moved, self._mouse = self._moved or mouse != self._mouse, mouse
            if self._moved:
                self._follow(context, obj)
        elif event.type == self._button and event.value == "RELEASE":
            return self._end(context)
        return {"RUNNING_MODAL"}

    def _begin(self, context: bpy.types.Context, *, any_time: bool) -> bool:
        """Take the pick under the mouse, or make one; False when the click was all: nothing is to be dragged."""
        scene = context.scene
        obj = pointing.pick_at(context, self._xy, any_time=any_time)
        self._flew = bool(flights_of(scene, places.trajectory(scene) if obj is None else obj[store.TRAJECTORY]))
        if obj is None:
            name, kind = places.trajectory(scene), scene.rockfall_picking.kind
            if kind == "pass" and pointing.camera_of(context) is not None:
                self._observe(context, name)
                return False
            place = pointing.place_at(context, self._xy, name)
            camera = pointing.solved_camera_of(context)
            there = pictures.of_this_picture(scene, camera, name, place.time_s)
            self._kept = None if there is None else editing.snapshot(there)
            second = there is not None and camera is not None and clicks.elsewhere(there, camera)
            obj, self._new = editing.make_or_move(scene, camera, place, name, kind)
            scene.rockfall_picking.trajectory = name
            if kind == "takeoff":
                scene.rockfall_picking.kind = "impact"  # an impact has one
            if second:
                pointing.select(context, obj)
                self.report({"INFO"}, editing.second_view(scene, obj))
                return False
            self._moved, self._place = True, place
        else:
            self._kept, self._moved, self._place = editing.snapshot(obj), False, None
            self._xy = pointing.handle_of(context, obj)  # held by its middle: it does not jump
            scene.rockfall_picking.trajectory = obj[store.TRAJECTORY]
        pointing.select(context, obj)
        self._identifier = obj[store.ID]
        return True

    def _observe(self, context: bpy.types.Context, name: str) -> None:
        camera, pixel = pointing.camera_of(context), pointing.pixel_at(context, self._xy)
        if pixel is None:
            raise RockfallError("This is outside of the picture. Click the block in it.")
        frame, video_s = pictures.picture_time(context.scene, camera)
        sigma_px = context.scene.rockfall_picking.sigma_px
        sightings.click(camera, name, frame, video_s, pixel, sigma_px)
        context.scene.rockfall_picking.trajectory = name
        self.report({"INFO"}, f"{name}: the block is at ({pixel[0]:.1f}, {pixel[1]:.1f}) in picture {frame}.")
        context.area.tag_redraw()

    def _follow(self, context: bpy.types.Context, obj: bpy.types.Object) -> None:
        try:
            self._place = pointing.place_at(context, self._xy, obj[store.TRAJECTORY])
        except RockfallError:
            return  # off the terrain: it waits where it is
        obj.location = self._place.position

    def _end(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        context.workspace.status_text_set(None)
        obj = picks.with_id(scene, self._identifier)
        camera = pointing.solved_camera_of(context)
        if not self._moved:
            self._look_again(context, obj, camera)
            return {"FINISHED"}  # a click on a pick selects it
        if self._place is not None:
            editing.move(scene, obj, camera, self._place)
        editing.finish(scene, obj)
        if not self._flew or (self._new and not look.is_seen(context, obj.location)):
            look.frame(context, flights_of(scene, obj[store.TRAJECTORY]), beside=True)
        warning = self._place.warning if self._place is not None else ""
        if warning:
            self.report({"WARNING"}, warning)
        else:
            self.report({"INFO"}, editing.described(obj))
        return {"FINISHED"}

    def _look_again(self, context: bpy.types.Context, obj: bpy.types.Object, camera: bpy.types.Object | None) -> None:
        """A click on a pick that was made in another video is its second view."""
        scene = context.scene
        if camera is None or not clicks.elsewhere(obj, camera):
            return
        if obj not in pictures.in_this_picture(scene, camera):
            return
        try:
            place = pointing.place_at(context, self._press, obj[store.TRAJECTORY])
        except RockfallError as error:
            self.report({"WARNING"}, str(error))
            return
        clicks.keep(scene, obj, camera, place)
        self.report({"INFO"}, editing.second_view(scene, obj))

    def _cancel(self, context: bpy.types.Context, obj: bpy.types.Object | None) -> set[str]:
        context.workspace.status_text_set(None)
        if obj is not None:
            if self._new:
                editing.remove(context.scene, obj)
            elif self._kept is not None:
                editing.restore(obj, self._kept)
        return {"CANCELLED"}


class ROCKFALL_OT_pick_kind(bpy.types.Operator):
    """Choose what the next clicks are; with the mouse on a pick of this picture, change that one"""

    bl_idname = "rockfall.pick_kind"
    bl_label = "Set Kind of Pick"
    bl_options = {"REGISTER", "UNDO"}

    kind: EnumProperty(name="Kind", items=KINDS)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _in_3d_view(cls, context)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        scene = context.scene
        obj = pointing.pick_at(context, (event.mouse_region_x, event.mouse_region_y))
        if obj is None:
            return self.execute(context)
        editing.set_kind(scene, obj, self.kind)
        pointing.select(context, obj)
        return {"FINISHED"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        context.scene.rockfall_picking.kind = self.kind
        context.area.tag_redraw()
        return {"FINISHED"}


class ROCKFALL_OT_remove_pick(bpy.types.Operator):
    """Remove the selected pick; its trajectory closes over the gap"""

    bl_idname = "rockfall.remove_pick"
    bl_label = "Remove Pick"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(cls, pointing.active_pick(context) is not None, "Select a pick first")

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        editing.remove(context.scene, pointing.active_pick(context))
        return {"FINISHED"}


class ROCKFALL_OT_use_triangulated(bpy.types.Operator):
    """Move the selected pick to where its rays from two videos meet"""

    bl_idname = "rockfall.use_triangulated"
    bl_label = "Use Triangulated Point"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        obj = pointing.active_pick(context)
        return possible(
            cls,
            obj is not None and len(clicks.of(obj)) > 1,
            "Select a pick, and click the same event in a second aligned video",
        )

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        miss = editing.use_triangulated(context.scene, pointing.active_pick(context))
        self.report({"INFO"}, f"The rays miss each other by {100 * miss:.1f} cm.")
        return {"FINISHED"}


class PickTool(bpy.types.WorkSpaceTool):
    """The tool in the toolbar."""

    bl_space_type, bl_context_mode = "VIEW_3D", "OBJECT"
    bl_idname, bl_label = TOOL, "Pick Impacts"
    bl_description = (
        "Pick where and when the block hits the ground.\n"
        "• Click the block: a new pick, at the time of the picture.\n"
        "• Drag a pick: it slides along the terrain (Shift: finely; Ctrl: of another picture).\n"
        "• ← → or Alt wheel: step through the pictures.\n"
        "• [ ]: move the selected pick by a tenth of a frame.\n"
        "• 1–6: impact, release, block here, contact, stop, take-off.\n"
        "• X: remove.  Enter: done"
    )
    bl_icon, bl_cursor = "ops.curve.draw", "CROSSHAIR"
    bl_widget = None
    bl_keymap = (
        ("rockfall.drag_pick", {"type": "LEFTMOUSE", "value": "PRESS"}, None),
        ("rockfall.drag_pick", {"type": "LEFTMOUSE", "value": "PRESS", "shift": True}, None),
        ("rockfall.drag_pick", {"type": "LEFTMOUSE", "value": "PRESS", "ctrl": True}, None),
        ("rockfall.nudge_pick_time", {"type": "LEFT_BRACKET", "value": "PRESS", "repeat": True},
         {"properties": [("frames", -0.1)]}),
        ("rockfall.nudge_pick_time", {"type": "RIGHT_BRACKET", "value": "PRESS", "repeat": True},
         {"properties": [("frames", 0.1)]}),
        ("rockfall.remove_pick", {"type": "X", "value": "PRESS"}, None),
        ("rockfall.remove_pick", {"type": "DEL", "value": "PRESS"}, None),
        *(("rockfall.pick_kind", {"type": key, "value": "PRESS"}, {"properties": [("kind", kind[0])]})
          for key, kind in zip(("ONE", "TWO", "THREE", "FOUR", "FIVE", "SIX"), KINDS, strict=True)),
        *(("rockfall.step_frame", {"type": key, "value": "PRESS", "repeat": True}, {"properties": [("step", step)]})
          for key, step in (("LEFT_ARROW", -1), ("RIGHT_ARROW", 1))),
        *(("rockfall.step_frame", {"type": key, "value": "PRESS", "alt": True}, {"properties": [("step", step)]})
          for key, step in (("WHEELUPMOUSE", -1), ("WHEELDOWNMOUSE", 1))),
        *(("wm.tool_set_by_id", {"type": key, "value": "PRESS"}, {"properties": [("name", "builtin.select_box")]})
          for key in ("RET", "NUMPAD_ENTER")),
    )  # fmt: skip

    @staticmethod
    def is_needed(context: bpy.types.Context) -> bool:
        """Whether there is a slope to pick on."""
        return store.has_role(context.scene, store.TERRAIN_ROLE)

    @staticmethod
    def draw_settings(context: bpy.types.Context, layout: bpy.types.UILayout, tool: object) -> None:
        names = ("trajectory", "kind", "aim", "sigma_px", "show_loupe")
        tool_header.settings(layout, context.scene.rockfall_picking, names)


CLASSES = (ROCKFALL_OT_drag_pick, ROCKFALL_OT_pick_kind, ROCKFALL_OT_remove_pick, ROCKFALL_OT_use_triangulated)
TOOLS = (PickTool,)

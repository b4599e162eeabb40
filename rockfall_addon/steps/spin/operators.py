# SPDX-License-Identifier: GPL-3.0-or-later
"""The tool that marks a point of the block in the footage, and what can be done with the marks."""

import math

import bpy
from bpy.props import EnumProperty, FloatProperty, IntProperty, StringProperty

from ....core.errors import RockfallError
from ....core.reconstruction.spin_marks import AXES, AXIS_WORDS
from ...scene import camera_paths, clocks, pictures, places, spins, store, sync, videos
from ...scene.spins import Measured
from ...view import pointing, tool_header
from ...view.reporting import possible, reported

TOOL = "rockfall.spin_tool"
AXIS_NAMES = {"rolling": "Rolling", "sight": "Sight"}


def follow(scene: bpy.types.Scene, name: str) -> None:
    """The marks of a trajectory have changed: measure, and show what follows."""
    spins.measure(scene, name)
    sync.sync(scene, [name])


def described(scene: bpy.types.Scene, name: str, time_s: float) -> tuple[str, bool]:
    """What the marks of the flight at a time say, and whether that is a spin."""
    for _, one in spins.of_trajectory(scene, name):
        if one.start_s <= time_s <= one.end_s:
            return sentence(name, one), one.is_known
    return next(iter(spins.homeless(scene, name)), f"{name}: the mark is in no flight."), False


def sentence(name: str, one: Measured) -> str:
    """A measured flight in words."""
    if not one.is_known:
        return f"{name}, flight {one.flight}: {' '.join(one.remarks)}"
    turns, sigma = one.rate / (2 * math.pi), one.sigma_rate / (2 * math.pi)
    return f"{name}, flight {one.flight}: {turns:.2f} ± {sigma:.2f} turns/s of {one.marks} marks."


class ROCKFALL_OT_mark_spin(bpy.types.Operator):
    """Mark a point of the block where you click; the same point in another picture of the flight gives its spin"""

    bl_idname = "rockfall.mark_spin"
    bl_label = "Mark Point of Block"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not possible(cls, context.area is not None and context.area.type == "VIEW_3D", "Works in the 3-D view"):
            return False
        return possible(cls, pointing.solved_camera_of(context), "Look through the camera of an aligned video")

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self._xy = (event.mouse_region_x, event.mouse_region_y)
        return self.execute(context)

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene, camera = context.scene, pointing.solved_camera_of(context)
        pixel = pointing.pixel_at(context, self._xy) if hasattr(self, "_xy") else None
        if pixel is None:
            raise RockfallError("This is outside of the picture. Click the block in it.")
        name = places.trajectory(scene)
        if name not in places.trajectories(scene):
            raise RockfallError(
                f"{name} has no picks, so no flight is known. Pick the impacts before and after it first."
            )
        frame, video_s = pictures.picture_time(scene, camera)
        spins.mark(camera, name, frame, video_s, pixel, store.double(scene.rockfall_picking.sigma_px))
        follow(scene, name)
        text, known = described(scene, name, pictures.common_time(camera, video_s, float(pixel[1])))
        self.report({"INFO"} if known or "mark the same point" in text else {"WARNING"}, text)
        return {"FINISHED"}


class _OfTrajectory:
    """Mix-in of operators on the marks of the trajectory that is picked."""

    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        scene = context.scene
        name = places.trajectory(scene)
        there = any(name in spins.names_in(camera) for camera in videos.cameras(scene))
        return possible(cls, there, f"No point of {name} is marked: use the tool Mark Spin in the footage")


class ROCKFALL_OT_remove_spin_mark(_OfTrajectory, bpy.types.Operator):
    """Remove the mark of the trajectory in this picture"""

    bl_idname = "rockfall.remove_spin_mark"
    bl_label = "Remove Mark of Spin"

    video: StringProperty(description="Id of the video; empty for the active one", options={"SKIP_SAVE"})
    frame: IntProperty(description="Picture; −1 for the one that is shown", default=-1, options={"SKIP_SAVE"})

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene, name = context.scene, places.trajectory(context.scene)
        camera = videos.by_id(scene, self.video) if self.video else videos.active_camera(scene)
        if camera is None:
            raise RockfallError("There is no such video.")
        frame = self.frame if self.frame >= 0 else pictures.picture_time(scene, camera)[0]
        if not spins.remove(camera, name, frame):
            raise RockfallError(f"{name} has no mark in picture {frame} of {camera.name}.")
        follow(scene, name)
        return {"FINISHED"}


class ROCKFALL_OT_clear_spin_marks(_OfTrajectory, bpy.types.Operator):
    """Remove all marks of the trajectory, in all videos, with the spins that they measured"""

    bl_idname = "rockfall.clear_spin_marks"
    bl_label = "Clear Marks of Spin"

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene, name = context.scene, places.trajectory(context.scene)
        count = sum(spins.remove(camera, name) for camera in videos.cameras(scene))
        follow(scene, name)
        self.report({"INFO"}, f"{count} marks of {name} are removed.")
        return {"FINISHED"}


class ROCKFALL_OT_measure_spin(_OfTrajectory, bpy.types.Operator):
    """Measure the spins of the trajectory anew, with the cameras and clocks as they are now"""

    bl_idname = "rockfall.measure_spin"
    bl_label = "Measure Spin Again"

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        follow(context.scene, places.trajectory(context.scene))
        return {"FINISHED"}


class ROCKFALL_OT_set_spin_axis(_OfTrajectory, bpy.types.Operator):
    """Assume another axis for the marks of the trajectory"""

    bl_idname = "rockfall.set_spin_axis"
    bl_label = "Assume Axis of Spin"

    axis: EnumProperty(name="Axis", items=[(axis, AXIS_NAMES[axis], AXIS_WORDS[axis]) for axis in AXES])

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene, name = context.scene, places.trajectory(context.scene)
        spins.set_axis(scene, name, self.axis)
        follow(scene, name)
        return {"FINISHED"}


class ROCKFALL_OT_count_turns(_OfTrajectory, bpy.types.Operator):
    """Say about how many turns per second were counted by eye: of the rates that fit, the nearest one is taken"""

    bl_idname = "rockfall.count_turns"
    bl_label = "Turns Counted by Eye"

    turns_per_s: FloatProperty(
        name="Turns/s", description="Negative for backwards; 0 forgets what was counted", precision=2
    )
    flight: IntProperty(
        name="Flight", description="Its number; 0 for the one that is shown", default=0, min=0, options={"SKIP_SAVE"}
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        return context.window_manager.invoke_props_dialog(self)

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene, name = context.scene, places.trajectory(context.scene)
        moment = clocks.common_time(scene)
        for _, one in spins.of_trajectory(scene, name):
            if one.flight == self.flight or (not self.flight and one.start_s <= moment <= one.end_s):
                counted = store.double(self.turns_per_s) or math.nan
                spins.set_counted(scene, name, one.start_s, one.end_s, counted)
                follow(scene, name)
                return {"FINISHED"}
        raise RockfallError("No marks are in the flight that is shown. Go to a picture of it, or give its number.")


class ROCKFALL_OT_go_to_spin_mark(bpy.types.Operator):
    """Show the picture in which this mark was made"""

    bl_idname = "rockfall.go_to_spin_mark"
    bl_label = "Go to Mark of Spin"
    bl_options = {"REGISTER", "UNDO"}
    looks_only = True

    video: StringProperty(description="Id of the video")
    frame: IntProperty(description="Picture")

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        camera = videos.by_id(scene, self.video)
        if camera is None:
            raise RockfallError("There is no such video.")
        frame = clocks.scene_frame_of(scene, camera, self.frame)
        scene.frame_set(int(frame // 1), subframe=float(frame % 1))
        return {"FINISHED"}


class SpinTool(bpy.types.WorkSpaceTool):
    """The tool in the toolbar."""

    bl_space_type, bl_context_mode = "VIEW_3D", "OBJECT"
    bl_idname, bl_label = TOOL, "Mark Spin"
    bl_description = (
        "Measure how fast the block turns.\n"
        "• Click a point of the block that you know again: an edge, a stain.\n"
        "• ← → or Alt wheel: step to another picture of the flight, and click the same point.\n"
        "• Click again in a picture: the mark moves.\n"
        "• X: remove the mark of this picture.  Enter: done"
    )
    bl_icon, bl_cursor = "ops.transform.rotate", "CROSSHAIR"
    bl_widget = None
    bl_keymap = (
        ("rockfall.mark_spin", {"type": "LEFTMOUSE", "value": "PRESS"}, None),
        ("rockfall.remove_spin_mark", {"type": "X", "value": "PRESS"}, None),
        ("rockfall.remove_spin_mark", {"type": "DEL", "value": "PRESS"}, None),
        *(("rockfall.step_frame", {"type": key, "value": "PRESS", "repeat": True}, {"properties": [("step", step)]})
          for key, step in (("LEFT_ARROW", -1), ("RIGHT_ARROW", 1))),
        *(("rockfall.step_frame", {"type": key, "value": "PRESS", "alt": True}, {"properties": [("step", step)]})
          for key, step in (("WHEELUPMOUSE", -1), ("WHEELDOWNMOUSE", 1))),
        *(("wm.tool_set_by_id", {"type": key, "value": "PRESS"}, {"properties": [("name", "builtin.select_box")]})
          for key in ("RET", "NUMPAD_ENTER")),
    )  # fmt: skip

    @staticmethod
    def is_needed(context: bpy.types.Context) -> bool:
        """Whether there is a flight, and an aligned video to see it in."""
        scene = context.scene
        return store.has_role(scene, store.FLIGHTS_ROLE) and any(map(camera_paths.is_solved, videos.cameras(scene)))

    @staticmethod
    def draw_settings(context: bpy.types.Context, layout: bpy.types.UILayout, tool: object) -> None:
        tool_header.settings(layout, context.scene.rockfall_picking, ("trajectory", "sigma_px", "show_loupe"))


CLASSES = (
    ROCKFALL_OT_mark_spin, ROCKFALL_OT_remove_spin_mark, ROCKFALL_OT_clear_spin_marks, ROCKFALL_OT_measure_spin,
    ROCKFALL_OT_set_spin_axis, ROCKFALL_OT_count_turns, ROCKFALL_OT_go_to_spin_mark,
)  # fmt: skip
TOOLS = (SpinTool,)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 3: align a camera: mark pairs, place it by eye, follow the background."""

import bpy
import numpy as np
from bpy.props import BoolProperty
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Vector

from ....core.camera.resection.problem import POSE_PAIRS
from ....core.errors import RockfallError
from ...scene.footage import alignment, camera_paths, clocks, footage_blend, pairs, videos
from ...scene.next_step import ALIGN_TOOL
from ...scene.storage import store
from ...scene.terrain import terrain
from ...view import image_view, job, look, workspace
from ...view.of_video import OfVideo, has_solved, has_video
from ...view.reporting import possible, reported
from . import following, looking, marking, solving

FINE = 0.1
STILL_PX = 3.0
NEAR_PX = 11.0
"""A click this near to a mark takes hold of it, in pixels at interface scale 1."""


def _pair(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Whether there is an active pair; if not, what to do."""
    if not has_video(cls, context):
        return False
    return possible(cls, pairs.active_pair(videos.active_camera(context.scene)) is not None, "There is no pair yet")


class ROCKFALL_OT_mark_pair(bpy.types.Operator):
    """Mark a place: in the picture where the view looks through the camera, on the terrain in any other view.
    Drag a mark to correct it, hold Shift to move it finely. Shift-click in the camera view marks the terrain that is
    seen there"""

    bl_idname = "rockfall.mark_pair"
    bl_label = "Mark a Pair"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.region_data is not None and has_video(cls, context)

    @reported
    def _begin(self, context: bpy.types.Context) -> set[str]:
        scene, camera = context.scene, videos.active_camera(context.scene)
        self._before = marking.remember(camera)
        self._camera = camera[store.ID]
        rectangle = image_view.image_rectangle(context.region, context.region_data, scene, camera)
        if rectangle is None and context.region_data.view_perspective == "CAMERA":
            raise RockfallError(
                "This view looks through another camera, or the render size has not the video's shape. "
                "Press Look Through in the Alignment panel."
            )
        self._taken = self._nearest(context, camera, rectangle)
        if self._taken:
            self._pair, self._side = self._taken[:2]
            marking.activate(camera, self._pair)
            self._place = np.array(self._taken[2])
        else:
            self._side = pairs.PIXEL if rectangle is not None and not self._shift else pairs.POINT
            self._place = self._mouse.copy()
            if rectangle is not None and self._shift and not camera_paths.is_solved(camera):
                raise RockfallError(
                    "The camera has no place yet, so what shines through is not what it sees. Click the terrain in "
                    "another view, or place the camera by eye with Use This View."
                )
            place = self._there(context, camera)
            if place is None:
                raise RockfallError(
                    "There is no terrain here. Click where the terrain is."
                    if terrain.tiles(scene)
                    else "There is no terrain to click on. Import it first (step 1)."
                )
            self._pair = marking.mark(scene, camera, self._side, place)
        context.window_manager.modal_handler_add(self)
        self._show(context)
        return {"RUNNING_MODAL"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self._mouse = np.array([event.mouse_region_x, event.mouse_region_y], dtype=np.float64)
        self._shift, self._moved, self._press = event.shift, False, self._mouse
        return self._begin(context)

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        camera = videos.by_id(context.scene, self._camera)
        if camera is None:
            self.report({"WARNING"}, "The camera is gone.")
            return {"CANCELLED"}
        if event.type == "MOUSEMOVE":
            now = np.array([event.mouse_region_x, event.mouse_region_y], dtype=np.float64)
            step, self._mouse = now - self._mouse, now
            self._place += step * (FINE if event.shift else 1.0)
            self._moved = self._moved or bool(np.hypot(*(now - self._press)) > self._still(context))
            self._move(context, camera, is_held=True)
        elif event.type == "LEFTMOUSE" and event.value == "RELEASE":
            if self._taken:
                self._move(context, camera, is_held=False)
            self._show(context)
            return {"FINISHED"}
        elif event.type in {"ESC", "RIGHTMOUSE"} and event.value == "PRESS":
            marking.restore(context.scene, camera, self._before)
            self._show(context)
            return {"CANCELLED"}
        return {"RUNNING_MODAL"}

    def _still(self, context: bpy.types.Context) -> float:
        """How far the mouse may tremble in a click on a dashed mark [px]; any other mark follows at once."""
        pair = pairs.with_id(pairs.pairs_of(videos.by_id(context.scene, self._camera)), self._pair)
        return STILL_PX * context.preferences.system.ui_scale if pair is not None and pair.proposed == self._side else 0

    def _move(self, context: bpy.types.Context, camera: bpy.types.Object, *, is_held: bool) -> None:
        try:
            if not self._moved:
                if not is_held:
                    marking.accept(context.scene, camera, self._pair)
                return
            place = self._there(context, camera)
            if place is not None:
                marking.move(context.scene, camera, self._pair, self._side, place, is_held=is_held)
        except RockfallError:
            return  # outside of the picture: the mark stays where it was
        self._show(context)

    def _there(self, context: bpy.types.Context, camera: bpy.types.Object) -> tuple[float, ...] | None:
        """The pixel, or the point of the terrain, under the mark that is held."""
        scene, region = context.scene, context.region
        rectangle = image_view.image_rectangle(region, context.region_data, scene, camera)
        if rectangle is not None:
            pixel = image_view.to_pixel(rectangle, videos.size_of(camera), self._place)
            if self._side == pairs.PIXEL:
                return tuple(pixel.tolist())
            return looking.point_at(scene, camera, pixel.tolist(), clocks.true_frame(scene, camera))
        ray = looking.free_ray(context.region_data, region.width, region.height, *self._place)
        return looking.meet(scene, *ray)

    def _nearest(
        self, context: bpy.types.Context, camera: bpy.types.Object, rectangle: image_view.Rectangle | None
    ) -> tuple[str, str, tuple[float, float]] | None:
        """The mark under the mouse: its pair, its side and where it is in the region."""
        frame, through = clocks.true_frame(context.scene, camera), rectangle is not None
        marked, side, places = marking.marks(camera, frame, through_camera=through)
        reach = NEAR_PX * context.preferences.system.ui_scale
        best = None
        for pair, place in zip(marked, places, strict=True):
            if through:
                spot = image_view.to_region(rectangle, videos.size_of(camera), place)
            else:
                spot = location_3d_to_region_2d(context.region, context.region_data, Vector(place))
            away = np.inf if spot is None else float(np.hypot(*(np.array(spot) - self._mouse)))
            if away < reach:
                reach, best = away, (pair.id, side, tuple(float(value) for value in spot))
        return best

    def _show(self, context: bpy.types.Context) -> None:
        for area in context.screen.areas if context.screen else ():
            area.tag_redraw()


class ROCKFALL_OT_delete_pair(bpy.types.Operator):
    """Delete the active pair"""

    bl_idname = "rockfall.delete_pair"
    bl_label = "Delete Pair"
    bl_options = {"REGISTER", "UNDO"}

    every: BoolProperty(name="All", description="Delete all pairs of the camera", options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _pair(cls, context)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if not self.every:
            return self.execute(context)
        return context.window_manager.invoke_confirm(self, event, title="Delete all pairs of this camera?")

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        camera = videos.active_camera(context.scene)
        chosen = pairs.pairs_of(camera) if self.every else [pairs.active_pair(camera)]
        marking.delete(context.scene, camera, [pair.id for pair in chosen])
        return {"FINISHED"}


class ROCKFALL_OT_accept_pair(bpy.types.Operator):
    """The dashed mark fits: take it as it is, as a check. It was not measured, so the camera is not solved with it"""

    bl_idname = "rockfall.accept_pair"
    bl_label = "Accept Prediction"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not has_video(cls, context):
            return False
        return possible(
            cls, _proposal(videos.active_camera(context.scene)) is not None, "No mark waits to be confirmed"
        )

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        camera = videos.active_camera(context.scene)
        marking.accept(context.scene, camera, _proposal(camera).id)
        return {"FINISHED"}


def _proposal(camera: bpy.types.Object) -> pairs.Pair | None:
    """The prediction that a person means: of the open pair, or of the active one."""
    for pair in (pairs.open_pair(camera), pairs.active_pair(camera)):
        if pair is not None and pair.proposed:
            return pair
    return None


class ROCKFALL_OT_align_views(OfVideo, bpy.types.Operator):
    """Footage to the left, terrain to the right, and the tool that marks pairs"""

    bl_idname = "rockfall.align_views"
    bl_label = "Footage Beside Terrain"

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene, camera = context.scene, videos.active_camera(context.scene)
        looking.look_through(scene, camera)
        footage_blend.set_blend(camera, footage_blend.blend_of(camera))
        if context.window is None or not _views(context):
            return {"FINISHED"}
        is_new = len(_views(context)) == 1
        picture = self._split(context) if is_new else self._choose(context)
        with context.temp_override(area=picture, region=_region(picture)):
            if context.mode != "OBJECT" and bpy.ops.object.mode_set.poll():
                bpy.ops.object.mode_set(mode="OBJECT")
            bpy.ops.wm.tool_set_by_id(name=ALIGN_TOOL)
            if is_new and bpy.ops.view3d.view_center_camera.poll():  # it gets its size when it is drawn
                bpy.ops.view3d.view_center_camera()
        if not is_new:
            workspace.fit_footage(scene, context.window.screen)
        return {"FINISHED"}

    def _split(self, context: bpy.types.Context) -> bpy.types.Area:
        """Make two views of one; returns that of the footage, to the left."""
        (area,) = _views(context)
        with context.temp_override(area=area, region=_region(area)):
            bpy.ops.screen.area_split(direction="VERTICAL", factor=0.5)
        look.show_relief(context, frame_all=bool(terrain.tiles(context.scene)))
        left, right = sorted(_views(context), key=lambda area: area.x)
        left.spaces.active.region_3d.view_perspective = "CAMERA"
        left.spaces.active.show_region_toolbar = False  # it would lie over the picture, as the sidebar
        if right.spaces.active.show_region_ui:
            left.spaces.active.show_region_ui = False
        return left

    def _choose(self, context: bpy.types.Context) -> bpy.types.Area:
        """Of several views, the one of the footage: that which is it already, or the largest. Another one is free."""
        areas = sorted(_views(context), key=lambda area: -area.width * area.height)
        through = [area for area in areas if area.spaces.active.region_3d.view_perspective == "CAMERA"]
        picture = (through or areas)[0]
        picture.spaces.active.region_3d.view_perspective = "CAMERA"
        if len(through) == len(areas):
            through[-1].spaces.active.region_3d.view_perspective = "PERSP"
        return picture


def _views(context: bpy.types.Context) -> list[bpy.types.Area]:
    return [area for area in context.window.screen.areas if area.type == "VIEW_3D"]


def _region(area: bpy.types.Area) -> bpy.types.Region:
    return next(region for region in area.regions if region.type == "WINDOW")


class ROCKFALL_OT_use_view(bpy.types.Operator):
    """Put the camera where this 3-D view looks from: a start for the pairs, or, for footage that cannot be solved,
    all there is"""

    bl_idname = "rockfall.use_view"
    bl_label = "Use This View"
    bl_options = {"REGISTER", "UNDO"}

    keep_focal: BoolProperty(
        name="Keep focal length",
        description="Keep the camera's focal length; otherwise the picture shows as much as the view",
        default=False,
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.region_data is not None and has_video(cls, context)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self.keep_focal = not videos.active_camera(context.scene).rockfall_alignment.free_focal
        return self.execute(context)

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene, camera = context.scene, videos.active_camera(context.scene)
        window = next(region for region in context.area.regions if region.type == "WINDOW")
        view = context.space_data.region_3d
        seen = looking.seen_camera(scene, camera, view, window.width, keep_focal=self.keep_focal)
        solving.place_by_eye(scene, camera, seen)
        looking.look_through(scene, camera)
        view.view_perspective = "CAMERA"
        footage_blend.set_blend(camera, 0.5)
        return {"FINISHED"}


class ROCKFALL_OT_go_to_pair(bpy.types.Operator):
    """Go to the frame of the active pair and look at its point of the terrain"""

    bl_idname = "rockfall.go_to_pair"
    bl_label = "Go to Pair"
    bl_options = {"REGISTER", "UNDO"}
    looks_only = True

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _pair(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        scene, camera = context.scene, videos.active_camera(context.scene)
        pair = pairs.active_pair(camera)
        frame = clocks.scene_frame_of(scene, camera, pair.frame)
        scene.frame_set(int(frame // 1), subframe=float(frame % 1))
        for area in _views(context) if context.window and pair.point else ():
            view = area.spaces.active.region_3d
            if view.view_perspective != "CAMERA":
                view.view_location = pair.point
        return {"FINISHED"}


class ROCKFALL_OT_propose_pairs(bpy.types.Operator):
    """Show where the terrain points of the pairs should be in this frame, to be dragged to where they are seen.
    Four of them tie the camera's path to this frame"""

    bl_idname = "rockfall.propose_pairs"
    bl_label = "Correct Here"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_solved(cls, context)

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene, camera = context.scene, videos.active_camera(context.scene)
        count = marking.propose_here(scene, camera)
        if not count:
            raise RockfallError("No other pair's point is in the picture here. Mark new pairs in this frame.")
        if count < POSE_PAIRS:
            self.report({"INFO"}, f"{count} points are in the picture; mark {POSE_PAIRS - count} more here.")
        return {"FINISHED"}


class ROCKFALL_OT_follow_background(job.InBackground, bpy.types.Operator):
    """Follow the background through the whole video and give the camera a pose for each frame; Esc stops it"""

    bl_idname = "rockfall.follow_background"
    bl_label = "Follow the Background"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return job.is_free(cls) and has_solved(cls, context)

    def prepare(self, context: bpy.types.Context) -> job.Work:
        return following.work(context.scene, videos.active_camera(context.scene))


class AlignTool(bpy.types.WorkSpaceTool):
    """The tool in the toolbar."""

    bl_space_type = "VIEW_3D"
    bl_context_mode = "OBJECT"
    bl_idname = ALIGN_TOOL
    bl_label = "Align Camera"
    bl_description = (
        "Mark the same place in the footage and on the terrain, in either order.\n"
        "• Click: mark, or take hold of a mark\n"
        "• Drag: correct, with Shift finely\n"
        "• Click a dashed mark, or Enter: it fits, as a check\n"
        "• X: delete the active pair\n"
        "• Shift Click in the footage: the terrain that shines through there"
    )
    bl_icon = "ops.transform.bone_envelope"
    bl_cursor = "CROSSHAIR"
    bl_keymap = (
        ("rockfall.mark_pair", {"type": "LEFTMOUSE", "value": "PRESS"}, None),
        ("rockfall.mark_pair", {"type": "LEFTMOUSE", "value": "PRESS", "shift": True}, None),
        ("rockfall.accept_pair", {"type": "RET", "value": "PRESS"}, None),
        ("rockfall.accept_pair", {"type": "NUMPAD_ENTER", "value": "PRESS"}, None),
        ("rockfall.delete_pair", {"type": "X", "value": "PRESS"}, None),
        ("rockfall.delete_pair", {"type": "DEL", "value": "PRESS"}, None),
    )

    @staticmethod
    def is_needed(context: bpy.types.Context) -> bool:
        """Whether there is a camera to align."""
        return videos.active_camera(context.scene) is not None

    @staticmethod
    def draw_settings(context: bpy.types.Context, layout: bpy.types.UILayout, tool: object) -> None:
        """What to do next, in the header, where it is not drawn over the view."""
        overlay = context.space_data.overlay
        hint = "" if overlay.show_overlays else alignment.hint(context.scene, videos.active_camera(context.scene))
        if hint:  # a button, as words alone have no ground there; it shows the marks again
            layout.prop(overlay, "show_overlays", text=hint, toggle=True)


CLASSES = (
    ROCKFALL_OT_mark_pair,
    ROCKFALL_OT_delete_pair,
    ROCKFALL_OT_accept_pair,
    ROCKFALL_OT_align_views,
    ROCKFALL_OT_use_view,
    ROCKFALL_OT_go_to_pair,
    ROCKFALL_OT_propose_pairs,
    ROCKFALL_OT_follow_background,
)
TOOLS = (AlignTool,)

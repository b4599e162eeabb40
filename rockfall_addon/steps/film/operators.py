# SPDX-License-Identifier: GPL-3.0-or-later
"""Set the scene up for a film, render it, take the set-up away."""

import bpy

from ....core.errors import RockfallError
from ....core.progress import Progress
from ...scene.film_preset import preset_of
from ...scene.storage import store
from ...view import job, workspace
from ...view.job import InBackground, Work
from ...view.reporting import possible, reported
from . import beside, dressing, remembered, stopwatch, up_to_date
from .engine import quickest_engine
from .properties import file_of, graphs_of


class ROCKFALL_OT_set_up_film(bpy.types.Operator):
    """Camera, captions and trails that grow with time: everything that a film of these trajectories needs.
    Press it again after a change"""

    bl_idname = "rockfall.set_up_film"
    bl_label = "Set Up Film"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(
            cls,
            store.has_role(context.scene, store.FLIGHTS_ROLE),
            "There are no trajectories to film: import picks first",
        )

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene, preset = context.scene, preset_of(context.scene)
        engine = quickest_engine() if preset.engine == "auto" else preset.engine
        dressing.set_up_film(scene, preset, engine, graphs_of(scene))
        up_to_date.keep(scene)
        _look_through_camera(context.screen)
        self.report({"INFO"}, "Press Preview Frame or Render Film, or play: the camera view shows the film")
        return {"FINISHED"}


def _look_through_camera(screen: bpy.types.Screen | None) -> None:
    """The largest view shows the film, unless one looks through the camera already; free views stay as they are."""
    views = [area for area in screen.areas if area.type == "VIEW_3D"] if screen else []
    if views and not any(workspace.camera_views(screen)):
        largest = max(views, key=lambda area: area.width * area.height)
        largest.spaces.active.region_3d.view_perspective = "CAMERA"


class ROCKFALL_OT_preview_film(bpy.types.Operator):
    """Render the present frame as it will be in the film, and show it. The film's file is not touched"""

    bl_idname = "rockfall.preview_film"
    bl_label = "Preview Frame"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _is_ready(cls, context)

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene, start = context.scene, stopwatch.started()
        try:
            bpy.ops.render.render(scene=scene.name)
        except RuntimeError as error:
            raise RockfallError(f"Blender could not render the frame: {error}") from error
        stopwatch.measured(scene, start)
        if not bpy.app.background:
            bpy.ops.render.view_show("INVOKE_DEFAULT")
        self.report({"INFO"}, f"Frame {scene.frame_current}. {stopwatch.expected(scene)}")
        return {"FINISHED"}


class ROCKFALL_OT_render_film(InBackground, bpy.types.Operator):
    """Render the film to its file, an MP4, in the background. It is checked before it replaces an old one"""

    bl_idname = "rockfall.render_film"
    bl_label = "Render Film"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _is_ready(cls, context) and job.is_free(cls)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        path = file_of(context.scene)
        if not path.exists():
            return self.execute(context)
        return context.window_manager.invoke_confirm(
            self, event, title="Replace the film?", message=str(path), confirm_text="Replace", icon="WARNING"
        )

    def execute(self, context: bpy.types.Context) -> set[str]:
        return super().execute(context) if bpy.app.background else self._begin(context)

    def prepare(self, context: bpy.types.Context) -> Work:
        scene, path = context.scene, file_of(context.scene)
        frames = scene.frame_end - scene.frame_start + 1
        unchanged = f"The old {path.name} is as it was." if path.exists() else "No film was written."
        render = beside.film_of(scene, path)

        def compute(progress: Progress) -> None:
            try:
                render(stopwatch.with_time_left(progress))
            except RockfallError as error:
                raise RockfallError(f"{error} {unchanged}") from error

        def keep(scene: bpy.types.Scene, _: None) -> str:
            beside.written[scene.session_uid] = path
            return f"Written: {path}, {frames} frames, checked."

        return Work("film", compute, keep, changes=False, unchanged=unchanged)


class ROCKFALL_OT_remove_film(bpy.types.Operator):
    """Take camera, captions and growing trails away: the scene is as it was before"""

    bl_idname = "rockfall.remove_film"
    bl_label = "Remove Film Set-up"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return remembered.is_set_up(context.scene)

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        dressing.remove_film(context.scene)
        return {"FINISHED"}


def _is_ready(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """For a poll: whether the film that would be made is the one that is wanted."""
    if not possible(cls, remembered.is_set_up(context.scene), "Set up the film first"):
        return False
    return possible(cls, up_to_date.is_up_to_date(context.scene), "Something has changed: press Update Set-up first")


CLASSES = (ROCKFALL_OT_set_up_film, ROCKFALL_OT_preview_film, ROCKFALL_OT_render_film, ROCKFALL_OT_remove_film)

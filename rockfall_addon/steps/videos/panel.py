# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 2: the videos and their times."""

import bpy

from ...scene.footage import camera_paths, video_times, videos
from ...scene.storage import store
from ...view import image_view
from ...view.panel import RockfallPanel, State, advise, facts, fields, paragraph, show_remarks
from . import proxies, wording


class ROCKFALL_PT_videos(RockfallPanel, bpy.types.Panel):
    bl_label = "2  Videos"
    bl_idname = "ROCKFALL_PT_videos"
    bl_options = {"DEFAULT_CLOSED"}

    @staticmethod
    def step_state(context: bpy.types.Context) -> State:
        scene = context.scene
        camera = videos.active_camera(scene)
        if videos.deleted(scene):
            return "ATTENTION"
        if camera is None:
            return "TO_DO"
        wrong = wording.is_missing(camera) or wording.warnings(scene, camera)
        return "ATTENTION" if wrong else "READY"

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        for identifier, name in videos.deleted(scene).items():
            paragraph(context, layout, f"The camera of {name} is gone. Undo, or add the video again.", "ERROR")
            layout.operator("rockfall.remove_video", text=f"Forget {name}", icon="X").identifier = identifier
        camera = videos.active_camera(scene)
        if camera is None:
            advise(context, layout, False, "Add the videos of the fall.")
            layout.operator("rockfall.add_video", icon="FILE_MOVIE")
            return
        self._list(scene, camera)
        layout.operator("rockfall.add_video", icon="FILE_MOVIE")
        if wording.is_missing(camera):
            paragraph(context, layout, wording.missing(camera), "ERROR")
            layout.operator("rockfall.relink_video", icon="FILEBROWSER")
        show_remarks(context, layout, wording.warnings(scene, camera))
        if scene.camera == camera and not image_view.shape_agrees(scene, camera):
            layout.operator("rockfall.use_video_size", icon="FULLSCREEN_ENTER")
        facts(layout, wording.facts(camera))
        show_remarks(context, layout, wording.remarks(camera))
        if wording.named_capture_rate(camera):
            layout.operator("rockfall.use_named_capture_rate", icon="TIME")
        self._proxies(camera)

    def _list(self, scene: bpy.types.Scene, active: bpy.types.Object) -> None:
        column = self.layout.box().column(align=True)
        for camera in videos.cameras(scene):
            row = column.row(align=True)
            chosen = camera == active
            icon = "VIEW_CAMERA" if chosen else "CAMERA_DATA"
            row.operator(
                "rockfall.look_through", text=camera.name, icon=icon, depress=chosen, translate=False
            ).identifier = camera[store.ID]
            row.label(text="", icon="CHECKMARK" if camera_paths.is_solved(camera) else "BLANK1")
            row.operator("rockfall.remove_video", text="", icon="X").identifier = camera[store.ID]

    def _proxies(self, camera: bpy.types.Object) -> None:
        layout = self.layout
        layout.use_property_split, layout.use_property_decorate = True, False
        layout.operator_menu_enum("rockfall.build_proxy", "size", text="Build Proxy", icon="FILE_CACHE")
        clip = next((b for b in camera.data.background_images if b.source == "MOVIE_CLIP"), None)
        if clip is not None and proxies.shown(camera):
            layout.prop(clip.clip_user, "proxy_render_size", text="Show")


class ROCKFALL_PT_video_times(RockfallPanel, bpy.types.Panel):
    bl_label = "Times"
    bl_idname = "ROCKFALL_PT_video_times"
    bl_parent_id = "ROCKFALL_PT_videos"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return videos.active_camera(context.scene) is not None

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        camera = videos.active_camera(scene)
        facts(layout, wording.now(scene, camera))
        row = layout.row(align=True)
        for step, icon in ((-10, "REW"), (-1, "TRIA_LEFT"), (1, "TRIA_RIGHT"), (10, "FF")):
            row.operator("rockfall.step_frame", text=f"{step:+d}", icon=icon).step = step
        paragraph(context, layout, "In the camera's view: arrow keys, or Alt and the wheel; with Ctrl by ten.")
        rates = wording.rates(scene, camera)
        if rates:
            paragraph(context, layout, rates, "INFO")
            layout.operator("rockfall.use_video_rate", icon="TIME")
        layout.operator_menu_enum(
            "rockfall.time_origin_here", "what", text="Time Origin Here", icon="TRACKING_FORWARDS"
        )
        names = ("capture_rate_hz", "offset_s", "drift_ppm", "row_time_us")
        fields(layout.column(align=True), camera.rockfall_video, names)
        if len(videos.cameras(scene)) > 1:
            self._synchronise(context, camera)

    def _synchronise(self, context: bpy.types.Context, camera: bpy.types.Object) -> None:
        layout, scene = self.layout, context.scene
        box = layout.box()
        for sentence in wording.synchronised(scene, camera):
            paragraph(context, box, sentence)
        show_remarks(context, box, wording.fit(camera))
        settings = scene.rockfall_videos
        box.prop(settings, "event")
        row = box.row(align=True)
        row.operator("rockfall.mark_event", icon="MARKER_HLT")
        if settings.event in video_times.events_of(camera):
            row.operator("rockfall.mark_event", text="", icon="X").clear = True
        box.operator("rockfall.reference_video", icon="SOLO_ON")
        box.prop(settings, "fit_drift")
        box.operator("rockfall.synchronise_videos", icon="UV_SYNC_SELECT")


CLASSES = (ROCKFALL_PT_videos, ROCKFALL_PT_video_times)

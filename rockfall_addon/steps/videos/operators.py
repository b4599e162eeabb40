# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 2: the videos, their times, and what is shown of them."""

from contextlib import suppress
from pathlib import Path

import bpy
from bpy.props import BoolProperty, CollectionProperty, EnumProperty, FloatProperty, IntProperty, StringProperty
from mathutils import Matrix

from ....core.errors import RockfallError
from ....core.footage.background import glance
from ....core.footage.sequences import PICTURES, sequence_beside
from ...scene.footage import alignment, clocks, footage, new_videos, video_files, video_times, videos
from ...scene.storage import start_up, store
from ...view import workspace
from ...view.first_import import FirstImport, begin_file
from ...view.from_file import FromFile, remember_folder
from ...view.of_video import OfVideo, has_video
from ...view.reporting import reported
from . import proxies, wording

EXTENSIONS = (".mp4", ".mov", ".avi", ".mkv", ".webm", ".m4v")

KEYS = (
    ("LEFT_ARROW", {}, -1),
    ("RIGHT_ARROW", {}, 1),
    ("LEFT_ARROW", {"ctrl": True}, -10),
    ("RIGHT_ARROW", {"ctrl": True}, 10),
    ("WHEELUPMOUSE", {"alt": True}, -1),
    ("WHEELDOWNMOUSE", {"alt": True}, 1),
    ("WHEELUPMOUSE", {"alt": True, "ctrl": True}, -10),
    ("WHEELDOWNMOUSE", {"alt": True, "ctrl": True}, 10),
)
"""Shortcuts of `rockfall.step_frame` while the view looks through the camera of a video."""

_keys: list[tuple[bpy.types.KeyMap, bpy.types.KeyMapItem]] = []


class ROCKFALL_OT_add_video(FirstImport, bpy.types.Operator):
    """Add videos of the fall: each gets a camera with its footage behind it, and keeps its own timestamps. Of numbered
    pictures, choose one: all of its sequence are taken"""

    bl_idname = "rockfall.add_video"
    bl_label = "Add Video"
    bl_options = {"REGISTER", "UNDO"}

    filter_glob: StringProperty(default=";".join(f"*{e}" for e in (*EXTENSIONS, *PICTURES)), options={"HIDDEN"})
    pictures_per_second: FloatProperty(
        name="Pictures per Second", description="Of numbered pictures, which have no times of their own. Videos have",
        default=0.0, min=0.0, max=100_000.0, precision=3, options={"SKIP_SAVE"},
    )  # fmt: skip
    directory: StringProperty(subtype="DIR_PATH", options={"SKIP_SAVE", "HIDDEN"})
    files: CollectionProperty(type=bpy.types.OperatorFileListElement, options={"SKIP_SAVE", "HIDDEN"})

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self.by_hand = True
        given = self.filepath or any(each.name for each in self.files)
        return self.execute(context) if given else super().invoke(context, event)

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.prop(self, "pictures_per_second")
        self.draw_offer(context, self.layout)

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        folder = Path(bpy.path.abspath(self.directory))
        paths = [folder / each.name for each in self.files if each.name] or [Path(bpy.path.abspath(self.filepath))]
        remember_folder(context, paths[0].parent)
        first = start_up.is_untouched(context.scene)
        added, errors = [], []
        rate = store.double(self.pictures_per_second) or None
        sequences = {path: sequence_beside(path) for path in paths if path.suffix.lower() in PICTURES}
        for path in dict.fromkeys(sequences.get(path, path) for path in paths):
            try:
                own = rate if path in sequences.values() else None
                added.append(new_videos.add_video(context.scene, path, matrix=_present_matrix(context), rate_hz=own))
            except RockfallError as error:
                errors.append(str(error))
        if not added:
            raise RockfallError("\n".join(errors))
        for camera in added:
            with suppress(RockfallError):  # it is a look, no more
                alignment.look_at_background(camera, glance(video_files.video_of(camera)))
                video_files.note_repeats(camera)
        _look_through(context, added[0])
        if first:
            begin_file(context, opens_workspace=self.opens_workspace)
        elif self.by_hand and context.screen is not None and workspace.is_open(context):
            workspace.take_tool(context.scene, context.screen)
        for error in errors:
            self.report({"WARNING"}, error)
        self.report({"INFO"}, " ".join(videos.summary(camera) for camera in added))
        return {"FINISHED"}


class ROCKFALL_OT_look_through(OfVideo, bpy.types.Operator):
    """Look through the camera of a video, with its footage behind the terrain"""

    bl_idname = "rockfall.look_through"
    bl_label = "Look Through"

    identifier: StringProperty(description="Id of the camera; the active one without", options={"SKIP_SAVE"})

    def execute(self, context: bpy.types.Context) -> set[str]:
        camera = videos.by_id(context.scene, self.identifier) or videos.active_camera(context.scene)
        _look_through(context, camera)
        return {"FINISHED"}


class ROCKFALL_OT_remove_video(bpy.types.Operator):
    """Remove a video from the scene: its camera with all that was marked with it. The file stays"""

    bl_idname = "rockfall.remove_video"
    bl_label = "Remove Video"
    bl_options = {"REGISTER", "UNDO"}

    identifier: StringProperty(description="Id of the camera", options={"SKIP_SAVE"})

    def execute(self, context: bpy.types.Context) -> set[str]:
        camera = videos.by_id(context.scene, self.identifier)
        if camera is None:
            footage.forget(context.scene, self.identifier)
        else:
            footage.remove(context.scene, camera)
        return {"FINISHED"}


class ROCKFALL_OT_relink_video(OfVideo, FromFile, bpy.types.Operator):
    """Tell where the file of the active video is now; nothing that was marked in it is lost"""

    bl_idname = "rockfall.relink_video"
    bl_label = "Find the File"

    filter_glob: StringProperty(default=";".join(f"*{e}" for e in EXTENSIONS), options={"HIDDEN"})

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        return self.execute(context) if self.filepath else super().invoke(context, event)

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        camera = videos.active_camera(context.scene)
        warnings = footage.relink(camera, self.chosen(context))
        footage.follow(context.scene)
        for sentence in warnings:
            self.report({"WARNING"}, sentence)
        if not warnings:
            self.report({"INFO"}, f"{camera.name} has its file again: size and timestamps are the same.")
        return {"FINISHED"}


class ROCKFALL_OT_step_frame(bpy.types.Operator):
    """Go to another picture of the active video, to its true time"""

    bl_idname = "rockfall.step_frame"
    bl_label = "Step Through the Video"
    bl_options = {"INTERNAL"}
    looks_only = True

    step: IntProperty(name="Pictures", default=1)
    in_camera_view: BoolProperty(options={"HIDDEN", "SKIP_SAVE"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_video(cls, context)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if self.in_camera_view and not _in_camera_view(context):
            return {"PASS_THROUGH"}
        return self.execute(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        video_times.step(context.scene, videos.active_camera(context.scene), self.step)
        return {"FINISHED"}


class ROCKFALL_OT_time_origin_here(OfVideo, bpy.types.Operator):
    """Begin to count time at the picture that is shown"""

    bl_idname = "rockfall.time_origin_here"
    bl_label = "Time Origin Here"

    what: EnumProperty(
        name="Set",
        items=[
            ("SCENE", "The scene's frame 0", "The timeline begins here: Blender plays nothing before frame 0. "
             "Times of picks and videos stay"),
            ("CLOCK", "The common clock", "This is time 0 for all videos. Only before there are picks"),
        ],
    )  # fmt: skip

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        {"SCENE": video_times.origin_here, "CLOCK": video_times.zero_here}[self.what](
            scene, videos.active_camera(scene)
        )
        return {"FINISHED"}


class ROCKFALL_OT_mark_event(OfVideo, bpy.types.Operator):
    """The picture that is shown is that of the event: a clap, an impact. Mark the same event in another video too"""

    bl_idname = "rockfall.mark_event"
    bl_label = "Event Here"

    clear: BoolProperty(name="Clear", description="Take the mark back instead", options={"SKIP_SAVE"})

    def execute(self, context: bpy.types.Context) -> set[str]:
        scene, camera = context.scene, videos.active_camera(context.scene)
        number = scene.rockfall_videos.event
        if self.clear:
            video_times.clear_event(camera, number)
        else:
            time = video_times.mark_event(scene, camera, number)
            self.report({"INFO"}, f"Event {number} is at {time:.3f} s of {camera.name}.")
        return {"FINISHED"}


class ROCKFALL_OT_synchronise_videos(OfVideo, bpy.types.Operator):
    """Set the clocks of the videos by the events that were marked in two of them"""

    bl_idname = "rockfall.synchronise_videos"
    bl_label = "Synchronise"

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        said = video_times.synchronise_cameras(context.scene, fit_drift=context.scene.rockfall_videos.fit_drift)
        self.report({"INFO"}, " ".join(remark.text for remark in said))
        return {"FINISHED"}


class ROCKFALL_OT_reference_video(OfVideo, bpy.types.Operator):
    """The clock of this video stays; the others are set by it"""

    bl_idname = "rockfall.reference_video"
    bl_label = "Reference Clock"

    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        scene[store.REFERENCE_CAMERA] = videos.active_camera(scene)[store.ID]
        return {"FINISHED"}


class ROCKFALL_OT_use_video_rate(OfVideo, bpy.types.Operator):
    """Play the scene at the rate of the active video: one frame of the scene for each picture"""

    bl_idname = "rockfall.use_video_rate"
    bl_label = "Use the Video's Rate"

    def execute(self, context: bpy.types.Context) -> set[str]:
        video_times.use_rate_of(context.scene, videos.active_camera(context.scene))
        return {"FINISHED"}


class ROCKFALL_OT_use_named_capture_rate(OfVideo, bpy.types.Operator):
    """Take over the rate at which the file says that its pictures were taken: slow motion becomes the true motion"""

    bl_idname = "rockfall.use_named_capture_rate"
    bl_label = "Use the File's Capture Rate"

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        camera = videos.active_camera(context.scene)
        rate = wording.named_capture_rate(camera)
        if not rate:
            raise RockfallError(f"{camera.name} names no other capture rate than that of its file, or one is set.")
        clocks.set_capture_rate(camera, rate)
        video_times.clock_changed(context.scene, camera)
        self.report({"INFO"}, f"{camera.name} was taken at {rate:.5g} pictures a second.")
        return {"FINISHED"}


class ROCKFALL_OT_use_video_size(OfVideo, bpy.types.Operator):
    """Render at the size of the active video, so that footage and terrain fit"""

    bl_idname = "rockfall.use_video_size"
    bl_label = "Use the Video's Size"

    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        scene.camera = videos.active_camera(scene)
        footage.use_size_of_active(scene, again=True)
        return {"FINISHED"}


class ROCKFALL_OT_build_proxy(OfVideo, bpy.types.Operator):
    """Write small copies of the active video, with which large footage plays smoothly; they lie beside the file.
    Picking and tracking use the full pictures in either case"""

    bl_idname = "rockfall.build_proxy"
    bl_label = "Build Proxy"

    size: EnumProperty(
        name="Size", items=[("25", "A quarter", "For 4K footage"), ("50", "A half", "For HD footage")], default="25"
    )  # fmt: skip

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        proxies.build(context, videos.active_camera(context.scene), int(self.size))
        self.report({"INFO"}, "The proxy is being written: the progress is in the status bar.")
        return {"FINISHED"}


class ROCKFALL_FH_video(bpy.types.FileHandler):
    """Drop videos into the 3-D view"""

    bl_idname = "ROCKFALL_FH_video"
    bl_label = "Rockfall video"
    bl_import_operator = "rockfall.add_video"
    bl_file_extensions = ";".join(EXTENSIONS)

    @classmethod
    def poll_drop(cls, context: bpy.types.Context) -> bool:
        return context.area is not None and context.area.type == "VIEW_3D"


def _view(context: bpy.types.Context) -> bpy.types.SpaceView3D | None:
    """The 3-D view that is worked in, else the largest of the window."""
    if isinstance(context.space_data, bpy.types.SpaceView3D):
        return context.space_data
    areas = [area for area in context.screen.areas if area.type == "VIEW_3D"] if context.screen else []
    return max(areas, key=lambda area: area.width * area.height).spaces.active if areas else None


def _view_matrix(context: bpy.types.Context) -> Matrix | None:
    """Where a free view looks from; None when there is none."""
    view = _view(context)
    if view is None or view.region_3d is None or view.region_3d.view_perspective == "CAMERA":
        return None
    return view.region_3d.view_matrix.inverted()


def _present_matrix(context: bpy.types.Context) -> Matrix | None:
    """Where the view looks from, also when it looks through a camera."""
    free = _view_matrix(context)
    if free is not None:
        return free
    return context.scene.camera.matrix_world.copy() if context.scene.camera is not None else None


def _in_camera_view(context: bpy.types.Context) -> bool:
    view = context.space_data
    return (
        isinstance(view, bpy.types.SpaceView3D)
        and view.region_3d is not None
        and view.region_3d.view_perspective == "CAMERA"
        and videos.is_video(context.scene.camera)
    )


def _look_through(context: bpy.types.Context, camera: bpy.types.Object) -> None:
    context.scene.camera = camera
    footage.follow(context.scene)
    view = _view(context)
    if view is not None and view.region_3d is not None:
        view.region_3d.view_perspective = "CAMERA"
    if not bpy.app.background and context.screen is not None and workspace.is_open(context):
        workspace.fit_footage(context.scene, context.screen)


def register() -> None:
    """Shortcuts, where there is a window."""
    config = bpy.context.window_manager.keyconfigs.addon if bpy.context.window_manager else None
    if config is None:
        return
    keymap = config.keymaps.new(name="Frames")  # Blender's own steps are there, and come before those of the 3-D view
    for key, modifiers, step in KEYS:
        item = keymap.keymap_items.new("rockfall.step_frame", key, "PRESS", repeat=True, head=True, **modifiers)
        item.properties.step, item.properties.in_camera_view = step, True
        _keys.append((keymap, item))


def unregister() -> None:
    """Take the shortcuts back."""
    while _keys:
        keymap, item = _keys.pop()
        keymap.keymap_items.remove(item)


CLASSES = (
    ROCKFALL_OT_add_video,
    ROCKFALL_OT_look_through,
    ROCKFALL_OT_remove_video,
    ROCKFALL_OT_relink_video,
    ROCKFALL_OT_step_frame,
    ROCKFALL_OT_time_origin_here,
    ROCKFALL_OT_mark_event,
    ROCKFALL_OT_synchronise_videos,
    ROCKFALL_OT_reference_video,
    ROCKFALL_OT_use_video_rate,
    ROCKFALL_OT_use_named_capture_rate,
    ROCKFALL_OT_use_video_size,
    ROCKFALL_OT_build_proxy,
    ROCKFALL_FH_video,
)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 4: follow the block through a video in the background, and propose impacts from its track."""

import queue
import threading

import bpy

from ....core.errors import RockfallError
from ....core.footage.tracking import BlockTrack, track_block
from ....core.progress import CancelledError
from ...scene import places, sightings, store, videos
from ...view.of_video import OfVideo
from ...view.reporting import reported
from . import tracks

POLL_S = 0.15


def _solved_name(context: bpy.types.Context) -> tuple[bpy.types.Object | None, str]:
    return videos.active_camera(context.scene), places.trajectory(context.scene)


class ROCKFALL_OT_track_block(OfVideo, bpy.types.Operator):
    """Follow the block through the video, from where it was clicked or picked; Esc stops"""

    bl_idname = "rockfall.track_block"
    bl_label = "Track Block"

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        try:
            work = self._prepare(context)
        except RockfallError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self._said: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._stop = threading.Event()
        self._found: list[BlockTrack | Exception] = []
        self._thread = threading.Thread(target=self._run, args=(work,), daemon=True)
        self._thread.start()
        self._timer = context.window_manager.event_timer_add(POLL_S, window=context.window)
        context.window_manager.modal_handler_add(self)
        context.workspace.status_text_set("Tracking the block …  Esc: stop")
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type == "ESC" and event.value == "PRESS":
            self._stop.set()
        elif event.type == "TIMER":
            text = ""
            while not self._said.empty():
                text = self._said.get()
            if text:
                context.workspace.status_text_set(f"{text}  |  Esc: stop")
            if not self._thread.is_alive():
                return self._end(context)
        return {"PASS_THROUGH"}

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        track = track_block(**self._prepare(context))
        return self._keep(context, track)

    def cancel(self, context: bpy.types.Context) -> None:
        self._stop.set()

    def _prepare(self, context: bpy.types.Context) -> dict[str, object]:
        scene = context.scene
        camera, self._name = _solved_name(context)
        self._camera = camera[store.ID]
        video = videos.video_of(camera)
        clicks, settings = tracks.clicks_for(scene, camera, self._name), scene.rockfall_picking
        first, last = 0, video.frames - 1
        if not settings.whole_video:
            shown = videos.true_frame(scene, camera)
            first, last = max(0, shown - settings.track_frames), min(last, shown + settings.track_frames)
            clicks = [click for click in clicks if first <= click[0] <= last]
            if not clicks:
                raise RockfallError("No click or pick is within these pictures. Go to one, or follow the whole video.")
        frame, u, v = clicks[0]
        return {"video": video, "frame": frame, "pixel": (u, v), "clicks": clicks[1:], "first": first, "last": last}

    def _run(self, work: dict[str, object]) -> None:
        def progress(text: str, done: int, total: int) -> None:
            if self._stop.is_set():
                raise CancelledError
            self._said.put(f"{text}: {done} of {total}" if total else text)

        try:
            self._found.append(track_block(**work, progress=progress))
        except Exception as error:  # noqa: BLE001 - it is told where the window can
            self._found.append(error)

    def _end(self, context: bpy.types.Context) -> set[str]:
        context.window_manager.event_timer_remove(self._timer)
        context.workspace.status_text_set(None)
        found = self._found[0] if self._found else CancelledError()
        if isinstance(found, CancelledError):
            self.report({"INFO"}, "Tracking was stopped; nothing has changed.")
            return {"CANCELLED"}
        if isinstance(found, Exception):
            self.report({"ERROR"}, str(found))
            return {"CANCELLED"}
        return self._keep(context, found)

    def _keep(self, context: bpy.types.Context, track: BlockTrack) -> set[str]:
        camera = videos.by_id(context.scene, self._camera)
        if camera is None:
            self.report({"ERROR"}, "The camera was deleted while its video was tracked.")
            return {"CANCELLED"}
        sightings.keep_track(camera, self._name, track)
        frames = f"{track.frame.size} pictures, {track.frame[0]} to {track.frame[-1]}"
        self.report({"INFO"}, f"{self._name} is followed through {frames}. After: {track.stopped[1]}.")
        return {"FINISHED"}


class _OfTrack:
    """Mix-in: works on the track of the tool's trajectory in the active video."""

    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        camera, name = _solved_name(context)
        if camera is not None and name in sightings.names_in(camera):
            return True
        cls.poll_message_set("Track the block first, or click it in flight")
        return False


class ROCKFALL_OT_propose_impacts(_OfTrack, bpy.types.Operator):
    """Make picks where the tracked block changes its velocity at once; those that are there stay"""

    bl_idname = "rockfall.propose_impacts"
    bl_label = "Propose Impacts"

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        camera, name = _solved_name(context)
        made = tracks.propose(context.scene, camera, name)
        passes = sum(thing[store.KIND] == "pass" for thing in made)
        count = f"{len(made) - passes} impacts are" if len(made) - passes != 1 else "One impact is"
        ends = f", and {passes} points in flight where the track begins or ends" if passes else ""
        self.report({"INFO"}, f"{count} proposed for {name}{ends}. Look at each, and move or remove it.")
        return {"FINISHED"} if made else {"CANCELLED"}


class ROCKFALL_OT_clear_track(_OfTrack, bpy.types.Operator):
    """Forget where the block of this trajectory was seen in this video"""

    bl_idname = "rockfall.clear_track"
    bl_label = "Clear Tracked Pixels"

    def execute(self, context: bpy.types.Context) -> set[str]:
        camera, name = _solved_name(context)
        count = sightings.clear(camera, name)
        self.report({"INFO"}, f"{count} pixels of {name} are forgotten.")
        return {"FINISHED"}


CLASSES = (ROCKFALL_OT_track_block, ROCKFALL_OT_propose_impacts, ROCKFALL_OT_clear_track)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 4: follow the block through a video in the background, and propose impacts from its track."""

import bpy

from ....core.errors import RockfallError
from ....core.progress import Progress
from ....core.workflow.tracking import FollowedBlock, follow_block
from ...scene.footage import alignment, camera_paths, clocks, sightings, video_files, videos
from ...scene.picks import places
from ...scene.picks.trajectories import flights_of
from ...scene.storage import store
from ...view import job, look
from ...view.of_video import has_video
from ...view.reporting import possible, reported
from . import tracks


def _solved_name(context: bpy.types.Context) -> tuple[bpy.types.Object | None, str]:
    return videos.active_camera(context.scene), places.trajectory(context.scene)


class ROCKFALL_OT_track_block(job.InBackground, bpy.types.Operator):
    """Follow the block through the video, from where it was clicked or picked; Esc stops"""

    bl_idname = "rockfall.track_block"
    bl_label = "Track Block"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_video(cls, context) and job.is_free(cls)

    def prepare(self, context: bpy.types.Context) -> job.Work:
        scene, settings = context.scene, context.scene.rockfall_picking
        camera, name = _solved_name(context)
        identifier, video = camera[store.ID], video_files.video_of(camera)
        clicks = tracks.clicks_for(scene, camera, name)
        first, last = 0, video.frames - 1
        if not settings.whole_video:
            shown = clocks.true_frame(scene, camera)
            first, last = max(0, shown - settings.track_frames), min(last, shown + settings.track_frames)
            clicks = [click for click in clicks if first <= click[0] <= last]
            if not clicks:
                raise RockfallError("No click or pick is within these pictures. Go to one, or follow the whole video.")

        def compute(progress: Progress) -> FollowedBlock:
            return follow_block(video, clicks, first, last, progress=progress)

        def keep(scene: bpy.types.Scene, found: FollowedBlock) -> str:
            track = found.track
            there = videos.by_id(scene, identifier)
            if there is None:
                raise RockfallError("The camera was deleted while its video was tracked: the track is not kept.")
            sightings.keep_track(there, name, track)
            if camera_paths.is_solved(there):
                alignment.keep_background(there, found.background)
            frames = f"{track.frame.size} pictures, {track.frame[0]} to {track.frame[-1]}"
            return f"{name} is followed through {frames}. After: {track.stopped[1]}. {found.said}".rstrip()

        return job.Work("picking", compute, keep)


class _OfTrack:
    """Mix-in: works on the track of the tool's trajectory in the active video."""

    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        camera, name = _solved_name(context)
        return possible(
            cls,
            camera is not None and name in sightings.names_in(camera),
            "Track the block first, or click it in flight",
        )


class ROCKFALL_OT_propose_impacts(_OfTrack, bpy.types.Operator):
    """Make picks where the tracked block changes its velocity at once; those that are there stay"""

    bl_idname = "rockfall.propose_impacts"
    bl_label = "Propose Impacts"

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        camera, name = _solved_name(context)
        new = not flights_of(context.scene, name)
        made = tracks.propose(context.scene, camera, name)
        if new:
            look.frame(context, flights_of(context.scene, name), beside=True)
        passes = sum(obj[store.KIND] == "pass" for obj in made)
        self.report({"INFO"}, said_of(name, len(made) - passes, passes))
        return {"FINISHED"} if made else {"CANCELLED"}


def said_of(name: str, impacts: int, passes: int) -> str:
    """What was proposed for a trajectory."""
    count = f"{impacts} impacts are" if impacts != 1 else "One impact is"
    points = f"{passes} points" if passes != 1 else "a point"
    ends = f", and {points} in flight where the track begins or ends" if passes else ""
    return f"{count} proposed for {name}{ends}. Look at each, and move or remove it."


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

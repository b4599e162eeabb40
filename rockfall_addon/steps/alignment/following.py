# SPDX-License-Identifier: GPL-3.0-or-later
"""A hand-held camera: the background is followed from the solved frame, which gives a pose to every frame.

What is needed is taken from the scene first, then computed without Blender (in a thread), then stored.
"""

import json
from collections import OrderedDict

import bpy

from ....core.camera.path import camera_at
from ....core.errors import RockfallError
from ....core.footage.background import background_motion
from ....core.footage.video import Video
from ....core.progress import Progress
from ....core.remarks import from_plain, to_plain
from ....core.workflow.alignment import SolvedFrames
from ....core.workflow.following import Background, FollowedCamera, follow_background
from ...scene.footage import alignment, camera_paths, pairs, video_files, videos
from ...scene.storage import store
from ...scene.terrain import terrain
from ...view import job
from . import solving

KEPT = 2
OTHER_FOCAL = 0.005
"""Share by which the focal length may change until the frames should be followed again."""

_backgrounds: OrderedDict[tuple[str, float], Background] = OrderedDict()


def work(scene: bpy.types.Scene, camera: bpy.types.Object) -> job.Work:
    """What there is to follow.

    Raises
    ------
    RockfallError : the camera is not solved, or does not move.
    """
    if not camera_paths.is_solved(camera):
        raise RockfallError("First solve the camera in one frame, from pairs.")
    if not alignment.moves(camera):
        raise RockfallError("This camera stands still. Choose Hand-held, if it does not.")
    video, surface = video_files.video_of(camera), terrain.surface_of_scene(scene)
    solution, path = alignment.solution_of(camera), camera_paths.camera_path(camera)
    times = pairs.times_of(camera, solution.keys).tolist()
    keys = {frame: camera_at(path, time) for frame, time in zip(solution.keys, times, strict=True)}
    solved = SolvedFrames(solution.reference, path.reference, keys)
    mode, identifier = camera.rockfall_alignment.motion.lower(), camera[store.ID]

    def compute(progress: Progress) -> FollowedCamera:
        background = _background(video, progress)
        return follow_background(video, solved, mode=mode, surface=surface, background=background, progress=progress)

    def keep(scene: bpy.types.Scene, found: FollowedCamera) -> str:
        there = videos.by_id(scene, identifier)
        if there is None:
            raise RockfallError("The camera was deleted while its video was followed: the result is not used.")
        return apply(scene, there, solved, found)

    return job.Work("alignment", compute, keep)


def _background(video: Video, progress: Progress) -> Background:
    """The motion of a video's background, which is remembered."""
    key = (str(video.path), video.path.stat().st_mtime)
    if key not in _backgrounds:
        _backgrounds[key] = background_motion(video, progress=progress)
        while len(_backgrounds) > KEPT:
            _backgrounds.popitem(last=False)
    return _backgrounds[key]


def apply(scene: bpy.types.Scene, camera: bpy.types.Object, solved: SolvedFrames, found: FollowedCamera) -> str:
    """Give the camera the poses that were found; returns a sentence about them."""
    frames = len(camera[store.VIDEO_TIMES])
    camera_paths.set_camera_path(
        scene,
        camera,
        found.path,
        rmse_px=camera.get(store.RMSE),
        pose_covariance=camera_paths.pose_covariance(camera),
        quality=camera_paths.quality_of(camera),
    )
    camera[store.FOLLOWED] = json.dumps(
        {
            "reference": solved.frame,
            "frames": frames,
            "focal": solved.camera.fx,
            "turn_deg": found.turn_deg,
            "features": found.features,
            "residual_px": None if found.is_still else found.residual_px,
            "sigma_px": found.sigma_px,
            "remarks": to_plain(found.remarks),
        }
    )
    solving.solve(scene, camera)  # the pairs may have changed meanwhile
    if found.is_still:
        return "The camera stands still: one pose serves all frames."
    return f"Followed through {frames} frames; the camera turns by up to {found.turn_deg:.1f}°."


def followed(camera: bpy.types.Object) -> dict | None:
    """What came out last: reference, frames, focal, turn_deg, features, residual_px, sigma_px, remarks."""
    known = store.read_json(camera, store.FOLLOWED, None)
    if known is None:
        return None
    return known | {"remarks": from_plain(known.get("remarks", known.get("advice", ())))}  # "advice" of version 0.1.0


def is_stale(camera: bpy.types.Object) -> bool:
    """Whether the focal length has changed so much that the frames should be followed again."""
    known = followed(camera)
    return known is not None and abs(alignment.focal_px(camera) / known["focal"] - 1) > OTHER_FOCAL

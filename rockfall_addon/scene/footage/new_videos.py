# SPDX-License-Identifier: GPL-3.0-or-later
"""A new video: its file is read, and a camera made for it."""

import uuid
from pathlib import Path

import bpy
from mathutils import Matrix

from ....core.camera.blender_lens import pose_to_blender
from ....core.camera.model import GUESSED_FOCAL, Camera
from ....core.footage.clock import Clock
from ....core.footage.video import Video
from ..storage import migration, store
from . import camera_paths, clocks, video_files, videos

FAR_M, NEAR_M = 20_000.0, 0.1


def add_video(
    scene: bpy.types.Scene, path: str | Path, *, matrix: Matrix | None = None, rate_hz: float | None = None
) -> bpy.types.Object:
    """Read a video's timestamps and make its camera; the first video gives the scene its frame rate and its range.

    Parameters
    ----------
    matrix : where the camera stands until it is aligned; at the origin, towards +y, without.
    rate_hz : of a sequence of pictures.

    Raises
    ------
    RockfallError : the file is no video that can be used. The scene is as it was.
    """
    video = video_files.opened(path, rate_hz)
    others = videos.cameras(scene)
    camera = add_camera(scene, video)
    if others:  # until they are synchronised, they begin together
        starts = [float(clocks.clock_of(other).to_common(float(other[store.VIDEO_TIMES][0]))) for other in others]
        clocks.set_clock(camera, Clock(min(starts), 0.0, float(video.time_s[0])))
    if matrix is not None:
        camera.matrix_world = matrix
    if not others:
        clocks.begin_with(scene, camera)
    return camera


def add_camera(scene: bpy.types.Scene, video: Video) -> bpy.types.Object:
    """The camera of a video that was opened, looking towards +y."""
    name = video.pictures[0].stem if video.pictures else video.path.stem
    data = bpy.data.cameras.new(name)
    data.clip_start, data.clip_end, data.passepartout_alpha = NEAR_M, FAR_M, 0.7
    data.show_background_images = True
    camera = bpy.data.objects.new(name, data)
    store.link(store.collection(scene, videos.COLLECTION), camera)
    camera[store.ROLE], camera[store.ID] = store.CAMERA_ROLE, uuid.uuid4().hex
    camera[store.CLOCK], camera[store.CAPTURE_RATE] = [0.0, 0.0, 0.0, 1.0], 0.0
    camera[store.SOLVED] = False
    video_files.write_video(camera, video)
    focal = GUESSED_FOCAL * video.width
    guess = Camera(video.width, video.height, focal, focal * video.pixel_aspect, video.width / 2, video.height / 2)
    camera_paths.write_lens(camera, guess)
    camera.matrix_world = Matrix(pose_to_blender(guess.position, guess.rotation).tolist())
    scene[store.SCHEMA] = migration.SCHEMA
    videos.remember(scene, [camera])
    return camera

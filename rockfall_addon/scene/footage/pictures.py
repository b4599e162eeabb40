# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture of a video, or the moment, that is shown: its time, the camera's pose, and the picks that are in it."""

from dataclasses import replace

import bpy
import numpy as np

from ....core.camera.model import Camera
from ....core.camera.path import CameraPath
from ....core.errors import RockfallError
from ..picks import picks
from ..storage import store
from . import camera_paths, clocks, timing, videos

SAME_PICTURE = 0.6
"""A pick that is nearer in time than this belongs to the picture [frames]."""


def picture_time(scene: bpy.types.Scene, camera: bpy.types.Object) -> tuple[int, float]:
    """Frame of the picture that is shown, and its true video time [s]."""
    frame = clocks.true_frame(scene, camera)
    return frame, float(videos.times_of(camera)[frame])


def common_time(camera: bpy.types.Object, video_s: float, v_px: float | None = None) -> float:
    """Common time of a picture [s]; of one of its rows where the shutter rolls."""
    late = 0.0
    if v_px is not None:
        late = (videos.row_time_of(camera) or 0.0) * (v_px - videos.size_of(camera)[1] / 2)
    return float(clocks.clock_of(camera).to_common(video_s)) + late


def frame_step_s(camera: bpy.types.Object) -> float:
    """Usual time between two pictures, on the common clock [s]."""
    times = videos.times_of(camera)
    return float(np.median(np.diff(times))) * clocks.clock_of(camera).speed if times.size > 1 else 0.04


def aligned_path(camera: bpy.types.Object) -> CameraPath:
    """The path of a video's camera.

    Raises
    ------
    RockfallError : its pose is not known.
    """
    if not camera_paths.is_solved(camera):
        raise RockfallError(
            f"The camera of {camera.name} is not aligned, so its pixels have no place on the terrain. Align it first, "
            "or pick on the terrain in a free view."
        )
    return camera_paths.camera_path(camera)


def posed(camera: bpy.types.Object, video_s: float) -> Camera:
    """The core's camera at the pose that it has at a video time.

    Raises
    ------
    RockfallError : its pose is not known.
    """
    path = aligned_path(camera)
    position, rotation = path.poses_at([video_s])
    return replace(path.reference, position=position[0], rotation=rotation[0])


def now(scene: bpy.types.Scene, name: str) -> float:
    """Common time that the scene shows, for a trajectory [s].

    A scene without videos plays trajectories one after the other, each with its own offset.
    """
    if videos.cameras(scene) or (scene.rockfall.playback == "REAL" and timing.origin_s(scene) is not None):
        return clocks.common_time(scene)
    shown = (scene.frame_current + scene.frame_subframe) / timing.frame_rate(scene)
    return shown + timing.kept_offsets(scene).get(name, 0.0)


def in_this_picture(
    scene: bpy.types.Scene, camera: bpy.types.Object | None, name: str | None = None
) -> list[bpy.types.Object]:
    """The picks that belong to the picture, or moment, that is shown: of one trajectory, or of all."""
    objects = picks.objects_of(scene, None if name is None else [name])
    if camera is not None:
        _, video_s = picture_time(scene, camera)
        moment, step = common_time(camera, video_s), frame_step_s(camera)
        times = dict.fromkeys(objects, moment)
    else:
        step = 1 / timing.frame_rate(scene)
        times = {obj: now(scene, obj[store.TRAJECTORY]) for obj in objects}
    return [obj for obj in objects if abs(obj[store.TIME] - times[obj]) <= SAME_PICTURE * step]


def of_this_picture(
    scene: bpy.types.Scene, camera: bpy.types.Object | None, name: str, time_s: float
) -> bpy.types.Object | None:
    """The pick that a trajectory has in the picture, or moment, that is shown: the one nearest to a common time."""
    near = in_this_picture(scene, camera, name)
    return min(near, key=lambda one: abs(one[store.TIME] - time_s), default=None)

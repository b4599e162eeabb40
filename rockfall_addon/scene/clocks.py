# SPDX-License-Identifier: GPL-3.0-or-later
"""The clocks of the videos and of the scene.

Times: *video* time is that of the file, *common* time the clock of the picks, and a scene's frame is common time from
the origin on, times the scene's rate.
"""

import json
from dataclasses import replace

import bpy
import numpy as np

from ...core.film.presets import blender_rate
from ...core.footage.advice import rate_advice
from ...core.footage.clock import Clock, clock_for
from ...core.footage.video import FRAME_AT_TOLERANCE_S
from ...core.vectors import Array
from . import store, timing, video_files, videos

SAME_RATE = 1e-5


def clock_of(camera: bpy.types.Object) -> Clock:
    """From the file's times to the common clock."""
    return Clock.of_numbers(camera[store.CLOCK])


def set_clock(camera: bpy.types.Object, clock: Clock) -> None:
    """Store a clock; the camera's keys follow by `follow_clock`, when the scene is drawn next."""
    camera[store.CLOCK] = clock.numbers


def set_capture_rate(camera: bpy.types.Object, capture_rate_hz: float | None) -> None:
    """Tell at which rate the pictures were taken; None or 0 for the rate of the file.

    The common time of the clock's origin stays.

    Raises
    ------
    RockfallError : the rate is not above 0, or the video has one frame.
    """
    old, video = clock_of(camera), video_files.stored_video(camera)
    clock = clock_for(video, capture_rate_hz or None, offset_s=old.offset_s, drift=old.drift, origin_s=old.origin_s)
    set_clock(camera, replace(clock, gaps=old.gaps))
    camera[store.CAPTURE_RATE] = float(capture_rate_hz or 0.0)
    known = videos.facts_of(camera) | {"advice": rate_advice(video, capture_rate_hz=capture_rate_hz or None)}
    camera[store.VIDEO_FACTS] = json.dumps(known)


def origin_of(scene: bpy.types.Scene) -> float:
    """Common time of scene frame 0 [s]; the first pick's where none was set, as the blocks are played."""
    origin = timing.origin_s(scene)
    if origin is not None:
        return origin
    return next(iter(timing.kept_offsets(scene).values()), 0.0) if scene.rockfall.playback == "REAL" else 0.0


def current_frame(scene: bpy.types.Scene) -> float:
    """The scene's frame, with its fraction."""
    return scene.frame_current + float(scene.frame_subframe)


def common_time(scene: bpy.types.Scene, frame: float | None = None) -> float:
    """Common time of a frame of the scene, the present one without [s]."""
    at = current_frame(scene) if frame is None else frame
    return origin_of(scene) + at / timing.frame_rate(scene)


def frame_at(scene: bpy.types.Scene, common_s: float) -> float:
    """The scene's frame, with its fraction, at a common time."""
    return (common_s - origin_of(scene)) * timing.frame_rate(scene)


def video_time(scene: bpy.types.Scene, camera: bpy.types.Object, frame: float | None = None) -> float:
    """Time of the video at a frame of the scene [s]; beyond the video's ends it runs on."""
    return clock_of(camera).to_video(common_time(scene, frame))


def true_frame(scene: bpy.types.Scene, camera: bpy.types.Object, frame: float | None = None) -> int:
    """Index of the picture on display at a frame of the scene: the last that is not later, 0 before the first."""
    times = videos.times_of(camera)
    return index_at(times, video_time(scene, camera, frame), tolerance_s(times))


def index_at(times: Array, time_s: float, tolerance: float) -> int:
    """The last of the timestamps (f,) that is not later than a time, 0 before the first."""
    return max(int(np.searchsorted(times, time_s + tolerance, side="right")) - 1, 0)


def tolerance_s(times: Array) -> float:
    """How far timestamps (f,) may be rounded: half a millisecond in Matroska [s]."""
    milliseconds = 1000 * (times - times[0])
    whole = np.abs(milliseconds - np.round(milliseconds)).max() < 1e-6
    return 0.51e-3 if whole else FRAME_AT_TOLERANCE_S


def scene_frame_of(scene: bpy.types.Scene, camera: bpy.types.Object, index: int) -> float:
    """The scene's frame, with its fraction, at the timestamp of a picture; whole where only rounding differs."""
    times, clock = videos.times_of(camera), clock_of(camera)
    frame = frame_at(scene, clock.to_common(float(times[int(np.clip(index, 0, times.size - 1))])))
    slack_frames = tolerance_s(times) * clock.speed * timing.frame_rate(scene)
    return float(round(frame)) if abs(frame - round(frame)) <= slack_frames else frame


def set_scene_rate(scene: bpy.types.Scene, rate_hz: float) -> None:
    """Give the scene a frame rate, exactly where it is a ratio like 30 000 / 1 001; our keys keep their times."""
    fps, base = scene_rate(rate_hz)
    if abs(timing.frame_rate(scene) - fps / base) > 1e-9:
        scene.render.fps, scene.render.fps_base = fps, base
        timing.follow_frame_rate(scene)


def scene_rate(rate_hz: float) -> tuple[int, float]:
    """`fps` and `fps_base` of a measured rate; near a whole number or a rate of television, it is that.

    The base of any other rate is near 1, so that another `fps`, typed by a person, is about what it says.
    """
    for usual in (float(round(rate_hz)), 1000 * round(1.001 * rate_hz) / 1001):
        if abs(usual / rate_hz - 1) < SAME_RATE:
            return blender_rate(usual)
    fps = max(1, round(rate_hz))
    return fps, fps / rate_hz


def begin_with(scene: bpy.types.Scene, camera: bpy.types.Object) -> None:
    """The first video: the scene plays at its rate, from its origin, as long as it lasts."""
    video = video_files.stored_video(camera)
    if np.isfinite(video.rate_hz):
        set_scene_rate(scene, video.rate_hz)
    if store.TIME_ORIGIN not in scene:
        scene[store.TIME_ORIGIN] = 0.0
    if scene.rockfall.playback != "REAL":
        scene.rockfall.playback = "REAL"
    scene.frame_start = int(np.floor(scene_frame_of(scene, camera, 0)))
    scene.frame_end = max(int(np.ceil(scene_frame_of(scene, camera, video.frames - 1))), scene.frame_start + 1)
    scene.frame_set(scene.frame_start)

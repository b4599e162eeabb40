# SPDX-License-Identifier: GPL-3.0-or-later
"""The files of the videos: stored with their cameras, shown behind them, opened once, found again when they moved."""

import json
from collections import OrderedDict
from pathlib import Path

import bpy
import numpy as np

from ....core.errors import RockfallError
from ....core.footage.advice import content_advice, proposed_capture_rate, rate_advice
from ....core.footage.sequences import is_there, sequence_beside
from ....core.footage.sources import repeats_at_a_glance
from ....core.footage.video import Image, Video, open_video, read_frame
from ..storage import store
from . import videos

KEPT_PICTURES = 6

_videos: dict[tuple[str, float, float | None], Video] = {}
_pictures: OrderedDict[tuple[str, float, int], Image] = OrderedDict()


def write_video(camera: bpy.types.Object, video: Video) -> None:
    """Store what is known of the file, and put its clip behind the camera."""
    camera[store.VIDEO_FILE] = str(video.path.resolve())
    camera[store.VIDEO_TIMES] = video.time_s.tolist()
    camera[store.VIDEO_SIZE] = [float(video.width), float(video.height)]
    facts = {
        "codec": video.codec,
        "container": video.container,
        "rotation_deg": video.rotation_deg,
        "header_rate_hz": video.header_rate_hz if np.isfinite(video.header_rate_hz) else 0.0,
        "header_frames": video.header_frames,
        "pixel_aspect": video.pixel_aspect,
        "rate_hz": video.rate_hz if np.isfinite(video.rate_hz) else 0.0,
        "named_capture_rate_hz": proposed_capture_rate(video.facts, video.rate_hz) or 0.0,
        "named_capture_rate_in": video.facts.capture_rate_name,
        "sequence_rate_hz": video.header_rate_hz if video.pictures else 0.0,
        "other_stream": video.facts.used != 0,
        "remarks": content_advice(video),
        "advice": rate_advice(video, capture_rate_hz=videos.capture_rate_of(camera)),
    }
    camera[store.VIDEO_FACTS] = json.dumps(facts)
    for old in list(camera.data.background_images):
        old.clip = old.image = None  # removing does not count down their users
        camera.data.background_images.remove(old)
    if not is_there(video.path):  # of a project whose video has moved
        return
    file = str(video.pictures[0].resolve()) if video.pictures else camera[store.VIDEO_FILE]
    clip = bpy.data.movieclips.load(file)
    clip.name = camera.name
    if bpy.data.filepath and bpy.context.preferences.filepaths.use_relative_paths:
        clip.filepath = _relative(file)
    background = camera.data.background_images.new()
    background.source, background.clip = "MOVIE_CLIP", clip
    background.frame_method = "STRETCH"  # fills the frame to the pixel; fitting could leave a seam
    background.alpha = 1.0


def note_repeats(camera: bpy.types.Object) -> None:
    """Add to what is said of a video that its pictures repeat, as a glance at it tells."""
    text = repeats_at_a_glance(video_of(camera))
    if text:
        facts = videos.facts_of(camera)
        camera[store.VIDEO_FACTS] = json.dumps(facts | {"remarks": [*facts.get("remarks", ()), text]})


def clip_of(camera: bpy.types.Object) -> bpy.types.MovieClip | None:
    """The footage behind a camera; None when someone removed it."""
    clips = (b.clip for b in camera.data.background_images if b.source == "MOVIE_CLIP")
    return next((clip for clip in clips if clip is not None), None)


def _relative(path: str) -> str:
    """A path from the .blend, which goes on where both are moved; as it is on another disk of Windows."""
    try:
        return bpy.path.relpath(path)
    except ValueError:
        return path


def file_of(camera: bpy.types.Object) -> Path:
    """The video's file, for all that reads or names it: that of the clip, which is what a person sees.

    Blender keeps its path, moves it with the .blend where it is relative, and finds it again. What was stored when the
    video was added holds where there is no clip, or where its file is not there.
    """
    stored = Path(bpy.path.abspath(str(camera.get(store.VIDEO_FILE, ""))))
    clip = clip_of(camera)
    if clip is not None and clip.source in ("MOVIE", "SEQUENCE"):
        shown = Path(bpy.path.abspath(clip.filepath, library=clip.library))
        if shown.is_file():
            return sequence_beside(shown.resolve()) if clip.source == "SEQUENCE" else shown.resolve()
    return stored


def sequence_rate_of(camera: bpy.types.Object) -> float | None:
    """Pictures per second of a sequence of pictures; None for a video file."""
    return float(videos.facts_of(camera).get("sequence_rate_hz", 0.0)) or None


def stored_video(camera: bpy.types.Object) -> Video:
    """What is known of the video without its file: no pictures can be read with it."""
    facts = videos.facts_of(camera)
    width, height = videos.size_of(camera)
    return Video(
        path=file_of(camera),
        width=width,
        height=height,
        rotation_deg=int(facts.get("rotation_deg", 0)),
        codec=str(facts.get("codec", "")),
        container=str(facts.get("container", "")),
        header_rate_hz=float(facts.get("header_rate_hz", 0.0)) or np.nan,
        header_frames=int(facts.get("header_frames", 0)),
        time_s=videos.times_of(camera),
        keyframe_s=np.empty(0),
        pixel_aspect=float(facts.get("pixel_aspect", 1.0)),
    )


def video_of(camera: bpy.types.Object) -> Video:
    """The video's file, opened; it is opened once.

    Raises
    ------
    RockfallError : the file has moved, is none any more, or one of another size.
    """
    path = file_of(camera)
    if not is_there(path):
        raise RockfallError(
            f"The video {path.name} is not at {path.parent} any more. Nothing is lost: use Find the File in the "
            "Videos panel."
        )
    video = opened(path, sequence_rate_of(camera))
    if (video.width, video.height) != videos.size_of(camera):
        (width, height), size = videos.size_of(camera), f"{video.width} × {video.height} px"
        raise RockfallError(
            f"The clip of {camera.name} shows {path.name}, which has {size}; what was marked is of {width} × {height} "
            "px. Use Find the File in the Videos panel, or add it as another video."
        )
    return video


def picture(camera: bpy.types.Object, index: int) -> Image:
    """The picture of a frame, (h, w, 3) RGB from the top row down; the last few are kept. Do not write into it.

    Raises
    ------
    RockfallError : the file has moved, or the frame cannot be decoded.
    """
    video = video_of(camera)
    file = video.pictures[index] if video.pictures else video.path
    key = (str(file), file.stat().st_mtime, int(index))
    if key not in _pictures:
        _pictures[key] = np.ascontiguousarray(read_frame(video, int(index))[:, :, ::-1])
        while len(_pictures) > KEPT_PICTURES:
            _pictures.popitem(last=False)
    _pictures.move_to_end(key)
    return _pictures[key]


def opened(path: str | Path, rate_hz: float | None = None) -> Video:
    """A video file, or a sequence of pictures of a rate, opened; it is opened once.

    Raises
    ------
    RockfallError : the file is no video that can be used.
    """
    path = Path(path)
    there = next((one for one in (path, path.parent) if one.exists()), None)
    key = (str(path), 0.0 if there is None else there.stat().st_mtime, rate_hz)
    if key not in _videos:
        _videos[key] = open_video(path, rate_hz=rate_hz)
    return _videos[key]


def forget_files() -> None:
    """Another .blend was opened: nothing of the old one is kept."""
    _videos.clear()
    _pictures.clear()

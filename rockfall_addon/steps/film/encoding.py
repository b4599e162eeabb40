# SPDX-License-Identifier: GPL-3.0-or-later
"""Writing films: Blender's FFmpeg, which knows codecs that the libraries of Python do not bring."""

from pathlib import Path

import bpy

from ....core.errors import RockfallError
from ....core.film.composed.kinds import CODECS
from ....core.film.job import FilmJob
from ....core.film.presets import blender_rate
from ....core.progress import Progress
from ...view.reporting import told


def use_movie(scene: bpy.types.Scene, path: Path, codec: str = "h264") -> None:
    """Output of the scene: an MP4."""
    render = scene.render
    render.filepath, render.use_file_extension = str(path), True
    render.image_settings.media_type = "VIDEO"
    render.ffmpeg.format, render.ffmpeg.codec, render.ffmpeg.audio_codec = "MPEG4", codec.upper(), "NONE"
    render.ffmpeg.constant_rate_factor, render.ffmpeg.ffmpeg_preset = "HIGH", "GOOD"
    render.ffmpeg.gopsize = 25


def encode(job: FilmJob, progress: Progress) -> None:
    """Write the frames of a folder as a film, colours unchanged.

    Raises
    ------
    RockfallError : this Blender does not write the codec, or could not write the film.
    """
    assert job.frames is not None
    first, last = job.frames
    scene = bpy.data.scenes.new("Rockfall frames")
    try:
        _strip(scene, job, first, last)
        try:
            use_movie(scene, job.out, job.codec)
        except TypeError as error:
            raise RockfallError(_lacking(job.codec)) from error
        written = 0

        def count(*_: object) -> None:
            nonlocal written
            written += 1
            progress("Writing the film", written, last - first + 1)

        bpy.app.handlers.render_write.append(count)
        try:
            bpy.ops.render.render(animation=True, scene=scene.name)
        except RuntimeError as error:
            reason = (
                _lacking(job.codec, str(error)) if not written else f"Blender could not write the film: {told(error)}."
            )
            raise RockfallError(reason) from error
        finally:
            bpy.app.handlers.render_write.remove(count)
        if written != last - first + 1:
            raise RockfallError(f"Blender wrote {written} of {last - first + 1} frames of the film.")
        if job.codec == "av1":
            _read_again(job, last - first + 1)
    finally:
        bpy.data.scenes.remove(scene)


def _strip(scene: bpy.types.Scene, job: FilmJob, first: int, last: int) -> None:
    render = scene.render
    render.resolution_x, render.resolution_y = job.size
    render.resolution_percentage = 100
    render.fps, render.fps_base = blender_rate(job.fps)
    scene.frame_start, scene.frame_end = 1, last - first + 1
    # What is in the pictures is what is seen: nothing is to be made prettier.
    scene.view_settings.view_transform, scene.view_settings.look = "Standard", "None"
    scene.sequencer_colorspace_settings.name = "sRGB"
    render.use_sequencer = True
    editor = scene.sequence_editor_create()
    strip = editor.strips.new_image("frames", str(job.source / f"{first:06d}.png"), 1, 1)
    for frame in range(first + 1, last + 1):
        strip.elements.append(f"{frame:06d}.png")
    strip.duration = last - first + 1


def _read_again(job: FilmJob, frames: int) -> None:
    """Decode the last frame of a film that OpenCV cannot decode."""
    try:
        image = bpy.data.images.load(str(job.out))
    except RuntimeError as error:
        raise RockfallError(_lacking(job.codec)) from error
    whole = image.source == "MOVIE" and image.frame_duration == frames and tuple(image.size) == job.size
    bpy.data.images.remove(image)
    if not whole:
        raise RockfallError(_lacking(job.codec))


def _lacking(codec: str, reason: str = "") -> str:
    said = f" ({reason.removeprefix('Error: ').strip().rstrip('.')})" if reason else ""
    return (
        f"This Blender cannot write {CODECS[codec]} here{said}. Choose another codec with --codec: "
        "h264 is written by all, --images keeps the frames as pictures."
    )

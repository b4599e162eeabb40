# SPDX-License-Identifier: GPL-3.0-or-later
"""The footage behind the cameras: the true picture at each frame of the scene, and the render size of the camera.

A clip of Blender shows, at its position n (from 0), the last picture that is not later than n / its rate, a rate that
the file's header tells. So the position is looked up by the true timestamps, and given to the clip as its offset.
Where two pictures lie between two positions, as in the footage of phones, no position shows the first of them:
such a picture is read from the file and shown as an image in front of the clip.
"""

import struct
import uuid
from pathlib import Path

import bpy
import numpy as np

from ....core.errors import RockfallError
from ....core.footage.sequences import sequence_beside
from ....core.footage.video import Image
from ....core.vectors import Array
from ..storage import migration, store
from . import camera_paths, clocks, video_files, videos


def follow(scene: bpy.types.Scene) -> None:
    """Bring cameras and footage in line with the scene: what handlers call. Changes only what has to change."""
    if migration.is_left_alone(scene) or bpy.app.is_job_running("RENDER"):
        return
    objects = videos.cameras(scene)
    if not objects:
        return
    _heal(objects)
    videos.remember(scene, objects)
    use_size_of_active(scene)
    for camera in objects:
        camera_paths.follow_clock(scene, camera)
    show_pictures(scene, objects)


def use_size_of_active(scene: bpy.types.Scene, *, again: bool = False) -> None:
    """When a video's camera becomes the scene's: render at the size of the video, so that footage and terrain fit.

    again : also when the camera is the same as before.
    """
    camera = scene.camera
    identifier = camera[store.ID] if camera is not None and videos.is_video(camera) else ""
    if camera is None or (scene.get(store.ACTIVE_CAMERA, "") == identifier and not again):
        return
    scene[store.ACTIVE_CAMERA] = identifier
    if identifier:
        render = scene.render
        render.resolution_x, render.resolution_y = videos.size_of(camera)
        render.pixel_aspect_x, render.pixel_aspect_y = camera.get(store.ASPECT, (1.0, 1.0))


def show_pictures(scene: bpy.types.Scene, cameras: list[bpy.types.Object]) -> None:
    """Each camera shows the picture of the scene's frame."""
    for camera in cameras:
        clip = video_files.clip_of(camera)
        if clip is None:
            continue
        times = videos.times_of(camera)
        slack = clocks.tolerance_s(times)
        index = clocks.index_at(times, clocks.video_time(scene, camera), slack)
        position, exact = clip_position(times, index, *_counting(camera, clip, times), slack)
        exact = exact and shows_pictures(camera, clip)
        offset = position - int(clocks.current_frame(scene)) + clip.frame_start
        if clip.frame_offset != offset:
            clip.frame_offset = offset
        _show_still(scene, camera, None if exact or scene.camera != camera else index)


def clip_position(times: Array, index: int, rate_hz: float, length: int, slack: float) -> tuple[int, bool]:
    """Position (from 0) of a clip at which it shows a picture, and whether it does; otherwise the nearest.

    Parameters
    ----------
    times : (f,) timestamps [s].
    rate_hz, length : of the clip, which counts evenly.
    slack : rounding of the timestamps [s].
    """
    if not rate_hz > 0:
        return index, True
    last = max(length - 1, 0)
    position = int(np.ceil((times[index] - slack) * rate_hz - 1e-9))
    following = times[index + 1] if index + 1 < times.size else np.inf
    exact = 0 <= position <= last and position / rate_hz < following - slack
    return int(np.clip(position, 0, last)), bool(exact)


def hidden(camera: bpy.types.Object) -> int:
    """How many of the pictures no position of the clip shows."""
    clip = video_files.clip_of(camera)
    if clip is None or not clip.fps > 0:
        return 0
    times = videos.times_of(camera)
    if not shows_pictures(camera, clip):
        return times.size
    slack = clocks.tolerance_s(times)
    position = np.ceil((times - slack) * clip.fps - 1e-9)
    seen = (position / clip.fps < np.append(times[1:], np.inf) - slack) & (position < clip.frame_duration)
    return int((~seen).sum())


def shows_pictures(camera: bpy.types.Object, clip: bpy.types.MovieClip) -> bool:
    """Whether Blender's clip shows the pictures that are used: it knows the first stream of a file alone."""
    return not videos.facts_of(camera).get("other_stream", False)


def _counting(camera: bpy.types.Object, clip: bpy.types.MovieClip, times: Array) -> tuple[float, int]:
    """Rate [Hz] and length by which a clip counts: the numbers of files in a sequence, of which some may be missing."""
    rate = video_files.sequence_rate_of(camera)
    if rate is None:
        return clip.fps, clip.frame_duration
    return rate, round(float(times[-1] - times[0]) * rate) + 1


def remove(scene: bpy.types.Scene, camera: bpy.types.Object) -> None:
    """Remove a video: its camera, its clip when nothing else uses it, and what is remembered of it."""
    identifier, data = camera[store.ID], camera.data
    camera_paths.unsolve(camera)
    bpy.data.objects.remove(camera)
    store.look_again()
    if not data.users:
        _remove_data(data)
    forget(scene, identifier)


def forget(scene: bpy.types.Scene, identifier: str) -> None:
    """A camera that is gone is not missed any more; clips and camera data that nothing uses go too."""
    videos.forget_id(scene, identifier)
    for data in [data for data in bpy.data.cameras if not data.users and any(b.clip for b in data.background_images)]:
        _remove_data(data)


def relink(camera: bpy.types.Object, path: str | Path) -> list[str]:
    """Take the video from another place; all that was marked in it stays.

    Returns sentences about what is not as it was.

    Raises
    ------
    RockfallError : the file is no video, or one of another size: its pixels would be others.
    """
    old, (width, height) = videos.times_of(camera), videos.size_of(camera)
    rate = video_files.sequence_rate_of(camera)
    video = video_files.opened(path if rate is None else sequence_beside(Path(path)), rate)
    if (video.width, video.height) != (width, height):
        raise RockfallError(
            f"{video.path.name} has {video.width} × {video.height} px, the video of {camera.name} has {width} × "
            f"{height} px: it is another one, or a converted copy. Choose the original, or add it as another video."
        )
    said = []
    if video.frames != old.size:
        said.append(
            f"{video.path.name} has {video.frames} frames, the video of {camera.name} had {old.size}: it may be "
            "another one. Look at a frame that you know."
        )
    else:
        apart = float(np.abs(video.time_s - old).max())
        if apart > 1e-3:
            said.append(
                f"The timestamps differ by up to {apart:.3f} s from those that were stored: this is a converted copy "
                "or another video. What was marked keeps its times; look at a frame that you know."
            )
    view = [(b.alpha, b.display_depth) for b in camera.data.background_images][:1]
    clip = video_files.clip_of(camera)
    video_files.write_video(camera, video)
    if clip is not None and not clip.users:
        bpy.data.movieclips.remove(clip)
    for alpha, depth in view:
        camera.data.background_images[0].alpha, camera.data.background_images[0].display_depth = alpha, depth
    return said


def _show_still(scene: bpy.types.Scene, camera: bpy.types.Object, index: int | None) -> None:
    """Show a picture in front of the clip, or, for None, the clip."""
    clip, still = (_background(camera, source) for source in ("MOVIE_CLIP", "IMAGE"))
    screen = bpy.context.screen
    playing = screen is not None and screen.is_animation_playing
    if index is not None and (not playing or not shows_pictures(camera, video_files.clip_of(camera))):
        try:
            still = still or camera.data.background_images.new()
            still.source, still.frame_method = "IMAGE", "STRETCH"
            still.image = _still(camera, index, still.image)
            still.alpha, still.display_depth = clip.alpha, clip.display_depth
        except (RockfallError, OSError):  # the panel tells of files that have moved
            index = None
    else:
        index = None
    if still is not None and still.show_background_image != (index is not None):
        still.show_background_image = index is not None
    if clip.show_background_image != (index is None):
        clip.show_background_image = index is None


def _background(camera: bpy.types.Object, source: str) -> bpy.types.CameraBackgroundImage | None:
    return next(
        (b for b in camera.data.background_images if b.source == source and (b.clip or source == "IMAGE")), None
    )


def _still(camera: bpy.types.Object, index: int, image: bpy.types.Image | None) -> bpy.types.Image:
    """A Blender image of a picture, by way of a file: pixels set from Python would have to be saved by the user."""
    if image is not None and image.get(store.STILL) == index and Path(image.filepath).is_file():
        return image
    path = Path(bpy.app.tempdir) / f"rockfall_{camera[store.ID]}.bmp"
    path.write_bytes(bitmap(video_files.picture(camera, index)))
    if image is None:
        image = bpy.data.images.load(str(path))
        image.name = f"{camera.name} still"
    elif image.filepath != str(path):
        image.filepath = str(path)
    image.reload()
    image[store.STILL] = index
    return image


def bitmap(picture: Image) -> bytes:
    """A picture (h, w, 3) RGB as a BMP file, which takes no time to write or read."""
    height, width = picture.shape[:2]
    rows = np.zeros((height, (3 * width + 3) // 4 * 4), np.uint8)
    rows[:, : 3 * width] = picture[::-1, :, ::-1].reshape(height, -1)
    header = struct.pack("<2sIHHI", b"BM", 54 + rows.size, 0, 0, 54)
    return (
        header + struct.pack("<IiiHHIIiiII", 40, width, height, 1, 24, 0, rows.size, 2835, 2835, 0, 0) + rows.tobytes()
    )


def _heal(objects: list[bpy.types.Object]) -> None:
    """A copy of a camera becomes a camera of its own: an id, a lens and footage of its own."""
    seen: set[str] = set()
    for obj in sorted(objects, key=lambda one: one.session_uid):
        if obj.get(store.ID) and obj[store.ID] not in seen:
            seen.add(obj[store.ID])
            continue
        obj[store.ID] = uuid.uuid4().hex
        seen.add(obj[store.ID])
        if obj.data.users > 1:
            obj.data = obj.data.copy()
        for background in obj.data.background_images:
            if background.clip is not None and background.clip.users > 1:
                background.clip = background.clip.copy()
        still = _background(obj, "IMAGE")
        if still is not None:
            still.image = None
            obj.data.background_images.remove(still)
        if obj.animation_data is not None and obj.animation_data.action is not None:
            obj.animation_data.action = obj.animation_data.action.copy()


def _remove_data(data: bpy.types.Camera) -> None:
    clips = {b.clip for b in data.background_images if b.clip is not None}
    images = {b.image for b in data.background_images if b.image is not None and store.STILL in b.image}
    bpy.data.cameras.remove(data)
    for clip in clips:
        if not clip.users:
            bpy.data.movieclips.remove(clip)
    for image in images:
        if not image.users:
            bpy.data.images.remove(image)

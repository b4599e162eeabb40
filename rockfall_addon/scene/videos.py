# SPDX-License-Identifier: GPL-3.0-or-later
"""Videos: each is a camera with its footage behind it. The file's own timestamps are stored with the camera.

Times: *video* time is that of the file, *common* time the clock of the picks, and a scene's frame is common time from
the origin on, times the scene's rate.
"""

import json
import uuid
from collections import OrderedDict
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from ...core.camera.blender_lens import BlenderLens, from_blender_lens, pose_to_blender, to_blender_lens
from ...core.camera.model import GUESSED_FOCAL, INTRINSICS, Camera
from ...core.camera.path import CameraPath, fixed
from ...core.errors import RockfallError
from ...core.film.presets import blender_rate
from ...core.footage.advice import content_advice, rate_advice
from ...core.footage.clock import Clock, clock_for
from ...core.footage.video import FRAME_AT_TOLERANCE_S, Image, Video, open_video, read_frame
from ...core.vectors import Array
from . import camera_keys, georeference, migration, store, timing

COLLECTION = "Cameras"
SAME_RATE = 1e-5
FAR_M, NEAR_M = 20_000.0, 0.1
KEPT_PICTURES = 6

_videos: dict[tuple[str, float], Video] = {}
_pictures: OrderedDict[tuple[str, float, int], Image] = OrderedDict()


def cameras(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """The cameras of the scene's videos, by name."""
    return [thing for thing in store.with_role(scene, store.CAMERA_ROLE) if is_video(thing)]


def is_video(thing: bpy.types.Object | None) -> bool:
    """Whether an object is the camera of a video."""
    return (
        thing is not None
        and thing.type == "CAMERA"
        and thing.get(store.ROLE) == store.CAMERA_ROLE
        and store.VIDEO_TIMES in thing
    )


def active_camera(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """The scene's camera if it belongs to a video, else that of the first video; None without videos."""
    if is_video(scene.camera):
        return scene.camera
    return next(iter(cameras(scene)), None)


def by_id(scene: bpy.types.Scene, identifier: str) -> bpy.types.Object | None:
    """The camera of an id."""
    return next((thing for thing in cameras(scene) if thing.get(store.ID) == identifier), None)


def add_video(scene: bpy.types.Scene, path: str | Path, *, matrix: Matrix | None = None) -> bpy.types.Object:
    """Read a video's timestamps and make its camera; the first video gives the scene its frame rate and its range.

    Parameters
    ----------
    matrix : where the camera stands until it is aligned; at the origin, towards +y, without.

    Raises
    ------
    RockfallError : the file is no video that can be used. The scene is as it was.
    """
    video = opened(path)
    others = cameras(scene)
    camera = add_camera(scene, video)
    if others:  # until they are synchronised, they begin together
        starts = [float(clock_of(other).to_common(float(other[store.VIDEO_TIMES][0]))) for other in others]
        set_clock(camera, Clock(min(starts), 0.0, float(video.time_s[0])))
    if matrix is not None:
        camera.matrix_world = matrix
    if not others:
        begin_with(scene, camera)
    return camera


def add_camera(scene: bpy.types.Scene, video: Video) -> bpy.types.Object:
    """The camera of a video that was opened, looking towards +y."""
    name = video.path.stem
    data = bpy.data.cameras.new(name)
    data.clip_start, data.clip_end, data.passepartout_alpha = NEAR_M, FAR_M, 0.7
    data.show_background_images = True
    camera = bpy.data.objects.new(name, data)
    store.collection(scene, COLLECTION).objects.link(camera)
    camera[store.ROLE], camera[store.ID] = store.CAMERA_ROLE, uuid.uuid4().hex
    camera[store.CLOCK], camera[store.CAPTURE_RATE], camera[store.ROW_TIME] = [0.0, 0.0, 0.0, 1.0], 0.0, 0.0
    camera[store.SOLVED] = False
    write_video(camera, video)
    focal = GUESSED_FOCAL * video.width
    guess = Camera(video.width, video.height, focal, focal * video.pixel_aspect, video.width / 2, video.height / 2)
    write_lens(camera, guess)
    camera.matrix_world = Matrix(pose_to_blender(guess.position, guess.rotation).tolist())
    scene[store.SCHEMA] = migration.SCHEMA
    remember(scene, [camera])
    return camera


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
        "remarks": content_advice(video),
        "advice": rate_advice(video, capture_rate_hz=capture_rate_of(camera)),
    }
    camera[store.VIDEO_FACTS] = json.dumps(facts)
    for old in list(camera.data.background_images):
        old.clip = old.image = None  # removing does not count down their users
        camera.data.background_images.remove(old)
    if not video.path.is_file():  # of a project whose video has moved
        return
    clip = bpy.data.movieclips.load(camera[store.VIDEO_FILE])
    clip.name = camera.name
    background = camera.data.background_images.new()
    background.source, background.clip = "MOVIE_CLIP", clip
    background.frame_method = "STRETCH"  # fills the frame to the pixel; fitting could leave a seam
    background.alpha = 1.0


def clip_of(camera: bpy.types.Object) -> bpy.types.MovieClip | None:
    """The footage behind a camera; None when someone removed it."""
    clips = (b.clip for b in camera.data.background_images if b.source == "MOVIE_CLIP")
    return next((clip for clip in clips if clip is not None), None)


def summary(camera: bpy.types.Object) -> str:
    """One sentence about a video that was added."""
    (width, height), known = size_of(camera), facts_of(camera)
    rate = f" at {known['rate_hz']:.4g} a second" if known.get("rate_hz") else ""
    return f"{camera.name}: {width} × {height} px, {len(camera[store.VIDEO_TIMES])} frames{rate}."


def facts_of(camera: bpy.types.Object) -> dict:
    """What the file says about itself: codec, container, rotation_deg, header_rate_hz, rate_hz, remarks …"""
    return json.loads(camera.get(store.VIDEO_FACTS, "{}"))


def file_of(camera: bpy.types.Object) -> Path:
    """The video file, which may have moved; where Blender was told of another place, that."""
    stored = Path(bpy.path.abspath(str(camera.get(store.VIDEO_FILE, ""))))
    clip = clip_of(camera)
    if not stored.is_file() and clip is not None:
        elsewhere = Path(bpy.path.abspath(clip.filepath))
        if elsewhere.is_file():
            return elsewhere
    return stored


def size_of(camera: bpy.types.Object) -> tuple[int, int]:
    """Width and height of the pictures [px]."""
    width, height = camera[store.VIDEO_SIZE]
    return round(width), round(height)


def times_of(camera: bpy.types.Object) -> Array:
    """(f,) timestamps of the frames, video time [s]."""
    return np.array(camera[store.VIDEO_TIMES], dtype=np.float64)


def stored_step_s(camera: bpy.types.Object) -> float:
    """Usual time between two pictures, video time [s]; 0 for a single one."""
    rate = float(facts_of(camera).get("rate_hz", 0.0))
    return 1 / rate if rate > 0 else 0.0


def stored_video(camera: bpy.types.Object) -> Video:
    """What is known of the video without its file: no pictures can be read with it."""
    facts = facts_of(camera)
    width, height = size_of(camera)
    return Video(
        path=file_of(camera),
        width=width,
        height=height,
        rotation_deg=int(facts.get("rotation_deg", 0)),
        codec=str(facts.get("codec", "")),
        container=str(facts.get("container", "")),
        header_rate_hz=float(facts.get("header_rate_hz", 0.0)) or np.nan,
        header_frames=int(facts.get("header_frames", 0)),
        time_s=times_of(camera),
        keyframe_s=np.empty(0),
        pixel_aspect=float(facts.get("pixel_aspect", 1.0)),
    )


def video_of(camera: bpy.types.Object) -> Video:
    """The video's file, opened; it is opened once.

    Raises
    ------
    RockfallError : the file has moved, or is none any more.
    """
    path = file_of(camera)
    if not path.is_file():
        raise RockfallError(
            f"The video {path.name} is not at {path.parent} any more. Nothing is lost: use Find the File in the "
            "Videos panel."
        )
    return opened(path)


def picture(camera: bpy.types.Object, index: int) -> Image:
    """The picture of a frame, (h, w, 3) RGB from the top row down; the last few are kept. Do not write into it.

    Raises
    ------
    RockfallError : the file has moved, or the frame cannot be decoded.
    """
    video = video_of(camera)
    key = (str(video.path), video.path.stat().st_mtime, int(index))
    if key not in _pictures:
        _pictures[key] = np.ascontiguousarray(read_frame(video, int(index))[:, :, ::-1])
        while len(_pictures) > KEPT_PICTURES:
            _pictures.popitem(last=False)
    _pictures.move_to_end(key)
    return _pictures[key]


def opened(path: str | Path) -> Video:
    """A video file, opened; it is opened once.

    Raises
    ------
    RockfallError : the file is no video that can be used.
    """
    path = Path(path)
    key = (str(path), path.stat().st_mtime if path.is_file() else 0.0)
    if key not in _videos:
        _videos[key] = open_video(path)
    return _videos[key]


def forget_files() -> None:
    """Another .blend was opened: nothing of the old one is kept."""
    _videos.clear()
    _pictures.clear()


def clock_of(camera: bpy.types.Object) -> Clock:
    """From the file's times to the common clock."""
    return Clock(*(float(value) for value in camera[store.CLOCK]))


def set_clock(camera: bpy.types.Object, clock: Clock) -> None:
    """Store a clock; the camera's keys follow by `follow_clock`, when the scene is drawn next."""
    camera[store.CLOCK] = [clock.offset_s, clock.drift, clock.origin_s, clock.rate]


def set_capture_rate(camera: bpy.types.Object, capture_rate_hz: float | None) -> None:
    """Tell at which rate the pictures were taken; None or 0 for the rate of the file.

    The common time of the clock's origin stays.

    Raises
    ------
    RockfallError : the rate is not above 0, or the video has one frame.
    """
    old, video = clock_of(camera), stored_video(camera)
    clock = clock_for(video, capture_rate_hz or None, offset_s=old.offset_s, drift=old.drift, origin_s=old.origin_s)
    set_clock(camera, clock)
    camera[store.CAPTURE_RATE] = float(capture_rate_hz or 0.0)
    known = facts_of(camera) | {"advice": rate_advice(video, capture_rate_hz=capture_rate_hz or None)}
    camera[store.VIDEO_FACTS] = json.dumps(known)


def capture_rate_of(camera: bpy.types.Object) -> float | None:
    """Pictures per second when filming; None when it is the rate of the file."""
    return float(camera.get(store.CAPTURE_RATE, 0.0)) or None


def row_time_of(camera: bpy.types.Object) -> float:
    """Readout time of one row of the image [s], 0 for a global shutter."""
    return float(camera.get(store.ROW_TIME, 0.0))


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
    times = times_of(camera)
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
    times, clock = times_of(camera), clock_of(camera)
    frame = frame_at(scene, clock.to_common(float(times[int(np.clip(index, 0, times.size - 1))])))
    slack_frames = tolerance_s(times) * clock.speed * timing.frame_rate(scene)
    return float(round(frame)) if abs(frame - round(frame)) <= slack_frames else frame


def is_solved(camera: bpy.types.Object) -> bool:
    """Whether the camera's place is known from alignment, and not only where someone put it."""
    return bool(camera.get(store.SOLVED, False))


def camera_path(camera: bpy.types.Object) -> CameraPath:
    """The camera, local to the scene's shift: the solved one, in doubles; before that, Blender's as it stands."""
    width, height = size_of(camera)
    scene = next(iter(camera.users_scene), bpy.context.scene)
    shift = georeference.read_shift(scene)
    if not is_solved(camera) or store.CAMERA not in camera:
        aspect = float(facts_of(camera).get("pixel_aspect", 1.0))
        lens = lens_of(camera, aspect)
        return fixed(from_blender_lens(lens, width, height, matrix=np.array(camera.matrix_world), shift=shift))
    poses = np.array(camera[store.POSES], dtype=np.float64).reshape(-1, 12)
    position, rotation = poses[:, :3], poses[:, 3:].reshape(-1, 3, 3)
    sigma = np.array(camera.get(store.POSE_SIGMA, np.zeros(2 * len(poses))), dtype=np.float64).reshape(-1, 2)
    reference = np.array(camera[store.REFERENCE_POSE], dtype=np.float64)
    position = position + np.array(camera.get(store.CAMERA_SHIFT, shift.vector)) - shift.vector
    numbers = dict(zip(INTRINSICS, (float(value) for value in camera[store.CAMERA]), strict=True))
    one = Camera(
        width=width,
        height=height,
        position=reference[:3] + np.array(camera.get(store.CAMERA_SHIFT, shift.vector)) - shift.vector,
        rotation=reference[3:].reshape(3, 3),
        shift=shift,
        **numbers,
    )
    times = np.array(camera[store.POSE_TIMES], dtype=np.float64)
    return CameraPath(one, times, position, rotation, sigma[:, 0].copy(), sigma[:, 1].copy())


def set_camera_path(
    scene: bpy.types.Scene,
    camera: bpy.types.Object,
    path: CameraPath,
    *,
    rmse_px: float | None = None,
    pose_covariance: Array | None = None,
) -> None:
    """Store a solved camera, exactly, and show it: lens, place, and keys when it moves.

    Parameters
    ----------
    path : its pictures have the size of the video's.
    pose_covariance : (6, 6) of rotation [rad] and position [m], of the whole path.

    Raises
    ------
    RockfallError : the size is another one.
    """
    if path.reference.size != size_of(camera):
        (width, height), (w, h) = path.reference.size, size_of(camera)
        raise RockfallError(
            f"This camera is of {width} × {height} px pictures, the video {camera.name} has {w} × {h} px. "
            "Solve the camera with this video."
        )
    shift, own = georeference.read_shift(scene), path.reference.shift
    one = path.reference.in_shift(shift)
    position = path.position + own.vector - shift.vector
    f = path.time_s.size
    camera[store.CAMERA] = one.intrinsics.tolist()
    camera[store.REFERENCE_POSE] = [*one.position.tolist(), *one.rotation.ravel().tolist()]
    camera[store.POSE_TIMES] = path.time_s.tolist()
    camera[store.POSES] = np.column_stack([position, path.rotation.reshape(f, 9)]).ravel().tolist()
    camera[store.POSE_SIGMA] = np.column_stack([path.sigma_position_m, path.sigma_rotation]).ravel().tolist()
    camera[store.CAMERA_SHIFT] = shift.vector.tolist()
    for key, value in ((store.RMSE, rmse_px), (store.POSE_COVARIANCE, pose_covariance)):
        if value is not None:
            camera[key] = float(value) if key == store.RMSE else np.asarray(value, np.float64).ravel().tolist()
        elif key in camera:
            del camera[key]
    camera[store.SOLVED] = True
    write_lens(camera, one)
    write_keys(scene, camera)


def unsolve(camera: bpy.types.Object) -> None:
    """The camera stands where it is shown, free to be moved; what was solved is forgotten."""
    camera[store.SOLVED] = False
    place = camera.matrix_world.copy()
    camera_keys.clear_keys(camera)
    camera.matrix_world = place
    _lock(camera, False)


def pose_covariance(camera: bpy.types.Object) -> Array | None:
    """(6, 6) of the solved pose; None when unknown."""
    return np.array(camera[store.POSE_COVARIANCE]).reshape(6, 6) if store.POSE_COVARIANCE in camera else None


def write_keys(scene: bpy.types.Scene, camera: bpy.types.Object) -> None:
    """Put a solved camera where it is, with a key at each frame when it moves."""
    path = camera_path(camera)
    common = clock_of(camera).to_common(path.time_s)
    frames = (common - origin_of(scene)) * timing.frame_rate(scene)
    camera_keys.write(camera, frames, pose_to_blender(path.position, path.rotation))
    camera[store.CAMERA_KEYED] = _keyed_with(scene, camera)
    _lock(camera, True)


def follow_clock(scene: bpy.types.Scene, camera: bpy.types.Object) -> bool:
    """Move the keys of a moving camera to where its clock, the origin and the rate say; True when they had to move."""
    if not is_solved(camera) or len(camera[store.POSE_TIMES]) < 2:
        return False
    if list(camera.get(store.CAMERA_KEYED, ())) == _keyed_with(scene, camera):
        return False
    write_keys(scene, camera)
    return True


def write_lens(camera: bpy.types.Object, one: Camera) -> None:
    """Give Blender's camera the lens of ours; Blender has no distortion."""
    lens, data = to_blender_lens(one), camera.data
    data.type, data.sensor_fit, data.lens_unit = "PERSP", lens.sensor_fit, "MILLIMETERS"
    data.sensor_width, data.sensor_height, data.lens = lens.sensor_width_mm, lens.sensor_height_mm, lens.lens_mm
    data.shift_x, data.shift_y = lens.shift_x, lens.shift_y
    camera[store.ASPECT] = [lens.aspect_x, lens.aspect_y]


def lens_of(camera: bpy.types.Object, pixel_aspect: float = 1.0) -> BlenderLens:
    """The lens as Blender's camera has it."""
    data = camera.data
    x, y = camera.get(store.ASPECT, (max(1.0, pixel_aspect), max(1.0, 1 / pixel_aspect)))
    return BlenderLens(
        data.lens, data.sensor_width, data.sensor_height, data.sensor_fit, data.shift_x, data.shift_y, x, y
    )


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


def remember(scene: bpy.types.Scene, things: list[bpy.types.Object]) -> None:
    """Remember which cameras there are, beside those that are gone."""
    known = json.loads(scene.get(store.KNOWN_VIDEOS, "{}"))
    known |= {thing[store.ID]: Path(str(thing[store.VIDEO_FILE])).name for thing in things}
    text = json.dumps(known)
    if scene.get(store.KNOWN_VIDEOS) != text:
        scene[store.KNOWN_VIDEOS] = text


def forget_id(scene: bpy.types.Scene, identifier: str) -> None:
    """A camera that is gone is not missed any more."""
    known = json.loads(scene.get(store.KNOWN_VIDEOS, "{}"))
    known.pop(identifier, None)
    scene[store.KNOWN_VIDEOS] = json.dumps(known)


def deleted(scene: bpy.types.Scene) -> dict[str, str]:
    """Id → name of the video, of cameras that someone deleted."""
    there = {thing[store.ID] for thing in cameras(scene)}
    known = json.loads(scene.get(store.KNOWN_VIDEOS, "{}"))
    return {identifier: name for identifier, name in known.items() if identifier not in there}


def begin_with(scene: bpy.types.Scene, camera: bpy.types.Object) -> None:
    """The first video: the scene plays at its rate, from its origin, as long as it lasts."""
    video = stored_video(camera)
    if np.isfinite(video.rate_hz):
        set_scene_rate(scene, video.rate_hz)
    if store.TIME_ORIGIN not in scene:
        scene[store.TIME_ORIGIN] = 0.0
    if scene.rockfall.playback != "REAL":
        scene.rockfall.playback = "REAL"
    scene.frame_start = int(np.floor(scene_frame_of(scene, camera, 0)))
    scene.frame_end = max(int(np.ceil(scene_frame_of(scene, camera, video.frames - 1))), scene.frame_start + 1)
    scene.frame_set(scene.frame_start)


def _keyed_with(scene: bpy.types.Scene, camera: bpy.types.Object) -> list[float]:
    return [*(float(value) for value in camera[store.CLOCK]), origin_of(scene), timing.frame_rate(scene)]


def _lock(camera: bpy.types.Object, locked: bool) -> None:
    """A solved camera is not to be moved by a slip of the mouse."""
    camera.lock_location = camera.lock_rotation = camera.lock_scale = (locked, locked, locked)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The solved path of a video's camera: stored in doubles, shown as Blender's lens, place and keys."""

import json

import bpy
import numpy as np

from ....core.camera.blender_lens import BlenderLens, from_blender_lens, pose_to_blender, to_blender_lens
from ....core.camera.model import INTRINSICS, Camera
from ....core.camera.path import CameraPath, fixed
from ....core.camera.quality import CameraQuality, from_plain, to_plain
from ....core.errors import RockfallError
from ....core.vectors import Array
from ..storage import store
from ..terrain import georeference
from . import camera_keys, clocks, timing, videos


def is_solved(camera: bpy.types.Object) -> bool:
    """Whether the camera's place is known from alignment, and not only where someone put it."""
    return bool(camera.get(store.SOLVED, False))


def camera_path(camera: bpy.types.Object) -> CameraPath:
    """The camera, local to the scene's shift: the solved one, in doubles; before that, Blender's as it stands."""
    width, height = videos.size_of(camera)
    scene = next(iter(camera.users_scene), bpy.context.scene)
    shift = georeference.read_shift(scene)
    if not is_solved(camera) or store.CAMERA not in camera:
        aspect = float(videos.facts_of(camera).get("pixel_aspect", 1.0))
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
    quality: CameraQuality | None = None,
) -> None:
    """Store a solved camera, exactly, and show it: lens, place, and keys when it moves.

    Parameters
    ----------
    path : its pictures have the size of the video's.
    pose_covariance : (6, 6) of rotation [rad] and position [m], of the whole path; one that is not finite, since the
        pairs do not determine it, is not kept.
    quality : what it was solved from; None when unknown.

    Raises
    ------
    RockfallError : the size is another one.
    """
    if path.reference.size != videos.size_of(camera):
        (width, height), (w, h) = path.reference.size, videos.size_of(camera)
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
    if pose_covariance is not None and not np.isfinite(pose_covariance).all():
        pose_covariance = None
    for key, value in ((store.RMSE, rmse_px), (store.POSE_COVARIANCE, pose_covariance)):
        if value is not None:
            camera[key] = float(value) if key == store.RMSE else np.asarray(value, np.float64).ravel().tolist()
        elif key in camera:
            del camera[key]
    if quality is not None:
        camera[store.CAMERA_QUALITY] = json.dumps(to_plain(quality))
    elif store.CAMERA_QUALITY in camera:
        del camera[store.CAMERA_QUALITY]
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


def quality_of(camera: bpy.types.Object) -> CameraQuality | None:
    """What a solved camera rests on; None when unknown."""
    values = store.read_json(camera, store.CAMERA_QUALITY, {}) if is_solved(camera) else {}
    return from_plain(values) if {"pairs", "redundancy"} <= values.keys() else None


def write_keys(scene: bpy.types.Scene, camera: bpy.types.Object) -> None:
    """Put a solved camera where it is, with a key at each frame when it moves."""
    path = camera_path(camera)
    common = clocks.clock_of(camera).to_common(path.time_s)
    frames = (common - clocks.origin_of(scene)) * timing.frame_rate(scene)
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


def _keyed_with(scene: bpy.types.Scene, camera: bpy.types.Object) -> list[float]:
    return [*(float(value) for value in camera[store.CLOCK]), clocks.origin_of(scene), timing.frame_rate(scene)]


def _lock(camera: bpy.types.Object, locked: bool) -> None:
    """A solved camera is not to be moved by a slip of the mouse."""
    camera.lock_location = camera.lock_rotation = camera.lock_scale = (locked, locked, locked)

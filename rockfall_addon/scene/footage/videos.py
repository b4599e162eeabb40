# SPDX-License-Identifier: GPL-3.0-or-later
"""Videos: each is a camera with its footage behind it, and stores what its file says of itself."""

import json
from pathlib import Path

import bpy
import numpy as np

from ....core.vectors import Array
from ..storage import store

COLLECTION = "Cameras"


def cameras(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """The cameras of the scene's videos, by name."""
    return [obj for obj in store.with_role(scene, store.CAMERA_ROLE) if is_video(obj)]


def is_video(obj: bpy.types.Object | None) -> bool:
    """Whether an object is the camera of a video."""
    return (
        obj is not None
        and obj.type == "CAMERA"
        and obj.get(store.ROLE) == store.CAMERA_ROLE
        and store.is_own(obj)
        and store.VIDEO_TIMES in obj
    )


def active_camera(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """The scene's camera if it belongs to a video, else that of the first video; None without videos."""
    if is_video(scene.camera):
        return scene.camera
    return next(iter(cameras(scene)), None)


def by_id(scene: bpy.types.Scene, identifier: str) -> bpy.types.Object | None:
    """The camera of an id."""
    return next((obj for obj in cameras(scene) if obj.get(store.ID) == identifier), None)


def summary(camera: bpy.types.Object) -> str:
    """One sentence about a video that was added."""
    (width, height), known = size_of(camera), facts_of(camera)
    rate = f" at {known['rate_hz']:.4g} a second" if known.get("rate_hz") else ""
    return f"{camera.name}: {width} × {height} px, {len(camera[store.VIDEO_TIMES])} frames{rate}."


def facts_of(camera: bpy.types.Object) -> dict:
    """What the file says about itself: codec, container, rotation_deg, header_rate_hz, rate_hz, remarks …"""
    return store.read_json(camera, store.VIDEO_FACTS, {})


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


def capture_rate_of(camera: bpy.types.Object) -> float | None:
    """Pictures per second when filming; None when it is the rate of the file."""
    return float(camera.get(store.CAPTURE_RATE, 0.0)) or None


def row_time_of(camera: bpy.types.Object) -> float | None:
    """Readout time of one row of the image [s], 0 for a global shutter; None when it is not known."""
    value = camera.get(store.ROW_TIME)
    return None if value is None else float(value)


def remember(scene: bpy.types.Scene, objects: list[bpy.types.Object]) -> None:
    """Remember which cameras there are, beside those that are gone."""
    known = store.read_json(scene, store.KNOWN_VIDEOS, {})
    known |= {obj[store.ID]: Path(str(obj[store.VIDEO_FILE])).name for obj in objects}
    text = json.dumps(known)
    if scene.get(store.KNOWN_VIDEOS) != text:
        scene[store.KNOWN_VIDEOS] = text


def forget_id(scene: bpy.types.Scene, identifier: str) -> None:
    """A camera that is gone is not missed any more."""
    known = store.read_json(scene, store.KNOWN_VIDEOS, {})
    known.pop(identifier, None)
    scene[store.KNOWN_VIDEOS] = json.dumps(known)


def deleted(scene: bpy.types.Scene) -> dict[str, str]:
    """Id → name of the video, of cameras that someone deleted."""
    there = {obj[store.ID] for obj in cameras(scene)}
    known = store.read_json(scene, store.KNOWN_VIDEOS, {})
    return {identifier: name for identifier, name in known.items() if identifier not in there}

# SPDX-License-Identifier: GPL-3.0-or-later
"""The videos of tests/data in the scene, and cameras made up for them."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np

DATA = Path(__file__).resolve().parents[1] / "data" / "videos"
Part = Callable[[str], ModuleType]


def scene() -> bpy.types.Scene:
    return bpy.context.scene


def number_in(image: np.ndarray) -> int:
    """The number that a picture of tests/data/videos shows in Gray code."""
    height, width = image.shape[:2]
    if height > width:  # turned by 90° clockwise
        image, width = np.rot90(image), height
    row = image[image.shape[0] // 2].mean(axis=-1)
    bits = [row[int((i + 0.5) * width / 8)] > 128 for i in range(8)]
    code = sum(int(bit) << i for i, bit in enumerate(bits))
    number = 0
    while code:
        number ^= code
        code >>= 1
    return number


def add(part: Part, name: str) -> bpy.types.Object:
    return part("rockfall_addon.scene.footage.new_videos").add_video(scene(), DATA / name)


def solved(part: Part, camera: bpy.types.Object, frames: int) -> object:
    """A made-up path with all numbers in use."""
    model, paths = part("core.camera.model"), part("core.camera.path")
    one = model.look_at(64, 48, (3.0, -20.0, 5.0), (0, 0, 1), focal_px=80)
    one = model.with_intrinsics(one, [80.1, 79.7, 31.2, 24.9, 0.01, -0.002, 0.0, 1e-4, 2e-4])
    if frames == 1:
        return paths.fixed(one)
    time = part("rockfall_addon.scene.footage.videos").times_of(camera)[:frames]
    turn = model.rotation_from_vector(np.outer(np.sin(5 * time), [0.02, -0.03, 0.01])) @ one.rotation
    place = one.position + np.outer(time, [0.1, 0.0, 0.05])
    return paths.CameraPath(one, time, place, turn, 0.01 * np.ones(frames), 1e-4 * np.ones(frames))

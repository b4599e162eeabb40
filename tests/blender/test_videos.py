# SPDX-License-Identifier: GPL-3.0-or-later
"""Videos in the scene: their cameras, times and pictures."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest

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


@pytest.mark.parametrize("name", ["constant.mp4", "rotated.mov", "variable.mp4"])
def test_added_video(part: Part, name: str) -> None:
    videos = part("rockfall_addon.bridge.videos")
    camera = videos.add_video(scene(), DATA / name)
    video = videos.video_of(camera)
    assert videos.size_of(camera) == (video.width, video.height) == tuple(videos.clip_of(camera).size)
    np.testing.assert_array_equal(videos.times_of(camera), video.time_s)
    for index in (0, 1, 17, video.frames - 1):
        frame = videos.scene_frame_of(scene(), camera, index)
        assert videos.true_frame(scene(), camera, frame) == index
        assert number_in(videos.picture(camera, index)) == index


def test_television_rate_is_exact(part: Part) -> None:
    videos = part("rockfall_addon.bridge.videos")
    videos.add_video(scene(), DATA / "rotated.mov")
    assert scene().render.fps / scene().render.fps_base == 30_000 / 1001

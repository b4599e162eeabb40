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


@pytest.mark.parametrize(("rate", "fps", "base"), [(30, 30, 1), (29.97002997, 30_000, 1001), (59.94006, 30_000, 500.5)])
def test_scene_rate(part: Part, rate: float, fps: int, base: float) -> None:
    assert part("rockfall_addon.bridge.videos").scene_rate(rate) == (fps, base)


def test_odd_rate(part: Part) -> None:
    fps, base = part("rockfall_addon.bridge.videos").scene_rate(29.83)
    assert fps == 30
    assert fps / base == pytest.approx(29.83)


@pytest.fixture
def seen(part: Part, tmp_path: Path) -> Callable[[bpy.types.Object, int], int]:
    """The number in the picture that Blender has behind a camera at a frame: rendered by the compositor."""
    videos = part("rockfall_addon.bridge.videos")
    tree = bpy.data.node_groups.new("seen", "CompositorNodeTree")
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    result = tree.nodes.new("NodeGroupOutput")
    scene().compositing_node_group = tree
    scene().view_settings.view_transform = "Standard"
    scene().render.engine = "CYCLES"
    scene().render.image_settings.file_format = "PNG"
    for layer in scene().view_layers:
        layer.use = False

    def number(camera: bpy.types.Object, frame: float) -> int:
        whole = int(np.floor(frame))
        scene().frame_set(whole, subframe=frame - whole)
        still = [b for b in camera.data.background_images if b.source == "IMAGE" and b.show_background_image]
        clips = [b for b in camera.data.background_images if b.source == "MOVIE_CLIP" and b.show_background_image]
        assert len(still) + len(clips) == 1
        for node in [node for node in tree.nodes if node != result]:
            tree.nodes.remove(node)
        if still:
            source = tree.nodes.new("CompositorNodeImage")
            source.image = still[0].image
        else:
            source = tree.nodes.new("CompositorNodeMovieClip")
            source.clip = clips[0].clip
        tree.links.new(source.outputs[0], result.inputs[0])
        render = scene().render
        render.resolution_x, render.resolution_y = videos.size_of(camera)
        render.filepath = str(tmp_path / "seen.png")
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(render.filepath)
        width, height = image.size
        pixels = np.array(image.pixels[:]).reshape(height, width, 4)[::-1, :, :3]
        bpy.data.images.remove(image)
        return number_in(np.round(255 * pixels).astype(np.uint8))

    return number


@pytest.mark.parametrize("name", ["constant.mp4", "rotated.mov", "variable.mp4", "variable.mkv", "slower.mp4"])
@pytest.mark.parametrize("capture_rate_hz", [None, 120.0])
def test_picture_behind_the_camera(
    part: Part, seen: Callable[[bpy.types.Object, float], int], name: str, capture_rate_hz: float | None
) -> None:
    """Whatever the rates, Blender shows the last picture that is not later than the scene's time."""
    videos, clock = part("rockfall_addon.bridge.videos"), part("core.footage.clock")
    camera = videos.add_video(scene(), DATA / name)
    scene().camera = camera
    scene().render.fps, scene().render.fps_base = 25, 1.0
    videos.set_capture_rate(camera, capture_rate_hz)
    one = videos.clock_of(camera)
    videos.set_clock(camera, clock.Clock(0.35, 2e-3, 0.1, one.rate))
    times = videos.times_of(camera)
    shown = []
    for frame in (-3, 0, 4, 8.5, 9, 10, 11, 12, 13, 14, 21, 22.25, 30, 31):
        common = frame / 25
        video_s = 0.1 + (common - 0.35) / ((1 + 2e-3) * one.rate)
        expected = max(int(np.flatnonzero(times <= video_s + 1e-5).max(initial=0)), 0)
        if abs(times - video_s).min() < 6e-4:
            continue  # on the edge between two pictures
        shown.append(expected)
        assert seen(camera, frame) == expected == videos.true_frame(scene(), camera)
    assert len(set(shown)) > 5


@pytest.mark.parametrize(
    "name", ["constant.mp4", "variable.mp4", "variable.mkv", "slower.mp4", "vp9.webm", "bframes.avi"]
)
def test_every_picture_can_be_seen(part: Part, seen: Callable[[bpy.types.Object, float], int], name: str) -> None:
    videos = part("rockfall_addon.bridge.videos")
    camera = videos.add_video(scene(), DATA / name)
    scene().camera = camera
    for index in range(0, 40, 1):
        assert seen(camera, videos.scene_frame_of(scene(), camera, index)) == index

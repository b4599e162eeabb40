# SPDX-License-Identifier: GPL-3.0-or-later
"""Videos in the scene: their pictures, their files, what is said of them."""

import shutil
from collections.abc import Callable
from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest
from video_scene import DATA, Part, add, number_in, scene


@pytest.mark.parametrize("name", ["constant.mp4", "rotated.mov", "variable.mp4"])
def test_added_video(part: Part, name: str) -> None:
    new_videos = part("rockfall_addon.scene.footage.new_videos")
    video_files = part("rockfall_addon.scene.footage.video_files")
    videos = part("rockfall_addon.scene.footage.videos")
    clocks = part("rockfall_addon.scene.footage.clocks")
    camera = new_videos.add_video(scene(), DATA / name)
    video = video_files.video_of(camera)
    assert videos.size_of(camera) == (video.width, video.height) == tuple(video_files.clip_of(camera).size)
    np.testing.assert_array_equal(videos.times_of(camera), video.time_s)
    for index in (0, 1, 17, video.frames - 1):
        frame = clocks.scene_frame_of(scene(), camera, index)
        assert clocks.true_frame(scene(), camera, frame) == index
        assert number_in(video_files.picture(camera, index)) == index


@pytest.fixture
def seen(part: Part, tmp_path: Path) -> Callable[[bpy.types.Object, int], int]:
    """The number in the picture that Blender has behind a camera at a frame: rendered by the compositor."""
    videos = part("rockfall_addon.scene.footage.videos")
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
    new_videos = part("rockfall_addon.scene.footage.new_videos")
    clocks = part("rockfall_addon.scene.footage.clocks")
    videos = part("rockfall_addon.scene.footage.videos")
    clock = part("core.footage.clock")
    camera = new_videos.add_video(scene(), DATA / name)
    scene().camera = camera
    scene().render.fps, scene().render.fps_base = 25, 1.0
    clocks.set_capture_rate(camera, capture_rate_hz)
    one = clocks.clock_of(camera)
    clocks.set_clock(camera, clock.Clock(0.35, 2e-3, 0.1, one.rate))
    times = videos.times_of(camera)
    shown = []
    for frame in (-3, 0, 4, 8.5, 9, 10, 11, 12, 13, 14, 21, 22.25, 30, 31):
        common = frame / 25
        video_s = 0.1 + (common - 0.35) / ((1 + 2e-3) * one.rate)
        expected = max(int(np.flatnonzero(times <= video_s + 1e-5).max(initial=0)), 0)
        if abs(times - video_s).min() < 6e-4:
            continue  # on the edge between two pictures
        shown.append(expected)
        assert seen(camera, frame) == expected == clocks.true_frame(scene(), camera)
    assert len(set(shown)) > 5


@pytest.mark.parametrize(
    "name", ["constant.mp4", "variable.mp4", "variable.mkv", "slower.mp4", "vp9.webm", "bframes.avi"]
)
def test_every_picture_can_be_seen(part: Part, seen: Callable[[bpy.types.Object, float], int], name: str) -> None:
    new_videos, clocks = part("rockfall_addon.scene.footage.new_videos"), part("rockfall_addon.scene.footage.clocks")
    camera = new_videos.add_video(scene(), DATA / name)
    scene().camera = camera
    for index in range(0, 40, 1):
        assert seen(camera, clocks.scene_frame_of(scene(), camera, index)) == index


@pytest.mark.parametrize("name", ["constant.mp4", "rotated.mov", "vp9.webm"])
def test_no_picture_of_a_healthy_video_is_said_to_be_hidden(part: Part, name: str) -> None:
    assert part("rockfall_addon.scene.footage.footage").hidden(add(part, name)) == 0


def test_file_moved(part: Part, tmp_path: Path) -> None:
    new_videos = part("rockfall_addon.scene.footage.new_videos")
    videos = part("rockfall_addon.scene.footage.videos")
    video_files = part("rockfall_addon.scene.footage.video_files")
    clocks = part("rockfall_addon.scene.footage.clocks")
    words = part("rockfall_addon.steps.videos.wording")
    errors = part("core.errors")
    there = tmp_path / "there.mp4"
    there.write_bytes((DATA / "constant.mp4").read_bytes())
    camera = new_videos.add_video(scene(), there)
    camera["rockfall_events"] = '{"1": 0.4}'
    there.rename(tmp_path / "elsewhere.mp4")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "moved.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "moved.blend"))
    (camera,) = videos.cameras(scene())
    assert words.is_missing(camera)
    assert "there.mp4" in words.missing(camera)
    with pytest.raises(errors.RockfallError, match="Find the File"):
        video_files.picture(camera, 0)
    scene().frame_set(12)
    assert clocks.true_frame(scene(), camera) == 12, "times are known without the file"
    assert not scene().get("rockfall_problem")
    with pytest.raises(RuntimeError, match="another one"):
        bpy.ops.rockfall.relink_video(filepath=str(DATA / "rotated.mov"))
    assert words.is_missing(camera)
    assert "frames" in part("rockfall_addon.scene.footage.footage").relink(camera, DATA / "variable.mp4")[0]
    assert bpy.ops.rockfall.relink_video(filepath=str(tmp_path / "elsewhere.mp4")) == {"FINISHED"}
    assert not words.is_missing(camera)
    assert part("rockfall_addon.scene.footage.video_times").events_of(camera) == {1: 0.4}
    assert number_in(video_files.picture(camera, 12)) == 12
    assert len(bpy.data.movieclips) == 1


def test_a_file_that_is_moved_with_its_video_takes_that_one(part: Part, tmp_path: Path) -> None:
    """The copy of a site reads its own video, though the old one is still there; in all that reads it."""
    new_videos, videos = part("rockfall_addon.scene.footage.new_videos"), part("rockfall_addon.scene.footage.videos")
    video_files = part("rockfall_addon.scene.footage.video_files")
    site, copy = tmp_path / "site", tmp_path / "copy ü"
    site.mkdir()
    (site / "video.mp4").write_bytes((DATA / "constant.mp4").read_bytes())
    bpy.ops.wm.save_as_mainfile(filepath=str(site / "site.blend"))
    camera = new_videos.add_video(scene(), site / "video.mp4")
    assert video_files.clip_of(camera).filepath == "//video.mp4"
    bpy.ops.wm.save_as_mainfile(filepath=str(site / "site.blend"))
    shutil.copytree(site, copy)
    bpy.ops.wm.open_mainfile(filepath=str(copy / "site.blend"))
    (camera,) = videos.cameras(scene())
    assert Path(camera["rockfall_video_file"]).parent == site, "what was stored is the other one"
    inputs = part("rockfall_addon.scene.simulation.design_sheet")._inputs(scene())
    paths = {video_files.file_of(camera), video_files.video_of(camera).path, inputs[f"video {camera.name}"]}
    assert paths == {(copy / "video.mp4").resolve()}
    (copy / "video.mp4").unlink()
    assert video_files.file_of(camera) == site / "video.mp4"
    bpy.data.movieclips.remove(video_files.clip_of(camera))
    assert video_files.file_of(camera) == site / "video.mp4"


def test_a_clip_of_another_size_is_refused(part: Part, tmp_path: Path) -> None:
    video_files = part("rockfall_addon.scene.footage.video_files")
    camera = add(part, "constant.mp4")
    video_files.clip_of(camera).filepath = str(DATA / "rotated.mov")
    with pytest.raises(part("core.errors").RockfallError, match=r"what was marked is of .* px\. Use Find the File"):
        video_files.picture(camera, 0)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("interlaced.mp4", "as interlaced video does here"),
        ("sound.mp4", "The file holds sound and no video"),
        ("nothing.mp4", "There is no such file"),
    ],
)
def test_bad_videos(part: Part, name: str, said: str) -> None:
    with pytest.raises(RuntimeError, match=rf"{name}: .*{said}"):
        bpy.ops.rockfall.add_video(filepath=str(DATA / name))
    assert len(bpy.data.cameras) == len(bpy.data.movieclips) == 0


def test_good_among_bad(part: Part) -> None:
    names = [{"name": name} for name in ("interlaced.mp4", "constant.mp4", "rotated.mov")]
    assert bpy.ops.rockfall.add_video(directory=str(DATA), files=names) == {"FINISHED"}
    cameras = part("rockfall_addon.scene.footage.videos").cameras(scene())
    assert [camera.name for camera in cameras] == ["constant", "rotated"]
    assert scene().camera == cameras[0]


def test_words_about_videos(part: Part) -> None:
    words = part("rockfall_addon.steps.videos.wording")
    for name in ("rotated.mov", "single.mp4", "repeated.avi", "variable.mp4"):
        camera = add(part, name)
        rows = dict(words.facts(camera))
        assert rows["Size"] == ("48 × 64 px" if name == "rotated.mov" else "64 × 48 px")
        said = " ".join(remark.text for remark in words.remarks(camera))
    for word in ("varies", "missing", "Blender's player"):
        assert word in said

    def told(frame: int) -> list[str]:
        scene().frame_set(frame)
        first, *others = (remark.text for remark in words.warnings(scene(), camera))
        assert "is not synchronised" in first
        return others

    assert "behind the end" in told(5000)[0]
    assert told(66) == []
    assert "before" in told(-5)[0]


def test_disabled_and_enabled(part: Part, installation: object) -> None:
    add(part, "constant.mp4")
    installation.disable()
    installation.enable()
    videos = installation.part("rockfall_addon.scene.footage.videos")
    clocks = installation.part("rockfall_addon.scene.footage.clocks")
    (camera,) = videos.cameras(scene())
    scene().frame_set(20)
    assert clocks.true_frame(scene(), camera) == 20


def test_a_video_that_was_held_by_hand_is_asked_about_before_anything_is_marked(scan, part: Part) -> None:
    """The demo's footage pans; it is asked until the camera is said to be hand-held."""
    footage = Path(__file__).resolve().parents[2] / "assets" / "demo" / "footage" / "footage.mp4"
    assert bpy.ops.rockfall.add_video(filepath=str(footage)) == {"FINISHED"}
    following, videos = part("rockfall_addon.scene.next_step"), part("rockfall_addon.scene.footage.videos")
    camera = videos.active_camera(scene())
    step = following.next_step(scene())
    assert "if it was held by hand, choose Hand-held in step 3" in step.sentence
    assert step.actions == ("rockfall.align_views",)
    camera.rockfall_alignment.motion = "ROTATION"
    assert "held by hand" not in following.next_step(scene()).sentence


def test_a_tripod_is_not_asked_about(scan, part: Part, tmp_path: Path) -> None:
    """A film of one noisy picture."""
    rng = np.random.default_rng(1)
    ground = cv2.GaussianBlur(rng.normal(120, 90, (240, 320, 3)), (0, 0), 2)
    writer = cv2.VideoWriter(str(tmp_path / "still.mp4"), cv2.VideoWriter_fourcc(*"mp4v"), 25, (320, 240))
    for _ in range(40):
        writer.write(np.clip(ground + rng.normal(0, 4, ground.shape), 0, 255).astype(np.uint8))
    writer.release()
    assert bpy.ops.rockfall.add_video(filepath=str(tmp_path / "still.mp4")) == {"FINISHED"}
    assert "held by hand" not in part("rockfall_addon.scene.next_step").next_step(scene()).sentence
    (camera,) = part("rockfall_addon.scene.footage.videos").cameras(scene())
    alignment = part("rockfall_addon.scene.footage.alignment")
    assert not alignment.background_remarks(camera)
    assert not alignment.is_taken_for_a_tripod(camera), "somebody has looked, and it stood still"


def test_a_camera_that_moves_is_to_be_followed_before_anything_is_picked(part: Part) -> None:
    """What comes after the advice to choose Hand-held: with the pose of one frame, picks would be beside the block."""
    demo = Path(__file__).resolve().parents[2] / "assets" / "demo"
    assert bpy.ops.rockfall.import_terrain(filepath=str(demo / "terrain.ply")) == {"FINISHED"}
    assert bpy.ops.rockfall.add_video(filepath=str(demo / "footage" / "footage.mp4")) == {"FINISHED"}
    following, videos = part("rockfall_addon.scene.next_step"), part("rockfall_addon.scene.footage.videos")
    camera = videos.active_camera(scene())
    camera.rockfall_alignment.motion = "ROTATION"
    assert "follow" not in following.next_step(scene()).sentence, "first it is solved"
    assert bpy.ops.rockfall.import_pairs(filepath=str(demo / "footage" / "pairs.csv")) == {"FINISHED"}
    step = following.next_step(scene())
    assert "follow its background" in step.sentence
    assert step.actions == ("rockfall.follow_background",)
    camera[part("rockfall_addon.scene.storage.store").FOLLOWED] = "{}"
    assert "follow" not in following.next_step(scene()).sentence, "also where it was found to stand still"

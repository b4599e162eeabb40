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
    new_videos = part("rockfall_addon.scene.new_videos")
    video_files = part("rockfall_addon.scene.video_files")
    videos = part("rockfall_addon.scene.videos")
    clocks = part("rockfall_addon.scene.clocks")
    camera = new_videos.add_video(scene(), DATA / name)
    video = video_files.video_of(camera)
    assert videos.size_of(camera) == (video.width, video.height) == tuple(video_files.clip_of(camera).size)
    np.testing.assert_array_equal(videos.times_of(camera), video.time_s)
    for index in (0, 1, 17, video.frames - 1):
        frame = clocks.scene_frame_of(scene(), camera, index)
        assert clocks.true_frame(scene(), camera, frame) == index
        assert number_in(video_files.picture(camera, index)) == index


def test_television_rate_is_exact(part: Part) -> None:
    new_videos = part("rockfall_addon.scene.new_videos")
    new_videos.add_video(scene(), DATA / "rotated.mov")
    assert scene().render.fps / scene().render.fps_base == 30_000 / 1001


@pytest.mark.parametrize(("rate", "fps", "base"), [(30, 30, 1), (29.97002997, 30_000, 1001), (59.94006, 30_000, 500.5)])
def test_scene_rate(part: Part, rate: float, fps: int, base: float) -> None:
    assert part("rockfall_addon.scene.clocks").scene_rate(rate) == (fps, base)


def test_odd_rate(part: Part) -> None:
    fps, base = part("rockfall_addon.scene.clocks").scene_rate(29.83)
    assert fps == 30
    assert fps / base == pytest.approx(29.83)


@pytest.fixture
def seen(part: Part, tmp_path: Path) -> Callable[[bpy.types.Object, int], int]:
    """The number in the picture that Blender has behind a camera at a frame: rendered by the compositor."""
    videos = part("rockfall_addon.scene.videos")
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
    new_videos = part("rockfall_addon.scene.new_videos")
    clocks = part("rockfall_addon.scene.clocks")
    videos = part("rockfall_addon.scene.videos")
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
    new_videos, clocks = part("rockfall_addon.scene.new_videos"), part("rockfall_addon.scene.clocks")
    camera = new_videos.add_video(scene(), DATA / name)
    scene().camera = camera
    for index in range(0, 40, 1):
        assert seen(camera, clocks.scene_frame_of(scene(), camera, index)) == index


@pytest.mark.parametrize("name", ["constant.mp4", "rotated.mov", "vp9.webm"])
def test_no_picture_of_a_healthy_video_is_said_to_be_hidden(part: Part, name: str) -> None:
    assert part("rockfall_addon.scene.footage").hidden(add(part, name)) == 0


def test_a_camera_that_stands_has_no_keys_of_one_that_moved(part: Part) -> None:
    camera_paths, camera = part("rockfall_addon.scene.camera_paths"), add(part, "variable.mp4")
    camera_paths.set_camera_path(scene(), camera, solved(part, camera, 20))
    action = camera.animation_data.action
    assert len(bpy.data.actions) == 1
    assert action.users == 1
    standing = solved(part, camera, 1)
    camera_paths.set_camera_path(scene(), camera, standing)
    assert camera.animation_data.action is None
    assert not bpy.data.actions
    scene().frame_set(7)
    np.testing.assert_allclose(camera.matrix_world.translation, standing.reference.position, atol=1e-5)


def add(part: Part, name: str) -> bpy.types.Object:
    return part("rockfall_addon.scene.new_videos").add_video(scene(), DATA / name)


@pytest.fixture
def pair(part: Part) -> tuple[bpy.types.Object, bpy.types.Object]:
    """A video of 30 pictures a second, and one that varies and begins elsewhere."""
    return add(part, "constant.mp4"), add(part, "variable.mp4")


@pytest.mark.parametrize("fit_drift", [False, True])
def test_events_synchronise(part: Part, fit_drift: bool) -> None:
    """Events at pictures whose times are known lead back to the clock that was made up for the second video."""
    videos = part("rockfall_addon.scene.videos")
    clocks = part("rockfall_addon.scene.clocks")
    times = part("rockfall_addon.scene.video_times")
    reference, other = (add(part, "slower.mp4") for _ in range(2))
    assert times.reference_camera(scene()) == reference
    drift = 0.02 if fit_drift else 0.0
    seen = videos.times_of(reference)[[30, 80, 110, 130]]
    truth = part("core.footage.clock").Clock(-0.3, drift, 0.2)
    other_s = videos.times_of(other)
    step = 0.0
    for number, common in enumerate(seen, start=1):
        times.go_to(scene(), clocks.frame_at(scene(), common))
        times.mark_event(scene(), reference, number)
        index = int(np.abs(other_s - truth.to_video(common)).argmin())
        step = max(step, abs(float(other_s[index] - truth.to_video(common))))
        times.go_to(scene(), clocks.scene_frame_of(scene(), other, index))
        assert times.mark_event(scene(), other, number) == pytest.approx(other_s[index], abs=1e-9)
    said = times.synchronise_cameras(scene(), fit_drift=fit_drift)
    found = clocks.clock_of(other)
    np.testing.assert_allclose(found.to_common(other_s), truth.to_common(other_s), atol=4 * step)
    assert "4 events" in said[0].text
    assert part("rockfall_addon.steps.videos.wording").fit(other)[0] == said[0]
    assert clocks.clock_of(reference).offset_s == 0.0


def test_next_video_begins_with_the_others(part: Part) -> None:
    clocks, videos = part("rockfall_addon.scene.clocks"), part("rockfall_addon.scene.videos")
    camera = add(part, "constant.mp4")
    clocks.set_clock(camera, part("core.footage.clock").Clock(465.5))
    other = add(part, "variable.mp4")
    assert clocks.clock_of(other).to_common(float(videos.times_of(other)[0])) == 465.5


def test_pixels_that_are_not_square(part: Part) -> None:
    """Of the same angle of view across and up: fx · width of a pixel = fy · height of a pixel."""
    from dataclasses import replace

    new_videos, camera_paths = part("rockfall_addon.scene.new_videos"), part("rockfall_addon.scene.camera_paths")
    video = replace(part("core.footage.video").open_video(DATA / "constant.mp4"), pixel_aspect=1.25)
    camera = new_videos.add_camera(scene(), video)
    one = camera_paths.camera_path(camera).reference
    assert one.fy / one.fx == pytest.approx(1.25)
    scene().camera = camera
    scene().frame_set(1)
    assert scene().render.pixel_aspect_x / scene().render.pixel_aspect_y == pytest.approx(1.25)


def test_nothing_to_synchronise(part: Part, pair: tuple[bpy.types.Object, ...]) -> None:
    times, errors = part("rockfall_addon.scene.video_times"), part("core.errors")
    with pytest.raises(errors.RockfallError, match="same event"):
        times.synchronise_cameras(scene(), fit_drift=False)
    part("rockfall_addon.scene.footage").remove(scene(), pair[1])
    with pytest.raises(errors.RockfallError, match="one video only"):
        times.synchronise_cameras(scene(), fit_drift=False)


def test_stepping_lands_on_true_frames(part: Part) -> None:
    videos = part("rockfall_addon.scene.videos")
    clocks = part("rockfall_addon.scene.clocks")
    times = part("rockfall_addon.scene.video_times")
    camera = add(part, "variable.mp4")
    scene().render.fps = 24
    stamps = videos.times_of(camera)
    scene().frame_set(0)
    for index in range(1, 40):
        assert bpy.ops.rockfall.step_frame(step=1) == {"FINISHED"}
        assert clocks.true_frame(scene(), camera) == index
        assert clocks.video_time(scene(), camera) == pytest.approx(stamps[index], abs=2e-7)
    bpy.ops.rockfall.step_frame(step=-10)
    assert clocks.true_frame(scene(), camera) == 29
    times.go_to(scene(), clocks.frame_at(scene(), float(stamps[10] + 0.4 * (stamps[11] - stamps[10]))))
    bpy.ops.rockfall.step_frame(step=-1)
    assert clocks.video_time(scene(), camera) == pytest.approx(stamps[10], abs=2e-7), "back to the picture's own time"
    bpy.ops.rockfall.step_frame(step=-100)
    bpy.ops.rockfall.step_frame(step=1000)
    assert clocks.true_frame(scene(), camera) == stamps.size - 1
    scene().frame_set(-40)
    bpy.ops.rockfall.step_frame(step=1)
    assert clocks.video_time(scene(), camera) == pytest.approx(stamps[0], abs=2e-7), (
        "from before the video to its start"
    )


def test_time_origin(part: Part, pair: tuple[bpy.types.Object, ...]) -> None:
    clocks = part("rockfall_addon.scene.clocks")
    camera, other = pair
    scene().camera = camera
    scene().frame_set(12)
    assert bpy.ops.rockfall.time_origin_here(what="SCENE") == {"FINISHED"}
    assert (scene().frame_current, clocks.true_frame(scene(), camera)) == (0, 12)
    assert clocks.common_time(scene()) == pytest.approx(0.4)
    assert bpy.ops.rockfall.time_origin_here(what="CLOCK") == {"FINISHED"}
    assert clocks.common_time(scene()) == 0.0
    assert clocks.true_frame(scene(), camera) == 12
    assert clocks.clock_of(other).to_common(0.4) == pytest.approx(0.0), "all clocks are set"


def test_common_clock_stays_with_picks(part: Part, pair: tuple[bpy.types.Object, ...]) -> None:
    bpy.ops.rockfall.load_demo()
    with pytest.raises(RuntimeError, match="common clock"):
        bpy.ops.rockfall.time_origin_here(what="CLOCK")


def test_render_size_follows_the_active_camera(part: Part) -> None:
    """Cameras of other sizes do not spoil each other."""
    view = part("rockfall_addon.view.image_view")
    wide, tall = add(part, "constant.mp4"), add(part, "rotated.mov")
    render = scene().render
    for camera, size in ((wide, (64, 48)), (tall, (48, 64)), (wide, (64, 48))):
        bpy.ops.rockfall.look_through(identifier=camera["rockfall_id"])
        assert scene().camera == camera
        assert (render.resolution_x, render.resolution_y) == size
        assert view.shape_agrees(scene(), camera)
    scene().camera = tall
    bpy.context.view_layer.update()
    scene().frame_set(1)
    assert (render.resolution_x, render.resolution_y) == (48, 64), "also when the camera is chosen in Blender's own way"
    render.resolution_x = 100
    scene().frame_set(2)
    assert not view.shape_agrees(scene(), tall)
    bpy.ops.rockfall.use_video_size()
    assert (render.resolution_x, render.resolution_y) == (48, 64)


def solved(part: Part, camera: bpy.types.Object, frames: int) -> object:
    """A made-up path with all numbers in use."""
    model, paths = part("core.camera.model"), part("core.camera.path")
    one = model.look_at(64, 48, (3.0, -20.0, 5.0), (0, 0, 1), focal_px=80)
    one = model.with_intrinsics(one, [80.1, 79.7, 31.2, 24.9, 0.01, -0.002, 0.0, 1e-4, 2e-4])
    if frames == 1:
        return paths.fixed(one)
    time = part("rockfall_addon.scene.videos").times_of(camera)[:frames]
    turn = model.rotation_from_vector(np.outer(np.sin(5 * time), [0.02, -0.03, 0.01])) @ one.rotation
    place = one.position + np.outer(time, [0.1, 0.0, 0.05])
    return paths.CameraPath(one, time, place, turn, 0.01 * np.ones(frames), 1e-4 * np.ones(frames))


@pytest.mark.parametrize("frames", [1, 20])
def test_solved_camera(part: Part, frames: int, tmp_path: Path) -> None:
    """Its doubles come back exactly, also from a file, and Blender's camera sees what ours does."""
    camera_paths = part("rockfall_addon.scene.camera_paths")
    videos = part("rockfall_addon.scene.videos")
    clocks = part("rockfall_addon.scene.clocks")
    model = part("core.camera.model")
    camera = add(part, "variable.mp4")
    moving = solved(part, camera, frames)
    camera_paths.set_camera_path(scene(), camera, moving, rmse_px=0.4, pose_covariance=np.diag(np.arange(1.0, 7.0)))
    scene().camera = camera
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "solved.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "solved.blend"))
    (camera,) = videos.cameras(scene())
    back = camera_paths.camera_path(camera)
    for name in ("time_s", "position", "rotation", "sigma_position_m", "sigma_rotation"):
        np.testing.assert_array_equal(getattr(back, name), getattr(moving, name))
    np.testing.assert_array_equal(back.reference.intrinsics, moving.reference.intrinsics)
    np.testing.assert_array_equal(camera_paths.pose_covariance(camera), np.diag(np.arange(1.0, 7.0)))
    straight = model.with_intrinsics(moving.reference, [*moving.reference.intrinsics[:4], 0, 0, 0, 0, 0])
    points = np.random.default_rng(3).uniform((-3, -3, -1), (3, 3, 3), (10, 3))
    for rate, index in ((30, 0), (30, 7), (24, 13)):
        scene().render.fps = rate
        frame = clocks.scene_frame_of(scene(), camera, index if frames > 1 else 0)
        scene().frame_set(int(frame // 1), subframe=frame % 1)
        position, rotation = moving.poses_at([moving.time_s[index if frames > 1 else 0]])
        ours = model.project(straight, points, position=position.repeat(10, 0), rotation=rotation.repeat(10, 0))
        matrix = camera.calc_matrix_camera(
            bpy.context.evaluated_depsgraph_get(),
            x=64,
            y=48,
            scale_x=scene().render.pixel_aspect_x,
            scale_y=scene().render.pixel_aspect_y,
        )
        clip = np.column_stack([points, np.ones(10)]) @ np.array(matrix @ camera.matrix_world.inverted()).T
        theirs = (clip[:, :2] / clip[:, 3:] * [1, -1] + 1) / 2 * [64, 48]
        np.testing.assert_allclose(theirs, ours, atol=2e-3)
    assert camera_paths.is_solved(camera)
    place = np.array(camera.matrix_world)
    camera_paths.unsolve(camera)
    np.testing.assert_allclose(np.array(camera.matrix_world), place, atol=1e-5)
    np.testing.assert_allclose(camera_paths.camera_path(camera).reference.fx, 80.1, rtol=1e-6)


def test_solved_camera_of_another_size(part: Part) -> None:
    camera = add(part, "rotated.mov")
    with pytest.raises(part("core.errors").RockfallError, match="64 × 48"):
        part("rockfall_addon.scene.camera_paths").set_camera_path(scene(), camera, solved(part, camera, 1))


def test_pixels_and_rays(part: Part) -> None:
    clocks = part("rockfall_addon.scene.clocks")
    camera_paths = part("rockfall_addon.scene.camera_paths")
    view = part("rockfall_addon.view.image_view")
    camera = add(part, "variable.mp4")
    clocks.set_clock(camera, part("core.footage.clock").Clock(5.0, 1e-3, 0.1, 0.25))
    camera_paths.set_camera_path(scene(), camera, solved(part, camera, 20))
    pixels = np.random.default_rng(4).uniform((5, 5), (59, 43), (12, 2))
    common = np.linspace(5.0, 5.1, 12)
    origins, directions = view.ray(scene(), camera, pixels, common)
    back = view.project(scene(), camera, origins + 30 * directions, common)
    np.testing.assert_allclose(back, pixels, atol=1e-6)
    origin, direction = view.ray(scene(), camera, pixels[3], common[3])
    np.testing.assert_array_equal(direction, directions[3])
    assert origin.shape == (3,)


def test_copied_camera_is_a_camera_of_its_own(part: Part) -> None:
    video_files = part("rockfall_addon.scene.video_files")
    clocks = part("rockfall_addon.scene.clocks")
    videos = part("rockfall_addon.scene.videos")
    camera = add(part, "constant.mp4")
    copy = camera.copy()  # linked data, as Alt D makes it
    camera.users_collection[0].objects.link(copy)
    scene().frame_set(3)
    assert copy["rockfall_id"] != camera["rockfall_id"]
    assert copy.data != camera.data
    assert video_files.clip_of(copy) != video_files.clip_of(camera)
    clocks.set_clock(copy, part("core.footage.clock").Clock(0.1))
    scene().frame_set(9)
    offsets = [video_files.clip_of(each).frame_offset for each in (camera, copy)]
    assert offsets[0] - offsets[1] == 3, "one shows picture 9, the other picture 6"
    camera.name = "Left"
    assert videos.by_id(scene(), camera["rockfall_id"]) == camera


def test_camera_deleted(part: Part) -> None:
    videos = part("rockfall_addon.scene.videos")
    camera, other = add(part, "constant.mp4"), add(part, "variable.mp4")
    identifier = camera["rockfall_id"]
    bpy.data.objects.remove(camera)
    scene().frame_set(2)
    assert videos.deleted(scene()) == {identifier: "constant.mp4"}
    assert videos.active_camera(scene()) == other
    assert bpy.ops.rockfall.remove_video(identifier=identifier) == {"FINISHED"}
    assert videos.deleted(scene()) == {}
    assert len(bpy.data.movieclips) == 1
    assert bpy.ops.rockfall.remove_video(identifier=other["rockfall_id"]) == {"FINISHED"}
    assert (len(bpy.data.movieclips), len(bpy.data.cameras), videos.cameras(scene())) == (0, 0, [])


def test_file_moved(part: Part, tmp_path: Path) -> None:
    new_videos = part("rockfall_addon.scene.new_videos")
    videos = part("rockfall_addon.scene.videos")
    video_files = part("rockfall_addon.scene.video_files")
    clocks = part("rockfall_addon.scene.clocks")
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
    assert "frames" in part("rockfall_addon.scene.footage").relink(camera, DATA / "variable.mp4")[0]
    assert bpy.ops.rockfall.relink_video(filepath=str(tmp_path / "elsewhere.mp4")) == {"FINISHED"}
    assert not words.is_missing(camera)
    assert part("rockfall_addon.scene.video_times").events_of(camera) == {1: 0.4}
    assert number_in(video_files.picture(camera, 12)) == 12
    assert len(bpy.data.movieclips) == 1


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
    cameras = part("rockfall_addon.scene.videos").cameras(scene())
    assert [camera.name for camera in cameras] == ["constant", "rotated"]
    assert scene().camera == cameras[0]


def test_scene_rate_changed(part: Part) -> None:
    clocks, words = part("rockfall_addon.scene.clocks"), part("rockfall_addon.steps.videos.wording")
    camera = add(part, "constant.mp4")
    assert words.rates(scene(), camera) == ""
    scene().render.fps = 24
    assert "24" in words.rates(scene(), camera)
    scene().frame_set(12)
    assert clocks.true_frame(scene(), camera) == 15
    assert bpy.ops.rockfall.use_video_rate() == {"FINISHED"}
    assert (scene().render.fps, scene().frame_current) == (30, 15)


def test_slow_motion(part: Part) -> None:
    """240 pictures a second stored at 30: the fall takes an eighth of the file's duration."""
    clocks = part("rockfall_addon.scene.clocks")
    camera = add(part, "constant.mp4")
    camera.rockfall_video.capture_rate_hz = 240
    assert clocks.clock_of(camera).to_common(0.8) == pytest.approx(0.1)
    assert camera.rockfall_video.capture_rate_hz == 240
    assert bpy.ops.rockfall.use_video_rate() == {"FINISHED"}
    assert scene().render.fps == 240
    scene().frame_set(17)
    assert clocks.true_frame(scene(), camera) == 17
    camera.rockfall_video.offset_s = 0.35
    assert clocks.clock_of(camera).offset_s == 0.35, "as typed, not its single precision"


def test_words_about_videos(part: Part) -> None:
    words = part("rockfall_addon.steps.videos.wording")
    for name in ("rotated.mov", "single.mp4", "repeated.avi", "variable.mp4"):
        camera = add(part, name)
        rows = dict(words.facts(camera))
        assert rows["Size"] == ("48 × 64 px" if name == "rotated.mov" else "64 × 48 px")
        said = " ".join(remark.text for remark in words.remarks(camera))
    for word in ("varies", "missing", "Blender's player"):
        assert word in said
    scene().frame_set(5000)
    assert "behind the end" in words.warnings(scene(), camera)[0].text
    scene().frame_set(66)
    assert words.warnings(scene(), camera) == []
    scene().frame_set(-5)
    assert "before" in words.warnings(scene(), camera)[0].text


def test_disabled_and_enabled(part: Part, installation: object) -> None:
    add(part, "constant.mp4")
    installation.disable()
    installation.enable()
    videos = installation.part("rockfall_addon.scene.videos")
    clocks = installation.part("rockfall_addon.scene.clocks")
    (camera,) = videos.cameras(scene())
    scene().frame_set(20)
    assert clocks.true_frame(scene(), camera) == 20


DEMO = Path(__file__).resolve().parents[2] / "assets" / "demo"


def test_footage_project(part: Part) -> None:
    """The demo's camera and track, as the command line made them, and the terrain under its pixels."""
    videos = part("rockfall_addon.scene.videos")
    camera_paths = part("rockfall_addon.scene.camera_paths")
    clocks = part("rockfall_addon.scene.clocks")
    view = part("rockfall_addon.view.image_view")
    assert part("rockfall_addon.scene.project").load_project(scene(), DEMO / "footage" / "project.toml") is None
    (camera,) = videos.cameras(scene())
    assert camera_paths.is_solved(camera)
    assert clocks.clock_of(camera).offset_s == 465.499
    assert clocks.video_time(scene(), camera, 0) == pytest.approx(0.0), "frame 0 is the first picture"
    assert (scene().frame_start, scene().frame_end, scene().render.fps) == (0, 299, 30)
    pairs = part("core.exchange.cameras").read_pairs(
        DEMO / "footage" / "pairs.csv", part("rockfall_addon.scene.georeference").read_shift(scene())
    )
    seen = view.project(scene(), camera, pairs.point, clocks.common_time(scene(), 0))
    assert np.sqrt(np.mean((seen - pairs.pixel) ** 2)) < 2.0
    assert part("rockfall_addon.scene.sightings").names_in(camera) == ["B10"]


def project_with_video(part: Part, folder: Path, file: Path) -> Path:
    cameras = part("core.exchange.cameras")
    camera = add(part, "variable.mp4")
    moving = solved(part, camera, 20)
    part("rockfall_addon.scene.footage").remove(scene(), camera)
    cameras.write_camera(folder / "camera.toml", moving, rmse_px=0.3, pose_covariance=np.eye(6))
    (folder / "track.csv").write_text("trajectory,frame,time_s,u_px,v_px\nB1,2,0.1,11.5,12.25\nB1,5,0.2,13,14\n")
    text = (DEMO / "project.toml").read_text()
    text = text.replace('"terrain.ply"', f'"{DEMO}/terrain.ply"').replace('"picks.csv"', f'"{DEMO}/picks.csv"')
    text += f"""
[[videos]]
name = "left"
file = "{file}"
camera = "camera.toml"
track = "track.csv"
offset_s = 3.5
drift = 1e-5
origin_s = 0.2
capture_rate_hz = 120.0
row_time_s = 2e-5
"""
    (folder / "project.toml").write_text(text)
    return folder / "project.toml"


@pytest.mark.parametrize("moved", [False, True])
def test_project_goes_out_as_it_came_in(part: Part, tmp_path: Path, moved: bool) -> None:
    """Also when the video is not where it was: nothing that is known of it is lost."""
    projects, videos = part("rockfall_addon.scene.project"), part("rockfall_addon.scene.videos")
    project, cameras = part("core.exchange.project"), part("core.exchange.cameras")
    file = tmp_path / "gone.mp4" if moved else DATA / "variable.mp4"
    path = project_with_video(part, tmp_path, file)
    projects.load_project(scene(), path)
    (camera,) = videos.cameras(scene())
    assert part("rockfall_addon.steps.videos.wording").is_missing(camera) == moved
    out = projects.save_project(scene(), tmp_path / "out")
    (before,), (after,) = (project.read_project(each).videos for each in (path, out))
    for name in ("name", "offset_s", "drift", "origin_s", "capture_rate_hz", "row_time_s"):
        assert getattr(after, name) == getattr(before, name)
    assert after.file.resolve() == before.file.resolve()
    shift = part("rockfall_addon.scene.georeference").read_shift(scene())
    first, second = (cameras.read_camera(each.camera, shift) for each in (before, after))
    np.testing.assert_allclose(second.path.position, first.path.position, atol=1e-9)
    np.testing.assert_array_equal(second.path.rotation, first.path.rotation)
    np.testing.assert_array_equal(second.path.reference.intrinsics, first.path.reference.intrinsics)
    np.testing.assert_array_equal(second.pose_covariance, np.eye(6))
    track = part("core.exchange.footage_tables").read_track(after.track)
    np.testing.assert_array_equal(track.pixel, [[11.5, 12.25], [13, 14]])
    assert track.trajectory.tolist() == ["B1", "B1"]

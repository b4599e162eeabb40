# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras of videos: solved ones, sizes, copies; pixels and rays."""

from pathlib import Path

import bpy
import numpy as np
import pytest
from video_scene import DATA, Part, add, scene, solved


def test_a_camera_that_stands_has_no_keys_of_one_that_moved(part: Part) -> None:
    camera_paths, camera = part("rockfall_addon.scene.footage.camera_paths"), add(part, "variable.mp4")
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


def test_a_camera_that_is_no_longer_solved_stays_where_it_was_shown(part: Part) -> None:
    """Free to be moved: keys of a camera that moved would take it back at the next picture."""
    camera_paths, camera = part("rockfall_addon.scene.footage.camera_paths"), add(part, "variable.mp4")
    camera_paths.set_camera_path(scene(), camera, solved(part, camera, 20))
    scene().frame_set(scene().frame_start + 3)
    shown = np.array(camera.matrix_world)
    assert all(camera.lock_location), "a solved camera is not moved by accident"
    camera_paths.unsolve(camera)
    camera.location.x += 1.0
    for frame in (scene().frame_start, scene().frame_end):
        scene().frame_set(frame)
        np.testing.assert_allclose(np.array(camera.matrix_world)[:3, 3] - shown[:3, 3], [1, 0, 0], atol=1e-5)
    assert not any(camera.lock_location)


def test_pixels_that_are_not_square(part: Part) -> None:
    """Of the same angle of view across and up: fx · width of a pixel = fy · height of a pixel."""
    from dataclasses import replace

    new_videos, camera_paths = (
        part("rockfall_addon.scene.footage.new_videos"),
        part("rockfall_addon.scene.footage.camera_paths"),
    )
    video = replace(part("core.footage.video").open_video(DATA / "constant.mp4"), pixel_aspect=1.25)
    camera = new_videos.add_camera(scene(), video)
    one = camera_paths.camera_path(camera).reference
    assert one.fy / one.fx == pytest.approx(1.25)
    scene().camera = camera
    scene().frame_set(1)
    assert scene().render.pixel_aspect_x / scene().render.pixel_aspect_y == pytest.approx(1.25)


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


@pytest.mark.parametrize("frames", [1, 20])
def test_solved_camera(part: Part, frames: int, tmp_path: Path) -> None:
    """Its doubles come back exactly, also from a file, and Blender's camera sees what ours does."""
    camera_paths = part("rockfall_addon.scene.footage.camera_paths")
    videos = part("rockfall_addon.scene.footage.videos")
    clocks = part("rockfall_addon.scene.footage.clocks")
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
        part("rockfall_addon.scene.footage.camera_paths").set_camera_path(scene(), camera, solved(part, camera, 1))


def test_pixels_and_rays(part: Part) -> None:
    clocks = part("rockfall_addon.scene.footage.clocks")
    camera_paths = part("rockfall_addon.scene.footage.camera_paths")
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
    video_files = part("rockfall_addon.scene.footage.video_files")
    clocks = part("rockfall_addon.scene.footage.clocks")
    videos = part("rockfall_addon.scene.footage.videos")
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
    videos = part("rockfall_addon.scene.footage.videos")
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

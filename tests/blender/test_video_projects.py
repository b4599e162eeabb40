# SPDX-License-Identifier: GPL-3.0-or-later
"""Videos of a project: read, and written as they were read."""

from pathlib import Path

import numpy as np
import pytest
from video_scene import DATA, Part, add, scene, solved

DEMO = Path(__file__).resolve().parents[2] / "assets" / "demo"


def test_footage_project(part: Part) -> None:
    """The demo's camera and track, as the command line made them, and the terrain under its pixels."""
    videos = part("rockfall_addon.scene.footage.videos")
    camera_paths = part("rockfall_addon.scene.footage.camera_paths")
    clocks = part("rockfall_addon.scene.footage.clocks")
    view = part("rockfall_addon.view.image_view")
    assert part("rockfall_addon.scene.project").load_project(scene(), DEMO / "footage" / "project.toml") is None
    (camera,) = videos.cameras(scene())
    assert camera_paths.is_solved(camera)
    assert clocks.clock_of(camera).offset_s == 465.499
    assert clocks.video_time(scene(), camera, 0) == pytest.approx(0.0), "frame 0 is the first picture"
    assert (scene().frame_start, scene().frame_end, scene().render.fps) == (0, 299, 30)
    pairs = part("core.exchange.cameras").read_pairs(
        DEMO / "footage" / "pairs.csv", part("rockfall_addon.scene.terrain.georeference").read_shift(scene())
    )
    seen = view.project(scene(), camera, pairs.point, clocks.common_time(scene(), 0))
    assert np.sqrt(np.mean((seen - pairs.pixel) ** 2)) < 2.0
    assert part("rockfall_addon.scene.footage.sightings").names_in(camera) == ["B10"]


def project_with_video(part: Part, folder: Path, file: Path) -> Path:
    cameras = part("core.exchange.cameras")
    camera = add(part, "variable.mp4")
    moving = solved(part, camera, 20)
    part("rockfall_addon.scene.footage.footage").remove(scene(), camera)
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
    projects, videos = part("rockfall_addon.scene.project"), part("rockfall_addon.scene.footage.videos")
    project, cameras = part("core.exchange.project"), part("core.exchange.cameras")
    file = tmp_path / "gone.mp4" if moved else DATA / "variable.mp4"
    path = project_with_video(part, tmp_path, file)
    projects.load_project(scene(), path)
    (camera,) = videos.cameras(scene())
    assert part("rockfall_addon.steps.videos.wording").is_missing(camera) == moved
    out, _ = projects.save_project(scene(), tmp_path / "out")
    (before,), (after,) = (project.read_project(each).videos for each in (path, out))
    for name in ("name", "offset_s", "drift", "origin_s", "capture_rate_hz", "row_time_s"):
        assert getattr(after, name) == getattr(before, name)
    assert after.file.resolve() == before.file.resolve()
    shift = part("rockfall_addon.scene.terrain.georeference").read_shift(scene())
    first, second = (cameras.read_camera(each.camera, shift) for each in (before, after))
    np.testing.assert_allclose(second.path.position, first.path.position, atol=1e-9)
    np.testing.assert_array_equal(second.path.rotation, first.path.rotation)
    np.testing.assert_array_equal(second.path.reference.intrinsics, first.path.reference.intrinsics)
    np.testing.assert_array_equal(second.pose_covariance, np.eye(6))
    track = part("core.exchange.footage_tables").read_track(after.track)
    np.testing.assert_array_equal(track.pixel, [[11.5, 12.25], [13, 14]])
    assert track.trajectory.tolist() == ["B1", "B1"]

# SPDX-License-Identifier: GPL-3.0-or-later
"""Picks from pixels of the demo's footage, against its truth."""

import csv
from dataclasses import replace
from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest

DEMO = Path(__file__).resolve().parents[2] / "assets" / "demo"
FOOTAGE = DEMO / "footage"
OFFSET_S = 465.499
"""Common time of the footage's first frame."""
ORIGIN = np.array([988400.0, 6375600.0, 1500.0])


def rows(name: str) -> list[dict[str, str]]:
    with (FOOTAGE / "truth" / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def local(row: dict[str, str], *names: str) -> np.ndarray:
    return np.array([float(row[name]) for name in names]) - ORIGIN


@pytest.fixture(scope="session")
def impacts() -> list[dict[str, str]]:
    """The true impacts that are in the picture."""
    return [row for row in rows("impacts.csv") if float(row["time_s"]) > 1.3]


@pytest.fixture
def site(part) -> bpy.types.Scene:
    """The demo's terrain and footage, the camera as it truly was."""
    scene = bpy.context.scene
    new_videos = part("rockfall_addon.scene.new_videos")
    clocks = part("rockfall_addon.scene.clocks")
    camera_paths = part("rockfall_addon.scene.camera_paths")
    surface = part("core.terrain.readers").read_terrain(
        DEMO / "terrain.ply", shift=part("core.georeference").GlobalShift(*ORIGIN)
    )
    part("rockfall_addon.scene.terrain").add_terrain(scene, surface, part("core.terrain.shading").shade(surface))
    camera = new_videos.add_video(scene, FOOTAGE / "footage.mp4")
    poses = rows("camera.csv")
    model = part("core.camera.model")
    place = np.array([local(row, "x_m", "y_m", "z_m") for row in poses])
    turn = np.array([[float(row[f"r{i}{j}"]) for i in "123" for j in "123"] for row in poses]).reshape(-1, 3, 3)
    lens = model.Camera(
        1280, 720, 2100.0, 2100.0, 640.0, 360.0, position=place[0], rotation=turn[0], shift=surface.shift
    )
    times = np.array([float(row["time_s"]) for row in poses])
    nothing = np.zeros(len(poses))
    path = part("core.camera.path").CameraPath(lens, times, place, turn, nothing, nothing)
    scene["rockfall_time_origin_s"] = OFFSET_S
    clocks.set_clock(camera, part("core.footage.clock").Clock(OFFSET_S))
    camera_paths.set_camera_path(scene, camera, path)
    scene.camera = camera
    scene.rockfall.block_diameter_m = 0.39
    return scene


def camera_of(scene: bpy.types.Scene, part) -> bpy.types.Object:
    (camera,) = part("rockfall_addon.scene.videos").cameras(scene)
    return camera


def picks_of(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    found = [obj for obj in scene.objects if obj.get("rockfall_role") == "pick"]
    return sorted(found, key=lambda obj: obj["rockfall_time_s"])


def exact(scene: bpy.types.Scene, camera: bpy.types.Object) -> None:
    """A camera and a terrain without errors of their own."""
    camera["rockfall_pose_covariance"] = (1e-14 * np.eye(6)).ravel().tolist()
    camera["rockfall_pose_sigma"] = [0.0] * len(camera["rockfall_pose_sigma"])
    scene.rockfall_terrain.accuracy_m = 1e-4


def pick(scene: bpy.types.Scene, part, frame: int, pixel: np.ndarray, name: str = "B10", **how) -> bpy.types.Object:
    places, editing = part("rockfall_addon.scene.places"), part("rockfall_addon.steps.picking.editing")
    scene.frame_set(frame)
    camera = camera_of(scene, part)
    place = places.in_picture(scene, camera, pixel, name, **how)
    obj, _ = editing.make_or_move(scene, camera, place, name, scene.rockfall_picking.kind)
    editing.finish(scene, obj)
    return obj


def test_a_pixel_of_the_ground_is_the_point_of_the_ground(site, part, impacts) -> None:
    """A true contact point, projected by hand, is found again."""
    places = part("rockfall_addon.scene.places")
    camera, poses = camera_of(site, part), rows("camera.csv")
    exact(site, camera)
    for row in impacts[:5]:
        frame = round(float(row["time_s"]) * 30)
        site.frame_set(frame)
        truth = local(row, "contact_x_m", "contact_y_m", "contact_z_m")
        pose = poses[frame]
        turn = np.array([[float(pose[f"r{i}{j}"]) for j in "123"] for i in "123"])
        x, y, z = turn @ (truth - local(pose, "x_m", "y_m", "z_m"))
        pixel = np.array([640 + 2100 * x / z, 360 + 2100 * y / z])
        place = places.in_picture(site, camera, pixel, "B10", centre=False)
        assert np.linalg.norm(place.position - truth) < 0.05, "truth lies on the terrain but for its roughness"
        assert place.frame == frame
        assert place.time_s == pytest.approx(OFFSET_S + frame / 30, abs=1e-6)
        assert place.sigma_time_s == pytest.approx(1 / 30 / np.sqrt(12), rel=1e-6)
        axes = np.linalg.norm(place.ellipse, axis=1)
        assert 0.03 < axes[1] <= axes[0] < 0.2, "a pixel is 4 cm wide there"
        away = np.linalg.norm(truth - local(pose, "x_m", "y_m", "z_m"))
        known = camera.pop("rockfall_pose_covariance")
        across = np.linalg.norm(places.in_picture(site, camera, pixel, "B10", centre=False).ellipse, axis=1)[1]
        usual = away * np.hypot(np.radians(0.1), 0.002)  # of a camera of which nothing is known
        assert across == pytest.approx(np.hypot(usual, axes[1]), rel=0.1)
        camera["rockfall_pose_covariance"] = list(known)


def test_the_middle_of_the_block_is_a_radius_from_the_ground(site, part, impacts) -> None:
    """The block's centre at the impact, as pixel → the contact that the truth has."""
    places, pictures = part("rockfall_addon.scene.places"), part("rockfall_addon.scene.pictures")
    camera, paths = camera_of(site, part), part("core.camera.path")
    path = part("rockfall_addon.scene.camera_paths").camera_path(camera)
    assert isinstance(path, paths.CameraPath)
    for row in impacts[:5]:
        frame = round(float(row["time_s"]) * 30)
        site.frame_set(frame)
        _, video_s = pictures.picture_time(site, camera)
        centre = local(row, "x_m", "y_m", "z_m")
        pixel = part("core.camera.model").project(pictures.posed(camera, video_s), centre[None])[0]
        place = places.in_picture(site, camera, pixel, "B10", centre=True)
        truth = local(row, "contact_x_m", "contact_y_m", "contact_z_m")
        assert np.linalg.norm(place.position - truth) < 0.12
        assert np.linalg.norm(place.position - centre) == pytest.approx(0.195, abs=0.05)


def test_clicks_become_picks_and_trajectories(site, part, impacts) -> None:
    block = {int(row["frame"]): row for row in rows("block.csv")}
    frames = [round(float(row["time_s"]) * 30) for row in impacts[:3]]
    for frame in frames:
        pick(site, part, frame, np.array([float(block[frame]["u_px"]), float(block[frame]["v_px"])]))
    made = picks_of(site)
    assert [obj["rockfall_trajectory"] for obj in made] == ["B10"] * 3
    assert [obj["rockfall_extra"]["frame"] for obj in made] == [str(frame) for frame in frames]
    assert all(obj["rockfall_sigma_position_m"][0] > 0 for obj in made)
    flights = [obj for obj in site.objects if obj.get("rockfall_role") == "flights"]
    assert len(flights) == 1, "the trajectory follows by itself"
    assert len(site.rockfall_impacts) == 3
    table = part("rockfall_addon.scene.picks").picks_of(site)
    assert set(table.extra["video"].tolist()) == {"footage"}
    assert float(table.extra["u_px"][0]) == float(block[frames[0]]["u_px"])


def test_a_second_click_in_one_picture_moves_the_pick(site, part) -> None:
    first = pick(site, part, 60, np.array([700.0, 300.0]))
    identifier, before = first["rockfall_id"], list(first["rockfall_position_m"])
    again = pick(site, part, 60, np.array([720.0, 300.0]))
    assert again["rockfall_id"] == identifier
    assert len(picks_of(site)) == 1
    assert 0.3 < np.linalg.norm(np.subtract(again["rockfall_position_m"], before)) < 3.0
    pick(site, part, 62, np.array([720.0, 300.0]))
    assert len(picks_of(site)) == 2


def test_what_was_seen_is_forgotten_when_the_pick_is_moved(site, part) -> None:
    clicks = part("rockfall_addon.scene.clicks")
    obj = pick(site, part, 60, np.array([700.0, 300.0]))
    (seen,) = clicks.of(obj).values()
    assert (seen.frame, seen.pixel.tolist(), seen.centre) == (60, [700.0, 300.0], True)
    bpy.context.view_layer.update()
    obj.location.x += 0.5
    bpy.context.view_layer.update()
    assert clicks.of(obj) == {}


def test_a_cancelled_click_leaves_the_pick_as_it_was(site, part) -> None:
    places, editing = part("rockfall_addon.scene.places"), part("rockfall_addon.steps.picking.editing")
    obj = pick(site, part, 60, np.array([700.0, 300.0]))
    kept = editing.snapshot(obj)
    camera = camera_of(site, part)
    place = places.in_picture(site, camera, np.array([500.0, 300.0]), "B10")
    editing.make_or_move(site, camera, place, "B10", "impact")
    assert editing.snapshot(obj) != kept
    editing.restore(obj, kept)
    assert editing.snapshot(obj) == kept
    assert np.allclose(obj.location, obj["rockfall_position_m"], atol=1e-5)


def test_grazing_rays_are_warned_of(part) -> None:
    """A camera 2 m above a plane, looking along it."""
    scene = bpy.context.scene
    surface = part("core.terrain.surface").Surface(
        np.array([[-200.0, -200, 0], [200, -200, 0], [200, 200, 0], [-200, 200, 0]]),
        np.array([[0, 1, 2], [0, 2, 3]]), part("core.georeference").GlobalShift(), "plane", (),
    )  # fmt: skip
    part("rockfall_addon.scene.terrain").add_terrain(scene, surface, part("core.terrain.shading").shade(surface))
    new_videos = part("rockfall_addon.scene.new_videos")
    camera_paths = part("rockfall_addon.scene.camera_paths")
    places = part("rockfall_addon.scene.places")
    editing = part("rockfall_addon.steps.picking.editing")
    camera = new_videos.add_video(scene, FOOTAGE / "footage.mp4")
    lens = part("core.camera.model").look_at(1280, 720, (0, -60, 2), (0, 0, 0), focal_px=1000)
    camera_paths.set_camera_path(scene, camera, part("core.camera.path").fixed(lens))
    exact(scene, camera)
    place = places.in_picture(scene, camera, np.array([640.0, 360.0]), "B01", centre=False)
    assert place.grazing_deg == pytest.approx(np.degrees(np.arctan2(2, 60)), abs=1e-6)
    assert "grazes the terrain at 1.9°" in place.warning
    along, across = np.linalg.norm(place.ellipse, axis=1)
    assert along == pytest.approx(60**2 / 2 / 1000, rel=0.01), "distance² / (height · focal length) for 1 px"
    assert across == pytest.approx(60 / 1000, rel=0.01)
    obj, new = editing.make_or_move(scene, camera, place, "B01", "impact")
    assert new
    assert "grazes" in editing.grazing_warning(obj)


def test_without_an_aligned_camera_the_terrain_is_picked(site, part) -> None:
    errors, places = part("core.errors"), part("rockfall_addon.scene.places")
    editing = part("rockfall_addon.steps.picking.editing")
    camera = camera_of(site, part)
    site.frame_set(90)
    part("rockfall_addon.scene.camera_paths").unsolve(camera)
    with pytest.raises(errors.RockfallError, match="not aligned"):
        places.in_picture(site, camera, np.array([640.0, 360.0]), "B10")
    place = places.on_ray(site, np.array([8.0, 60.0, 200.0]), np.array([0.0, 0.0, -1.0]), "B10")
    assert place.time_s == pytest.approx(OFFSET_S + 3.0)
    obj, _ = editing.make_or_move(site, None, place, "B10", "impact")
    assert obj["rockfall_position_m"][:2] == pytest.approx([8.0, 60.0])
    with pytest.raises(errors.RockfallError, match="no terrain under"):
        places.on_ray(site, np.array([9000.0, 0.0, 200.0]), np.array([0.0, 0.0, -1.0]), "B10")


def test_without_a_video_the_scene_is_the_clock(site, part) -> None:
    places, editing = part("rockfall_addon.scene.places"), part("rockfall_addon.steps.picking.editing")
    bpy.data.objects.remove(camera_of(site, part))
    del site["rockfall_time_origin_s"]
    for frame, y in ((30, 60.0), (60, 55.0)):
        site.frame_set(frame)
        place = places.on_ray(site, np.array([8.0, y, 200.0]), np.array([0.0, 0.0, -1.0]), "B01")
        obj, _ = editing.make_or_move(site, None, place, "B01", "impact")
        editing.finish(site, obj)
    rate = site.render.fps / site.render.fps_base
    assert [obj["rockfall_time_s"] for obj in picks_of(site)] == pytest.approx([30 / rate, 60 / rate])
    assert [obj["rockfall_key_frame"] for obj in picks_of(site)] == pytest.approx([30, 60])


def test_two_views_make_one_point(site, part) -> None:
    new_videos = part("rockfall_addon.scene.new_videos")
    clocks = part("rockfall_addon.scene.clocks")
    camera_paths = part("rockfall_addon.scene.camera_paths")
    places = part("rockfall_addon.scene.places")
    pictures, clicks = part("rockfall_addon.scene.pictures"), part("rockfall_addon.scene.clicks")
    editing = part("rockfall_addon.steps.picking.editing")
    model = part("core.camera.model")
    truth = np.array(local(rows("impacts.csv")[3], "x_m", "y_m", "z_m"))
    first = camera_of(site, part)
    second = new_videos.add_video(site, FOOTAGE / "footage.mp4")
    clocks.set_clock(second, part("core.footage.clock").Clock(OFFSET_S))
    lens = model.look_at(1280, 720, np.add(truth, (70, -40, 30)), truth, focal_px=2000)
    lens = replace(lens, shift=part("core.georeference").GlobalShift(*ORIGIN))
    camera_paths.set_camera_path(site, second, part("core.camera.path").fixed(lens))
    frame = round(float(rows("impacts.csv")[3]["time_s"]) * 30)
    site.frame_set(frame)
    for camera in (first, second):
        _, video_s = pictures.picture_time(site, camera)
        pixel = model.project(pictures.posed(camera, video_s), truth[None])[0]
        if camera == second:
            (obj,) = picks_of(site)
            curve = clicks.epipolar(site, obj, second)
            assert np.linalg.norm(curve - pixel, axis=1).min() < 20
            assert clicks.triangulated(site, obj) is None
        place = places.in_picture(site, camera, pixel, "B10")
        obj, new = editing.make_or_move(site, camera, place, "B10", "impact")
        assert new is (camera == first)
    found = clicks.triangulated(site, obj)
    assert np.linalg.norm(found.point[0] - truth) < 1e-3
    assert found.miss_distance[0] < 1e-3
    assert editing.use_triangulated(site, obj) < 1e-3
    assert np.linalg.norm(np.array(obj["rockfall_position_m"]) - truth) == pytest.approx(0.195, abs=0.05)
    assert len(clicks.of(obj)) == 2


def test_the_triangulated_point_has_the_normal_of_the_terrain_there(site, part, numbers) -> None:
    """A normal that came with the pick is of its old place."""
    new_videos = part("rockfall_addon.scene.new_videos")
    clocks = part("rockfall_addon.scene.clocks")
    camera_paths = part("rockfall_addon.scene.camera_paths")
    places = part("rockfall_addon.scene.places")
    pictures, editing = part("rockfall_addon.scene.pictures"), part("rockfall_addon.steps.picking.editing")
    model, raycast = part("core.camera.model"), part("core.terrain.raycast")
    row = rows("impacts.csv")[3]
    truth, moment = np.array(local(row, "x_m", "y_m", "z_m")), float(row["time_s"])
    first = camera_of(site, part)
    second = new_videos.add_video(site, FOOTAGE / "footage.mp4")
    clocks.set_clock(second, part("core.footage.clock").Clock(OFFSET_S))
    lens = model.look_at(1280, 720, np.add(truth, (70, -40, 30)), truth, focal_px=2000)
    lens = replace(lens, shift=part("core.georeference").GlobalShift(*ORIGIN))
    camera_paths.set_camera_path(site, second, part("core.camera.path").fixed(lens))
    add, surface = part("rockfall_addon.scene.picks").add_pick, part("rockfall_addon.scene.reconstruction").ground(site)
    for seconds, away in ((-0.8, 6.0), (0.8, -6.0)):  # so that the impact has both velocities
        place = raycast.closest_points(surface, truth + np.array([0.0, away, 0.0])).point[0]
        add(site, "B10", OFFSET_S + moment + seconds, place)
    site.frame_set(round(moment * 30))
    for camera in (first, second):
        _, video_s = pictures.picture_time(site, camera)
        aim = truth if camera == second else truth + np.array([0.5, 0.0, 0.0])  # the first click lies half a metre off
        place = places.in_picture(site, camera, model.project(pictures.posed(camera, video_s), aim[None])[0], "B10")
        obj, _ = editing.make_or_move(site, camera, place, "B10", "impact")
    obj["rockfall_normal"] = [0.6, 0.0, 0.8]
    old = np.array(obj["rockfall_position_m"])
    editing.use_triangulated(site, obj)
    here = np.array(obj["rockfall_position_m"])
    assert np.linalg.norm(here - old) > 0.2
    normals = part("core.reconstruction.placement").terrain_normals(surface, here[None], np.array([0.39]), None)
    (impact,) = [i for i in site.rockfall_impacts if abs(i.time_s - obj["rockfall_time_s"]) < 1e-4]
    v1, v2 = (np.array(list(numbers(obj)[name])) for name in ("incident_mps", "restituted_mps"))
    assert impact.rn == pytest.approx(abs(v2 @ normals.normal[0]) / abs(v1 @ normals.normal[0]), rel=1e-4)


def test_proposals_are_the_first_picks_of_the_same_project(site, part, tmp_path) -> None:
    """One track and one camera, in the scene and through files: Propose Impacts and rockfall refine begin alike."""
    tracking, exchange = part("core.footage.tracking"), part("core.exchange.project")
    camera = camera_of(site, part)
    block = [row for row in rows("block.csv") if row["visible"] == "1" and float(row["time_s"]) < 5.0]
    pixel = np.array([[float(row["u_px"]), float(row["v_px"])] for row in block])
    frame, time = np.array([int(row["frame"]) for row in block]), np.array([float(row["time_s"]) for row in block])
    one = np.ones(len(block))
    track = tracking.BlockTrack(frame, time, pixel, 0.1 * one, one, pixel, 9 * one, ("", ""))
    part("rockfall_addon.scene.sightings").keep_track(camera, "B10", track)
    site.rockfall_picking.trajectory = "B10"
    assert bpy.ops.rockfall.propose_impacts() == {"FINISHED"}
    made = part("rockfall_addon.scene.picks").picks_of(site)

    size = dict.fromkeys(("d1_m", "d2_m", "d3_m"), 0.39)
    project = exchange.Project(
        terrain=exchange.TerrainSource((DEMO / "terrain.ply",), shift=tuple(ORIGIN)),
        block=exchange.BlockEntry(**size),
        videos=part("rockfall_addon.scene.project_videos").write_videos(site, tmp_path),
    )
    surface = part("core.workflow.opening").open_terrain(project)
    first = part("core.workflow.footage").picks_from_footage(project, surface)
    assert made.kind.tolist() == first.kind.tolist()
    assert made.kind.tolist().count("pass") >= 1, "open flights are closed"
    np.testing.assert_allclose(made.time_s, first.time_s, atol=1e-6)
    np.testing.assert_allclose(made.position, first.position, atol=1e-3)
    np.testing.assert_allclose(made.sigma_time_s, first.sigma_time_s, rtol=1e-3)
    for column in ("video", "frame"):
        assert made.extra[column].tolist() == first.extra[column].tolist()


def test_clicked_and_proposed_observations(site, part) -> None:
    """The true pixels, as a track: its kinks are the true impacts."""
    tracking, sightings = part("core.footage.tracking"), part("rockfall_addon.scene.sightings")
    tracks = part("rockfall_addon.steps.picking.tracks")
    camera = camera_of(site, part)
    block = [row for row in rows("block.csv") if row["visible"] == "1" and float(row["time_s"]) < 5.0]
    pixel = np.array([[float(row["u_px"]), float(row["v_px"])] for row in block])
    frame, time = np.array([int(row["frame"]) for row in block]), np.array([float(row["time_s"]) for row in block])
    one = np.ones(len(block))
    with pytest.raises(part("core.errors").RockfallError, match="It is not known where"):
        tracks.clicks_for(site, camera, "B10")
    sightings.click(camera, "B10", int(frame[3]), float(time[3]), pixel[3] + 0.25, 0.5)
    assert tracks.clicks_for(site, camera, "B10") == [(int(frame[3]), *(pixel[3] + 0.25))]
    site.frame_set(60)
    places, editing = part("rockfall_addon.scene.places"), part("rockfall_addon.steps.picking.editing")
    place = places.in_picture(site, camera, np.array([700.0, 300.0]), "B10", centre=True)
    obj, _ = editing.make_or_move(site, camera, place, "B10", "impact")
    assert (60, 700.0, 300.0) in tracks.clicks_for(site, camera, "B10"), "a pick's click begins a track, too"
    editing.remove(site, obj)
    track = tracking.BlockTrack(frame, time, pixel, 0.1 * one, one, pixel, 9 * one, ("", ""))
    sightings.keep_track(camera, "B10", track)
    seen = sightings.seen_in(camera, "B10")
    assert len(seen) == len(block)
    np.testing.assert_array_equal(seen.pixel[0], pixel[0])
    assert seen.by_hand.sum() == 1
    np.testing.assert_array_equal(seen.pixel[seen.by_hand][0], pixel[3] + 0.25)

    made = tracks.propose(site, camera, "B10")
    truth = np.array([[float(row["time_s"]), float(row["leave_time_s"])] for row in rows("impacts.csv")]).ravel()
    impacts = [obj for obj in made if obj["rockfall_kind"] == "impact"]
    times = np.array([obj["rockfall_time_s"] for obj in impacts]) - OFFSET_S
    assert len(impacts) >= 3
    off = np.abs(truth[:, None] - times[None]).min(axis=0)
    assert off.max() < 0.02, "each proposal is a true impact"
    assert tracks.propose(site, camera, "B10") == [], "those that are there stay"
    assert sightings.clear(camera, "B10") == len(block)
    assert sightings.names_in(camera) == []


def test_operators_tell_what_is_missing(part) -> None:
    scene = bpy.context.scene
    assert not bpy.ops.rockfall.remove_pick.poll()
    assert not bpy.ops.rockfall.drag_pick.poll()
    places = part("rockfall_addon.scene.places")
    with pytest.raises(part("core.errors").RockfallError, match="no terrain to pick on"):
        places.on_ray(scene, np.zeros(3), np.array([0.0, 0, -1]), "B01")


def test_the_block_is_tracked(site, part) -> None:
    """From one rough click, through thirty pictures: the operator as it runs without a window."""
    sightings = part("rockfall_addon.scene.sightings")
    camera = camera_of(site, part)
    site.frame_set(60)
    sightings.click(camera, "B10", 60, 2.0, np.array([862.0, 143.0]), 1.0)
    block = {int(row["frame"]): np.array([float(row["u_px"]), float(row["v_px"])]) for row in rows("block.csv")}
    sightings.click(camera, "B10", 60, 2.0, block[60].round(), 1.0)
    settings = site.rockfall_picking
    settings.trajectory, settings.whole_video, settings.track_frames = "B10", False, 15
    assert bpy.ops.rockfall.track_block() == {"FINISHED"}
    seen = sightings.seen_in(camera, "B10")
    assert len(seen) > 25
    off = np.array([np.hypot(*(seen.pixel[i] - block[int(seen.frame[i])])) for i in range(len(seen))])
    assert np.median(off) < 2.5, "its sunny side is 1 to 2 px from its centre"
    assert seen.frame.min() >= 45
    assert seen.frame.max() <= 75
    alignment, paths = (part(f"rockfall_addon.scene.{name}") for name in ("alignment", "camera_paths"))
    assert alignment.background_remarks(camera) == (), "the camera is known to move"
    held, truth = part("core.camera.path"), paths.camera_path(camera)
    camera.rockfall_alignment.motion = "FIXED"
    paths.set_camera_path(site, camera, held.fixed(truth.reference), rmse_px=1.0)
    (said,) = alignment.background_remarks(camera)
    relative = truth.rotation[(truth.time_s > 44.5 / 30) & (truth.time_s < 75.5 / 30)]
    turned = np.degrees(np.arccos((np.einsum("nij,ij->n", relative, relative[0]) - 1) / 2)).max()
    assert float(said.text.split(" by ")[1].split("°")[0]) == pytest.approx(turned, abs=0.5), "as the demo was filmed"
    assert part("rockfall_addon.scene.next_step").next_step(site).sentence == said.text


def test_near_and_far_ground_that_move_differently_are_told(
    scene: bpy.types.Scene, part, tmp_path: Path, capfd
) -> None:
    rng, film = np.random.default_rng(5), tmp_path / "film.avi"
    far, near = (cv2.GaussianBlur(rng.integers(0, 255, (400, 500, 3), np.uint8), (0, 0), 2) for _ in "ab")
    writer = cv2.VideoWriter(str(film), cv2.VideoWriter_fourcc(*"MJPG"), 30, (400, 300))
    for frame in range(40):
        pan, beyond = 2 * frame, round(8 * np.sin(frame / 6))
        picture = far[:300, pan : pan + 400].copy()
        picture[190:] = near[210 + beyond : 320 + beyond, pan : pan + 400]
        cv2.circle(picture, (30 + 8 * frame, 40 + 4 * frame), 9, (255, 255, 255), -1)
        writer.write(picture)
    writer.release()
    camera = part("rockfall_addon.scene.new_videos").add_video(scene, film)
    scene.camera = camera
    part("rockfall_addon.scene.sightings").click(camera, "B1", 10, 10 / 30, np.array([110.0, 80.0]), 1.0)
    scene.rockfall_picking.trajectory, scene.rockfall_picking.whole_video = "B1", True
    assert bpy.ops.rockfall.track_block() == {"FINISHED"}
    told = capfd.readouterr().out
    assert "B1 is followed through" in told
    assert "Parts of the background move differently, by " in told


def test_the_guide_leads_through_the_synchronisation_of_two_videos(site, part) -> None:
    following, scene = part("rockfall_addon.scene.next_step"), site
    first = part("rockfall_addon.scene.videos").cameras(scene)[0]
    second = part("rockfall_addon.scene.new_videos").add_video(scene, FOOTAGE / "footage.mp4")
    camera_paths = part("rockfall_addon.scene.camera_paths")
    camera_paths.set_camera_path(scene, second, camera_paths.camera_path(first))
    scene.camera = first
    for camera in (first, second):
        step = following.next_step(scene)
        assert step.actions == ("rockfall.mark_event",), step.sentence
        assert bpy.ops.rockfall.mark_event() == {"FINISHED"}
        if camera == first:
            step = following.next_step(scene)
            assert (step.actions, step.video) == (("rockfall.look_through",), second["rockfall_id"])
            bpy.ops.rockfall.look_through(identifier=step.video)
    assert following.next_step(scene).actions == ("rockfall.synchronise_videos",)
    assert bpy.ops.rockfall.synchronise_videos() == {"FINISHED"}
    assert following.PICK_TOOL in following.next_step(scene).actions

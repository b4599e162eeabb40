# SPDX-License-Identifier: GPL-3.0-or-later
"""Refinement of picks that are a little wrong, with pixels made from the demo's truth."""

import csv
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest

DEMO = Path(__file__).resolve().parents[2] / "assets" / "demo"
FOOTAGE = DEMO / "footage"
OFFSET_S = 465.499
ORIGIN = np.array([988400.0, 6375600.0, 1500.0])


def rows(name: str) -> list[dict[str, str]]:
    with (FOOTAGE / "truth" / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def local(row: dict[str, str], *names: str) -> np.ndarray:
    return np.array([float(row[name]) for name in names]) - ORIGIN


@pytest.fixture(scope="session")
def truth() -> list[dict[str, str]]:
    """The true impacts that are in the picture: the first five."""
    return [row for row in rows("impacts.csv") if float(row["time_s"]) > 1.3][:5]


@pytest.fixture
def site(part, truth) -> bpy.types.Scene:
    """Terrain, the true camera, a track of true pixels with 0.3 px of noise, picks 15 cm and 20 ms off."""
    scene = bpy.context.scene
    new_videos = part("rockfall_addon.scene.new_videos")
    clocks = part("rockfall_addon.scene.clocks")
    camera_paths = part("rockfall_addon.scene.camera_paths")
    surface = part("core.terrain.readers").read_terrain(
        DEMO / "terrain.ply", shift=part("core.georeference").GlobalShift(*ORIGIN)
    )
    part("rockfall_addon.scene.terrain").add_terrain(scene, surface, part("core.terrain.shading").shade(surface))
    camera = new_videos.add_video(scene, FOOTAGE / "footage.mp4")
    scene["rockfall_time_origin_s"] = OFFSET_S
    poses = rows("camera.csv")
    place = np.array([local(row, "x_m", "y_m", "z_m") for row in poses])
    turn = np.array([[float(row[f"r{i}{j}"]) for i in "123" for j in "123"] for row in poses]).reshape(-1, 3, 3)
    lens = part("core.camera.model").Camera(
        1280, 720, 2100.0, 2100.0, 640.0, 360.0, position=place[0], rotation=turn[0], shift=surface.shift
    )
    times, nothing = np.array([float(row["time_s"]) for row in poses]), np.zeros(len(poses))
    clocks.set_clock(camera, part("core.footage.clock").Clock(OFFSET_S))
    path = part("core.camera.path").CameraPath(lens, times, place, turn, nothing, nothing)
    camera_paths.set_camera_path(scene, camera, path)
    scene.camera = camera
    scene.rockfall.block_diameter_m = 0.39
    scene.rockfall.normal_radius_m = 0.6

    random = np.random.default_rng(5)
    add = part("rockfall_addon.scene.picks").add_pick
    for row in truth:
        spot = local(row, "contact_x_m", "contact_y_m", "contact_z_m") + random.normal(0, 0.15, 3)
        closest = part("core.terrain.raycast").closest_points(surface, spot).point[0]
        add(scene, "B10", OFFSET_S + float(row["time_s"]) + random.normal(0, 0.02), closest)
    part("rockfall_addon.scene.sync").sync(scene)
    bpy.context.view_layer.update()
    return scene


@pytest.fixture
def tracked(site, part, truth) -> bpy.types.Scene:
    first, last = float(truth[0]["time_s"]), float(truth[-1]["time_s"])
    block = [row for row in rows("block.csv") if row["visible"] == "1" and first < float(row["time_s"]) < last]
    random = np.random.default_rng(3)
    pixel = np.array([[float(row["u_px"]), float(row["v_px"])] for row in block])
    pixel += random.normal(0, 0.3, pixel.shape)
    frame, time = np.array([int(row["frame"]) for row in block]), np.array([float(row["time_s"]) for row in block])
    one = np.ones(len(block))
    track = part("core.footage.tracking").BlockTrack(frame, time, pixel, 0.3 * one, one, pixel, 9 * one, ("", ""))
    (camera,) = part("rockfall_addon.scene.videos").cameras(site)
    site.rockfall_terrain.accuracy_m = 0.02
    camera.rockfall_video.row_time_us = 0.0
    part("rockfall_addon.scene.sightings").keep_track(camera, "B10", track)
    return site


def picks_of(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    found = [obj for obj in scene.objects if obj.get("rockfall_role") == "pick"]
    return sorted(found, key=lambda obj: obj["rockfall_time_s"])


def times_off(scene: bpy.types.Scene, truth) -> np.ndarray:
    """How far the times of the inner picks are from when the block truly touched the ground [s]."""
    time = np.array([obj["rockfall_time_s"] for obj in picks_of(scene)]) - OFFSET_S
    begin, end = (np.array([float(row[name]) for row in truth]) for name in ("time_s", "leave_time_s"))
    return np.maximum(np.maximum(begin - time, time - end), 0.0)[1:-1]


def test_what_is_missing_is_said(site, part) -> None:
    proposal = part("rockfall_addon.scene.proposal")
    assert "Track the block" in proposal.lacking(site)
    assert not bpy.ops.rockfall.refine.poll()
    for obj in picks_of(site):
        bpy.data.objects.remove(obj)
    assert proposal.lacking(site) == "Pick the impacts first."


def test_a_proposal_changes_nothing_until_it_is_applied(tracked, part, truth, numbers) -> None:
    proposal = part("rockfall_addon.scene.proposal")
    before = [list(obj["rockfall_position_m"]) for obj in picks_of(tracked)]
    off = times_off(tracked, truth)
    assert bpy.ops.rockfall.refine() == {"FINISHED"}
    found = proposal.read(tracked)
    assert found.before_px > 3.0
    assert found.after_px < 0.6, "0.3 px of noise on each axis are 0.42 px"
    assert len(found.changes) == 5
    assert [cells[0].split()[0] for cells in found.what_if[:3]] == ["Deviation", "Camera", "Terrain"]
    assert all(cells[1].endswith(" %") for cells in found.what_if)
    assert [cells[0].split()[0] for cells in found.unnoticed[:3]] == ["Camera", "Terrain", "Terrain"]
    assert all(cells[1].endswith(" m") and cells[2].endswith(" %") for cells in found.unnoticed[:3])
    assert not found.stale
    assert [list(obj["rockfall_position_m"]) for obj in picks_of(tracked)] == before
    place, colour, joined = proposal.path(tracked)
    assert len(place) == len(colour) == len(joined) > 50

    assert bpy.ops.rockfall.apply_refinement() == {"FINISHED"}
    assert proposal.read(tracked) is None
    assert times_off(tracked, truth).max() < 0.004 < off.max()
    far = []
    for obj, row in zip(picks_of(tracked), truth, strict=True):
        contact = local(row, "contact_x_m", "contact_y_m", "contact_z_m")
        far.append(np.linalg.norm(np.array(obj["rockfall_position_m"]) - contact))
        assert 0 < obj["rockfall_sigma_position_m"][0] < 0.4
        assert 0 < obj["rockfall_sigma_time_s"][0] < 0.05
    assert np.median(far) < 0.2, "at two of the five the block touches the ground more than once"
    assert tracked.rockfall.flights_join == "centres"
    assert tracked.frame_end >= 299, "the video's length stays"
    result = numbers(picks_of(tracked)[2])
    speed = np.linalg.norm(local(truth[2], "v1x_mps", "v1y_mps", "v1z_mps") + ORIGIN)
    assert np.linalg.norm(list(result["incident_mps"])) == pytest.approx(speed, rel=0.03)
    assert np.isfinite(result["sigma_r"]), "impacts show their errors"
    remarks = part("rockfall_addon.scene.problems").remarks(tracked)
    assert not [remark for remark in remarks if "went wrong" in remark.text]


def test_picks_that_were_changed_meanwhile_are_not_refined(tracked, part) -> None:
    """The fit runs beside Blender: a person goes on with the picks it began with."""
    proposal, fitting = part("rockfall_addon.scene.proposal"), part("rockfall_addon.steps.refinement.fitting")
    work = fitting.work(tracked, None, [])
    found = work.compute(lambda *_: None)
    picks_of(tracked)[2].location.x += 0.5
    part("rockfall_addon.scene.sync").sync(tracked)
    with pytest.raises(part("core.errors").RockfallError, match="changed while they were refined"):
        work.keep(tracked, found)
    assert proposal.read(tracked) is None


def test_what_is_applied_fits_the_pixels(tracked, part) -> None:
    """Refined once more, nothing moves: the scene's picks are those of the core's result."""
    proposal = part("rockfall_addon.scene.proposal")
    bpy.ops.rockfall.refine()
    first = proposal.read(tracked).changes
    place, _, _ = proposal.path(tracked)
    bpy.ops.rockfall.apply_refinement()
    path = part("rockfall_addon.view.footage_view").path_of(tracked, "B10")
    np.testing.assert_allclose(path.position, place, atol=1e-6)
    bpy.ops.rockfall.refine()
    for before, again in zip(first, proposal.read(tracked).changes, strict=True):
        assert again.moved_cm < 0.25 * before.moved_cm


def test_pixels_of_pictures_without_a_pose_are_not_used(tracked, part) -> None:
    """Where nothing of the background was recognised, the pose is a guess."""
    proposal = part("rockfall_addon.scene.proposal")
    videos = part("rockfall_addon.scene.videos")
    camera_paths = part("rockfall_addon.scene.camera_paths")
    bpy.ops.rockfall.refine()
    whole = proposal.read(tracked)
    (camera,) = videos.cameras(tracked)
    path, lost = camera_paths.camera_path(camera), np.arange(70, 76)
    sigma, place = path.sigma_rotation.copy(), path.position.copy()
    sigma[lost], place[lost] = np.inf, place[lost] + 5.0
    camera_paths.set_camera_path(tracked, camera, replace(path, sigma_rotation=sigma, position=place))
    bpy.ops.rockfall.refine()
    found = proposal.read(tracked)
    assert found.pixels == whole.pixels - lost.size
    assert found.outliers == whole.outliers
    assert found.after_px == pytest.approx(whole.after_px, abs=0.05)
    (said,) = (remark for remark in found.remarks if "pose of the camera" in remark.text)
    assert said.text.startswith(f"{lost.size} pixels are not used: the pose of the camera is not known")
    assert [one.about for one in found.remarks if one != said] == [one.about for one in whole.remarks]


def test_the_guide_says_what_does_not_fit_before_the_pixels(tracked, part) -> None:
    """The block touches the ground twice at one pick, as the demo's simulation knows: the next flight is another."""
    following = part("rockfall_addon.scene.next_step")
    bpy.ops.rockfall.refine()
    step = following.next_step(tracked)
    assert step.sentence.index("is an impact missing there?") < step.sentence.index(" px ")
    assert step.actions[0] == following.PICK_TOOL
    picks_of(tracked)[1].location.z += 0.3
    bpy.context.view_layer.update()
    step = following.next_step(tracked)
    assert "refine again" in step.sentence
    assert "rockfall.apply_refinement" not in step.actions


def test_the_guide_tells_of_an_impact_that_the_track_shows_and_the_picks_lack(tracked, part) -> None:
    following = part("rockfall_addon.scene.next_step")
    bpy.ops.rockfall.refine()
    bpy.ops.rockfall.apply_refinement()
    assert following.next_step(tracked).sentence.startswith("Play the fall")
    gone = picks_of(tracked)[1]
    bpy.data.objects.remove(gone)
    bpy.context.view_layer.update()
    part("rockfall_addon.scene.sync").sync(tracked)
    step = following.next_step(tracked)
    assert "px off the flights" in step.sentence
    assert "rockfall.export_tables" not in step.actions


def test_discarding_and_changing(tracked, part) -> None:
    proposal = part("rockfall_addon.scene.proposal")
    kept = [dict(obj.items()).keys() for obj in picks_of(tracked)]
    bpy.ops.rockfall.refine()
    bpy.ops.rockfall.discard_refinement()
    assert proposal.read(tracked) is None
    assert [dict(obj.items()).keys() for obj in picks_of(tracked)] == kept
    assert not [key for key in tracked.keys() if "proposal" in key]  # noqa: SIM118 - a scene is no dictionary

    bpy.ops.rockfall.refine()
    picks_of(tracked)[1].location.z += 0.3
    bpy.context.view_layer.update()
    assert proposal.read(tracked).stale
    with pytest.raises(RuntimeError, match="were changed since"):
        bpy.ops.rockfall.apply_refinement()


def test_gravity_can_be_checked(tracked, part) -> None:
    tracked.rockfall_picking.free = {"gravity"}
    bpy.ops.rockfall.refine()
    (name, value, sigma) = part("rockfall_addon.scene.proposal").read(tracked).unknowns[0]
    assert name == "gravity_mps2"
    assert abs(value - 9.81) < max(4 * sigma, 0.05)
    bpy.ops.rockfall.apply_refinement()
    assert tracked["rockfall_gravity_mps2"] == value


def test_what_is_drawn_over_the_footage(tracked, part, truth) -> None:
    """After refinement the outline lies on the true block, in pixels of a hand-held picture."""
    view, videos = part("rockfall_addon.view.footage_view"), part("rockfall_addon.scene.videos")
    bpy.ops.rockfall.refine()
    bpy.ops.rockfall.apply_refinement()
    (camera,) = videos.cameras(tracked)
    block = {int(row["frame"]): row for row in rows("block.csv")}
    for frame in (60, 75, 100):
        tracked.frame_set(frame)
        drawing = view.draw(tracked, camera, picks_of(tracked)[1])
        seen = np.array([float(block[frame]["u_px"]), float(block[frame]["v_px"])])
        outlines = [line.segments for line in drawing.lines if tuple(line.colour[0, 0, :3]) == view.OUTLINE]
        assert len(outlines) == 1
        assert np.linalg.norm(outlines[0].mean(axis=(0, 1)) - seen) < 1.0
        assert np.ptp(outlines[0][:, 0, 0]) == pytest.approx(9.3, abs=0.6), "39 cm at 88 m"
        assert sum(mark.shape == "ring" for mark in drawing.marks) >= 6
        dots = np.vstack([pixels for pixels, _, size in drawing.dots if size == view.SEEN_SIZE])
        assert np.linalg.norm(dots - seen, axis=1).min() < 1.5
    camera_line = view.path_of(tracked, "B10", None)
    assert camera_line is view.path_of(tracked, "B10", None), "it is kept until the picks change"


def test_sightings_beyond_the_path_are_not_joined_with_it(tracked, part) -> None:
    view, clocks = (part(f"rockfall_addon.{name}") for name in ("view.footage_view", "scene.clocks"))
    (camera,) = part("rockfall_addon.scene.videos").cameras(tracked)
    first, *_, last = picks_of(tracked)
    bpy.data.objects.remove(last)
    part("rockfall_addon.scene.sync").sync(tracked)
    end = picks_of(tracked)[-1]["rockfall_time_s"]
    tracked.frame_set(60)
    lines = view.draw(tracked, camera, first).lines
    joined = [one.segments for one in lines if tuple(one.colour[0, 0]) == (*view.SEEN, 0.8)]
    seen = part("rockfall_addon.scene.sightings").seen_in(camera, "B10")
    common = clocks.clock_of(camera).to_common(seen.time_s)
    within = (common >= first["rockfall_time_s"]) & (common <= end)
    assert 0 < within.sum() < len(seen) - 5
    assert sum(map(len, joined)) == within.sum()


def test_paths_bend_with_the_lens(part) -> None:
    """A straight line in space, through a lens with k1, is curved as OpenCV has it."""
    view, model = part("rockfall_addon.view.footage_view"), part("core.camera.model")
    lens = model.Camera(1280, 720, 1000.0, 1000.0, 640.0, 360.0, k1=-0.2)
    line = np.column_stack([np.linspace(-5, 5, 11), np.full(11, 10.0), np.full(11, 3.0)])
    drawing = view.Drawing()
    view._add_polyline(drawing, lens, line, np.ones((11, 3)), np.arange(11) < 10)
    x, y = line[:, 0] / 10, np.full(11, -0.3)
    stretch = 1 - 0.2 * (x**2 + y**2)
    expected = np.column_stack([640 + 1000 * x * stretch, 360 + 1000 * y * stretch])
    np.testing.assert_allclose(drawing.lines[0].segments[:, 0], expected[:-1], atol=1e-9)


def test_motion_graphs_show_how_far_the_track_lies_from_the_motion(tracked, part, truth) -> None:
    """Far before the refinement, hardly more than the noise of the pixels after it."""
    graphs = part("core.analysis.motion_graphs")
    motion = part("rockfall_addon.scene.motion")

    def residual() -> np.ndarray:
        (course,) = motion.motion_of(tracked).courses
        assert course.has(graphs.RESIDUAL)
        assert course.impact_time_s[0] == pytest.approx(picks_of(tracked)[0]["rockfall_time_s"] - OFFSET_S)
        return course.residuals[0].distance_px

    before = residual()
    assert np.nanmedian(before) > 5.0
    assert bpy.ops.rockfall.refine() == {"FINISHED"}
    assert residual() is not None
    np.testing.assert_array_equal(residual(), before)  # a proposal changes nothing yet
    assert bpy.ops.rockfall.apply_refinement() == {"FINISHED"}
    assert np.nanmedian(residual()) < 2.0
    (camera,) = part("rockfall_addon.scene.videos").cameras(tracked)
    part("rockfall_addon.scene.sightings").clear(camera, "B10")
    assert motion.motion_of(tracked).courses[0].residuals == ()

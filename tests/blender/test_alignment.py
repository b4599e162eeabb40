# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs in the scene, and the camera that is solved from them: the core's, in doubles, through undo and files."""

import shutil
from dataclasses import fields
from functools import partial
from pathlib import Path

import bpy
import numpy as np
import pytest

FOOTAGE = Path(__file__).resolve().parents[2] / "assets" / "demo" / "footage"
PAIRS = FOOTAGE / "pairs.csv"
TRUTH = FOOTAGE / "truth" / "camera.csv"


@pytest.fixture
def scene(part):
    return bpy.context.scene


@pytest.fixture
def aligned(part):
    return part("rockfall_addon.scene.footage.alignment")


@pytest.fixture
def pairs(part):
    return part("rockfall_addon.scene.footage.pairs")


@pytest.fixture
def marking(part):
    return part("rockfall_addon.steps.alignment.marking")


@pytest.fixture
def solving(part):
    return part("rockfall_addon.steps.alignment.solving")


@pytest.fixture
def looking(part):
    return part("rockfall_addon.steps.alignment.looking")


_opened: dict = {}


@pytest.fixture
def camera(part, scene, monkeypatch):
    """The demo's footage, not aligned, in the demo's local frame; its file is read once for all tests."""
    video = part("core.footage.video")
    if not _opened:
        one = video.open_video(FOOTAGE / "footage.mp4")
        _opened.update({field.name: getattr(one, field.name) for field in fields(one)})
    kept = video.Video(**_opened)
    monkeypatch.setattr(part("rockfall_addon.scene.footage.video_files"), "open_video", lambda path, **_: kept)
    part("rockfall_addon.scene.terrain.georeference").write_shift(
        scene, part("core.georeference").GlobalShift(988400, 6375600, 0)
    )
    return part("rockfall_addon.scene.footage.new_videos").add_video(scene, FOOTAGE / "footage.mp4")


@pytest.fixture
def table(part, scene):
    return part("core.exchange.cameras").read_pairs(
        PAIRS, part("rockfall_addon.scene.terrain.georeference").read_shift(scene)
    )


@pytest.fixture
def slope(part, scene):
    """A plane through the demo's control points, roughly: something for rays to meet."""

    def make(table) -> object:
        centre = table.point.mean(axis=0)
        _, _, axes = np.linalg.svd(table.point - centre)
        corners = centre + 80 * np.array([-axes[0] - axes[1], axes[0] - axes[1], axes[0] + axes[1], axes[1] - axes[0]])
        faces = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
        if axes[2][2] < 0:
            faces = faces[:, ::-1].copy()
        surface = part("core.terrain.surface").Surface(corners, faces, table.shift, "plane", ())
        part("rockfall_addon.scene.terrain.terrain").add_terrain(
            scene, surface, part("core.terrain.shading").shade(surface)
        )
        return surface

    return make


def solved_by_core(part, table, rows=slice(None), **options):
    lens = options.pop("camera", None) or part("core.camera.model").Camera(
        1280, 720, 1536.0, 1536.0, 640.0, 360.0, shift=table.shift
    )
    return part("core.camera.resection.resect").resect(
        table.pixel[rows], table.point[rows], 1280, 720, camera=lens, names=table.name[rows].tolist(), **options
    )


def mark_all(marking, scene, camera, table, count) -> None:
    for i in range(count):
        marking.mark(scene, camera, "pixel", table.pixel[i])
        marking.mark(scene, camera, "point", table.point[i])


def test_imported_pairs_give_the_cores_camera(part, scene, aligned, camera, table) -> None:
    assert bpy.ops.rockfall.import_pairs(filepath=str(PAIRS)) == {"FINISHED"}
    found = solved_by_core(part, table)
    moving = part("rockfall_addon.scene.footage.camera_paths").camera_path(camera)
    np.testing.assert_allclose(moving.reference.position, found.camera.position, atol=1e-6)
    np.testing.assert_allclose(moving.reference.rotation, found.camera.rotation, atol=1e-9)
    assert moving.reference.fx == pytest.approx(found.camera.fx, rel=1e-9)
    assert abs(moving.reference.fx - 2100) < 10, "the truth"
    place = np.array([float(cell) for cell in TRUTH.read_text().splitlines()[1].split(",")][2:5])
    assert np.linalg.norm(moving.reference.shift.to_survey(moving.reference.position) - place) < 0.3, "the truth"
    solution = aligned.solution_of(camera)
    assert solution.rmse_px == pytest.approx(found.rmse_px, rel=1e-6)
    rows = camera.rockfall_alignment.rows
    lengths = np.hypot(*found.residual_px.T)
    np.testing.assert_allclose([row.residual_px for row in rows], lengths, rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose([row.residual_m for row in rows], found.residual_m, rtol=1e-4, atol=1e-7)
    assert [row.name for row in rows] == table.name.tolist()
    assert aligned.placement(camera) == "pairs"


def test_the_poses_covariance_is_that_for_the_lens_as_found(part, scene, camera, table) -> None:
    """As the command line writes it; with the lens free the camera could back away while its focal length grows."""
    bpy.ops.rockfall.import_pairs(filepath=str(PAIRS))
    found = solved_by_core(part, table)
    kept = part("rockfall_addon.scene.footage.camera_paths").pose_covariance(camera)
    np.testing.assert_allclose(kept, found.pose_covariance_given_lens, rtol=1e-6)
    along, free = (np.sqrt(np.trace(each[3:, 3:])) for each in (kept, found.pose_covariance))
    assert along < 0.5 * free


def test_blenders_camera_sees_the_points_where_they_were_marked(part, scene, looking, camera, table) -> None:
    from bpy_extras.object_utils import world_to_camera_view
    from mathutils import Vector

    bpy.ops.rockfall.import_pairs(filepath=str(PAIRS))
    looking.look_through(scene, camera)
    bpy.context.view_layer.update()
    views = [world_to_camera_view(scene, camera, Vector(point)) for point in table.point.tolist()]
    seen = np.array([(view.x * 1280, (1 - view.y) * 720) for view in views])
    assert np.sqrt(((seen - table.pixel) ** 2).sum(axis=1).mean()) < 0.6


def test_clicks_in_either_order(part, scene, aligned, pairs, marking, camera, table) -> None:
    one = marking.mark(scene, camera, "pixel", table.pixel[0])
    assert pairs.open_pair(camera).missing == "point"
    assert "terrain" in aligned.hint(scene, camera)
    assert marking.mark(scene, camera, "pixel", table.pixel[1]) == one, (
        "a second click in the picture corrects the first"
    )
    marking.mark(scene, camera, "point", table.point[1])
    assert pairs.open_pair(camera) is None
    other = marking.mark(scene, camera, "point", table.point[0])
    assert pairs.open_pair(camera).missing == "pixel"
    marking.mark(scene, camera, "pixel", table.pixel[0])
    first, second = pairs.pairs_of(camera)
    assert (first.id, second.id) == (one, other)
    assert second.pixel == tuple(table.pixel[0]), "doubles, exactly"
    assert second.point == tuple(table.point[0])
    assert first.colour != second.colour
    assert aligned.placement(camera) == ""


def test_solved_from_the_fifth_pair_on_and_predicted_from_then(
    part, scene, aligned, pairs, marking, camera, table, slope
) -> None:
    surface = slope(table)
    mark_all(marking, scene, camera, table, 4)
    assert not part("rockfall_addon.scene.footage.camera_paths").is_solved(camera)
    assert "1 more" in aligned.hint(scene, camera)
    order = [4, 5, 7]
    for i in order:
        marking.mark(scene, camera, "pixel", table.pixel[i])
        if pairs.open_pair(camera).proposed:
            marking.move(scene, camera, pairs.open_pair(camera).id, "point", table.point[i])
        else:
            marking.mark(scene, camera, "point", table.point[i])
    assert part("rockfall_addon.scene.footage.camera_paths").is_solved(camera)
    assert len([pair for pair in pairs.pairs_of(camera) if pair.is_complete]) == 7
    pair = marking.mark(scene, camera, "pixel", table.pixel[8])
    proposed = pairs.with_id(pairs.pairs_of(camera), pair)
    assert proposed.proposed == "point"
    assert not proposed.is_complete
    moving = part("rockfall_addon.scene.footage.camera_paths").camera_path(camera)
    np.testing.assert_allclose(
        part("core.camera.model").project(moving.reference, [proposed.point])[0], table.pixel[8], atol=1e-6
    )
    near = part("core.terrain.raycast").closest_points(surface, [proposed.point])
    assert near.distance[0] < 1e-3, "on the terrain"
    before = aligned.solution_of(camera).rmse_px
    marking.delete(scene, camera, [pair])
    pair = marking.mark(scene, camera, "point", table.point[8])
    proposed = pairs.with_id(pairs.pairs_of(camera), pair)
    assert proposed.proposed == "pixel"
    assert np.hypot(*(np.array(proposed.pixel) - table.pixel[8])) < 5
    assert aligned.solution_of(camera).rmse_px == pytest.approx(before, rel=1e-9), "a prediction does not count"
    ready = aligned.ready_pairs(scene, camera)
    marking.accept(scene, camera, pair)
    assert pairs.with_id(pairs.pairs_of(camera), pair).is_complete
    assert pairs.open_pair(camera) is None
    assert aligned.solution_of(camera).rmse_px == pytest.approx(before, rel=1e-9), "nor does one that was agreed with"
    assert aligned.ready_pairs(scene, camera) == ready
    assert camera.rockfall_alignment.rows[-1].agreed
    marking.move(scene, camera, pair, "pixel", table.pixel[8])
    assert not camera.rockfall_alignment.rows[-1].agreed
    assert aligned.ready_pairs(scene, camera) == ready + 1, "dragged, it is measured"
    assert aligned.solution_of(camera).rmse_px != pytest.approx(before, rel=1e-9)


def test_what_is_made_with_a_camera_of_five_pairs_says_so(part, scene, camera, marking, table, slope, tmp_path) -> None:
    """In the next step, beside the picks, in the written camera, and in the view whose clicks it covers."""
    slope(table)
    for i in range(5):
        marking.mark(scene, camera, "pixel", table.pixel[i])
        pair = part("rockfall_addon.scene.footage.pairs").open_pair(camera)
        if pair.proposed:
            marking.move(scene, camera, pair.id, "point", table.point[i])
        else:
            marking.mark(scene, camera, "point", table.point[i])
    rests = f"measured with the camera {camera.name} rests on 5 pairs (3 observations more than unknowns)"
    step = part("rockfall_addon.scene.next_step").next_step(scene)
    assert rests in step.sentence
    assert step.actions[0] == "rockfall.align_views"
    problems = part("rockfall_addon.scene.problems")
    problems.update(scene)
    (said,) = [remark for remark in problems.remarks(scene) if rests in remark.text]
    assert said.severity == "advice", "picking need not wait for it"
    bpy.ops.rockfall.export_camera(filepath=str(tmp_path / "camera.toml"))
    written = part("core.exchange.cameras").read_camera(tmp_path / "camera.toml").quality
    assert (written.pairs, written.redundancy) == (5, 3)
    view = part("rockfall_addon.scene.footage.sightings").view_of(camera)
    np.testing.assert_array_equal(view.camera_covariance, written.covariance)
    found = solved_by_core(part, table, slice(0, 5))
    np.testing.assert_allclose(view.camera_covariance, found.whole, rtol=0.02, atol=1e-9)
    bpy.ops.rockfall.import_camera(filepath=str(tmp_path / "camera.toml"))
    assert rests in part("rockfall_addon.scene.next_step").next_step(scene).sentence
    placed = part("rockfall_addon.scene.footage.camera_paths").camera_path(camera).reference
    part("rockfall_addon.steps.alignment.solving").place_by_eye(scene, camera, placed)
    assert rests not in part("rockfall_addon.scene.next_step").next_step(scene).sentence


def test_known_focal_length_needs_four_pairs(part, scene, marking, camera, table) -> None:
    settings = camera.rockfall_alignment
    settings.focal_px = 2100.0
    settings.free_focal = False
    rows = [0, 4, 7, 11]
    for i in rows:
        marking.mark(scene, camera, "pixel", table.pixel[i])
        marking.mark(scene, camera, "point", table.point[i])
    moving = part("rockfall_addon.scene.footage.camera_paths").camera_path(camera)
    assert part("rockfall_addon.scene.footage.camera_paths").is_solved(camera)
    assert moving.reference.fx == 2100.0
    assert settings.focal_mm == pytest.approx(43.2666 * 2100 / np.hypot(1280, 720), rel=1e-5)
    before = moving.reference.position
    settings.focal_px = 2150.0
    after = part("rockfall_addon.scene.footage.camera_paths").camera_path(camera).reference
    assert after.fx == 2150.0
    assert np.linalg.norm(after.position - before) > 0.5, "the camera has gone back"


def test_boxes_of_the_lens(part, scene, aligned, camera, table) -> None:
    bpy.ops.rockfall.import_pairs(filepath=str(PAIRS))
    settings = camera.rockfall_alignment
    focal = aligned.focal_px(camera)
    settings.free_k1 = True
    found = solved_by_core(part, table, free=("f", "k1"))
    assert aligned.lens_of(camera)[4] == pytest.approx(found.camera.k1, rel=1e-5)
    assert aligned.solution_of(camera).sigma["k1"] == pytest.approx(found.sigma["k1"], rel=1e-5)
    settings.free_k1 = False
    assert aligned.lens_of(camera)[4] == 0.0, "a coefficient that is not asked for is not there"
    assert aligned.focal_px(camera) == pytest.approx(focal, rel=1e-9)
    settings.free_focal = False
    assert aligned.focal_px(camera) == pytest.approx(focal, rel=1e-9), "locked where it was found"
    assert "fx" not in aligned.solution_of(camera).sigma


def test_enabled_box_and_wrong_pair(part, scene, aligned, pairs, marking, camera, table) -> None:
    bpy.ops.rockfall.import_pairs(filepath=str(PAIRS))
    rows = camera.rockfall_alignment.rows
    rows[3].enabled = False
    found = solved_by_core(part, table, [i for i in range(14) if i != 3])
    assert aligned.focal_px(camera) == pytest.approx(found.camera.fx, rel=1e-9)
    assert rows[3].residual_px > 0, "it is still checked"
    rows[3].enabled = True
    wrong = pairs.pairs_of(camera)[5]
    marking.move(scene, camera, wrong.id, "pixel", (wrong.pixel[0] + 40, wrong.pixel[1]))
    assert aligned.solution_of(camera).wrong == (wrong.id,)
    assert [row.is_wrong for row in rows].index(True) == 5
    assert [remark.about for remark in aligned.solution_of(camera).remarks][:1] == ["pair T06"]
    rows[5].name = "ledge"
    assert pairs.pairs_of(camera)[5].name == "ledge"


def test_bad_pairs_in_words(part, scene, aligned, pairs, marking, camera, table) -> None:
    errors = part("core.errors")
    with pytest.raises(errors.RockfallError, match="outside of the picture"):
        marking.mark(scene, camera, "pixel", (1300.0, 10.0))
    assert pairs.pairs_of(camera) == []
    line = table.point[0] + np.linspace(0, 10, 6)[:, None] * [1, 2, 0.5]
    for i in range(6):
        marking.mark(scene, camera, "pixel", table.pixel[i])
        marking.mark(scene, camera, "point", line[i])
    assert "line" in aligned.solution_of(camera).problem
    assert not part("rockfall_addon.scene.footage.camera_paths").is_solved(camera)
    marking.delete(scene, camera, [pair.id for pair in pairs.pairs_of(camera)])
    assert "rockfall_pairs" not in camera
    assert len(camera.rockfall_alignment.rows) == 0


def test_file_keeps_the_doubles(part, scene, aligned, pairs, camera, table, tmp_path) -> None:
    bpy.ops.rockfall.import_pairs(filepath=str(PAIRS))
    kept, lens = repr(pairs.pairs_of(camera)), aligned.lens_of(camera).tolist()
    pose = part("rockfall_addon.scene.footage.camera_paths").camera_path(camera).reference.position.tolist()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "aligned.blend"))
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "aligned.blend"), load_ui=False)
    videos, camera_paths = (
        part("rockfall_addon.scene.footage.videos"),
        part("rockfall_addon.scene.footage.camera_paths"),
    )
    again = videos.active_camera(bpy.context.scene)
    assert repr(pairs.pairs_of(again)) == kept
    assert aligned.lens_of(again).tolist() == lens
    assert camera_paths.camera_path(again).reference.position.tolist() == pose
    assert len(again.rockfall_alignment.rows) == 14
    assert aligned.solution_of(again).rmse_px < 0.5


def test_pairs_and_camera_go_through_files(part, scene, aligned, pairs, camera, table, tmp_path) -> None:
    bpy.ops.rockfall.import_pairs(filepath=str(PAIRS))
    assert bpy.ops.rockfall.export_pairs(filepath=str(tmp_path / "pairs.csv")) == {"FINISHED"}
    again = part("core.exchange.cameras").read_pairs(tmp_path / "pairs.csv", table.shift)
    np.testing.assert_allclose(again.point, table.point, atol=1e-8)
    np.testing.assert_array_equal(again.pixel, table.pixel)
    assert again.frame.tolist() == [0] * 14
    assert bpy.ops.rockfall.export_camera(filepath=str(tmp_path / "camera.toml")) == {"FINISHED"}
    file = part("core.exchange.cameras").read_camera(tmp_path / "camera.toml", table.shift)
    camera_paths = part("rockfall_addon.scene.footage.camera_paths")
    solved = camera_paths.camera_path(camera).reference
    np.testing.assert_allclose(file.path.reference.position, solved.position, atol=1e-8)
    assert file.rmse_px == pytest.approx(aligned.solution_of(camera).rmse_px)
    assert len((tmp_path / "pairs_residuals.csv").read_text().splitlines()) == 15
    bpy.ops.rockfall.delete_pair(every=True)
    camera_paths.unsolve(camera)
    assert bpy.ops.rockfall.import_camera(filepath=str(tmp_path / "camera.toml")) == {"FINISHED"}
    np.testing.assert_allclose(camera_paths.camera_path(camera).reference.position, solved.position, atol=1e-8)
    assert aligned.placement(camera) == "file"
    text = (tmp_path / "camera.toml").read_text().replace("width = 1280", "width = 640")
    (tmp_path / "small.toml").write_text(text)
    with pytest.raises(RuntimeError, match="640 × 720 px"):
        bpy.ops.rockfall.import_camera(filepath=str(tmp_path / "small.toml"))


def test_a_camera_and_its_pairs_are_written_together(part, scene, camera, tmp_path, monkeypatch) -> None:
    """Neither of the two files is of another camera than the other, also when one of them cannot be written."""
    from errno import ENOSPC

    bpy.ops.rockfall.import_pairs(filepath=str(PAIRS))
    for name in ("camera.toml", "left bank.toml"):
        assert bpy.ops.rockfall.export_camera(filepath=str(tmp_path / name)) == {"FINISHED"}
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    assert sorted(before) == ["camera.toml", "left bank.toml", "left bank_pairs_residuals.csv", "pairs_residuals.csv"]

    def full(*_: object) -> None:
        raise OSError(ENOSPC, "No space left on device")

    assert bpy.ops.rockfall.delete_pair() == {"FINISHED"}
    monkeypatch.setattr(part("rockfall_addon.steps.alignment.files"), "write_pair_residuals", full)
    with pytest.raises(RuntimeError, match="No space left on device"):
        bpy.ops.rockfall.export_camera(filepath=str(tmp_path / "camera.toml"))
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == before


def test_a_marked_pair_can_be_taken_back(part, scene, aligned, marking, pairs, solving, camera, table) -> None:
    """Pairs, solution, lens and place of the camera are as before, whether it was solved or not."""
    camera_paths = part("rockfall_addon.scene.footage.camera_paths")

    def state() -> tuple:
        path, lens = camera_paths.camera_path(camera), camera.data
        return (
            repr(pairs.pairs_of(camera)), repr(pairs.open_pair(camera)), repr(aligned.solution_of(camera)),
            aligned.placement(camera), path.reference.intrinsics.tolist(), path.position.tolist(),
            path.rotation.tolist(), repr(camera_paths.pose_covariance(camera)),
            [list(row) for row in camera.matrix_world],
            (lens.lens, lens.sensor_width, lens.sensor_fit, lens.shift_x), tuple(camera.lock_location),
            repr([(row.name, row.residual_px) for row in camera.rockfall_alignment.rows]),
        )  # fmt: skip

    camera.location = (3.0, 4.0, 5.0)
    bpy.context.view_layer.update()
    mark_all(marking, scene, camera, table, 4)
    marking.mark(scene, camera, "pixel", table.pixel[4])
    known, before = state(), marking.remember(camera)
    marking.mark(scene, camera, "point", table.point[4])
    assert camera_paths.is_solved(camera)
    marking.restore(scene, camera, before)
    bpy.context.view_layer.update()
    assert state() == known
    assert not camera_paths.is_solved(camera)
    marking.delete(scene, camera, [pair.id for pair in pairs.pairs_of(camera)])
    mark_all(marking, scene, camera, table, 9)
    bpy.context.view_layer.update()
    known, before = state(), marking.remember(camera)
    pair = pairs.pairs_of(camera)[7]
    marking.move(scene, camera, pair.id, "pixel", (pair.pixel[0] + 30, pair.pixel[1]))
    assert repr(aligned.solution_of(camera)) != known[2]
    marking.restore(scene, camera, before)
    bpy.context.view_layer.update()
    assert state() == known


def test_placed_by_eye(part, scene, aligned, solving, camera, table) -> None:
    bpy.ops.rockfall.import_pairs(filepath=str(PAIRS))
    one = part("core.camera.model").look_at(1280, 720, (10, -40, 1540), (20, 60, 1530), focal_px=1000.0)
    solving.place_by_eye(scene, camera, one)
    assert aligned.placement(camera) == "eye"
    assert aligned.focal_px(camera) == 1000.0
    assert np.isnan(aligned.solution_of(camera).rmse_px)
    assert camera.rockfall_alignment.rows[0].residual_px > 5, "the pairs say how far off it is"


def test_camera_that_is_gone(part, scene, aligned, marking, camera) -> None:
    marking.mark(scene, camera, "pixel", (10.0, 10.0))
    bpy.data.objects.remove(camera)
    assert aligned.hint(scene, None) == "Add a video first (step 2)."
    with pytest.raises(RuntimeError, match="Add a video first"):
        bpy.ops.rockfall.import_pairs(filepath=str(PAIRS))


def test_video_that_has_moved(part, scene, aligned, table, tmp_path) -> None:
    part("rockfall_addon.scene.terrain.georeference").write_shift(scene, table.shift)
    file = tmp_path / "clip.mp4"
    shutil.copy(FOOTAGE / "footage.mp4", file)
    camera = part("rockfall_addon.scene.footage.new_videos").add_video(scene, file)
    bpy.ops.rockfall.import_pairs(filepath=str(PAIRS))
    assert aligned.solution_of(camera).rmse_px < 0.5
    file.unlink()
    part("rockfall_addon.scene.footage.video_files").forget_files()
    camera.rockfall_alignment.motion = "ROTATION"
    with pytest.raises(RuntimeError, match=r"clip\.mp4"):
        bpy.ops.rockfall.follow_background()


def test_hand_held_camera_is_followed_and_corrected(
    part, scene, aligned, pairs, marking, camera, table, monkeypatch
) -> None:
    """Each frame's pose is close to the truth, and pairs of another frame bend the path through it.

    A third of the video is followed, to be quick.
    """
    following = part("rockfall_addon.steps.alignment.following")
    monkeypatch.setattr(following, "background_motion", partial(following.background_motion, last=95))
    bpy.ops.rockfall.import_pairs(filepath=str(PAIRS))
    with pytest.raises(RuntimeError, match="stands still"):
        bpy.ops.rockfall.follow_background()
    camera.rockfall_alignment.motion = "ROTATION"
    assert bpy.ops.rockfall.follow_background() == {"FINISHED"}
    camera_paths = part("rockfall_addon.scene.footage.camera_paths")
    known = following.followed(camera)
    assert (known["reference"], known["frames"]) == (0, 300)
    assert not following.is_stale(camera)
    moving = camera_paths.camera_path(camera)
    assert moving.time_s.size == 300
    true = _true_rotations()[:96]
    turned = moving.rotation[:96] @ np.swapaxes(true, 1, 2)
    relative = turned @ turned[0].T
    angle = np.arccos(np.clip((np.trace(relative, axis1=1, axis2=2) - 1) / 2, -1, 1))
    assert np.degrees(angle).max() < 0.1
    scene.frame_set(90)
    middle = part("core.exchange.cameras").read_pairs(FOOTAGE / "pairs_middle.csv", table.shift)
    count = marking.propose_here(scene, camera)
    assert count >= 4
    offered = [pair for pair in pairs.pairs_of(camera) if pair.proposed]
    assert len(offered) == count
    for pair in offered:
        there = middle.pixel[middle.name.tolist().index(pair.name)]
        assert np.hypot(*(np.array(pair.pixel) - there)) < 6
        marking.move(scene, camera, pair.id, "pixel", there)
    assert aligned.solution_of(camera).keys == (90,)
    corrected = camera_paths.camera_path(camera)
    assert not np.allclose(corrected.rotation[90], moving.rotation[90], atol=1e-9)
    np.testing.assert_allclose(corrected.rotation[0], moving.rotation[0], atol=1e-9)
    rows = [row for row in camera.rockfall_alignment.rows if row.frame == 90]
    assert max(row.residual_px for row in rows) < 3


def _true_rotations() -> np.ndarray:
    lines = TRUTH.read_text().splitlines()
    names = lines[0].split(",")
    columns = [names.index(f"r{i}{j}") for i in (1, 2, 3) for j in (1, 2, 3)]
    rows = [[float(line.split(",")[c]) for c in columns] for line in lines[1:]]
    return np.array(rows).reshape(-1, 3, 3)


def test_pairs_that_were_read_wrongly_are_told_what_they_are(part, scene, aligned, camera, tmp_path) -> None:
    """Of a table with u and v exchanged nothing is taken; one that counts v from below solves no camera."""
    head, *rows = PAIRS.read_text(encoding="utf-8").splitlines()
    cells = [row.split(",") for row in rows]
    path = tmp_path / "pairs.csv"
    path.write_text("\n".join([head, *(",".join([v, u, *rest]) for u, v, *rest in cells)]), encoding="utf-8")
    with pytest.raises(RuntimeError, match="With u and v exchanged all pairs lie inside"):
        bpy.ops.rockfall.import_pairs(filepath=str(path))
    upside_down = [",".join([u, str(720 - float(v)), *rest]) for u, v, *rest in cells]
    path.write_text("\n".join([head, *upside_down]), encoding="utf-8")
    bpy.ops.rockfall.import_pairs(filepath=str(path))
    problem = aligned.solution_of(camera).problem
    assert problem
    assert "from the bottom" in problem
    corners = "".join(f"v {x} {y} 1500\n" for x, y in ((988000, 6375000), (989000, 6375000), (988000, 6376000)))
    (tmp_path / "plane.obj").write_text(f"{corners}f 1 2 3\n", encoding="utf-8")
    bpy.ops.rockfall.import_terrain(filepath=str(tmp_path / "plane.obj"))
    assert part("rockfall_addon.scene.next_step").next_step(scene).sentence == problem

# SPDX-License-Identifier: GPL-3.0-or-later
"""A film shows all trajectories, its captions tell the truth at every frame, and the scene can be had back."""

from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector

HEADER = "trajectory,time_s,x_m,y_m,z_m,kind,status,nx,ny,nz\n"
TIMES = (0.0, 0.75, 1.9, 2.4)
PLACES = ((0.0, 0.0, 40.0), (4.1, 0.3, 36.2), (11.3, -0.5, 27.9), (13.9, 0.1, 26.0))


@pytest.fixture
def picks(tmp_path: Path) -> Path:
    """Two runs, the second 3 m beside and 20 s later; only the first one comes to rest."""
    rows = [
        f"{name},{time + later!r},{x!r},{y + aside!r},{z!r},{kind},ok,0.5,0.0,0.8660254037844386"
        for name, later, aside, last in (("A", 0.0, 0.0, "stop"), ("B", 20.0, 3.0, "impact"))
        for time, (x, y, z), kind in zip(TIMES, PLACES, ("release", "impact", "impact", last), strict=True)
    ]
    path = tmp_path / "picks.csv"
    path.write_text(HEADER + "\n".join(rows) + "\n", encoding="utf-8")
    return path


@pytest.fixture
def scene(rockfall, picks: Path) -> bpy.types.Scene:
    scene = bpy.context.scene
    scene.render.fps = 25
    assert bpy.ops.rockfall.import_picks(filepath=str(picks)) == {"FINISHED"}
    return scene


@pytest.fixture
def preset(part):
    return part("core.exchange.project").RenderPreset(
        "tiny", width=64, height=36, fps=25.0, engine="cycles", stagger_s=0.4, time_scale=0.5
    )


def film_objects(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    return [obj for obj in scene.objects if obj.get("rockfall_role") == "film"]


def shape(obj: bpy.types.Object) -> np.ndarray:
    mesh = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    places = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("co", places)
    return places.reshape(-1, 3)


def test_camera_shows_every_point_of_the_trajectories(scene, preset, part) -> None:
    part("rockfall_addon.steps.film.dressing").set_up_film(scene, preset, "cycles")
    bpy.context.view_layer.update()
    motions = part("rockfall_addon.steps.film.motions").motions_of(scene)
    points = np.vstack([motion.position for motion in motions])
    seen = np.array([world_to_camera_view(scene, scene.camera, Vector(point)) for point in points])
    assert seen[:, :2].min() > 0.05
    assert seen[:, :2].max() < 0.95
    assert seen[:, 2].min() > scene.camera.data.clip_start
    assert seen[:, 2].max() < scene.camera.data.clip_end
    # our own projection is Blender's
    view = part("rockfall_addon.steps.film.camera").automatic_view(scene, motions, 64 / 36)
    np.testing.assert_allclose(view.project(points), seen, atol=2e-4)


def test_a_given_camera_stands_in_survey_coordinates(scene, preset, part) -> None:
    from dataclasses import replace

    part("rockfall_addon.scene.terrain.georeference").write_shift(
        scene, part("core.georeference").GlobalShift(1000.0, 2000.0, 0.0)
    )
    placement = part("core.exchange.project").CameraPlacement((1060.0, 2000.0, 30.0), (1000.0, 2000.0, 30.0), 50.0)
    part("rockfall_addon.steps.film.dressing").set_up_film(scene, replace(preset, camera=placement), "cycles")
    bpy.context.view_layer.update()
    np.testing.assert_allclose(scene.camera.matrix_world.translation, (60, 0, 30), atol=1e-4)
    assert np.degrees(scene.camera.data.angle) == pytest.approx(50.0, abs=1e-3)
    np.testing.assert_allclose(world_to_camera_view(scene, scene.camera, Vector((0, 0, 30)))[:2], (0.5, 0.5), atol=1e-4)


def test_captions_say_time_and_speed_of_each_frame(scene, preset, part) -> None:
    part("rockfall_addon.steps.film.dressing").set_up_film(scene, preset, "cycles")
    captions = part("rockfall_addon.steps.film.captions")
    for frame in (0, 7, 31, 77):
        scene.frame_set(frame)
        time = frame * 0.5 / 25  # half speed
        assert scene.frame_current == frame
        speeds = [0.0]
        for motion in part("rockfall_addon.steps.film.motions").motions_of(scene):
            if motion.time_s[0] <= time <= motion.time_s[-1]:
                speeds.append(float(np.interp(time, motion.time_s, motion.speed_mps)))
        for name, text in (
            ("Film time", f"{time:.1f} s"),
            ("Film fastest block", f"fastest block  {max(speeds):.1f} m/s"),
        ):
            shown = scene.objects[name]
            inputs = _inputs(shown)
            size, weight = inputs["Size"].value, inputs["Weight"].value / inputs["Size"].value
            said = captions.caption("expected", text, shown.location[:2], size, align="RIGHT", weight=weight)
            scene.collection.objects.link(said)
            bpy.context.view_layer.update()
            expected, found = shape(said), shape(shown)
            expected, found = expected[1:], found[len(shown.data.vertices) :]  # the loose points of the numbers
            assert expected.shape == found.shape, f"frame {frame}: not {text!r}"
            np.testing.assert_allclose(found, expected, atol=1e-5)
            bpy.data.objects.remove(said)


def _inputs(obj: bpy.types.Object) -> dict:
    modifier = obj.modifiers[0]
    sockets = [item for item in modifier.node_group.interface.items_tree if item.in_out == "INPUT"]
    if not hasattr(modifier, "properties"):
        pytest.skip("reading the values back is written for Blender 5.2")
    return {s.name: getattr(modifier.properties.inputs, s.identifier) for s in sockets if s.name != "Geometry"}


def test_blocks_are_there_while_they_move(scene, preset, part) -> None:
    part("rockfall_addon.steps.film.dressing").set_up_film(scene, preset, "cycles")
    a, b = (scene.objects[f"{name} block"] for name in "AB")
    hidden = {}
    for frame in (0, 19, 21, scene.frame_end):  # B starts at 0.4 s, which is frame 20 at half speed
        scene.frame_set(frame)
        hidden[frame] = (a.hide_render, b.hide_render)
    assert hidden == {0: (False, True), 19: (False, True), 21: (False, False), scene.frame_end: (False, True)}


def test_a_fall_late_in_its_video_is_in_the_first_preview(rockfall, picks: Path, preset, part) -> None:
    """The film of one's own footage may begin long before the fall: its first frame would be an empty slope."""
    rows = [row for row in picks.read_text(encoding="utf-8").splitlines() if not row.startswith("A,")]
    rows.append("C,30,0,9,40,release,ok,0.5,0.0,0.8660254037844386")
    rows.append("C,31,5,9,35,impact,ok,0.5,0.0,0.8660254037844386")
    picks.write_text("\n".join(rows) + "\n", encoding="utf-8")
    scene = bpy.context.scene
    assert bpy.ops.rockfall.import_picks(filepath=str(picks)) == {"FINISHED"}
    scene[part("rockfall_addon.scene.storage.store").TIME_ORIGIN] = 12.0  # a video that began 8 s before the fall
    part("rockfall_addon.scene.footage.sync").recompute(scene)
    part("rockfall_addon.steps.film.dressing").set_up_film(scene, replace(preset, stagger_s=None), "cycles")
    assert scene.frame_current > 0
    assert not scene.objects["B block"].hide_render
    assert scene.objects["C block"].hide_render


def test_trails_and_impact_rings_grow(scene, preset, part) -> None:
    part("rockfall_addon.steps.film.dressing").set_up_film(scene, preset, "cycles")
    counts = []
    for frame in (0, 40, 90, scene.frame_end):
        scene.frame_set(frame)
        counts.append([len(shape(scene.objects[name])) for name in ("A flights", "Film impacts")])
    trail, rings = np.array(counts).T
    assert (np.diff(trail) >= 0).all()
    assert trail[0] < trail[1] < trail[2]
    assert rings.tolist()[0] == 0
    assert rings[-1] == 5 * rings[1]  # the first impact of A at 0.75 s (frame 37.5), five in all


def test_a_ring_for_each_impact_where_and_when_it_was(scene, part) -> None:
    marks = part("rockfall_addon.steps.film.marks").impact_marks(scene, 0.5)
    corners = np.array([vertex.co[:] for vertex in marks.data.vertices]).reshape(-1, 64, 3)
    times = np.array(
        [
            each.value
            for each in marks.data.attributes[part("rockfall_addon.scene.storage.materials").TIME_ATTRIBUTE].data
        ]
    ).reshape(-1, 64)
    impacts = [o for o in scene.objects if o.get("rockfall_role") == "pick" and o["rockfall_kind"] == "impact"]
    assert len(corners) == len(impacts) > 1
    for pick in impacts:
        up = np.array(pick.rotation_quaternion.to_matrix())[:, 2]
        middle = np.array(pick.location) + 0.25 * 0.5 * up
        (i,) = np.flatnonzero(np.linalg.norm(corners.mean(axis=1) - middle, axis=1) < 1e-4)
        outer = np.linalg.norm(corners[i] - middle, axis=1)
        np.testing.assert_allclose(outer, [0.5] * 16 + [0.31] * 16 + [0.61] * 16 + [0.5] * 16, atol=1e-4)
        np.testing.assert_allclose((corners[i] - middle) @ up, 0.0, atol=1e-4)
        np.testing.assert_allclose(times[i], pick["rockfall_key_frame"] / scene.render.fps, atol=1e-4)


def test_set_up_and_removal_leave_the_scene_as_it_was(scene, part) -> None:
    def state() -> dict:
        remembered = part("rockfall_addon.steps.film.remembered")
        owners = {name: remembered.owner(scene, name) for name in remembered.SETTINGS}
        values = {name: getattr(*owner) for name, owner in owners.items()}
        objects = {
            obj.name: (obj.hide_render, tuple(obj.scale), tuple(obj.location), len(obj.modifiers))
            for obj in scene.objects
        }
        curves = sorted(
            (obj.name, curve.data_path)
            for obj in scene.objects
            if obj.get("rockfall_role") == "block"
            for curve in obj.animation_data.action.layers[0].strips[0].channelbags[0].fcurves
        )
        return {"settings": values, "things": objects, "camera": scene.camera, "curves": curves}

    scene.frame_set(3)
    before = state()
    for size in ("preview", "hd"):  # setting up twice is as good as once
        wanted = scene.rockfall_film
        wanted.size, wanted.engine, wanted.time_scale = size, "cycles", 0.5
        assert bpy.ops.rockfall.set_up_film() == {"FINISHED"}
    assert film_objects(scene)
    assert scene.render.resolution_x == 1920
    assert bpy.ops.rockfall.remove_film() == {"FINISHED"}
    assert not film_objects(scene)
    after = state()
    for part_of in before:
        assert after[part_of] == before[part_of]
    assert not bpy.ops.rockfall.remove_film.poll()


def test_film_of_three_frames(scene, preset, part, tmp_path: Path) -> None:
    part("rockfall_addon.steps.film.dressing").set_up_film(scene, preset, "cycles")
    scene.cycles.samples = 1
    path, reported = tmp_path / "film.mp4", []
    part("rockfall_addon.steps.film.render").render_film(scene, path, (10, 12), lambda *done: reported.append(done))
    assert reported == [(what, i, 3) for what in ("Rendering", "Checking the film") for i in (1, 2, 3)]
    assert [file.name for file in tmp_path.iterdir() if file.suffix == ".mp4"] == ["film.mp4"]
    clip = bpy.data.movieclips.load(str(path))
    assert tuple(clip.size) == (64, 36)
    assert clip.frame_duration == 3
    assert clip.fps == pytest.approx(25.0)


def test_a_film_that_is_not_whole_is_refused(scene, preset, part, tmp_path: Path) -> None:
    part("rockfall_addon.steps.film.dressing").set_up_film(scene, preset, "cycles")
    scene.cycles.samples = 1
    render, check, path = part("rockfall_addon.steps.film.render"), part("core.film.check"), tmp_path / "film.mp4"
    render.render_film(scene, path, (10, 12), lambda *_: None)
    with pytest.raises(part("core.errors").RockfallError, match="3 of its 4 frames can be read"):
        check.check_film(path, 4, (64, 36))
    with pytest.raises(part("core.errors").RockfallError, match="64 × 36 pixels instead of 64 × 38"):
        check.check_film(path, 3, (64, 38))
    render.render_picture(scene, tmp_path / "still.png")
    for whole, verify in (
        (path, lambda: check.check_film(path, 3, (64, 36))),
        (tmp_path / "still.png", lambda: check.check_picture(tmp_path / "still.png", (64, 36))),
    ):
        verify()
        whole.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
        with pytest.raises(part("core.errors").RockfallError, match=f"Blender has not made {whole.name} as it should"):
            verify()


def test_frames_beyond_the_film(scene, preset, part, tmp_path: Path) -> None:
    part("rockfall_addon.steps.film.dressing").set_up_film(scene, preset, "cycles")
    render = part("rockfall_addon.steps.film.render")
    with pytest.raises(part("core.errors").InputError, match=r"no frame 100000\. Its last frame is"):
        render.render_film(scene, tmp_path / "film.mp4", (100_000, 100_001), lambda *_: None)


def test_whole_job_in_another_process(picks: Path, tmp_path: Path, part) -> None:
    """`rockfall render` as a user runs it, with Blender as a module."""
    import subprocess
    import sys

    if bpy.app.binary_path:
        pytest.skip("Blender itself renders in its own process")
    project = tmp_path / "project.toml"
    project.write_text(
        'schema = 1\n[picks]\nfile = "picks.csv"\n[[render]]\nname = "tiny"\nwidth = 64\nheight = 36\n'
        f'fps = {60000 / 1001!r}\nengine = "cycles"\nstagger_s = 0.0\n',
        encoding="utf-8",
    )
    command = [sys.executable, "-m", "rockfall.core.cli", "render", str(project), "--preset", "tiny"]
    out = tmp_path / "film"
    done = subprocess.run(
        [*command, "--out", str(out), "--frames", "0-2"], capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert "Rendering: 100 %, 3 of 3" in done.stderr
    assert done.stdout.splitlines()[0] == "64×36, rendered with Cycles"
    clip = bpy.data.movieclips.load(str(out / "rockfall.mp4"))
    assert (clip.frame_duration, round(clip.fps, 5)) == (3, 59.94006)
    opencv = part("core.opencv").opencv()
    header = opencv.VideoCapture(str(out / "rockfall.mp4")).get(opencv.CAP_PROP_FPS)
    assert header == pytest.approx(60000 / 1001, rel=1e-12)

    (tmp_path / "picks.csv").write_text(HEADER + "A,zero,0,0,0,impact,ok,,,\n", encoding="utf-8")
    bad = subprocess.run(
        [*command, "--out", str(tmp_path / "other")], capture_output=True, text=True, check=False, timeout=300
    )
    assert bad.returncode == 1
    assert "picks.csv, row 2" in bad.stderr
    assert not (tmp_path / "other").exists()


@pytest.fixture
def small_film(scene, part):
    """A scene that is set up for a film of few frames, each of few pixels."""
    film = scene.rockfall_film
    film.size, film.engine, film.time_scale = "preview", "cycles", 20.0
    assert bpy.ops.rockfall.set_up_film() == {"FINISHED"}
    scene.cycles.samples, scene.render.resolution_percentage = 1, 10
    scene.frame_start, scene.frame_end = 2, 4
    return film


def test_the_file_of_a_film_has_a_name(scene, small_film, part, tmp_path: Path) -> None:
    properties = part("rockfall_addon.steps.film.properties")
    assert Path(small_film.file).name == "rockfall.mp4"
    folder = tmp_path / "films"
    folder.mkdir()
    for asked, name in (
        (str(folder), "films/rockfall.mp4"), (f"{tmp_path}/new/", "new/rockfall.mp4"), (f"{tmp_path}/a.b", "a.b.mp4"),
        (f"{tmp_path}/fall.MP4", "fall.MP4"),
    ):  # fmt: skip
        small_film.file = asked
        assert properties.file_of(scene) == tmp_path / name == Path(small_film.file)
    small_film.file = " "
    assert properties.file_of(scene).name == "rockfall.mp4"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "site.blend"))
    assert small_film.file == "//site.mp4"
    assert properties.file_of(scene) == tmp_path / "site.mp4"


def test_settings_are_in_the_blend(rockfall, tmp_path: Path) -> None:
    film = bpy.context.scene.rockfall_film
    film.size, film.engine, film.time_scale, film.graphs = "preview", "cycles", 20.0, "MOTION"
    film.file = "//fall.mp4"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "site.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "site.blend"))
    film = bpy.context.scene.rockfall_film
    assert (film.size, film.engine, film.time_scale, film.graphs, film.file) == (
        "preview", "cycles", 20.0, "MOTION", "//fall.mp4",
    )  # fmt: skip


def test_a_film_that_is_older_than_a_change_is_not_rendered(scene, small_film, part) -> None:
    assert bpy.ops.rockfall.render_film.poll()
    small_film.size = "hd"
    assert not bpy.ops.rockfall.render_film.poll()
    assert bpy.ops.rockfall.set_up_film() == {"FINISHED"}
    assert bpy.ops.rockfall.preview_film.poll()
    pick = next(obj for obj in scene.objects if obj.get("rockfall_kind") == "impact")
    pick.location.z += 0.5
    bpy.context.view_layer.update()
    part("rockfall_addon.scene.footage.sync").sync(scene)
    assert not bpy.ops.rockfall.preview_film.poll()
    assert bpy.ops.rockfall.set_up_film() == {"FINISHED"}
    bpy.data.objects.remove(scene.camera)
    assert not bpy.ops.rockfall.render_film.poll()


def test_a_preview_tells_the_time_and_writes_nothing(scene, small_film, part, tmp_path: Path) -> None:
    stopwatch = part("rockfall_addon.steps.film.stopwatch")
    small_film.file = str(tmp_path / "film.mp4")
    scene.frame_set(3)
    assert not stopwatch.expected(scene)
    assert bpy.ops.rockfall.preview_film() == {"FINISHED"}
    assert scene.frame_current == 3
    assert stopwatch.expected(scene) == "About 5 s for 3 frames on this machine"
    assert not list(tmp_path.glob("*.mp4"))
    small_film.graphs = "MOTION"
    assert not stopwatch.expected(scene)


def test_the_open_scene_becomes_a_film(scene, small_film, part, tmp_path: Path) -> None:
    path, output = tmp_path / "film.mp4", scene.render.filepath
    path.write_bytes(b"an old film")
    small_film.file = str(path)
    assert bpy.ops.rockfall.render_film() == {"FINISHED"}
    part("core.film.check").check_film(path, 3, (64, 36))
    assert scene.render.filepath == output
    assert [file.name for file in tmp_path.glob("*film*")] == ["film.mp4"]
    whole = path.read_bytes()
    small_film.file = str(tmp_path / "no" / "film.mp4")
    with pytest.raises(RuntimeError, match="No film was written"):
        bpy.ops.rockfall.render_film()
    assert path.read_bytes() == whole


def test_an_old_film_stays_where_the_new_one_is_not_whole(scene, small_film, part, tmp_path: Path, monkeypatch) -> None:
    """Blender says nothing on a full disk: what it has written is looked at."""
    path, progress = tmp_path / "film.mp4", part("core.progress")
    path.write_bytes(b"an old film")
    small_film.file = str(path)
    error = part("core.errors").RockfallError

    def half(command: list[str], name: str, *_: object) -> None:
        raise error(f"Blender has not made {name} as it should be: 1 of its 3 frames can be read.")

    def stopped(*_: object) -> None:
        raise progress.CancelledError

    beside, maker = part("rockfall_addon.steps.film.beside"), part("core.film.maker")
    monkeypatch.setattr(maker, "run_job", half)
    with pytest.raises(
        RuntimeError,
        match=r"made film\.mp4 as it should be: 1 of its 3 frames can be read\. The old film\.mp4 is as it was\.",
    ):
        bpy.ops.rockfall.render_film()
    monkeypatch.setattr(maker, "run_job", stopped)
    with pytest.raises(progress.CancelledError):
        beside.film_of(scene, path)(progress.silent)
    assert [(file.name, file.read_bytes()) for file in tmp_path.glob("*film*")] == [("film.mp4", b"an old film")]


def test_a_scene_whose_animation_was_cleared_is_set_up_again(scene, small_film, part) -> None:
    """Clear Animation takes the keys of the blocks, and the drivers of captions and background."""
    small_film.size = "preview"
    scene.render.resolution_percentage = 100
    assert bpy.ops.rockfall.set_up_film() == {"FINISHED"}

    def state() -> list[tuple]:
        scene.frame_set(scene.frame_end)
        bpy.context.view_layer.update()
        return [(obj.name, obj.hide_render, np.round(np.array(obj.matrix_world), 5).tolist()) for obj in scene.objects]

    before = state()
    for obj in scene.objects:
        obj.animation_data_clear()
    scene.camera.data.animation_data_clear()
    part("rockfall_addon.scene.footage.sync").sync(scene)
    assert bpy.ops.rockfall.set_up_film() == {"FINISHED"}
    assert sorted(state()) == sorted(before)


def test_a_saved_scene_becomes_what_its_settings_say(scene, part, tmp_path: Path, monkeypatch) -> None:
    """As `rockfall render FILE.blend` makes it: set up where nobody has done it, refused where it is too old."""
    monkeypatch.setattr(part("rockfall_addon.steps.film.engine"), "PICTURE_SAMPLES", 1)
    render, errors, job = (part(name) for name in ("rockfall_addon.steps.film.render", "core.errors", "core.film.job"))
    film, blend = scene.rockfall_film, tmp_path / "site.blend"
    film.size, film.engine, film.time_scale = "preview", "cycles", 20.0
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    still = job.FilmJob("still", blend, tmp_path / "still.png", job.AS_SET_UP, frames=(2, 2))
    render.make(still, lambda *_: None)
    part("core.film.check").check_picture(still.out, (640, 360))
    scene = bpy.context.scene
    assert (scene.frame_current, scene.render.frame_map_old / scene.render.frame_map_new) == (2, 20.0)
    part("rockfall_addon.steps.film.up_to_date").keep(scene)
    scene.rockfall_film.graphs = "MOTION"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    with pytest.raises(errors.InputError, match=r"site\.blend.*Something has changed since the film was set up"):
        render.make(still, lambda *_: None)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    with pytest.raises(errors.InputError, match="no trajectories to film"):
        render.make(still, lambda *_: None)
    blend.write_bytes(b"BLENDER")
    with pytest.raises(errors.InputError, match=r"site\.blend.*cannot open this"):
        render.make(still, lambda *_: None)

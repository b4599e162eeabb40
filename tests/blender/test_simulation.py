# SPDX-License-Identifier: GPL-3.0-or-later
"""Simulated blocks are where the core says, stay so in a saved file, and come again with the same seed."""

from pathlib import Path

import bpy
import numpy as np
import pytest

G = 9.81
MODELS = {"noel_2017", "stevens_1998"}
SINGLE_M = 2e-4
"""Places of single precision, a hundred metres and some seconds away from zero."""


@pytest.fixture
def drawn(scan: bpy.types.Scene, part) -> bpy.types.Scene:
    """A line near the top, from which eight blocks of two models start."""
    points = [np.array([6.0, y, 91.5]) for y in (20.0, 60.0, 100.0)]
    line = part("rockfall_addon.scene.drawn_releases").make(scan, "line", points)
    settings = scan.rockfall_simulation
    settings.source, settings.drawn, settings.number, settings.seed = "DRAWN", line, 8, 3
    settings.models = MODELS
    return scan


def of_role(scene: bpy.types.Scene, role: str) -> dict[str, bpy.types.Object]:
    return {obj["rockfall_model"]: obj for obj in scene.objects if obj.get("rockfall_role") == role}


def places(scene: bpy.types.Scene, obj: bpy.types.Object) -> np.ndarray:
    """(n, 3) where Blender shows the blocks of an object now."""
    graph = bpy.context.evaluated_depsgraph_get()
    return np.array(
        [
            each.matrix_world.copy().translation
            for each in graph.object_instances
            if each.is_instance and each.parent is not None and each.parent.original == obj
        ]
    ).reshape(-1, 3)


def exact(part, scene: bpy.types.Scene) -> dict[str, object]:
    """What the core simulates from the scene's settings, asked directly."""
    setup = part("rockfall_addon.scene.simulation_setup")
    plan = setup.plan(scene)
    return {one.settings.model: one for one in part("core.workflow.simulation").run_scenario(plan.scenario)}


def position_at(part, simulation, run: int, time_s: float) -> np.ndarray | None:
    """The centre of a block by its records alone; None on the ground, for which there is no closed form here."""
    engine = part("core.simulation.engine")
    records = simulation.records
    rows = np.flatnonzero(records.run == run)
    if time_s >= records.time_s[rows[-1]]:
        return records.position[rows[-1]] if simulation.at_rest[run] else None
    row = rows[np.searchsorted(records.time_s[rows], time_s, side="right") - 1]
    if engine.ON_GROUND in (records.what[row], records.what[row + 1]) or records.what[row + 1] == engine.ENDED:
        return None
    after = time_s - records.time_s[row]
    return records.position[row] + records.v2[row] * after - [0.0, 0.0, 0.5 * G * after**2]


def check_motion(part, scene: bpy.types.Scene, simulations: dict[str, object]) -> None:
    rate, seen = scene.render.fps / scene.render.fps_base, 0
    scene.rockfall.block_scale = 1.0  # larger ones are lifted
    blocks = of_role(scene, "simulated_blocks")
    assert blocks.keys() == simulations.keys()
    for frame in (*range(0, 61, 3), 101, 170, 900, 5000):
        scene.frame_set(frame)
        for model, simulation in simulations.items():
            shown = places(scene, blocks[model])
            for run in range(len(simulation)):
                where = position_at(part, simulation, run, frame / rate)
                if where is not None:
                    assert np.linalg.norm(shown - where, axis=1).min() < SINGLE_M
                    seen += 1
            gone = ~simulation.at_rest & (simulation.time_s < frame / rate - 1e-3)
            assert len(shown) == len(simulation) - gone.sum(), "one block for each run, until it has left"
    assert seen > 40, "eight are in flight at times, and all lie at the end"


def test_blocks_are_where_the_core_says_at_every_frame_rate(drawn: bpy.types.Scene, part) -> None:
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    simulations = exact(part, drawn)
    check_motion(part, drawn, simulations)
    drawn.render.fps, drawn.render.fps_base = 30000, 1001.0
    check_motion(part, drawn, simulations)


def test_a_saved_file_shows_the_same_and_simulates_the_same_again(drawn: bpy.types.Scene, part, tmp_path: Path) -> None:
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    simulations = exact(part, drawn)
    before = {model: path_points(obj) for model, obj in of_role(drawn, "simulated_paths").items()}
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "kept.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "kept.blend"))
    scene = bpy.context.scene
    check_motion(part, scene, simulations)
    assert not part("rockfall_addon.scene.simulation_setup").is_stale(scene)
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    again = {model: path_points(obj) for model, obj in of_role(scene, "simulated_paths").items()}
    for model, points in before.items():
        np.testing.assert_array_equal(again[model], points)
    scene.rockfall_simulation.seed = 4
    assert part("rockfall_addon.scene.simulation_setup").is_stale(scene)
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    other = path_points(of_role(scene, "simulated_paths")["noel_2017"])
    assert other.shape != before["noel_2017"].shape or not np.array_equal(other, before["noel_2017"])


def path_points(obj: bpy.types.Object) -> np.ndarray:
    values = np.empty(3 * len(obj.data.points), dtype=np.float32)
    obj.data.attributes["position"].data.foreach_get("vector", values)
    return values.reshape(-1, 3)


def test_numbers_of_a_run_are_those_of_the_core(drawn: bpy.types.Scene, part) -> None:
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    simulation = exact(part, drawn)["stevens_1998"]
    settings = drawn.rockfall_simulation
    settings.run_model, settings.run = "stevens_1998", 5
    rows = dict(part("rockfall_addon.scene.simulation").selected_run(drawn))
    way = simulation.position[4] - simulation.releases.position[4]
    assert rows["Run"] == "5 of 8"
    assert rows["Release"] == "Release line"
    assert rows["Run-out in plan"] == f"{np.hypot(*way[:2]):.1f} m"
    assert rows["Greatest speed"] == f"{simulation.v_max_mps[4]:.1f} m/s"
    assert rows["Impacts"] == str(simulation.impacts[4])
    assert bpy.ops.rockfall.next_run(step=-1) == {"FINISHED"}
    assert settings.run == 4
    settings.run = 9
    assert part("rockfall_addon.scene.simulation").selected_run(drawn) is None, "there are eight"


def test_what_decides_is_told_when_it_has_changed(drawn: bpy.types.Scene, part) -> None:
    stale = part("rockfall_addon.scene.simulation_setup").is_stale
    assert not stale(drawn), "nothing is shown yet"
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    assert not stale(drawn)
    settings = drawn.rockfall_simulation
    settings.friction = 0.7
    assert stale(drawn)
    settings.friction = 0.5
    assert not stale(drawn)
    settings.drawn.data.vertices[0].co.x += 1.0
    assert stale(drawn)
    settings.drawn.data.vertices[0].co.x -= 1.0
    drawn.rockfall_parameters.noel_2017.rn_limit = 1.5
    assert stale(drawn)
    assert bpy.ops.rockfall.reset_parameter(model="noel_2017", parameter="rn_limit") == {"FINISHED"}
    assert not stale(drawn)
    terrain = next(obj for obj in drawn.objects if obj.get("rockfall_role") == "terrain")
    terrain.location.z += 0.1
    bpy.context.view_layer.update()
    assert stale(drawn)


def test_parameters_are_the_scenes_own(drawn: bpy.types.Scene, part) -> None:
    models = part("rockfall_addon.scene.models")
    group = drawn.rockfall_parameters.noel_2017
    group.rt = 0.35
    group.transfer_basis = "energy"
    assert models.parameters_of(drawn) == {"noel_2017": {"rt": 0.35, "transfer_basis": "energy"}}, "in full digits"
    scenario = part("rockfall_addon.scene.simulation_setup").plan(drawn).scenario
    assert scenario.models["noel_2017"] == {"rt": 0.35, "transfer_basis": "energy"}
    group.rt = 5e9
    spec = part("core.impact_models.registry").MODELS["noel_2017"].parameter("rt")
    assert models.parameters_of(drawn)["noel_2017"]["rt"] == spec.maximum
    assert bpy.ops.rockfall.reset_parameter(model="noel_2017") == {"FINISHED"}
    assert models.parameters_of(drawn) == {}
    assert group.rt == pytest.approx(spec.default)


def test_measured_blocks_start_beside_the_real_ones(part) -> None:
    assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
    scene = bpy.context.scene
    settings = scene.rockfall_simulation
    settings.models, settings.number = {"noel_2017", "observed"}, 1
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    blocks = of_role(scene, "simulated_blocks")["noel_2017"]
    assert settings.source == "MEASURED"
    size = scene.rockfall.block_scale
    for playback in ("TOGETHER", "REAL"):
        scene.rockfall.playback = playback
        real = {o["rockfall_trajectory"]: o for o in scene.objects if o.get("rockfall_role") == "block"}
        offsets = part("rockfall_addon.scene.timing").kept_offsets(scene)
        result = part("rockfall_addon.scene.reconstruction").reconstruct_scene(scene)
        for name in ("B01", "B05"):
            first = result.picks.time_s[result.picks.trajectory == name].min() - offsets[name] + 0.2
            frame = first * scene.render.fps / scene.render.fps_base
            scene.frame_set(int(frame), subframe=frame % 1)
            block = real[name]
            away = np.linalg.norm(places(scene, blocks) - np.array(block.matrix_world.translation), axis=1)
            radius = block.scale.x / size
            assert away.min() < 3 * radius, "it has just left with the measured velocity, its centre off the ground"


def test_one_pick_can_be_the_source(part) -> None:
    assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
    scene = bpy.context.scene
    settings = scene.rockfall_simulation
    settings.source, settings.number = "PICK", 3
    assert not bpy.ops.rockfall.simulate.poll(), "nothing is selected"
    pick = next(
        obj for obj in scene.objects if obj.get("rockfall_kind") == "impact" and obj["rockfall_trajectory"] == "B03"
    )
    bpy.context.view_layer.objects.active = pick
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    blocks = of_role(scene, "simulated_blocks")["noel_2017"]
    starts = np.array([vertex.co for vertex in blocks.data.vertices])
    assert np.linalg.norm(starts - np.array(pick["rockfall_position_m"]), axis=1).min() < 0.5
    begin = part("rockfall_addon.scene.simulation").release_begins(scene, blocks)
    offset = part("rockfall_addon.scene.timing").kept_offsets(scene)["B03"]
    np.testing.assert_allclose(begin, pick["rockfall_time_s"] - offset)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda s: setattr(s, "drawn", None), "Draw where blocks start"),
        (lambda s: setattr(s, "source", "MEASURED"), "Nothing is measured yet"),
        (lambda s: setattr(s, "models", set()), "at least one model"),
        (lambda s: setattr(s, "models", {"observed"}), "needs measured impacts"),
    ],
)
def test_what_is_missing_is_said_before(drawn: bpy.types.Scene, part, change, words: str) -> None:
    change(drawn.rockfall_simulation)
    assert words in part("rockfall_addon.scene.simulation_setup").missing(drawn)
    assert not bpy.ops.rockfall.simulate.poll()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda s: setattr(s, "steeper_than_deg", 85.0) or setattr(s, "source", "STEEP"), "No terrain is steeper"),
        (lambda s: setattr(s.drawn, "location", (5000.0, 0.0, 0.0)), "outside of the terrain"),
        (lambda s: setattr(s, "diameter_m", 500.0), "larger than the terrain"),
        (lambda s: setattr(s, "number", 40_000), "too many to be shown"),
    ],
)
def test_what_cannot_be_is_refused_in_words_and_changes_nothing(drawn: bpy.types.Scene, change, words: str) -> None:
    change(drawn.rockfall_simulation)
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError, match=words):
        bpy.ops.rockfall.simulate()
    assert not of_role(drawn, "simulated_blocks")


def test_a_deleted_terrain_leaves_what_is_shown_and_says_so(drawn: bpy.types.Scene, part) -> None:
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    bpy.data.objects.remove(next(obj for obj in drawn.objects if obj.get("rockfall_role") == "terrain"))
    assert len(of_role(drawn, "simulated_blocks")) == 2
    assert part("rockfall_addon.scene.simulation_setup").is_stale(drawn)
    assert bpy.types.ROCKFALL_PT_simulation.poll(bpy.context)
    assert bpy.ops.rockfall.remove_simulation() == {"FINISHED"}
    assert not bpy.types.ROCKFALL_PT_simulation.poll(bpy.context)


def test_without_terrain_there_is_nothing_to_fall_on(drawn: bpy.types.Scene) -> None:
    terrain = next(obj for obj in drawn.objects if obj.get("rockfall_role") == "terrain")
    bpy.data.objects.remove(terrain)
    assert not bpy.ops.rockfall.simulate.poll()


def test_a_cancel_keeps_what_is_finished_and_says_so(drawn: bpy.types.Scene, part) -> None:
    setup, errors = part("rockfall_addon.scene.simulation_setup"), part("core.progress")
    drawn.rockfall_simulation.number = 400
    plan = setup.plan(drawn)

    def stop(text: str, done: int, total: int) -> None:
        if done >= 500:  # in the second model
            raise errors.CancelledError

    found = setup.run(plan, stop)
    prepared, remarks = found.prepared, found.remarks
    assert prepared[0].model == "noel_2017"
    assert "Stopped by you" in remarks[0].text
    part("rockfall_addon.scene.simulation").show_prepared(drawn, prepared, plan.origins)
    setup.keep(drawn, plan.said, remarks)
    assert "Stopped by you" in setup.remarks(drawn)[0].text
    counts = {model: len(obj.data.curves) for model, obj in of_role(drawn, "simulated_paths").items()}
    assert counts["noel_2017"] == 400
    assert counts.get("stevens_1998", 0) < 400


def test_removing_leaves_nothing(drawn: bpy.types.Scene) -> None:
    before = {kind: len(getattr(bpy.data, kind)) for kind in ("objects", "meshes", "hair_curves", "collections")}
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    assert len(of_role(drawn, "simulated_blocks")) == 2
    assert bpy.ops.rockfall.remove_simulation() == {"FINISHED"}
    after = {kind: len(getattr(bpy.data, kind)) for kind in before}
    assert after == before | {"meshes": after["meshes"]}
    assert {mesh.name for mesh in bpy.data.meshes if "simulated" in mesh.name} == set()


@pytest.mark.parametrize("kind", ["mesh edges", "face", "bezier", "grease pencil"])
def test_own_drawings_are_read(scan: bpy.types.Scene, part, kind: str) -> None:
    corners = [(10.0, 20.0, 30.0), (20.0, 20.0, 25.0), (20.0, 40.0, 25.0)]
    if kind in ("mesh edges", "face"):
        mesh = bpy.data.meshes.new("own")
        mesh.from_pydata(corners, [(2, 0), (0, 1)] if kind == "mesh edges" else [], [(0, 1, 2)] * (kind == "face"))
        obj = bpy.data.objects.new("own", mesh)
        expected = ("line", [corners[1], corners[0], corners[2]]) if kind == "mesh edges" else ("polygon", corners)
    elif kind == "bezier":
        curve = bpy.data.curves.new("own", "CURVE")
        curve.dimensions = "3D"
        spline = curve.splines.new("POLY")
        spline.points.add(2)
        for point, corner in zip(spline.points, corners, strict=True):
            point.co = (*corner, 1.0)
        spline.use_cyclic_u = True
        obj, expected = bpy.data.objects.new("own", curve), ("polygon", corners)
    else:
        pencil = bpy.data.grease_pencils.new("own")
        drawing = pencil.layers.new("one").frames.new(1).drawing
        drawing.add_strokes([3])
        for point, corner in zip(drawing.strokes[0].points, corners, strict=True):
            point.position = corner
        obj, expected = bpy.data.objects.new("own", pencil), ("line", corners)
    scan.collection.objects.link(obj)
    obj.location.z = 1.0
    bpy.context.view_layer.update()
    found, points = part("rockfall_addon.scene.drawn_releases").read(obj)
    assert found == expected[0]
    assert {tuple(p) for p in points.tolist()} == {(x, y, z + 1.0) for x, y, z in expected[1]}
    if found == "line":
        np.testing.assert_allclose(
            points[[0, -1]][np.argsort(points[[0, -1], 0])],
            sorted([[*expected[1][0][:2], expected[1][0][2] + 1], [*expected[1][-1][:2], expected[1][-1][2] + 1]]),
        )


@pytest.mark.parametrize("source", ["line", "pick", "steep"])
def test_a_project_takes_the_settings_along(part, tmp_path: Path, source: str, request: pytest.FixtureRequest) -> None:
    if source == "pick":
        assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
    else:
        request.getfixturevalue("drawn")
    scene = bpy.context.scene
    settings = scene.rockfall_simulation
    settings.number, settings.seed, settings.friction, settings.rolling = 7, 11, 0.35, "coulomb"
    settings.diameter_law, settings.diameter_m, settings.diameter_second_m = "lognormal", 0.4, 0.2
    settings.models, settings.use_drag = MODELS, True
    if source == "pick":
        settings.source = "PICK"
        of_b03 = [obj for obj in scene.objects if obj.get("rockfall_trajectory") == "B03"]
        bpy.context.view_layer.objects.active = next(o for o in of_b03 if o.get("rockfall_kind") == "impact")
    elif source == "steep":
        settings.source, settings.steeper_than_deg = "STEEP", 33.0
    scene.rockfall_parameters.noel_2017.rt = 0.41
    sources = part("rockfall_addon.scene.simulated_sources")
    stated = sources.entry_of(scene)
    assert bpy.ops.rockfall.export_project(directory=str(tmp_path / "out")) == {"FINISHED"}
    read = part("core.exchange.project").read_project(tmp_path / "out" / "project.toml")
    assert read.simulation.releases == stated.releases
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    assert bpy.ops.rockfall.open_project(filepath=str(tmp_path / "out" / "project.toml")) == {"FINISHED"}
    scene = bpy.context.scene
    again = sources.entry_of(scene)
    if source == "line":
        np.testing.assert_allclose(again.releases.points_m, stated.releases.points_m, atol=1e-4)
    else:
        assert again == stated
    assert (again.models, again.seed, again.friction, again.rolling) == (
        stated.models, stated.seed, stated.friction, stated.rolling,
    )  # fmt: skip
    assert part("rockfall_addon.scene.models").parameters_of(scene)["noel_2017"] == {"rt": 0.41}


def test_tables_are_of_the_shown_runs_in_survey_coordinates(drawn: bpy.types.Scene, part, tmp_path: Path) -> None:
    assert not bpy.ops.rockfall.export_simulation.poll(), "nothing is shown"
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    assert bpy.ops.rockfall.export_simulation(directory=str(tmp_path / "tables")) == {"FINISHED"}
    lines = (tmp_path / "tables" / "runs.csv").read_text(encoding="utf-8").splitlines()
    names = lines[0].split(",")
    assert len(lines) == 1 + 2 * 8
    simulation = exact(part, drawn)["noel_2017"]
    rows = [dict(zip(names, line.split(","), strict=True)) for line in lines[1:]]
    of_model = [row for row in rows if row["model"] == "noel_2017"]
    np.testing.assert_allclose(
        [float(row["x_m"]) for row in of_model], 2_600_000.0 + simulation.position[:, 0], atol=1e-3
    )
    assert {path.name for path in (tmp_path / "tables").iterdir()} == {
        "runs.csv", "impacts.csv", "trajectories.csv", "summary.json",
    }  # fmt: skip
    drawn.rockfall_simulation.seed += 1
    assert not bpy.ops.rockfall.export_simulation.poll(), "what is shown is not what would be written"


def test_blocks_meet_the_points_of_the_terrain_where_that_is_chosen(drawn: bpy.types.Scene, part, tmp_path) -> None:
    """Vertices 2 m apart are too few for blocks of 0.5 m, which is said, and enough for blocks of 12 m."""
    settings = drawn.rockfall_simulation
    settings.models, settings.number = {"noel_2017"}, 4
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    settings.contact = "points"
    assert part("rockfall_addon.scene.simulation_setup").is_stale(drawn)
    with pytest.raises(RuntimeError, match="would hang on single points"):
        bpy.ops.rockfall.simulate()
    settings.diameter_m = 12.0
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    assert "Blocks meet the points of the terrain, 2" in " ".join(
        remark.text for remark in part("rockfall_addon.scene.simulation_setup").remarks(drawn)
    )
    assert bpy.ops.rockfall.export_project(directory=str(tmp_path / "out")) == {"FINISHED"}
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    assert bpy.ops.rockfall.open_project(filepath=str(tmp_path / "out" / "project.toml")) == {"FINISHED"}
    assert bpy.context.scene.rockfall_simulation.contact == "points"


def test_a_seed_that_blender_cannot_hold_is_said(scan: bpy.types.Scene, part) -> None:
    """A property of Blender has 32 bits, a project 63."""
    entry, sources = (
        part("core.exchange.simulation_entry").SimulationEntry,
        part("rockfall_addon.scene.simulated_sources"),
    )
    scan.rockfall_simulation.seed = 5
    assert "the seed 2147483648, which is above 2147483647" in sources.keep_entry(scan, entry(seed=2**31))
    assert scan.rockfall_simulation.seed == 5
    assert sources.keep_entry(scan, entry(seed=2**31 - 1)) == ""
    assert scan.rockfall_simulation.seed == 2**31 - 1


def test_the_mesh_is_checked_where_that_is_asked_for(drawn: bpy.types.Scene, part) -> None:
    def of_mesh() -> list[str]:
        assert bpy.ops.rockfall.simulate() == {"FINISHED"}
        found = part("rockfall_addon.scene.simulation_setup").remarks(drawn)
        return [one.text for one in found if "divided" in one.text]

    assert not of_mesh()
    drawn.rockfall_simulation.check_mesh = True
    plan = part("rockfall_addon.scene.simulation_setup").plan(drawn)
    ground = part("core.workflow.simulation").ground_of(plan.scenario)
    check = part("core.workflow.mesh_check")
    changes = check.mesh_changes(plan.scenario, ground, plan.scenario.releases(ground))
    assert {one.model for one in changes} == MODELS
    assert set(of_mesh()) == {one.text for one in check.change_remarks(changes)}
    drawn.rockfall_simulation.contact = "points"
    assert not part("rockfall_addon.scene.simulation_setup").plan(drawn).check_mesh, "points have no mesh"


@pytest.mark.parametrize(("contact", "diameter"), [("mesh", 0.5), ("points", 12.0)])
def test_the_exported_project_is_the_same_scenario(scan: bpy.types.Scene, part, tmp_path, contact, diameter) -> None:
    settings = scan.rockfall_simulation
    settings.source, settings.steeper_than_deg, settings.number, settings.seed = "STEEP", 33.0, 6, 5
    settings.contact, settings.diameter_m, settings.models = contact, diameter, MODELS
    settings.trees, settings.stems_per_hectare = "DRAWN", 200.0
    scan.rockfall_parameters.noel_2017.rt = 0.41
    shown = exact(part, scan)
    assert bpy.ops.rockfall.export_project(directory=str(tmp_path / "out")) == {"FINISHED"}
    file = tmp_path / "out" / "project.toml"
    project = part("core.exchange.project").read_project(file)
    scenario, _ = part("core.workflow.scenarios").open_simulation(project, file)
    stated = {one.settings.model: one for one in part("core.workflow.simulation").run_scenario(scenario)}
    assert stated.keys() == shown.keys() == MODELS
    for model, one in stated.items():
        assert len(one) == len(shown[model]) == 6
        np.testing.assert_array_equal(one.position, shown[model].position)
        np.testing.assert_array_equal(one.settings.trees.position, shown[model].settings.trees.position)

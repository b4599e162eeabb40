# SPDX-License-Identifier: GPL-3.0-or-later
"""All that counts is in the .blend, to the last double, and survives what people do to files."""

import json
import re
from pathlib import Path

import bpy
import numpy as np
import pytest

SHIFT = (2600000.0, 1200000.0, 400.0)
SLOPE = 0.7
BLOCK = (0.41, 0.375, 0.3333333333333333, 2712.5)


def ground(x: float) -> float:
    return 50.0 - SLOPE * x


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A project in survey coordinates, with numbers that single precision does not hold."""
    folder = tmp_path / "site"
    folder.mkdir()
    corners = [
        (SHIFT[0] + x, SHIFT[1] + y, SHIFT[2] + ground(x)) for x, y in ((-10, -20), (60, -20), (60, 30), (-10, 30))
    ]
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in corners) + "f 1 2 3\nf 1 3 4\n"
    (folder / "terrain.obj").write_text(text, encoding="utf-8")
    rows = ["trajectory,time_s,x_m,y_m,z_m,kind,status,sigma_position_m,confidence,crew"]
    for name, later, y in (("A", 0.0, 0.123456789), ("B" * 70, 30.0, 5.0)):
        kinds = ("release", "impact", "impact", "impact", "stop")
        times, along = (10.0, 10.7312, 11.90017, 12.4, 13.0), (0.0, 4.1, 12.3, 16.2, 19.7)
        for time, x, kind in zip(times, along, kinds, strict=True):
            place = ",".join(repr(float(v)) for v in (SHIFT[0] + x, SHIFT[1] + y, SHIFT[2] + ground(x)))
            rows.append(f"{name},{time + later!r},{place},{kind},ok,{'0.05' if name == 'A' else ''},2,Ana")
    (folder / "picks.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    (folder / "project.toml").write_text(
        "schema = 1\n"
        '[site]\nname = "Test"\ndescription = "A plane"\n'
        f'[terrain]\nfile = "terrain.obj"\nshift = {list(SHIFT)}\ncrs = "EPSG:2056"\n'
        '[picks]\nfile = "picks.csv"\n'
        "[block]\nd1_m = {0}\nd2_m = {1}\nd3_m = {2}\ndensity_kgpm3 = {3}\n".format(*BLOCK)
        + '[[blocks]]\nname = "A"\nd1_m = 0.5\n'
        "[reconstruction]\nnormal_radius_m = 0.6123456789\ngravity_mps2 = 9.80665\nair_density_kgpm3 = 1.0123456789\n"
        'drag = true\nflights = "centres"\n'
        "[models.noel_2017]\nrn_limit = 0.9\n"
        '[[render]]\nname = "small"\nwidth = 320\nheight = 180\n'
        "[render.camera]\nposition = [2600000.0, 1199950.0, 480.0]\ntarget = [2600010.0, 1200000.0, 440.0]\n",
        encoding="utf-8",
    )
    return folder / "project.toml"


@pytest.fixture
def scene(part, project: Path) -> bpy.types.Scene:
    part("rockfall_addon.scene.project").load_project(bpy.context.scene, project)
    bpy.context.view_layer.update()
    return bpy.context.scene


def picks_of(scene: bpy.types.Scene, name: str) -> list[bpy.types.Object]:
    found = [o for o in scene.objects if o.get("rockfall_role") == "pick" and o["rockfall_trajectory"] == name]
    return sorted(found, key=lambda o: o["rockfall_time_s"])


def objects(scene: bpy.types.Scene, role: str) -> list[bpy.types.Object]:
    return [o for o in scene.objects if o.get("rockfall_role") == role]


def everything(scene: bpy.types.Scene, part, *, ids: bool = True) -> dict[str, object]:
    """All numbers of the state, and of what is computed from it."""
    picks = part("rockfall_addon.scene.picks").picks_of(scene)
    reconstruction = part("rockfall_addon.scene.reconstruction")
    result = reconstruction.reconstruct_scene(scene)
    settings = reconstruction.project_settings(scene, picks.trajectory.tolist())
    names = ("trajectory", "time_s", "position", "kind", "status", "normal", "sigma_time_s", "sigma_position_m")
    found: dict[str, object] = {name: getattr(picks, name).tolist() for name in names}
    found |= {"extra": {n: v.tolist() for n, v in picks.extra.items()}, "shift": picks.shift}
    found |= {"settings": settings, "models": part("rockfall_addon.scene.models").parameters_of(scene)}
    found |= {"rn": np.round(result.impacts.rn, 9).tolist(), "v1": np.round(result.impacts.v1, 9).tolist()}
    if ids:
        found["ids"] = sorted(o["rockfall_id"] for o in objects(scene, "pick"))
    return json.loads(json.dumps(found, default=repr).replace("NaN", "null"))


def shown(scene: bpy.types.Scene) -> tuple[int, ...]:
    return (*(len(objects(scene, role)) for role in ("pick", "flights", "block")), len(scene.rockfall_impacts))


def edit(scene: bpy.types.Scene) -> None:
    """By hand: a place and a time with all bits."""
    one, other = picks_of(scene, "A")[1:3]
    one.location.y += 0.3
    other.rockfall_pick.time_s = "11.812345678901234"
    bpy.context.view_layer.update()


def save_and_load(path: Path) -> bpy.types.Scene:
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False)
    return bpy.context.scene


def test_save_and_load(scene: bpy.types.Scene, part, tmp_path: Path) -> None:
    edit(scene)
    before = everything(scene, part), shown(scene)
    loaded = save_and_load(tmp_path / "a.blend")
    assert (everything(loaded, part), shown(loaded)) == before
    assert loaded["rockfall_schema"] == 2
    assert before[1] == (10, 2, 2, 6)


def test_a_project_goes_out_and_comes_in_the_same(scene: bpy.types.Scene, part, tmp_path: Path) -> None:
    edit(scene)
    before = everything(scene, part, ids=False)
    assert before["settings"].count("9.80665") == 1
    out = tmp_path / "out"
    assert bpy.ops.rockfall.export_project(directory=str(out)) == {"FINISHED"}
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    assert bpy.ops.rockfall.open_project(filepath=str(out / "project.toml")) == {"FINISHED"}
    assert everything(bpy.context.scene, part, ids=False) == before
    projects = part("rockfall_addon.scene.project")
    again = tmp_path / "again"
    projects.save_project(bpy.context.scene, again)
    for name in ("project.toml", "picks.csv", "terrain.ply"):
        assert (again / name).read_bytes() == (out / name).read_bytes(), name
    read = part("core.exchange.project").read_project(again / "project.toml")
    assert (read.site.name, read.site.description) == ("Test", "A plane")
    assert (read.block.d1_m, read.block.d2_m, read.block.d3_m, read.block.density_kgpm3) == BLOCK
    assert read.render[0].camera.target == (2600010.0, 1200000.0, 440.0)
    assert read.reconstruction.flights == "centres"


def test_the_film_of_the_panel_goes_with_the_project(scene: bpy.types.Scene, part, tmp_path: Path) -> None:
    scene.rockfall_film.size, scene.rockfall_film.engine, scene.rockfall_film.time_scale = "720p", "workbench", 0.25
    scene.rockfall.playback = "REAL"
    path, _ = part("rockfall_addon.scene.project").save_project(scene, tmp_path)
    film = part("core.film.presets").find_preset(part("core.exchange.project").read_project(path), "film")
    assert (film.width, film.height, film.engine, film.time_scale) == (1280, 720, "workbench", 0.25)
    assert film.stagger_s is None
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    assert bpy.ops.rockfall.open_project(filepath=str(path)) == {"FINISHED"}
    asked = bpy.context.scene.rockfall_film
    assert (asked.size, asked.engine, asked.time_scale) == ("720p", "workbench", 0.25)
    assert bpy.context.scene.rockfall.playback == "REAL"


def test_the_command_line_takes_an_exported_project(scene: bpy.types.Scene, part, tmp_path: Path, numbers) -> None:
    out = tmp_path / "out"
    path, _ = part("rockfall_addon.scene.project").save_project(scene, out)
    _, result = part("core.workflow.opening").open_project(part("core.exchange.project").read_project(path))
    stored = [list(numbers(o)["incident_mps"]) for o in picks_of(scene, "A")[1:4]]
    np.testing.assert_allclose(result.impacts.v1[:3], stored, atol=1e-9)


@pytest.mark.parametrize("how", ["object", "collection", "data"])
def test_renamed_things_are_still_ours(scene: bpy.types.Scene, part, how: str) -> None:
    before = everything(scene, part)
    for i, obj in enumerate(o for o in scene.objects if "rockfall_role" in o):
        if how == "object":
            obj.name = f"mine {i}"
        elif how == "data" and obj.data.users == 1:
            obj.data.name = f"mine {i}"
    if how == "collection":
        for i, each in enumerate(bpy.data.collections):
            each.name = f"mine {i}"
    edit(scene)
    assert shown(scene) == (10, 2, 2, 6)
    assert everything(scene, part)["ids"] == before["ids"]
    assert not [o for o in bpy.data.objects if o.name.startswith("A flights") and how == "object"]


@pytest.mark.parametrize("role", ["flights", "block"])
def test_what_is_deleted_by_hand_comes_again(scene: bpy.types.Scene, part, role: str) -> None:
    obj = next(o for o in objects(scene, role) if o["rockfall_trajectory"] == "A")
    bpy.data.objects.remove(obj)
    bpy.context.view_layer.update()
    assert shown(scene) == (10, 2, 2, 6)


def test_a_deleted_marker_mesh_or_group_comes_again(scene: bpy.types.Scene, part) -> None:
    bpy.data.node_groups.remove(bpy.data.node_groups["Rockfall trail"])
    edit(scene)
    part("rockfall_addon.scene.sync").sync(scene, again=True)
    trail = objects(scene, "flights")[0]
    assert trail.modifiers["Trail"].node_group.name == "Rockfall trail"
    bpy.data.meshes["Rockfall impact"].name = "other"
    part("rockfall_addon.scene.sync").sync(scene, again=True)
    assert picks_of(scene, "A")[1].data.name == "Rockfall impact"


def test_a_deleted_collection(scene: bpy.types.Scene, part) -> None:
    """As the outliner does it: what was in it goes to the scene; then even that is taken from the flights."""
    folder = next(c for c in bpy.data.collections if c.get("rockfall_name") == "A")
    for obj in list(folder.objects):
        if obj["rockfall_role"] != "flights":
            scene.collection.objects.link(obj)
    bpy.data.collections.remove(folder)
    bpy.context.view_layer.update()
    assert shown(scene) == (10, 2, 2, 6)
    edit(scene)
    assert shown(scene) == (10, 2, 2, 6)


def folder_of(name: str) -> bpy.types.Collection:
    return next(c for c in bpy.data.collections if c.get("rockfall_name") == name)


def undo(how: str = "undo") -> bpy.types.Scene:
    getattr(bpy.ops.ed, how)()
    return bpy.context.scene


@pytest.mark.parametrize("name", ["Rockfall", "Trajectories", "A"])
def test_a_collection_that_an_undo_leaves_outside_of_the_scene_comes_back(scene: bpy.types.Scene, name: str) -> None:
    """Blender forgets now and then where the collection hung that an undo brings back: here it is made to."""

    def forget(*_unused: object) -> None:
        for parent in (bpy.context.scene.collection, *bpy.context.scene.collection.children_recursive):
            for child in parent.children:
                if child.get("rockfall_name") == name:
                    parent.children.unlink(child)

    before, everything_in = shown(scene), sorted(obj.name for obj in scene.objects)
    bpy.ops.ed.undo_push(message="before")
    bpy.data.collections.remove(folder_of(name))
    bpy.context.view_layer.update()
    bpy.ops.ed.undo_push(message="deleted")
    bpy.app.handlers.undo_post.insert(0, forget)
    try:
        scene = undo()
    finally:
        bpy.app.handlers.undo_post.remove(forget)
    assert shown(scene) == before
    assert sorted(obj.name for obj in scene.objects) == everything_in


def test_a_collection_that_was_taken_out_of_the_scene_stays_out_after_an_undo(scene: bpy.types.Scene, part) -> None:
    bpy.ops.ed.undo_push(message="before")
    scene.collection.children.unlink(folder_of("Rockfall"))
    part("rockfall_addon.scene.sync").sync(scene)
    bpy.ops.ed.undo_push(message="taken out")
    scene.collection.objects.link(bpy.data.objects.new("other", None))
    bpy.ops.ed.undo_push(message="another")
    scene = undo()
    assert "other" not in scene.objects
    assert shown(scene) == (0, 0, 0, 0)
    scene = undo()
    assert shown(scene) == (10, 2, 2, 6)
    assert shown(undo("redo")) == (0, 0, 0, 0)


def test_appended_into_a_scene_with_another_origin_and_rate(part, project: Path, tmp_path: Path) -> None:
    scene = bpy.context.scene
    part("rockfall_addon.scene.project").load_project(scene, project)
    expected = part("rockfall_addon.scene.picks").picks_of(scene)
    survey = expected.shift.to_survey(expected.position)[:5]
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    scene = bpy.context.scene
    scene.render.fps = 50
    shift = part("core.georeference").GlobalShift(2600010.0, 1199990.0, 390.0)
    part("rockfall_addon.scene.georeference").write_shift(scene, shift)
    with bpy.data.libraries.load(str(tmp_path / "a.blend")) as (source, target):
        target.objects = [name for name in source.objects if name.startswith("A ")]
    for obj in target.objects:
        scene.collection.objects.link(obj)
    bpy.context.view_layer.update()
    picks = part("rockfall_addon.scene.picks").picks_of(scene)
    np.testing.assert_array_equal(picks.time_s, expected.time_s[:5])
    np.testing.assert_allclose(picks.shift.to_survey(picks.position), survey, atol=1e-9)
    assert shown(scene)[:3] == (5, 1, 1)
    assert len({o["rockfall_id"] for o in objects(scene, "pick")}) == 5
    frames = [o["rockfall_key_frame"] for o in picks_of(scene, "A")]
    np.testing.assert_allclose(frames, (picks.time_s - picks.time_s[0]) * 50, atol=1e-3)


@pytest.mark.parametrize("kind", ["FULL_COPY", "LINK_COPY"])
def test_a_duplicated_scene_is_edited_alone(scene: bpy.types.Scene, part, kind: str) -> None:
    before = everything(scene, part)
    bpy.ops.scene.new(type=kind)
    other = bpy.context.scene
    assert other != scene
    assert shown(other) == (10, 2, 2, 6)
    edit(other)
    bpy.context.view_layer.update()
    after = everything(other, part)
    assert after["time_s"] != before["time_s"]
    assert shown(scene) == shown(other) == (10, 2, 2, 6)
    if kind == "FULL_COPY":
        assert everything(scene, part) == before
    else:
        assert everything(scene, part) == after


def test_edits_while_rockfall_was_disabled_are_found(part, installation, project: Path) -> None:
    part("rockfall_addon.scene.project").load_project(bpy.context.scene, project)
    scene = bpy.context.scene
    picks_of(scene, "A")[2].location.y += 0.4
    installation.disable()
    scene = bpy.context.scene
    bpy.data.objects.remove(next(o for o in objects(scene, "block") if o["rockfall_trajectory"] == "A"))
    bpy.context.view_layer.update()
    picks_of(scene, "A")[1].location.y += 0.2  # after the update, in which Blender may put keyed objects back
    installation.enable()
    if bpy.app.binary_path:  # registering may not touch the data there: a timer does it, which only a window has
        part("rockfall_addon.scene.sync").sync(scene)
    assert picks_of(scene, "A")[1]["rockfall_position_m"][1] == pytest.approx(0.323456789, abs=1e-6)
    assert shown(scene) == (10, 2, 2, 6)


def make_older(scene: bpy.types.Scene) -> None:
    """As the version without schema numbers left it."""
    blocks = json.loads(scene["rockfall_blocks"])
    scene["rockfall_blocks"] = {name[:60]: values for name, values in blocks.items()}
    for key in ("rockfall_schema", "rockfall_shown", "rockfall_offsets_s", "rockfall_ground"):
        del scene[key]
    for obj in objects(scene, "pick"):
        for key in ("rockfall_key_frame", "rockfall_pick_shift_m"):
            del obj[key]
    for obj in objects(scene, "flights"):
        for name in ("below_terrain", "doubt", "tick"):
            obj.data.attributes.remove(obj.data.attributes[name])
        del obj["rockfall_mass_kg"]
    for row in reversed(range(len(scene.rockfall_impacts))):
        scene.rockfall_impacts.remove(row)
    group = bpy.data.node_groups["Rockfall trail"]
    group.interface.remove(group.interface.items_tree["Ticks"])


def test_a_file_of_the_version_before_is_brought_up_to_date(scene: bpy.types.Scene, part, tmp_path: Path) -> None:
    before = everything(scene, part)
    frames = [o["rockfall_key_frame"] for o in picks_of(scene, "A")]
    handlers = part("rockfall_addon.handlers")
    bpy.app.handlers.save_pre.remove(handlers._saving)
    try:
        make_older(scene)
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    finally:
        bpy.app.handlers.save_pre.append(handlers._saving)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"), load_ui=False)
    scene = bpy.context.scene
    assert scene["rockfall_schema"] == 2
    found = everything(scene, part)
    for name in ("ids", "time_s", "position", "extra", "shift"):
        assert found[name] == before[name], name
    assert found["v1"][:3] == before["v1"][:3]
    assert shown(scene) == (10, 2, 2, 6)
    assert "Ticks" in objects(scene, "flights")[0].modifiers["Trail"].node_group.interface.items_tree
    assert "tick" in objects(scene, "flights")[0].data.attributes
    assert [o["rockfall_key_frame"] for o in picks_of(scene, "A")] == pytest.approx(frames, abs=1e-3)
    edit(scene)
    assert picks_of(scene, "A")[2]["rockfall_time_s"] == 11.812345678901234


def test_a_newer_file_is_left_alone(scene: bpy.types.Scene, part) -> None:
    problems, picks = part("rockfall_addon.scene.problems"), picks_of(scene, "A")
    scene["rockfall_schema"] = 99
    trail = next(o for o in objects(scene, "flights") if o["rockfall_trajectory"] == "A")
    before = [tuple(v.co) for v in trail.data.vertices], list(picks[1]["rockfall_position_m"])
    picks[1].location.y += 0.3
    bpy.context.view_layer.update()
    scene.rockfall.block_diameter_m = 0.9
    scene.render.fps = 50
    bpy.context.view_layer.update()
    assert ([tuple(v.co) for v in trail.data.vertices], list(picks[1]["rockfall_position_m"])) == before
    assert scene["rockfall_schema"] == 99
    assert "newer Rockfall" in problems.remarks(scene)[0].text
    with pytest.raises(RuntimeError, match="newer Rockfall"):
        bpy.ops.rockfall.reconstruct()


LOOK_ONLY = {
    "fit_footage", "go_to_pair", "impact_table", "open_workspace", "show_impact", "show_relief", "sort_impacts",
    "step_frame", "show_result", "stop_job", "dismiss_problem", "open_graphs",
    "open_graphs_workspace", "open_motion_graphs",
    "point_in_graph", "leave_graphs", "press_in_motion", "graph_menu", "zoom_graph", "pan_graph", "reset_graphs",
    "show_all_points", "maximise_graph", "save_parameters", "test_groups", "point_in_strip", "leave_strip", "open_keys",
    "frame_trajectory", "select_set_aside", "go_to_spin_mark",
}  # fmt: skip


def test_every_operator_refuses_a_newer_file_in_the_same_words(scene: bpy.types.Scene, part) -> None:
    operators = {name.removeprefix("ROCKFALL_OT_") for name in dir(bpy.types) if name.startswith("ROCKFALL_OT_")}
    assert len(operators) > 50
    assert operators == {name for name in dir(bpy.ops.rockfall) if not name.startswith("_")}
    assert operators >= LOOK_ONLY
    scene["rockfall_schema"] = 99
    said = part("rockfall_addon.scene.migration").warning(scene)
    before = {o.name: repr(sorted(o.items())) for o in scene.objects}
    for name in sorted(operators - LOOK_ONLY):
        with pytest.raises(RuntimeError, match=re.escape(said)):
            getattr(bpy.ops.rockfall, name)()
    assert {o.name: repr(sorted(o.items())) for o in scene.objects} == before
    scene["rockfall_schema"] = 1
    assert bpy.ops.rockfall.reconstruct() == {"FINISHED"}


def test_a_shift_that_is_not_finite_changes_nothing(scene: bpy.types.Scene, part) -> None:
    before = everything(scene, part)
    georeference = part("rockfall_addon.scene.georeference")
    with pytest.raises(part("core.errors").RockfallError, match="not finite"):
        georeference.write_shift(scene, part("core.georeference").GlobalShift(float("nan"), 0.0, 0.0))
    assert everything(scene, part) == before


def test_a_scene_without_anything_of_ours_stays_so(part) -> None:
    scene = bpy.context.scene
    scene.collection.objects.link(bpy.data.objects.new("empty", None))
    bpy.context.view_layer.update()
    part("rockfall_addon.handlers")._catch_up()
    assert [key for key in scene.keys() if key.startswith("rockfall_")] == []  # noqa: SIM118 - no dictionary


def on_the_parabolas(scene: bpy.types.Scene, part) -> bool:
    """Whether the blocks are on their flights at every frame."""
    result = part("rockfall_addon.scene.reconstruction").reconstruct_scene(scene)
    offsets = part("rockfall_addon.scene.timing").kept_offsets(scene)
    states, flights = part("core.reconstruction.flight").flight_states, result.flights
    rate, worst = scene.render.fps / scene.render.fps_base, 0.0
    for block in objects(scene, "block"):
        name = block["rockfall_trajectory"]
        bag = block.animation_data.action.layers[0].strips[0].channelbag(block.animation_data.action_slot)
        for i in np.flatnonzero(flights.trajectory == name):
            start, end = (rate * (times[i] - offsets[name]) for times in (flights.start_time_s, flights.end_time_s))
            for frame in range(int(np.ceil(start)), int(end) + 1):
                there = [bag.fcurves.find("location", index=axis).evaluate(frame) for axis in range(3)]
                place = states(flights, [i], [frame / rate + offsets[name]])[0][0]
                worst = max(worst, float(np.linalg.norm(there - place)))
    return worst < 1e-3


@pytest.mark.parametrize("first", ["sync", "recompute", "add_pick"])
def test_another_frame_rate_before_blender_says_so(scene: bpy.types.Scene, part, first: str) -> None:
    """In a window what waits may be done after the rate has changed and before the handlers are called."""
    before, sync = everything(scene, part), part("rockfall_addon.scene.sync")
    assert on_the_parabolas(scene, part)
    scene.render.fps = 60
    if first == "add_pick":
        place = [30.0, 0.123456789, ground(30.0)]
        part("rockfall_addon.scene.picks").add_pick(scene, "A", 13.9, place)
        sync.sync(scene, ["A"])
    else:
        getattr(sync, first)(scene)
    bpy.context.view_layer.update()
    assert scene["rockfall_keyed_rate_hz"] == 60
    assert on_the_parabolas(scene, part)
    times = sorted(o["rockfall_time_s"] for o in objects(scene, "pick"))
    assert times == sorted([*before["time_s"], *([13.9] if first == "add_pick" else [])])
    frames = [o["rockfall_key_frame"] for o in picks_of(scene, "A")]
    expected = [(o["rockfall_time_s"] - 10.0) * 60 for o in picks_of(scene, "A")]
    np.testing.assert_allclose(frames, expected, atol=1e-3)


def test_another_frame_rate_keeps_times(scene: bpy.types.Scene, part) -> None:
    before = everything(scene, part)
    scene.render.fps = 60
    bpy.context.view_layer.update()
    assert everything(scene, part) == before
    frames = [o["rockfall_key_frame"] for o in picks_of(scene, "A")]
    times = np.array([o["rockfall_time_s"] for o in picks_of(scene, "A")])
    np.testing.assert_allclose(frames, (times - times[0]) * 60, atol=1e-3)
    trail = next(o for o in objects(scene, "flights") if o["rockfall_trajectory"] == "A")
    ticks, clock = (np.empty(len(trail.data.vertices), dtype=kind) for kind in (bool, np.float32))
    trail.data.attributes["tick"].data.foreach_get("value", ticks)
    trail.data.attributes["display_time_s"].data.foreach_get("value", clock)
    np.testing.assert_allclose(np.diff(clock[ticks]).min(), 1 / 60, atol=1e-5)


def test_problems_of_a_file_of_0_1_0_are_remarks(scene: bpy.types.Scene, part) -> None:
    problems, remark = part("rockfall_addon.scene.problems"), part("core.remarks").Remark
    scene["rockfall_problem"] = "The terrain is gone.\nSo is the camera."
    scene["rockfall_trajectory_problems"] = '{"A": ["A has a single pick."]}'
    assert problems.remarks(scene) == [
        remark("The terrain is gone.", "warning"),
        remark("So is the camera.", "warning"),
    ]
    assert problems.of_trajectories(scene) == {"A": [remark("A has a single pick.", "warning")]}

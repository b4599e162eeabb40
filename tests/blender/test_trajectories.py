# SPDX-License-Identifier: GPL-3.0-or-later
"""Picks become objects, curves and blocks that stand where the paper's equations say, at every frame."""

from pathlib import Path

import bpy
import numpy as np
import pytest
from two_runs import key_frames

GRAVITY = 9.81
SHIFT = np.array([2600000.0, 1200000.0, 0.0])
TIMES = np.array([10.0, 10.0 + 0.7312, 10.0 + 1.90017, 10.0 + 2.4])
PLACES = np.array([[0.0, 0.0, 40.0], [4.1, 0.3, 36.2], [11.3, -0.5, 27.9], [13.9, 0.1, 26.0]])
HEADER = "trajectory,time_s,x_m,y_m,z_m,kind,status,nx,ny,nz,crew\n"


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """Two runs of the same shape, the second 30 s later."""
    rows = [
        f"{name},{time + later!r},{x!r},{y!r},{z!r},{kind},ok,0.5,0.0,0.8660254037844386,Ana"
        for name, later in (("A", 0.0), ("B", 30.0))
        for time, (x, y, z), kind in zip(
            TIMES.tolist(), (PLACES + SHIFT).tolist(), ("release", "impact", "impact", "impact"), strict=True
        )
    ]
    path = tmp_path / "picks.csv"
    path.write_text(HEADER + "\n".join(rows) + "\n", encoding="utf-8")
    return path


@pytest.fixture
def scene(part, table: Path) -> bpy.types.Scene:
    scene = bpy.context.scene
    part("rockfall_addon.scene.terrain.georeference").write_shift(scene, part("core.georeference").GlobalShift(*SHIFT))
    assert bpy.ops.rockfall.import_picks(filepath=str(table)) == {"FINISHED"}
    return scene


def parabola(time: float) -> np.ndarray:
    """Where the block is `time` seconds after the first pick: eq. 1 with the launch velocity of eq. 5."""
    clock = time + TIMES[0]
    k = int(np.clip(np.searchsorted(TIMES, clock, side="right") - 1, 0, len(TIMES) - 2))
    duration, since = TIMES[k + 1] - TIMES[k], np.clip(clock - TIMES[k], 0.0, TIMES[k + 1] - TIMES[k])
    launch = (PLACES[k + 1] - PLACES[k]) / duration + np.array([0, 0, GRAVITY * duration / 2])
    return PLACES[k] + launch * since - np.array([0, 0, GRAVITY * since**2 / 2])


def worst_distance(scene: bpy.types.Scene, name: str, later: float) -> float:
    rate = scene.render.fps / scene.render.fps_base
    block = scene.objects[f"{name} block"]
    worst = 0.0
    for frame in np.arange(0.0, 3.0 * rate, 0.25):
        scene.frame_set(int(frame), subframe=float(frame % 1))
        place = np.array(block.matrix_world.translation)
        worst = max(worst, float(np.linalg.norm(place - parabola(frame / rate - later))))
    return worst


@pytest.mark.parametrize(("fps", "base"), [(24, 1.0), (30000, 1001.0), (50, 1.0)])
def test_block_is_on_the_parabola_at_every_frame(scene: bpy.types.Scene, fps: int, base: float) -> None:
    assert worst_distance(scene, "A", 0.0) < 5e-5
    scene.render.fps, scene.render.fps_base = fps, base
    assert worst_distance(scene, "A", 0.0) < 5e-5
    assert worst_distance(scene, "B", scene.rockfall.stagger_s) < 5e-5


def test_blocks_play_as_filmed(scene: bpy.types.Scene) -> None:
    scene.rockfall.playback = "REAL"
    assert worst_distance(scene, "A", 0.0) < 5e-5
    assert worst_distance(scene, "B", 30.0) < 5e-5
    assert scene.frame_end >= (30 + TIMES[-1] - TIMES[0]) * scene.render.fps


def test_picks_come_back_exactly_after_save_and_load(scene: bpy.types.Scene, part, table: Path, tmp_path: Path) -> None:
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "site.blend"))
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "site.blend"), load_ui=False)
    picks = part("rockfall_addon.scene.picks.picks").picks_of(bpy.context.scene)
    expected = part("core.exchange.tables").read_picks(table, part("core.georeference").GlobalShift(*SHIFT))
    for name in ("trajectory", "time_s", "position", "kind", "status", "normal"):
        np.testing.assert_array_equal(getattr(picks, name), getattr(expected, name), err_msg=name)
    assert picks.extra["crew"].tolist() == ["Ana"] * 8
    assert picks.shift.vector.tolist() == SHIFT.tolist()
    assert worst_distance(bpy.context.scene, "A", 0.0) < 5e-5


def test_a_moved_pick_moves_the_trajectory(scene: bpy.types.Scene, part) -> None:
    pick = scene.objects["A impact 1"]
    pick.animation_data_clear()
    pick.location.x += 0.5
    assert bpy.ops.rockfall.reconstruct() == {"FINISHED"}
    picks = part("rockfall_addon.scene.picks.picks").picks_of(scene)
    np.testing.assert_allclose(picks.position[1], PLACES[1] + [0.5, 0, 0], atol=1e-6)
    scene.frame_set(int(0.7312 * 24), subframe=(0.7312 * 24) % 1)
    np.testing.assert_allclose(scene.objects["A block"].matrix_world.translation, PLACES[1] + [0.5, 0, 0], atol=1e-3)


def test_a_take_off_begins_the_next_flight_and_without_its_impact_it_is_said(scene: bpy.types.Scene, part) -> None:
    picks, sync = part("rockfall_addon.scene.picks.picks"), part("rockfall_addon.scene.footage.sync")
    first = scene.objects["A impact 1"]
    place = list(first["rockfall_position_m"])
    off = picks.add_pick(scene, "A", first["rockfall_time_s"] + 0.08, [place[0] + 1, *place[1:]], kind="takeoff")
    sync.sync(scene, ["A"])
    result = part("rockfall_addon.scene.picks.reconstruction").reconstruct_scene(scene)
    flies = result.flights.first_pick[~result.flights.is_contact & (result.flights.trajectory == "A")].tolist()
    assert flies[:2] == [0, 2]
    words = part("rockfall_addon.steps.impacts.panel")._slide(scene, first)
    assert words == [("Until the take-off", "1.00 m, 80 ms")]
    first["rockfall_kind"] = "pass"
    sync.sync(scene, ["A"])
    said = part("rockfall_addon.scene.problems").remarks(scene)
    assert any("does not follow an impact" in remark.text for remark in said)
    assert off.name.startswith("A takeoff")


def test_picks_keep_their_objects_and_selection(scene: bpy.types.Scene) -> None:
    pick = scene.objects["A impact 1"]
    before = {o.name: o["rockfall_id"] for o in scene.objects if o.get("rockfall_role") == "pick"}
    pick.select_set(True)
    bpy.context.view_layer.objects.active = pick
    scene.rockfall.block_diameter_m = 0.5
    assert bpy.ops.rockfall.reconstruct() == {"FINISHED"}
    assert bpy.context.view_layer.objects.active == pick
    assert pick.select_get()
    assert {o.name: o["rockfall_id"] for o in scene.objects if o.get("rockfall_role") == "pick"} == before
    assert len(set(before.values())) == 8


def test_imported_again_a_pick_is_what_the_table_says(scene: bpy.types.Scene, table: Path) -> None:
    text = table.read_text(encoding="utf-8").replace(",impact,ok,0.5,0.0,0.8660254037844386,", ",pass,ok,,,,", 1)
    table.write_text(text, encoding="utf-8")
    pick = scene.objects["A impact 1"]
    assert {"rockfall_normal", "rockfall_result", "rockfall_flags"} <= set(pick.keys())
    assert bpy.ops.rockfall.import_picks(filepath=str(table)) == {"FINISHED"}
    assert pick["rockfall_kind"] == "pass"
    assert pick.data.name == "Rockfall pass"
    assert not {"rockfall_normal", "rockfall_result", "rockfall_flags"} & set(pick.keys())


def test_a_deleted_pick_is_gone(scene: bpy.types.Scene, part, numbers) -> None:
    bpy.data.objects.remove(scene.objects["A impact 2"])
    assert bpy.ops.rockfall.reconstruct() == {"FINISHED"}
    assert len(part("rockfall_addon.scene.picks.picks").picks_of(scene)) == 7
    direct = (PLACES[3] - PLACES[1]) / (TIMES[3] - TIMES[1]) + [0, 0, GRAVITY * (TIMES[3] - TIMES[1]) / 2]
    pick = scene.objects["A impact 1"]
    np.testing.assert_allclose(numbers(pick)["restituted_mps"], direct, atol=1e-9)


def test_flight_curve_lies_on_the_parabola_and_ends_now(scene: bpy.types.Scene) -> None:
    curve = scene.objects["A flights"]
    coordinates = np.empty(3 * len(curve.data.vertices), dtype=np.float32)
    curve.data.vertices.foreach_get("co", coordinates)
    times = np.empty(len(curve.data.vertices), dtype=np.float32)
    curve.data.attributes["display_time_s"].data.foreach_get("value", times)
    expected = np.array([parabola(float(time)) for time in times])
    assert np.linalg.norm(coordinates.reshape(-1, 3) - expected, axis=1).max() < 1e-4

    scene.rockfall.trail_until_now = True
    scene.frame_set(24)
    tube = curve.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    shown = np.empty(len(tube.vertices), dtype=np.float32)
    tube.attributes["display_time_s"].data.foreach_get("value", shown)
    assert 0.95 < shown.max() <= 1.0
    assert tube.attributes.active_color_name == "speed_colour"


def test_of_many_flights_only_renders_have_tubes(part, scene: bpy.types.Scene, table: Path, monkeypatch) -> None:
    monkeypatch.setattr(part("rockfall_addon.scene.picks.trails"), "MANY_FLIGHTS", 2)
    bpy.data.objects.remove(scene.objects["A flights"])
    assert bpy.ops.rockfall.import_picks(filepath=str(table)) == {"FINISHED"}
    shown = {
        name: (scene.objects[name].modifiers["Trail"].show_viewport, scene.objects[name].modifiers["Trail"].show_render)
        for name in ("A flights", "B flights")
    }
    assert shown == {"A flights": (False, True), "B flights": (True, True)}
    graph = bpy.context.evaluated_depsgraph_get()
    bare, tube = (scene.objects[name].evaluated_get(graph).data for name in shown)
    assert len(bare.vertices) == len(scene.objects["A flights"].data.vertices)
    assert len(tube.vertices) > 3 * len(scene.objects["B flights"].data.vertices)


def test_among_many_each_has_keys_of_its_own_that_are_copies(part, scene: bpy.types.Scene, table, monkeypatch) -> None:
    def keys() -> dict[str, list]:
        moving = [obj for obj in scene.objects if obj.get("rockfall_role") in ("pick", "block")]
        return {obj.name: key_frames(obj) for obj in moving}

    one_by_one = keys()
    for obj in list(scene.objects):
        bpy.data.objects.remove(obj)
    bpy.data.orphans_purge()
    monkeypatch.setattr(part("rockfall_addon.scene.picks.keyframes"), "MANY_ACTIONS", 1)
    assert bpy.ops.rockfall.import_picks(filepath=str(table)) == {"FINISHED"}
    assert keys() == one_by_one
    actions = {obj.name: obj.animation_data.action for obj in scene.objects if obj.name in one_by_one}
    assert len({action.name for action in actions.values()}) == len(one_by_one) == 10
    kinds = [action.name.split(".")[0] for action in actions.values()]
    assert sorted(kinds) == ["Key of pick"] * 8 + ["Keys of block"] * 2


def test_what_is_looked_up_is_what_is_there(part, scene: bpy.types.Scene) -> None:
    store, picks = part("rockfall_addon.scene.storage.store"), part("rockfall_addon.scene.picks.picks")
    bpy.data.objects.remove(scene.objects["A flights"])
    with store.looking(scene):
        assert store.trajectories_of(scene, store.PICK_ROLE) == {"A", "B"}
        assert store.trajectories_of(scene, store.FLIGHTS_ROLE) == {"B"}
        assert store.has_role(scene, store.BLOCK_ROLE)
        assert not store.has_role(scene, store.MODEL_FLIGHTS_ROLE)
        store.remove_objects(picks.objects_of(scene, ["A"]))
        assert store.trajectories_of(scene, store.PICK_ROLE) == {"B"}
    assert store.trajectories_of(scene, store.PICK_ROLE) == {"B"}


def test_impact_object_keeps_the_impacts_numbers(scene: bpy.types.Scene, numbers) -> None:
    pick = scene.objects["A impact 2"]
    d1, d2 = np.diff(TIMES)[1:3]
    v1 = np.diff(PLACES, axis=0)[1] / d1 - [0, 0, GRAVITY * d1 / 2]
    v2 = np.diff(PLACES, axis=0)[2] / d2 + [0, 0, GRAVITY * d2 / 2]
    result = numbers(pick)
    np.testing.assert_allclose(result["incident_mps"], v1, atol=1e-9)
    np.testing.assert_allclose(result["restituted_mps"], v2, atol=1e-9)
    assert result["r"] == pytest.approx(np.linalg.norm(v2) / np.linalg.norm(v1), abs=1e-9)


def test_exported_tables_are_those_of_the_core(scene: bpy.types.Scene, part, table: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert bpy.ops.rockfall.export_tables(directory=str(out)) == {"FINISHED"}
    tables, core = part("core.exchange.tables"), part("core.reconstruction.trajectory")
    expected = core.reconstruct(tables.read_picks(table, part("core.georeference").GlobalShift(*SHIFT)))
    impacts = tables.read_impacts(out / "impacts.csv")
    np.testing.assert_allclose(impacts.v1, expected.impacts.v1, atol=1e-9)
    np.testing.assert_allclose(impacts.rn, expected.impacts.rn, atol=1e-9)
    again = tables.read_picks(out / "picks.csv")
    np.testing.assert_allclose(again.shift.to_survey(again.position)[:4], PLACES + SHIFT, atol=1e-6)
    assert (out / "trajectories.csv").stat().st_size > 1000


def test_bad_table_changes_nothing(scene: bpy.types.Scene, tmp_path: Path) -> None:
    bad = tmp_path / "bad.csv"
    bad.write_text("trajectory,time_s,x_m,y_m,z_m\nA,1.0,0,0,0\nA,1.0,1,0,0\n", encoding="utf-8")
    before = sorted(o.name for o in scene.objects)
    with pytest.raises(RuntimeError, match=r"bad\.csv.*row 3"):
        bpy.ops.rockfall.import_picks(filepath=str(bad))
    assert sorted(o.name for o in scene.objects) == before

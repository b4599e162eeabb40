# SPDX-License-Identifier: GPL-3.0-or-later
"""Files whose stored values were damaged open: what is bad is set aside and named, the good is exported, no pick is
lost, and what was corrected counts again.
"""

import csv
import json
import random
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest
from two_runs import check_shown, picks_of, trail, update
from video_scene import add, solved

NAN, INF = float("nan"), float("inf")
KEY = "rockfall_{}"


def of_pick(key: str, value: object) -> Callable[[bpy.types.Scene], None]:
    """Give the second pick of A a value; None takes it away."""

    def damage(scene: bpy.types.Scene) -> None:
        write(picks_of(scene, "A")[1], key, value)

    return damage


def of_scene(key: str, value: object) -> Callable[[bpy.types.Scene], None]:
    return lambda scene: write(scene, key, value)


def write(holder: bpy.types.ID, key: str, value: object) -> None:
    if value is not None:
        holder[KEY.format(key)] = value
    elif KEY.format(key) in holder:
        del holder[KEY.format(key)]


def same_id(scene: bpy.types.Scene) -> None:
    first, second = picks_of(scene, "A")[1:3]
    first["rockfall_id"] = second["rockfall_id"]


def same_id_at_frame_50(scene: bpy.types.Scene) -> None:
    same_id(scene)
    scene.frame_set(50)


def same_time(scene: bpy.types.Scene) -> None:
    first, second = picks_of(scene, "A")[1:3]
    second["rockfall_time_s"] = first["rockfall_time_s"]


def block_of_a(scene: bpy.types.Scene) -> bpy.types.Object:
    (block,) = [o for o in scene.objects if o.get("rockfall_role") == "block" and o["rockfall_trajectory"] == "A"]
    return block


def broken_block_keys(scene: bpy.types.Scene) -> None:
    block_of_a(scene).animation_data.action["rockfall_block_keys"] = "[[1]]"


def written_of_action(scene: bpy.types.Scene) -> None:
    picks_of(scene, "A")[1].animation_data.action["rockfall_written"] = NAN


def block_of_no_trajectory(scene: bpy.types.Scene) -> None:
    block_of_a(scene)["rockfall_trajectory"] = 5


def mass_of_flights(scene: bpy.types.Scene) -> None:
    trail(scene, "A")["rockfall_mass_kg"] = "heavy"


JUNK = (
    NAN, -INF, -1, 1e300, 10**9, True, "", "x", "{", "[]", '{"A": null}', [], [NAN] * 3, ["a"], {"a": {}}, b"\xff",
    None,
)  # fmt: skip
WITHOUT_PICK, WITHOUT_A = "without the pick", "without A"
ALL = "all"
OF_A = {"A": [0.3, 0.3, 0.3, 0.0], "B": [0.3, 0.3, 0.3, 2700.0]}
CASES = {
    "position nan": (of_pick("position_m", [NAN, 0.0, 0.0]), "rockfall_position_m", WITHOUT_PICK),
    "position 2": (of_pick("position_m", [0.0, 0.0]), "no list of 3 numbers", WITHOUT_PICK),
    "position beyond": (of_pick("position_m", [1e300, 0.0, 0.0]), "beyond what can be", WITHOUT_PICK),
    "time inf": (of_pick("time_s", INF), "Set aside: the time of A impact 1 (inf) is not finite", WITHOUT_PICK),
    "time text": (of_pick("time_s", "soon"), "Set aside: the time of A impact 1 ('soon') is no number", WITHOUT_PICK),
    "kind gone": (of_pick("kind", None), "Set aside: the kind of A impact 1 is missing", WITHOUT_PICK),
    "kind unknown": (of_pick("kind", "impakt"), "did you mean impact?", WITHOUT_PICK),
    "status number": (of_pick("status", 3), "Set aside: the status of A impact 1 (3)", WITHOUT_PICK),
    "trajectory number": (of_pick("trajectory", 5), "It is of no trajectory", WITHOUT_PICK),
    "sigma text": (of_pick("sigma_position_m", "x"), "rockfall_sigma_position_m of A impact 1 ('x')", ALL),
    "sigma negative": (of_pick("sigma_position_m", [-1.0]), "beyond what can be", ALL),
    "normal zero": (of_pick("normal", [0.0, 0.0, 0.0]), "has length zero", ALL),
    "extra text": (of_pick("extra", "x"), "rockfall_extra of A impact 1 ('x')", ALL),
    "key frame text": (of_pick("key_frame", "x"), "rockfall_key_frame of A impact 1 ('x')", ALL),
    "written text": (of_pick("written", "x"), "rockfall_written of A impact 1 ('x')", ALL),
    "result text": (of_pick("result", "x"), "rockfall_result of A impact 1 ('x')", ALL),
    "result too short": (of_pick("result", [1.0] * 3), "rockfall_result of A impact 1", ALL),
    "result of no impact": (of_pick("result", [NAN] * 36), "is of no impact", ALL),
    "flags a number": (of_pick("flags", 1), "rockfall_flags of A impact 1 (1) is no text", ALL),
    "shift of pick nan": (of_pick("pick_shift_m", [NAN, 0.0, 0.0]), "rockfall_pick_shift_m of A impact 1", ALL),
    "id gone": (of_pick("id", None), "", ALL),
    "id twice": (same_id, "", ALL),
    "id twice, frame 50": (same_id_at_frame_50, "", ALL),
    "two picks at one time": (same_time, "Two picks at one time, 10.7312 s", WITHOUT_A),
    "block of A without density": (
        of_scene("blocks", json.dumps(OF_A)),
        "trajectory A: Its block cannot be: The block's density must be a positive number",
        WITHOUT_A,
    ),
    "blocks broken": (of_scene("blocks", "{"), "rockfall_blocks of the scene ('{') is no readable JSON", ALL),
    "blocks a list": (of_scene("blocks", "[1]"), "rockfall_blocks of the scene ('[1]') is no JSON object", ALL),
    "default block text": (of_scene("default_block", "x"), "rockfall_default_block of the scene ('x')", ALL),
    "gravity nan": (of_scene("gravity_mps2", NAN), "rockfall_gravity_mps2 of the scene (nan) is not finite", ALL),
    "drag text": (of_scene("drag", "x"), "rockfall_drag of the scene ('x')", ALL),
    "offsets broken": (of_scene("offsets_s", "{"), "rockfall_offsets_s of the scene ('{')", ALL),
    "offsets nan": (of_scene("offsets_s", '{"A": NaN}'), "rockfall_offsets_s of the scene", ALL),
    "shown broken": (of_scene("shown", "{"), "rockfall_shown of the scene ('{')", ALL),
    "problems broken": (of_scene("trajectory_problems", "{"), "rockfall_trajectory_problems of the scene", ALL),
    "shift text": (of_scene("shift_m", "x"), "it was taken from the picks", ALL),
    "unknown model": (of_scene("model_parameters", '{"nobody_1999": {"x": 1}}'), "nobody_1999", ALL),
    "schema text": (of_scene("schema", "x"), "", ALL),
    "written of an action": (written_of_action, "(nan) is no whole number and is set aside", ALL),
    "block of no trajectory": (block_of_no_trajectory, "Set aside: A block, as its rockfall_trajectory (5)", ALL),
    "mass text": (mass_of_flights, "rockfall_mass_kg of A flights ('heavy') is no number", ALL),
    "keys of a block": (broken_block_keys, "rockfall_block_keys of A block", ALL),
}


def opened(path: Path, *, unseen: bool = True) -> bpy.types.Scene:
    """The scene of the file that is saved there and opened again.

    unseen : Rockfall does not look at it when it is saved, as if another program had written it.
    """
    handlers = bpy.app.handlers.save_pre
    ours = [each for each in handlers if "rockfall" in each.__module__] if unseen else []
    for each in ours:
        handlers.remove(each)
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    for each in ours:
        handlers.append(each)
    bpy.ops.wm.open_mainfile(filepath=str(path))
    return bpy.context.scene


def said_of(scene: bpy.types.Scene, part) -> str:
    return "\n".join(remark.text for remark in part("rockfall_addon.scene.problems").remarks(scene))


def all_picks(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    return [o for o in scene.objects if o.get("rockfall_role") in ("pick", "pick_set_aside")]


def check_export(part, table: Path, folder: Path, left_out: str = ALL) -> None:
    """The tables hold the good picks of the imported table, and of whole trajectories what the core makes of it."""
    assert bpy.ops.rockfall.export_tables(directory=str(folder)) == {"FINISHED"}
    with table.open(encoding="utf-8") as rows:
        wanted = [(row["trajectory"], float(row["time_s"])) for row in csv.DictReader(rows)]
    if left_out == WITHOUT_PICK:
        wanted.remove(("A", 10.7312))
    if left_out == WITHOUT_A:
        wanted = [row for row in wanted if row[0] != "A"]
    with (folder / "picks.csv").open(encoding="utf-8") as rows:
        assert [(row["trajectory"], float(row["time_s"])) for row in csv.DictReader(rows)] == wanted
    picks = part("core.exchange.tables").read_picks(table)
    impacts = part("core.reconstruction.trajectory").reconstruct(picks).impacts
    with (folder / "impacts.csv").open(encoding="utf-8") as rows:
        found = [float(row["v1x_mps"]) for row in csv.DictReader(rows) if row["trajectory"] == "B"]
    np.testing.assert_allclose(found, impacts.v1[impacts.trajectory == "B"][:, 0], rtol=1e-9)


@pytest.mark.parametrize("name", CASES)
def test_a_damaged_file(scene: bpy.types.Scene, part, table: Path, tmp_path: Path, name: str) -> None:
    damage, words, left_out = CASES[name]
    damage(scene)
    scene = opened(tmp_path / "damaged.blend")
    said = said_of(scene, part)
    assert "Something went wrong" not in said
    assert words in said if words else not said, said
    assert len(all_picks(scene)) == 10
    assert len([o for o in scene.objects if o.get("rockfall_role") == "pick_set_aside"]) == (left_out == WITHOUT_PICK)
    check_export(part, table, tmp_path / "out", left_out)
    before = said
    scene = opened(tmp_path / "again.blend", unseen=False)
    assert said_of(scene, part) == before, "what was set aside stays so"
    assert len(all_picks(scene)) == 10


@pytest.mark.parametrize("seed", range(6))
def test_any_damage(scene: bpy.types.Scene, part, tmp_path: Path, capfd, seed: int) -> None:
    """Values of any kind under any of our keys: the file opens, nothing fails in other than our own words."""
    chance = random.Random(seed)
    for holder in (scene, *chance.sample(picks_of(scene, "A") + picks_of(scene, "B"), 3)):
        keys = [key for key in holder.keys() if key.startswith("rockfall_") and key != "rockfall_role"]  # noqa: SIM118
        for key in chance.sample(keys, 4):
            write(holder, key.removeprefix("rockfall_"), chance.choice(JUNK))
    scene = opened(tmp_path / "damaged.blend")
    assert "Something went wrong" not in said_of(scene, part)
    assert len(all_picks(scene)) == 10
    with suppress(RuntimeError):  # that of an error that is not in our words has a traceback
        bpy.ops.rockfall.export_tables(directory=str(tmp_path / "out"))
    assert "Traceback" not in capfd.readouterr().err


def test_what_is_corrected_counts_again(scene: bpy.types.Scene, part, table: Path, tmp_path: Path) -> None:
    of_pick("time_s", "soon")(scene)
    scene = opened(tmp_path / "damaged.blend")
    (apart,) = [o for o in scene.objects if o.get("rockfall_role") == "pick_set_aside"]
    apart.rockfall_pick.time_s = "10.7312"
    assert said_of(scene, part) == ""
    check_shown(scene, part)
    check_export(part, table, tmp_path / "out")


def test_a_trajectory_without_a_good_pick_waits_in_grey(scene: bpy.types.Scene, part, tmp_path: Path) -> None:
    for pick in picks_of(scene, "A"):
        pick["rockfall_kind"] = 7
    scene = opened(tmp_path / "damaged.blend")
    assert trail(scene, "A")["rockfall_stale"]
    assert "1 more picks are set aside" in said_of(scene, part)
    assert bpy.ops.rockfall.export_tables(directory=str(tmp_path / "out")) == {"FINISHED"}
    assert bpy.ops.rockfall.recover_picks() == {"FINISHED"}
    assert said_of(scene, part).count("it has another value now") == 4
    assert not trail(scene, "A").get("rockfall_stale")
    assert [pick["rockfall_kind"] for pick in picks_of(scene, "A")] == ["release", *["impact"] * 3, "stop"]
    check_shown(scene, part)


def test_picks_are_recovered_from_their_markers(scene: bpy.types.Scene, part, tmp_path: Path) -> None:
    first, second, third, fourth = picks_of(scene, "A")[:4]
    place = list(third["rockfall_position_m"])
    first["rockfall_trajectory"], second["rockfall_time_s"], third["rockfall_position_m"] = "", NAN, [NAN] * 3
    del fourth["rockfall_status"]
    scene = opened(tmp_path / "damaged.blend")
    assert len(picks_of(scene, "A")) == 1
    assert bpy.ops.rockfall.recover_picks() == {"FINISHED"}
    recovered = picks_of(scene, "A")
    times = [pick["rockfall_time_s"] for pick in recovered]
    np.testing.assert_allclose(times, [10.0, 10.7312, 11.90017, 12.4, 13.0], atol=1e-5)
    np.testing.assert_allclose(recovered[2]["rockfall_position_m"], place, atol=1e-5)
    assert [p["rockfall_status"] for p in recovered] == ["ok", "doubtful", "doubtful", "doubtful", "ok"]
    assert np.isnan(recovered[1]["rockfall_set_aside"]["rockfall_time_s"]), "the raw value stays"
    check_shown(scene, part)
    assert bpy.ops.rockfall.remove_set_aside() == {"FINISHED"}
    assert said_of(scene, part) == ""
    assert len(picks_of(scene, "A")) == 5


def test_what_is_set_aside_is_selected_and_deleted(scene: bpy.types.Scene, part, tmp_path: Path) -> None:
    of_pick("time_s", "soon")(scene)
    of_scene("gravity_mps2", NAN)(scene)
    scene = opened(tmp_path / "damaged.blend")
    assert bpy.ops.rockfall.select_set_aside() == {"FINISHED"}
    assert [obj.name for obj in bpy.context.selected_objects] == ["A impact 1 (set aside)"]
    assert part("rockfall_addon.scene.next_step").next_step(scene).actions[0] == "rockfall.recover_picks"
    assert bpy.ops.rockfall.remove_set_aside() == {"FINISHED"}
    assert said_of(scene, part) == ""
    assert len(all_picks(scene)) == 9
    with pytest.raises(RuntimeError, match="Nothing is set aside"):
        bpy.ops.rockfall.remove_set_aside()


def test_one_bad_trajectory_stops_nothing_that_is_made_of_the_others(slope: bpy.types.Scene, part) -> None:
    same_time(slope)
    assert bpy.ops.rockfall.reconstruct() == {"FINISHED"}
    result, left_out = part("rockfall_addon.scene.picks.reconstruction").reconstruct_good(slope)
    assert set(result.picks.trajectory.tolist()) == {"B"}
    assert [remark.about for remark in left_out] == ["A"]
    assert bpy.ops.rockfall.show_models(models={"noel_2017"}) == {"FINISHED"}
    slope.rockfall_simulation.source = "MEASURED"
    plan = part("rockfall_addon.scene.simulation.simulation_setup").plan(slope)
    assert set(plan.origins) == {"B"}
    assert [remark.about for remark in plan.remarks] == ["A"]


def test_a_marker_that_is_nowhere_goes_back(scene: bpy.types.Scene, part) -> None:
    pick = picks_of(scene, "A")[1]
    place = list(pick["rockfall_position_m"])
    pick.location.x = NAN
    update()
    assert list(pick["rockfall_position_m"]) == place
    np.testing.assert_allclose(pick.location, place, atol=1e-6)
    check_shown(scene, part)


@pytest.mark.parametrize(
    ("key", "value", "words", "aside", "is_solved"),
    [
        ("video_size", "x", "Set aside: constant, as its rockfall_video_size", True, None),
        ("video_times_s", [NAN], "Set aside: constant, as its rockfall_video_times_s", True, None),
        ("poses", [1.0] * 11, "rockfall_poses of constant", False, False),
        ("pose_sigma", "x", "rockfall_pose_sigma of constant ('x')", False, True),
        ("video_facts", "{", "rockfall_video_facts of constant ('{')", False, True),
    ],
)
def test_a_damaged_camera(part, tmp_path: Path, key: str, value: object, words: str, aside: bool, is_solved) -> None:
    camera_paths, camera = part("rockfall_addon.scene.footage.camera_paths"), add(part, "constant.mp4")
    camera_paths.set_camera_path(bpy.context.scene, camera, solved(part, camera, 20))
    write(camera, key, value)
    scene = opened(tmp_path / "damaged.blend")
    said = said_of(scene, part)
    assert words in said
    assert "Something went wrong" not in said
    found = part("rockfall_addon.scene.footage.videos").cameras(scene)
    assert [camera_paths.is_solved(each) for each in found] == ([] if aside else [is_solved])
    scene.frame_set(5)
    assert "Something went wrong" not in said_of(scene, part)


def test_poses_that_are_not_known_are_no_damage(part, tmp_path: Path) -> None:
    """Where the background is not recognised a pose's standard deviation is infinite, and so is one from few pairs."""
    camera_paths, camera = part("rockfall_addon.scene.footage.camera_paths"), add(part, "constant.mp4")
    path = solved(part, camera, 20)
    sigma = path.sigma_rotation.copy()
    sigma[3:6] = np.inf
    infinite = np.full((6, 6), np.inf)
    camera_paths.set_camera_path(
        bpy.context.scene, camera, replace(path, sigma_rotation=sigma), pose_covariance=infinite
    )
    scene = opened(tmp_path / "unknown.blend")
    assert "Set aside" not in said_of(scene, part)
    (found,) = part("rockfall_addon.scene.footage.videos").cameras(scene)
    kept = camera_paths.camera_path(found).sigma_rotation
    assert np.flatnonzero(np.isinf(kept)).tolist() == [3, 4, 5]
    assert camera_paths.pose_covariance(found) is None


def test_a_newer_file_is_left_as_it_is(scene: bpy.types.Scene, part, tmp_path: Path) -> None:
    of_pick("time_s", "soon")(scene)
    scene["rockfall_schema"] = 99
    scene = opened(tmp_path / "newer.blend")
    assert not [o for o in scene.objects if o.get("rockfall_role") == "pick_set_aside"]
    assert "newer Rockfall" in said_of(scene, part)

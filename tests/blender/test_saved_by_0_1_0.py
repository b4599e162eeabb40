# SPDX-License-Identifier: GPL-3.0-or-later
"""A file that version 0.1.0 saved, with everything that a file can hold, against what 0.1.0 itself read from it.

Picks, pairs, clocks and poses are compared as exact doubles; what is computed anew from them, to 1e-9 of itself.
"""

import json
from pathlib import Path

import bpy
import numpy as np
import pytest

DATA = Path(__file__).resolve().parents[1] / "data"
FILE = DATA / "saved_by_0.1.0.blend"
COMPUTED = {"rockfall_result", "rockfall_flags"}


@pytest.fixture(scope="module")
def old() -> dict:
    return json.loads(FILE.with_suffix(".json").read_text(encoding="utf-8"))


@pytest.fixture
def opened(part) -> bpy.types.Scene:
    assert bpy.ops.wm.open_mainfile(filepath=str(FILE)) == {"FINISHED"}
    return bpy.context.scene


def plain(value: object) -> object:
    """ID properties, arrays and dataclasses as JSON would hold them."""
    if hasattr(value, "to_dict"):
        return {name: plain(each) for name, each in value.to_dict().items()}
    if hasattr(value, "to_list"):
        return value.to_list()
    if hasattr(value, "__dataclass_fields__"):
        return {name: plain(getattr(value, name)) for name in value.__dataclass_fields__ if name != "shift"}
    if isinstance(value, dict):
        return {str(name): plain(each) for name, each in value.items()}
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, (list, tuple)):
        return [plain(each) for each in value]
    return value.item() if isinstance(value, np.generic) else value


def same(new: object, before: object, rtol: float = 0.0, where: str = "") -> None:
    """Fail where two trees of numbers and texts differ; NaN is as NaN."""
    if isinstance(before, dict):
        assert isinstance(new, dict), where
        assert set(new) == set(before), where
        for name in before:
            same(new[name], before[name], rtol, f"{where}.{name}")
    elif isinstance(before, list):
        assert len(new) == len(before), where
        for i, (one, other) in enumerate(zip(new, before, strict=True)):
            same(one, other, rtol, f"{where}[{i}]")
    elif isinstance(before, float):
        np.testing.assert_allclose(new, before, rtol=rtol, atol=rtol, err_msg=where)
    else:
        assert new == before, where


def stored(obj: bpy.types.ID) -> dict:
    return {name: plain(obj[name]) for name in obj.keys() if name.startswith("rockfall_")}  # noqa: SIM118


def all_picks(part, scene: bpy.types.Scene) -> list[dict]:
    picks = part("rockfall_addon.scene.picks.picks")
    return [stored(obj) for obj in picks.ordered(scene, picks.objects_of(scene))]


def test_every_pick_is_identical(opened, part, old) -> None:
    picks, clicks = part("rockfall_addon.scene.picks.picks"), part("rockfall_addon.scene.footage.clicks")
    found = all_picks(part, opened)
    assert len(found) == 18
    for new, before in zip(found, old["picks"], strict=True):
        for name in set(before) - COMPUTED:
            same(new[name], before[name], where=f"{before['rockfall_trajectory']} {before['rockfall_time_s']} {name}")
        assert set(new) - {"rockfall_flags"} == set(before)
    same(plain(picks.picks_of(opened)), old["table"])
    seen = {obj["rockfall_id"]: plain(clicks.of(obj)) for obj in picks.objects_of(opened)}
    same(seen, old["sightings"])
    assert sum(map(len, seen.values())) == 5


def test_every_result_is_equal(opened, part, old) -> None:
    impacts = part("rockfall_addon.scene.picks.reconstruction").reconstruct_scene(opened).impacts
    for name, before in old["impacts"].items():
        if name != "sigma":
            same(plain(getattr(impacts, name)), before, 1e-9, name)
    sigma = plain(impacts.sigma)
    assert set(sigma) == set(old["impacts"]["sigma"])
    for name in ("v1", "v2"):
        same(sigma[name], old["impacts"]["sigma"][name], 1e-9, name)
    for name in ("kinetic1_j", "kinetic2_j"):  # drawn, where 0.1.0 took derivatives
        same(sigma[name], old["impacts"]["sigma"][name], 0.01, name)
    proposal = plain(part("rockfall_addon.scene.picks.proposal").read(opened))
    for name in ("before_px", "after_px", "pixels", "outliers", "by_video", "stale"):
        same(proposal[name], old["proposal"][name], where=name)
    same([list(change.values()) for change in proposal["changes"]], old["proposal"]["picks"])
    assert [remark["text"] for remark in proposal["remarks"]] == old["proposal"]["advice"] != []
    kept = json.loads(opened["rockfall_proposal"])
    for name in ("ids", "names"):
        same(kept[name], old["proposal"][name], where=name)


def test_cameras_pairs_and_clocks_are_identical(opened, part, old) -> None:
    videos = part("rockfall_addon.scene.footage.videos")
    camera_paths = part("rockfall_addon.scene.footage.camera_paths")
    clocks = part("rockfall_addon.scene.footage.clocks")
    video_files = part("rockfall_addon.scene.footage.video_files")
    alignment = part("rockfall_addon.scene.footage.alignment")
    cameras = videos.cameras(opened)
    assert [camera.name for camera in cameras] == sorted(old["cameras"])
    for camera in cameras:
        before = old["cameras"][camera.name]
        path = camera_paths.camera_path(camera)
        for name in ("time_s", "position", "rotation", "sigma_position_m", "sigma_rotation"):
            same(plain(getattr(path, name)), before[name], where=name)
        same(plain(path.reference.intrinsics), before["intrinsics"])
        same(plain(camera_paths.pose_covariance(camera)), before["pose_covariance"])
        same(plain(clocks.clock_of(camera)), before["clock"] | {"gaps": []})  # which 0.1.0 did not have
        same(plain(videos.times_of(camera)[:5]), before["video_s"])
        assert len(videos.times_of(camera)) == before["frames"]
        assert (videos.row_time_of(camera) or 0.0) == before["row_time_s"]
        pairs = [{"agreed": ""} | pair for pair in before["pairs"]]  # 0.1.0 knew of none that was only agreed with
        same([plain(pair) for pair in alignment.pairs_of(camera)], pairs)
        solution = plain(alignment.solution_of(camera))
        for name in ("rmse_px", "residual", "residual_m", "wrong", "sigma", "reference", "keys"):
            same(solution[name], before["solution"][name], where=name)
        same(plain(part("rockfall_addon.scene.footage.video_times").events_of(camera)), before["events"])
        sightings = part("rockfall_addon.scene.footage.sightings")
        seen = {name: plain(sightings.seen_in(camera, name)) for name in sightings.names_in(camera)}
        same(seen, before["seen"])
        for name, value in before["settings"].items():
            same(plain(getattr(camera.rockfall_alignment, name)), value, where=name)
        assert video_files.file_of(camera).is_file(), "the footage is found beside the file"
    assert len(old["cameras"]["Bridge"]["pairs"]) == 14


def named_by_0_1_0(obj: bpy.types.Object) -> str:
    """A pick was numbered among all picks of its trajectory, where impacts are counted now."""
    run = obj.get("rockfall_trajectory")
    if obj.get("rockfall_role") != "pick":
        return obj.name
    times = [o["rockfall_time_s"] for o in bpy.context.scene.objects if o.get("rockfall_role") == "pick"
             and o["rockfall_trajectory"] == run]  # fmt: skip
    return f"{run} {1 + sorted(times).index(obj['rockfall_time_s']):02d} {obj['rockfall_kind']}"


def test_settings_models_and_film_are_as_they_were(opened, part, old) -> None:
    for settings, before in ((opened.rockfall, old["settings"]), (opened.rockfall_picking, old["picking"])):
        for name, value in before.items():
            now = getattr(settings, name)
            same(plain(sorted(now) if isinstance(now, set) else now), value, where=name)
    shift = part("rockfall_addon.scene.terrain.georeference").read_shift(opened)
    same([*shift.vector.tolist(), shift.crs], old["shift"])
    project = part("rockfall_addon.scene.picks.reconstruction").project_settings(opened, ["B02", "B07", "B10"])
    block = plain(project.block)
    assert block.pop("shape") == "ellipsoid"  # there was no other
    same(plain(project.reconstruction) | {"block": block}, old["reconstruction"])
    tiles = part("rockfall_addon.scene.terrain.terrain").tiles(opened)
    assert [[len(tile.data.vertices), len(tile.data.polygons)] for tile in tiles] == old["terrain"]
    assert list(part("rockfall_addon.scene.models.models").shown_models(opened)) == old["models"]
    assert part("rockfall_addon.steps.film.remembered").is_set_up(opened) is old["film"] is True
    named = [
        [named_by_0_1_0(o), str(o.get("rockfall_role", "")), str(o.get("rockfall_trajectory", ""))]
        for o in opened.objects
    ]
    assert sorted(named) == old["objects"]
    for name in ("rockfall_problem", "rockfall_trajectory_problems", "rockfall_offsets_s", "rockfall_blocks"):
        assert opened[name] == old["scene"][name], name


def test_numbers_of_impacts_come_over(opened, numbers, old) -> None:
    """They were lists by name; `opened` computes them anew, so they are compared to 1e-9."""
    before = {pick["rockfall_id"]: pick["rockfall_result"] for pick in old["picks"] if "rockfall_result" in pick}
    now = {o["rockfall_id"]: o for o in opened.objects if "rockfall_result" in o}
    assert set(now) == set(before)
    for name, kept in before.items():
        assert now[name]["rockfall_flags"] == kept["flags"]
        found = {key: np.atleast_1d(value).tolist() for key, value in numbers(now[name]).items() if key in kept}
        same(found, {key: np.atleast_1d(kept[key]).tolist() for key in found}, 1e-9, name)
        assert set(kept) - set(found) == {"flags"}


def test_files_hold_the_numbers_of_an_impact_in_this_order(part) -> None:
    """Another order needs another schema, and a step to it."""
    judged = ("rn", "rt", "r", "theta1", "theta_dev")
    deviations = ("rn", "rt", "r", "theta1_deg", "theta_dev_deg", "speed1", "speed2", "kinetic1_j", "kinetic2_j")
    assert list(part("rockfall_addon.scene.picks.impact_numbers").SHAPE) == [
        "number", "incident_mps", "restituted_mps", "rn", "rt", "r", "theta1_deg", "theta_dev_deg", "normal_spread_deg",
        "kinetic1_j", "kinetic2_j", "bounce_height_m", "chord_height_m", *(f"sigma_{name}" for name in deviations),
        *(f"interval_{name}" for name in judged),
    ]  # fmt: skip


def test_numbers_that_cannot_be_computed_anew_come_over(scene, part, numbers, old) -> None:
    migration, pick = part("rockfall_addon.scene.storage.migration"), scene.objects["A impact 1"]
    kept = next(each["rockfall_result"] for each in old["picks"] if "rockfall_result" in each)
    pick["rockfall_result"], pick["rockfall_flags"] = kept, "gone"
    broken = scene.objects["A impact 2"]
    broken["rockfall_result"] = {"rn": "high", "flags": 3}
    scene["rockfall_schema"] = 1
    assert migration.migrate(scene)
    assert pick["rockfall_flags"] == kept["flags"]
    assert numbers(pick)["incident_mps"] == pytest.approx(kept["incident_mps"], nan_ok=True)
    assert numbers(pick)["kinetic2_j"] == pytest.approx(kept["kinetic2_j"][0], nan_ok=True)
    assert np.isnan(numbers(pick)["interval_rn"]).all(), "0.1.0 had none"
    assert numbers(broken) is None
    assert scene["rockfall_schema"] == 3


def test_numbers_of_an_impact_lose_the_intervals_that_they_ended_with(scene, part, numbers) -> None:
    pick = scene.objects["A impact 1"]
    known = pick["rockfall_result"].to_list()
    pick["rockfall_result"] = [*known, 0.1, 0.9, 0.2, 0.8, 0.3, 0.7]
    scene["rockfall_schema"] = 2
    assert part("rockfall_addon.scene.storage.migration").migrate(scene)
    np.testing.assert_array_equal(pick["rockfall_result"].to_list(), known)
    assert scene["rockfall_schema"] == 3


def test_it_can_be_edited_and_saved_again(opened, part, old, tmp_path: Path, numbers) -> None:
    picks, store = part("rockfall_addon.scene.picks.picks"), part("rockfall_addon.scene.storage.store")
    _, second, *_ = picks.ordered(opened, picks.objects_of(opened, ["B07"]))
    before = stored(second)
    incident = numbers(second)["incident_mps"]
    second[store.TIME] = before["rockfall_time_s"] + 0.02
    part("rockfall_addon.scene.footage.sync").sync(opened)
    after = stored(second)
    assert after["rockfall_key_frame"] == pytest.approx(before["rockfall_key_frame"] + 0.6, abs=1e-4)
    assert numbers(second)["incident_mps"] != incident
    assert bpy.ops.rockfall.remove_models() == {"FINISHED"}
    assert bpy.ops.rockfall.remove_film() == {"FINISHED"}
    edited = all_picks(part, opened)
    again = tmp_path / "again.blend"
    assert bpy.ops.wm.save_as_mainfile(filepath=str(again)) == {"FINISHED"}
    bpy.ops.wm.open_mainfile(filepath=str(again))
    same(all_picks(part, bpy.context.scene), edited)
    untouched = [pick for pick in old["picks"] if pick["rockfall_trajectory"] != "B07"]
    kept = [pick for pick in edited if pick["rockfall_trajectory"] != "B07"]
    for new, was in zip(kept, untouched, strict=True):
        same({name: new[name] for name in set(was) - COMPUTED}, {name: was[name] for name in set(was) - COMPUTED})


def test_keys_of_its_blocks_drive_their_picks(opened, part, old) -> None:
    """0.1.0 did not keep which pick a key is of."""
    picks, store = part("rockfall_addon.scene.picks.picks"), part("rockfall_addon.scene.storage.store")
    (block,) = [o for o in store.with_role(opened, store.BLOCK_ROLE) if o[store.TRAJECTORY] == "B10"]
    moved = picks.ordered(opened, picks.objects_of(opened, ["B10"]))[1]
    before = stored(moved)
    bag = block.animation_data.action.layers[0].strips[0].channelbag(block.animation_data.action_slot)
    for axis in range(3):
        curve = bag.fcurves.find("location", index=axis)
        min(curve.keyframe_points, key=lambda point: abs(point.co[0] - before["rockfall_key_frame"])).co_ui[0] += 1.5
        curve.update()
    bpy.context.view_layer.update()
    assert moved["rockfall_time_s"] == pytest.approx(before["rockfall_time_s"] + 1.5 / 30.0, abs=1e-6)
    others = [pick for pick in all_picks(part, opened) if pick["rockfall_id"] != before["rockfall_id"]]
    were = [pick for pick in old["picks"] if pick["rockfall_id"] != before["rockfall_id"]]
    same([pick["rockfall_time_s"] for pick in others], [pick["rockfall_time_s"] for pick in were])
    same([pick["rockfall_position_m"] for pick in others], [pick["rockfall_position_m"] for pick in were])

# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits of picks, by hand, by key, by panel, are followed by their trajectory, and by no other."""

import json

import bpy
import numpy as np
import pytest
from two_runs import RATE, SLOPE, check_shown, ground, key_frames, move_key, picks_of, places, trail, update


def test_a_moved_object_moves_its_trajectory_alone(scene: bpy.types.Scene, part) -> None:
    pick, others = picks_of(scene, "A")[2], places(trail(scene, "B").data)
    before = trail(scene, "A"), trail(scene, "A").data.name
    pick.location.y += 0.5
    update()
    assert pick["rockfall_position_m"][1] == pytest.approx(0.5)
    assert before == (trail(scene, "A"), trail(scene, "A").data.name), "the trail is brought in line, not made anew"
    check_shown(scene, part)
    np.testing.assert_array_equal(places(trail(scene, "B").data), others)
    scene.frame_set(3)
    assert pick.location.y == pytest.approx(0.5), "the key follows the object"


def test_a_moved_pick_stays_on_the_terrain(slope: bpy.types.Scene, part) -> None:
    pick = picks_of(slope, "A")[2]
    pick.location = (13.0, 0.4, ground(13.0) + 0.6)
    update()
    x, y, z = pick["rockfall_position_m"]
    assert z == pytest.approx(ground(x), abs=1e-5)
    normal = np.array([SLOPE, 0.0, 1.0]) / np.hypot(SLOPE, 1.0)
    expected = np.array([13.0, 0.4, ground(13.0) + 0.6]) - 0.6 / np.hypot(SLOPE, 1.0) * normal
    np.testing.assert_allclose([x, y, z], expected, atol=1e-5)
    np.testing.assert_allclose(pick.location, expected, atol=1e-5)
    check_shown(slope, part)
    pick.rockfall_pick.kind = "pass"
    pick.location.z += 2.0
    update()
    assert pick["rockfall_position_m"][2] > ground(pick["rockfall_position_m"][0]) + 1.9, "a pass is in the air"


def test_a_second_pick_that_is_still_held_makes_a_flight_of_which_nothing_is_put_back(
    slope: bpy.types.Scene, part
) -> None:
    picks, sync, following = (
        part(f"rockfall_addon.scene.{name}") for name in ("picks.picks", "footage.sync", "next_step")
    )
    for obj in [one for name in "AB" for one in picks_of(slope, name)]:
        bpy.data.objects.remove(obj)
    picks.add_pick(slope, "C", 20.0, [0.0, 0.0, ground(0.0)])
    sync.sync(slope)
    assert "next impact" in following.next_step(slope).sentence, "one pick is no flight, and nothing can be played"
    picks.add_pick(slope, "C", 21.0, [6.0, 0.0, ground(6.0)])
    sync.sync(slope, ["C"], dragging=True)
    sync.sync(slope)
    assert not part("rockfall_addon.scene.problems").remarks(slope)
    assert following.next_step(slope).sentence.startswith("Play")
    check_shown(slope, part)


def test_what_comes_while_a_person_drags_belongs_to_an_undo_step_afterwards_and_once(
    slope: bpy.types.Scene, part, monkeypatch: pytest.MonkeyPatch
) -> None:
    sync, picks = part("rockfall_addon.scene.footage.sync"), part("rockfall_addon.scene.picks.picks")
    held, stored = [True], []
    monkeypatch.setattr(sync, "is_dragging", lambda: bool(held))
    monkeypatch.setattr(
        part("rockfall_addon.scene.storage.undo"), "extend_last_step", lambda name: stored.append(bool(held))
    )
    for time, x in ((20.0, 0.0), (21.0, 6.0)):
        picks.add_pick(slope, "C", time, [x, 0.0, ground(x)])
    sync.touch(slope, ["C"])
    assert trail(slope, "C")
    assert not stored
    held.clear()
    sync.work()
    sync.work()
    assert stored == [False]


def test_a_moved_key_moves_the_time(scene: bpy.types.Scene, part) -> None:
    pick = picks_of(scene, "A")[2]
    place, time = list(pick["rockfall_position_m"]), pick["rockfall_time_s"]
    move_key(pick, 2.5)
    assert pick["rockfall_time_s"] == pytest.approx(time + 2.5 / RATE, abs=1e-6)
    assert list(pick["rockfall_position_m"]) == place
    check_shown(scene, part)
    time = pick["rockfall_time_s"]
    update()
    assert pick["rockfall_time_s"] == time, "once is enough"
    frames = key_frames(pick)
    assert frames == [[pytest.approx((time - 10.0) * RATE, abs=1e-4)]] * 3


@pytest.mark.parametrize("frames", [-9.117, 700.3])
def test_a_key_that_is_moved_and_put_back_gives_the_time_back(scene: bpy.types.Scene, part, frames: float) -> None:
    """As an undo does: to the last bit, though frames of another size are rounded in other steps."""
    scene.render.fps = 240
    update()
    pick = picks_of(scene, "A")[3]
    pick["rockfall_time_s"] = time = 10.0 + 515.123456789 / 240
    part("rockfall_addon.scene.footage.sync").sync(scene)
    (before,) = key_frames(pick)[0]
    for wanted in (before + frames, before):
        for curve in pick.animation_data.action.layers[0].strips[0].channelbags[0].fcurves:
            curve.keyframe_points[0].co[0] = wanted
        update()
    assert pick["rockfall_time_s"] == time


def test_the_first_key_moves_without_moving_the_others(scene: bpy.types.Scene, part) -> None:
    first, second = picks_of(scene, "A")[:2]
    frame = key_frames(second)
    move_key(first, -3.0)
    assert first["rockfall_time_s"] == pytest.approx(10.0 - 3 / RATE, abs=1e-6)
    assert key_frames(second) == frame
    check_shown(scene, part)


def test_a_key_inserted_elsewhere_is_no_time(scene: bpy.types.Scene, part) -> None:
    """Auto-keying at another frame: the place is new, the time is not."""
    pick = picks_of(scene, "A")[2]
    time = pick["rockfall_time_s"]
    scene.frame_set(70)
    pick.location.y = 0.25
    pick.keyframe_insert("location", frame=70)
    update()
    assert pick["rockfall_time_s"] == time
    assert pick["rockfall_position_m"][1] == 0.25
    assert key_frames(pick) == [[pytest.approx((time - 10.0) * RATE, abs=1e-4)]] * 3
    check_shown(scene, part)


def test_a_deleted_pick_leaves_a_longer_flight(scene: bpy.types.Scene, part) -> None:
    bpy.data.objects.remove(picks_of(scene, "A")[2])
    update()
    assert len(picks_of(scene, "A")) == 4
    check_shown(scene, part)


def test_a_trajectory_without_picks_is_gone(scene: bpy.types.Scene, part) -> None:
    for pick in picks_of(scene, "A"):
        bpy.data.objects.remove(pick)
    update()
    assert not [o for o in scene.objects if o.get("rockfall_trajectory") == "A"]
    assert {row.trajectory for row in scene.rockfall_impacts} == {"B"}
    check_shown(scene, part)


def test_a_renamed_trajectory_leaves_nothing_under_its_old_name(scene: bpy.types.Scene, part) -> None:
    for pick in picks_of(scene, "A"):
        pick["rockfall_trajectory"] = "first run"
        pick.update_tag()
    update()
    check_shown(scene, part)
    assert set(json.loads(scene["rockfall_shown"])) == {"first run", "B"}
    assert {obj.get("rockfall_trajectory") for obj in scene.objects} <= {"first run", "B", None}


def test_a_copy_is_a_pick_of_its_own_at_the_present_moment(scene: bpy.types.Scene, part) -> None:
    pick = picks_of(scene, "A")[2]
    scene.frame_set(40)
    copy = pick.copy()
    copy.animation_data.action = pick.animation_data.action.copy()
    scene.collection.objects.link(copy)
    copy.location.y += 0.1
    update()
    assert copy["rockfall_id"] != pick["rockfall_id"]
    assert copy["rockfall_time_s"] == pytest.approx(10.0 + 40 / RATE, abs=1e-5)
    assert len(picks_of(scene, "A")) == 6
    check_shown(scene, part)


def test_a_linked_copy_gets_keys_of_its_own(scene: bpy.types.Scene, part) -> None:
    pick = picks_of(scene, "A")[2]
    frames = key_frames(pick)
    scene.frame_set(40)
    copy = pick.copy()  # shares the action
    scene.collection.objects.link(copy)
    update()
    assert copy.animation_data.action != pick.animation_data.action
    assert key_frames(pick) == frames
    assert key_frames(copy)[0][0] == pytest.approx(40.0, abs=1e-3)


def test_panel_edits(scene: bpy.types.Scene, part) -> None:
    pick = picks_of(scene, "A")[2]
    pick.rockfall_pick.status = "shattered"
    flags = [one["rockfall_flags"] for one in picks_of(scene, "A")[1:4]]
    assert flags == ["", "last;gap;shattered", "first;last;gap;contact"]
    pick.rockfall_pick.status = "ok"
    pick.rockfall_pick.kind = "pass"
    assert not {"rockfall_result", "rockfall_flags"} & set(pick.keys())
    assert pick.data.name == "Rockfall pass"
    check_shown(scene, part)
    pick.rockfall_pick.time_s = "11.812345678901234"
    assert pick["rockfall_time_s"] == 11.812345678901234
    check_shown(scene, part)
    pick.rockfall_pick.time_s = "soon"
    assert pick["rockfall_time_s"] == 11.812345678901234
    pick.rockfall_pick.note = "a dust cloud"
    assert dict(pick["rockfall_extra"])["note"] == "a dust cloud"


def test_confidence_is_a_standard_deviation(scene: bpy.types.Scene, part, numbers) -> None:
    pick = picks_of(scene, "A")[2]
    known = numbers(pick)["sigma_r"]
    del pick["rockfall_sigma_position_m"]
    pick.rockfall_pick.confidence = "1"
    assert numbers(pick)["sigma_r"] > 2 * known
    assert "rockfall_sigma_position_m" not in pick
    assert bpy.ops.rockfall.reconstruct() == {"FINISHED"}
    assert "rockfall_sigma_position_m" not in pick, "the confidence is not turned into a given deviation"
    pick.rockfall_pick.confidence = "NONE"
    assert np.isnan(numbers(pick)["sigma_r"])


def test_nudge(scene: bpy.types.Scene, part) -> None:
    pick = picks_of(scene, "A")[2]
    time = pick["rockfall_time_s"]
    bpy.context.view_layer.objects.active = pick
    assert bpy.ops.rockfall.nudge_pick_time(frames=0.1) == {"FINISHED"}
    assert pick["rockfall_time_s"] == pytest.approx(time + 0.1 / RATE, abs=1e-12)
    check_shown(scene, part)


def test_the_panel_shows_the_stored_kind_and_status(scene: bpy.types.Scene) -> None:
    for name in ("A", "B"):
        for pick in picks_of(scene, name):
            assert pick.rockfall_pick.kind == pick["rockfall_kind"]
            assert pick.rockfall_pick.status == pick["rockfall_status"]
    assert [pick.rockfall_pick.status for pick in picks_of(scene, "B")].count("doubtful") == 1


def test_a_new_pick(slope: bpy.types.Scene, part) -> None:
    picks, live = part("rockfall_addon.scene.picks.picks"), part("rockfall_addon.scene.footage.sync")
    for time, x in ((50.0, 2.0), (50.8, 6.0), (51.5, 11.0)):
        picks.add_pick(slope, "new run", time, [x, -3.0, ground(x)])
    live.sync(slope)
    check_shown(slope, part)
    assert len(json.loads(slope["rockfall_shown"])) == 3


@pytest.mark.parametrize("key", ["rockfall_time_s", "rockfall_position_m", "rockfall_id", "rockfall_extra"])
def test_a_pick_that_lost_a_property(scene: bpy.types.Scene, part, key: str) -> None:
    pick = picks_of(scene, "A")[2]
    del pick[key]
    pick.location.y += 0.2
    update()
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("other", None))
    update()
    said = [remark.text for remark in part("rockfall_addon.scene.problems").remarks(scene)]
    if key in ("rockfall_time_s", "rockfall_position_m"):
        (text,) = said
        assert "of A impact 2 is missing. Trajectory A goes without it" in text
    else:
        assert said == []
    check_shown(scene, part)
    assert len([row for row in scene.rockfall_impacts if row.trajectory == "A"]) == (
        2 if key in ("rockfall_time_s", "rockfall_position_m") else 3
    )


def test_a_key_beyond_the_end_moves_the_end(scene: bpy.types.Scene) -> None:
    end = scene.frame_end
    move_key(picks_of(scene, "B")[-1], 200.0)
    assert scene.frame_end > end


def test_a_time_shown_in_short_keeps_its_digits(scene: bpy.types.Scene) -> None:
    pick = picks_of(scene, "A")[2]
    pick.rockfall_pick.time_s = "11.812345678901234"
    assert pick.rockfall_pick.time_s == "11.8123"
    pick.rockfall_pick.time_s = "11.8123"  # Enter in the field, with nothing typed
    assert pick["rockfall_time_s"] == 11.812345678901234


def test_a_marker_stands_on_the_slope(slope: bpy.types.Scene) -> None:
    """Its z axis is at right angles to the plane, whose fall is known."""
    update()
    across = np.array([SLOPE, 0.0, 1.0]) / np.hypot(SLOPE, 1.0)
    impacts = [obj for obj in picks_of(slope, "A") if obj["rockfall_kind"] == "impact"]
    assert len(impacts) == 3
    for obj in impacts:
        up = obj.matrix_world.to_3x3().normalized().col[2]
        np.testing.assert_allclose(up, across, atol=1e-5)

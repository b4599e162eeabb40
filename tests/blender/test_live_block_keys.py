# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys of a block that a person moves, copies or deletes are edits of its picks."""

import bpy
import numpy as np
import pytest
from two_runs import RATE, SLOPE, check_shown, ground, key_frames, picks_of, places, trail, update


def block_of(scene: bpy.types.Scene, name: str) -> bpy.types.Object:
    (found,) = [o for o in scene.objects if o.get("rockfall_role") == "block" and o["rockfall_trajectory"] == name]
    return found


def curves_of(obj: bpy.types.Object) -> list[bpy.types.FCurve]:
    bag = obj.animation_data.action.layers[0].strips[0].channelbag(obj.animation_data.action_slot)
    return [bag.fcurves.find("location", index=axis) for axis in range(3)]


def nearest(curve: bpy.types.FCurve, frame: float) -> bpy.types.Keyframe:
    return min(curve.keyframe_points, key=lambda point: abs(point.co[0] - frame))


def check_block(scene: bpy.types.Scene, part, name: str) -> None:
    """The block has one key at each pick, and is on the flights between them, at sub-frames too."""
    block, rate = block_of(scene, name), scene.render.fps
    frames = [(pick["rockfall_time_s"] - 10.0 - 30.0 * (name == "B")) * rate for pick in picks_of(scene, name)]
    frames = [frame + (name == "B") * scene.rockfall.stagger_s * rate for frame in frames]
    assert key_frames(block) == [[pytest.approx(frame, abs=1e-4) for frame in frames]] * 3
    result = part("rockfall_addon.scene.picks.reconstruction").reconstruct_scene(scene)
    states = part("core.reconstruction.flight").flight_states
    for i in np.flatnonzero(result.flights.trajectory == name):
        start, end = result.flights.start_time_s[i], result.flights.end_time_s[i]
        for time in np.linspace(start, end, 5):
            frame = np.interp(time, [p["rockfall_time_s"] for p in picks_of(scene, name)], frames)
            there = [curve.evaluate(frame) for curve in curves_of(block)]
            np.testing.assert_allclose(there, states(result.flights, [i], [time])[0][0], atol=2e-4)


def test_a_key_of_the_block_moves_the_time_of_its_pick(scene: bpy.types.Scene, part) -> None:
    pick, others = picks_of(scene, "A")[2], places(trail(scene, "B").data)
    place, time, frame = list(pick["rockfall_position_m"]), pick["rockfall_time_s"], pick["rockfall_key_frame"]
    for curve in curves_of(block_of(scene, "A")):
        nearest(curve, frame).co_ui[0] += 2.5
        curve.update()
    update()
    assert pick["rockfall_time_s"] == pytest.approx(time + 2.5 / RATE, abs=1e-6)
    assert pick["rockfall_key_frame"] == pytest.approx(frame + 2.5, abs=1e-4)
    assert list(pick["rockfall_position_m"]) == place
    check_shown(scene, part)
    check_block(scene, part, "A")
    np.testing.assert_array_equal(places(trail(scene, "B").data), others)
    time = pick["rockfall_time_s"]
    update()
    assert pick["rockfall_time_s"] == time, "once is enough"
    assert not scene.get("rockfall_problem")


def test_all_keys_of_the_block_stretched(scene: bpy.types.Scene, part) -> None:
    before = np.array([pick["rockfall_time_s"] for pick in picks_of(scene, "A")])
    for curve in curves_of(block_of(scene, "A")):
        for point in curve.keyframe_points:
            point.co_ui[0] *= 1.2
        curve.update()
    update()
    after = np.array([pick["rockfall_time_s"] for pick in picks_of(scene, "A")])
    np.testing.assert_allclose(after - 10.0, 1.2 * (before - 10.0), atol=1e-5)
    check_shown(scene, part)
    check_block(scene, part, "A")


def test_keys_of_the_block_that_pass_each_other(scene: bpy.types.Scene, part) -> None:
    second, third = picks_of(scene, "A")[1:3]
    gap = third["rockfall_key_frame"] - second["rockfall_key_frame"]
    times = second["rockfall_time_s"], third["rockfall_time_s"]
    for curve in curves_of(block_of(scene, "A")):
        nearest(curve, second["rockfall_key_frame"]).co_ui[0] += gap + 3.0
        curve.update()
    update()
    assert second["rockfall_time_s"] == pytest.approx(times[1] + 3.0 / RATE, abs=1e-5)
    assert third["rockfall_time_s"] == times[1]
    check_shown(scene, part)
    check_block(scene, part, "A")


def test_a_deleted_key_of_the_block_deletes_its_pick(scene: bpy.types.Scene, part) -> None:
    gone = picks_of(scene, "A")[2]
    identifier, frame = gone["rockfall_id"], gone["rockfall_key_frame"]
    for curve in curves_of(block_of(scene, "A")):
        curve.keyframe_points.remove(nearest(curve, frame))
        curve.update()
    update()
    left = picks_of(scene, "A")
    assert len(left) == 4
    assert identifier not in [pick["rockfall_id"] for pick in left]
    check_shown(scene, part)
    check_block(scene, part, "A")
    assert len(picks_of(scene, "B")) == 5


def test_a_copied_key_of_the_block_is_a_new_pick(scene: bpy.types.Scene, part) -> None:
    pick = picks_of(scene, "A")[1]
    pick["rockfall_seen"] = {"position": list(pick["rockfall_position_m"]), "some": {"frame": 3}}
    frame = pick["rockfall_key_frame"]
    for curve in curves_of(block_of(scene, "A")):
        curve.keyframe_points.insert(frame + 12.0, nearest(curve, frame).co[1], options={"FAST"})
        curve.update()
    update()
    found = picks_of(scene, "A")
    assert len(found) == 6
    (new,) = [one for one in found if one["rockfall_time_s"] == pytest.approx(pick["rockfall_time_s"] + 12 / RATE)]
    assert new["rockfall_id"] != pick["rockfall_id"]
    assert list(new["rockfall_position_m"]) == list(pick["rockfall_position_m"])
    assert new["rockfall_kind"] == "impact"
    assert "rockfall_seen" not in new
    assert new.animation_data.action != pick.animation_data.action
    check_shown(scene, part)
    check_block(scene, part, "A")
    update()
    assert len(picks_of(scene, "A")) == 6


def test_a_key_of_the_block_moved_in_space_moves_its_pick_along_the_terrain(slope: bpy.types.Scene, part) -> None:
    pick = picks_of(slope, "A")[2]
    time, (x, y, _) = pick["rockfall_time_s"], pick["rockfall_position_m"]
    curves = curves_of(block_of(slope, "A"))
    nearest(curves[0], pick["rockfall_key_frame"]).co[1] += 0.8
    nearest(curves[1], pick["rockfall_key_frame"]).co[1] -= 0.3
    curves[0].update(), curves[1].update()
    update()
    along = 0.8 / (1 + SLOPE**2)  # the nearest point of the plane
    np.testing.assert_allclose(pick["rockfall_position_m"], [x + along, y - 0.3, ground(x + along)], atol=1e-4)
    assert pick["rockfall_time_s"] == time
    check_shown(slope, part)
    check_block(slope, part, "A")


def test_a_key_of_the_block_that_is_no_picks_is_put_back(scene: bpy.types.Scene, part) -> None:
    block = block_of(scene, "A")
    frames, times = key_frames(block), [pick["rockfall_time_s"] for pick in picks_of(scene, "A")]
    scene.frame_set(30)
    block.keyframe_insert("location", frame=30)
    update()
    assert key_frames(block) == frames
    assert "put back" in scene["rockfall_problem"]
    assert block.name in scene["rockfall_problem"]
    assert [pick["rockfall_time_s"] for pick in picks_of(scene, "A")] == times
    picks_of(scene, "A")[2].location.y += 0.1
    update()
    assert scene["rockfall_problem"] == "", "the next edit takes the remark away"
    block.animation_data_clear()
    block.location.x += 0.01
    update()
    assert key_frames(block) == frames, "all keys at once: the run does not vanish"
    assert len(picks_of(scene, "A")) == 5
    assert "put back" in scene["rockfall_problem"]


def test_keys_between_the_impacts_are_put_back(scene: bpy.types.Scene, part) -> None:
    scene.rockfall.use_drag = True
    block = block_of(scene, "A")
    frames, times = key_frames(block), [pick["rockfall_time_s"] for pick in picks_of(scene, "A")]
    assert len(frames[0]) > 20
    for curve in curves_of(block):
        curve.keyframe_points[3].co_ui[0] += 0.7
        curve.update()
    update()
    assert key_frames(block) == frames
    assert "put back" in scene["rockfall_problem"]
    pick = picks_of(scene, "A")[2]
    for curve in curves_of(block):
        nearest(curve, pick["rockfall_key_frame"]).co_ui[0] += 0.7
        curve.update()
    update()
    after = [pick["rockfall_time_s"] for pick in picks_of(scene, "A")]
    np.testing.assert_allclose(np.subtract(after, times), [0, 0, 0.7 / RATE, 0, 0], atol=1e-6)
    check_shown(scene, part)


def test_a_key_moved_onto_another_is_put_back_with_it(scene: bpy.types.Scene, part) -> None:
    """Blender deletes the other key then; nobody has deleted its pick."""
    second, third = picks_of(scene, "A")[1:3]
    times = second["rockfall_time_s"], third["rockfall_time_s"]
    for curve in curves_of(block_of(scene, "A")):
        moved, other = (nearest(curve, pick["rockfall_key_frame"]) for pick in (second, third))
        moved.co_ui[0] = other.co[0]
        curve.keyframe_points.remove(other)
        curve.update()
    update()
    assert (second["rockfall_time_s"], third["rockfall_time_s"]) == times
    assert len(picks_of(scene, "A")) == 5
    assert "moved to the time of another" in scene["rockfall_problem"]
    check_block(scene, part, "A")


def test_a_key_at_no_finite_place_is_put_back(scene: bpy.types.Scene, part) -> None:
    pick = picks_of(scene, "A")[2]
    place = list(pick["rockfall_position_m"])
    nearest(curves_of(block_of(scene, "A"))[0], pick["rockfall_key_frame"]).co[1] = float("nan")
    block_of(scene, "A").update_tag()
    update()
    assert list(pick["rockfall_position_m"]) == place
    assert "no finite time or place" in scene["rockfall_problem"]
    check_block(scene, part, "A")


def test_the_picks_own_key_goes_before_the_blocks(scene: bpy.types.Scene, part) -> None:
    """Both in a selection of all keys: moved once, not twice."""
    pick = picks_of(scene, "A")[2]
    time, frame = pick["rockfall_time_s"], pick["rockfall_key_frame"]
    for obj in (block_of(scene, "A"), pick):
        for curve in curves_of(obj):
            nearest(curve, frame).co_ui[0] += 1.5
            curve.update()
    update()
    assert pick["rockfall_time_s"] == pytest.approx(time + 1.5 / RATE, abs=1e-6)
    check_shown(scene, part)
    check_block(scene, part, "A")


def test_a_key_of_the_block_counts_once_while_its_run_cannot_be_computed(scene: bpy.types.Scene, part) -> None:
    first, second, third = picks_of(scene, "A")[1:4]
    first.rockfall_pick.time_s = repr(second["rockfall_time_s"])
    assert "trajectory A" in scene["rockfall_problem"]
    time = third["rockfall_time_s"]
    for curve in curves_of(block_of(scene, "A")):
        nearest(curve, third["rockfall_key_frame"]).co_ui[0] += 3.0
        curve.update()
    update()
    for _ in range(3):
        part("rockfall_addon.scene.footage.sync").sync(scene)
    assert third["rockfall_time_s"] == pytest.approx(time + 3.0 / RATE, abs=1e-6)
    first.rockfall_pick.time_s = "10.9"
    assert scene["rockfall_problem"] == ""
    check_shown(scene, part)
    check_block(scene, part, "A")


def test_while_a_key_of_the_block_is_held_the_flights_follow_and_nothing_is_written(scene, part) -> None:
    pick, block = picks_of(scene, "A")[2], block_of(scene, "A")
    time, frame = pick["rockfall_time_s"], pick["rockfall_key_frame"]
    for curve in curves_of(block):
        nearest(curve, frame).co_ui[0] += 6.0
    before = places(trail(scene, "A").data)
    assert part("rockfall_addon.scene.footage.sync").sync(scene, dragging=True).rebuilt == ["A"]
    assert pick["rockfall_time_s"] == time
    held = places(trail(scene, "A").data)
    assert held.shape != before.shape or not np.allclose(held, before, atol=1e-3)
    assert nearest(curves_of(block)[0], frame + 6.0).co[0] == pytest.approx(frame + 6.0)
    part("rockfall_addon.scene.footage.sync").sync(scene)
    assert pick["rockfall_time_s"] == pytest.approx(time + 6 / RATE, abs=1e-6)
    np.testing.assert_allclose(places(trail(scene, "A").data), held, atol=1e-4)
    check_block(scene, part, "A")


def test_keys_of_the_block_at_another_frame_rate(scene: bpy.types.Scene, part) -> None:
    pick = picks_of(scene, "A")[2]
    time = pick["rockfall_time_s"]
    scene.render.fps = 50
    update()
    assert pick["rockfall_time_s"] == time
    for curve in curves_of(block_of(scene, "A")):
        nearest(curve, pick["rockfall_key_frame"]).co_ui[0] += 5.0
        curve.update()
    update()
    assert pick["rockfall_time_s"] == pytest.approx(time + 0.1, abs=1e-6)
    check_shown(scene, part)
    check_block(scene, part, "A")


def test_a_run_without_flights_and_with_them_again(slope: bpy.types.Scene, part) -> None:
    """Where each pick is a stop, nothing moves: block and trail of the run go, and come again."""
    picks = picks_of(slope, "A")
    for pick in picks:
        pick.rockfall_pick.kind = "stop"
    assert not [o for o in slope.objects if o.get("rockfall_role") in ("block", "flights") and o.name.startswith("A ")]
    assert part("rockfall_addon.scene.problems").remarks(slope) == []
    picks[2].rockfall_pick.kind = "impact"
    check_shown(slope, part)
    check_block(slope, part, "B")

# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits of picks, by hand, by key, by panel, are followed by their trajectory, and by no other."""

import itertools
import json
from pathlib import Path

import bmesh
import bpy
import numpy as np
import pytest

GRAVITY = 9.81
RATE = 24.0
SLOPE = 0.7  # fall per metre along x


def ground(x: float) -> float:
    return 50.0 - SLOPE * x


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """Two runs down a plane, the second 30 s later and 5 m beside the first; B's last impact is doubtful."""
    rows = ["trajectory,time_s,x_m,y_m,z_m,kind,status,sigma_position_m,note"]
    for name, later, y in (("A", 0.0, 0.0), ("B", 30.0, 5.0)):
        kinds = ("release", "impact", "impact", "impact", "stop")
        for time, x, kind in zip(
            (10.0, 10.7312, 11.90017, 12.4, 13.0), (0.0, 4.0, 12.0, 16.0, 19.0), kinds, strict=True
        ):
            status = "doubtful" if name == "B" and time == 12.4 else "ok"
            rows.append(f"{name},{time + later!r},{x!r},{y!r},{ground(x)!r},{kind},{status},0.05,seen")
    path = tmp_path / "picks.csv"
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


@pytest.fixture
def terrain_file(tmp_path: Path) -> Path:
    path = tmp_path / "plane.obj"
    corners = [(x, y, ground(x)) for x, y in ((-10, -20), (60, -20), (60, 30), (-10, 30))]
    path.write_text("".join(f"v {x} {y} {z}\n" for x, y, z in corners) + "f 1 2 3\nf 1 3 4\n", encoding="utf-8")
    return path


@pytest.fixture
def scene(part, table: Path) -> bpy.types.Scene:
    assert bpy.ops.rockfall.import_picks(filepath=str(table)) == {"FINISHED"}
    return bpy.context.scene


@pytest.fixture
def slope(part, table: Path, terrain_file: Path) -> bpy.types.Scene:
    """The scene with its terrain."""
    surface = part("core.terrain.readers").read_terrain(terrain_file)
    part("rockfall_addon.scene.terrain").add_terrain(
        bpy.context.scene, surface, part("core.terrain.shading").shade(surface)
    )
    assert bpy.ops.rockfall.import_picks(filepath=str(table)) == {"FINISHED"}
    return bpy.context.scene


def update() -> None:
    bpy.context.view_layer.update()


def picks_of(scene: bpy.types.Scene, name: str) -> list[bpy.types.Object]:
    found = [o for o in scene.objects if o.get("rockfall_role") == "pick" and o["rockfall_trajectory"] == name]
    return sorted(found, key=lambda o: o["rockfall_time_s"])


def trail(scene: bpy.types.Scene, name: str) -> bpy.types.Object:
    (found,) = [o for o in scene.objects if o.get("rockfall_role") == "flights" and o["rockfall_trajectory"] == name]
    return found


def places(mesh: bpy.types.Mesh) -> np.ndarray:
    values = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("co", values)
    return values.reshape(-1, 3)


def values(mesh: bpy.types.Mesh, name: str) -> np.ndarray:
    attribute = mesh.attributes[name]
    found = np.empty(len(mesh.vertices), dtype=bool if attribute.data_type == "BOOLEAN" else np.float32)
    attribute.data.foreach_get("value", found)
    return found


def key_frames(obj: bpy.types.Object) -> list[list[float]]:
    (layer,) = obj.animation_data.action.layers
    bag = layer.strips[0].channelbag(obj.animation_data.action_slot)
    return [[point.co[0] for point in bag.fcurves.find("location", index=i).keyframe_points] for i in range(3)]


def move_key(obj: bpy.types.Object, frames: float) -> None:
    bag = obj.animation_data.action.layers[0].strips[0].channelbag(obj.animation_data.action_slot)
    for curve in bag.fcurves:
        for point in curve.keyframe_points:
            point.co_ui[0] += frames
        curve.update()
    update()


def check_shown(scene: bpy.types.Scene, part) -> None:
    """What is shown is what a reconstruction of the picks from nothing gives."""
    result = part("rockfall_addon.scene.reconstruction").reconstruct_scene(scene)
    rows = {(row.trajectory, row.number): row for row in scene.rockfall_impacts}
    assert len(rows) == len(result.impacts)
    for i in range(len(result.impacts)):
        row = rows[str(result.impacts.trajectory[i]), int(result.impacts.impact[i])]
        np.testing.assert_allclose([row.r, row.rn], [result.impacts.r[i], result.impacts.rn[i]], rtol=1e-6)
        pick = next(o for o in scene.objects if o.get("rockfall_id") == row.pick)
        assert pick["rockfall_time_s"] == result.impacts.time_s[i]
        np.testing.assert_array_equal(pick["rockfall_position_m"], result.impacts.position[i])
        np.testing.assert_array_equal(pick["rockfall_result"]["incident_mps"], result.impacts.v1[i])
    for name in set(result.picks.trajectory.tolist()):
        which = np.flatnonzero(result.flights.trajectory == name)
        shown = places(trail(scene, name).data)
        for point in (*result.flights.start_position[which], result.flights.end_position[which[-1]]):
            assert np.linalg.norm(shown - point, axis=1).min() < 1e-4


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
    flags = [one["rockfall_result"]["flags"] for one in picks_of(scene, "A")[1:4]]
    assert flags == ["", "last;gap;shattered", "first;last;gap;contact"]
    pick.rockfall_pick.status = "ok"
    pick.rockfall_pick.kind = "pass"
    assert "rockfall_result" not in pick
    assert pick.data.name == "Rockfall pass"
    check_shown(scene, part)
    pick.rockfall_pick.time_s = "11.812345678901234"
    assert pick["rockfall_time_s"] == 11.812345678901234
    check_shown(scene, part)
    pick.rockfall_pick.time_s = "soon"
    assert pick["rockfall_time_s"] == 11.812345678901234
    pick.rockfall_pick.note = "a dust cloud"
    assert dict(pick["rockfall_extra"])["note"] == "a dust cloud"


def test_confidence_is_a_standard_deviation(scene: bpy.types.Scene, part) -> None:
    pick = picks_of(scene, "A")[2]
    known = list(pick["rockfall_result"]["sigma_r"])
    del pick["rockfall_sigma_position_m"]
    pick.rockfall_pick.confidence = "1"
    assert pick["rockfall_result"]["sigma_r"][0] > 2 * known[0]
    assert "rockfall_sigma_position_m" not in pick
    assert bpy.ops.rockfall.reconstruct() == {"FINISHED"}
    assert "rockfall_sigma_position_m" not in pick, "the confidence is not turned into a given deviation"
    pick.rockfall_pick.confidence = "NONE"
    assert np.isnan(pick["rockfall_result"]["sigma_r"][0])


def test_nudge(scene: bpy.types.Scene, part) -> None:
    pick = picks_of(scene, "A")[2]
    time = pick["rockfall_time_s"]
    bpy.context.view_layer.objects.active = pick
    assert bpy.ops.rockfall.nudge_pick_time(frames=0.1) == {"FINISHED"}
    assert pick["rockfall_time_s"] == pytest.approx(time + 0.1 / RATE, abs=1e-12)
    check_shown(scene, part)


def test_two_picks_at_one_time_are_told_and_the_last_good_flights_stay(scene: bpy.types.Scene, part) -> None:
    first, second = picks_of(scene, "A")[1:3]
    shown = places(trail(scene, "A").data)
    second.rockfall_pick.time_s = first.rockfall_pick.time_s
    problem = scene["rockfall_problem"]
    assert "trajectory A" in problem
    assert "10.7312" in problem
    np.testing.assert_array_equal(places(trail(scene, "A").data), shown)
    assert trail(scene, "A")["rockfall_stale"]
    picks_of(scene, "B")[2].location.y += 0.3
    update()
    assert "trajectory A" in scene["rockfall_problem"]
    second.rockfall_pick.time_s = "11.9"
    assert scene["rockfall_problem"] == ""
    assert not trail(scene, "A").get("rockfall_stale")
    check_shown(scene, part)


def test_a_bad_trajectory_does_not_stop_the_others_from_following_a_setting(scene: bpy.types.Scene, part) -> None:
    picks_of(scene, "A")[2].rockfall_pick.time_s = "10.7312"
    mass = trail(scene, "B")["rockfall_mass_kg"]
    scene.rockfall.block_diameter_m = 0.7
    assert trail(scene, "B")["rockfall_mass_kg"] == pytest.approx(8 * mass, rel=1e-3)
    assert "trajectory A" in scene["rockfall_problem"]


def test_deleted_terrain_is_told(slope: bpy.types.Scene, part) -> None:
    (terrain,) = [o for o in slope.objects if o.get("rockfall_role") == "terrain"]
    rn = picks_of(slope, "A")[1]["rockfall_result"]["rn"][0]
    bpy.data.objects.remove(terrain)
    update()
    assert "terrain is gone" in slope["rockfall_problem"]
    assert picks_of(slope, "A")[1]["rockfall_result"]["rn"][0] == rn, "what was computed stays"
    picks_of(slope, "A")[2].location.y += 0.3
    update()
    assert np.isnan(picks_of(slope, "A")[1]["rockfall_result"]["rn"][0])
    assert np.isfinite(picks_of(slope, "A")[1]["rockfall_result"]["r"][0])
    assert picks_of(slope, "B")[1]["rockfall_result"]["rn"][0] == pytest.approx(rn, abs=1e-12)
    assert "terrain is gone" in slope["rockfall_problem"]


def test_another_terrain_recomputes_all(slope: bpy.types.Scene, part) -> None:
    (terrain,) = [o for o in slope.objects if o.get("rockfall_role") == "terrain"]
    terrain.location.z -= 0.4
    update()
    update()
    check_shown(slope, part)
    assert picks_of(slope, "B")[1]["rockfall_result"]["bounce_height_m"][0] > 0.3


def test_the_panel_shows_the_stored_kind_and_status(scene: bpy.types.Scene) -> None:
    for name in ("A", "B"):
        for pick in picks_of(scene, name):
            assert pick.rockfall_pick.kind == pick["rockfall_kind"]
            assert pick.rockfall_pick.status == pick["rockfall_status"]
    assert [pick.rockfall_pick.status for pick in picks_of(scene, "B")].count("doubtful") == 1


def test_a_marker_lies_on_the_terrain(slope: bpy.types.Scene) -> None:
    normal = np.array([SLOPE, 0.0, 1.0]) / np.hypot(SLOPE, 1.0)
    for pick in picks_of(slope, "A")[1:4]:
        up = np.array(pick.rotation_quaternion.to_matrix())[:, 2]
        np.testing.assert_allclose(up, normal, atol=1e-5)


def test_doubt_of_flights(slope: bpy.types.Scene) -> None:
    """The relative deviation of the speed at either end, where 20 % are the top; 1 beside a doubtful pick."""
    picks, mesh = picks_of(slope, "B"), trail(slope, "B").data
    doubt, at = values(mesh, "doubt"), places(mesh)
    ends = [np.array(pick["rockfall_position_m"]) for pick in picks]
    found = [doubt[(at[:, 0] > a[0] + 1e-3) & (at[:, 0] < b[0] - 1e-3)] for a, b in itertools.pairwise(ends)]
    assert all(np.ptp(one) == 0 for one in found), "one value for each flight"

    def relative(pick: bpy.types.Object, side: int) -> float:
        result = pick["rockfall_result"]
        speed = np.linalg.norm(result["incident_mps" if side == 1 else "restituted_mps"])
        return result[f"sigma_speed{side}"][0] / speed / 0.2

    first, second = picks[1:3]
    expected = [relative(first, 1), max(relative(first, 2), relative(second, 1)), 1.0, 1.0]
    np.testing.assert_allclose([one[0] for one in found], np.minimum(expected, 1.0), rtol=1e-5)
    assert 0.0 < expected[0] < 1.0


def raised(x: np.ndarray) -> np.ndarray:
    """What an edit adds to the heights of the plane, which it also turns."""
    return 5.0 + 0.2 * x


def edit_by_script(tile: bpy.types.Object) -> None:
    for vertex in tile.data.vertices:
        vertex.co.z += raised(vertex.co.x)
    tile.data.update()


def edit_in_edit_mode(tile: bpy.types.Object) -> None:
    bpy.context.view_layer.objects.active = tile
    bpy.ops.object.mode_set(mode="EDIT")
    mesh = bmesh.from_edit_mesh(tile.data)
    for vertex in mesh.verts:
        vertex.co.z += raised(vertex.co.x)
    bmesh.update_edit_mesh(tile.data)
    bpy.ops.object.mode_set(mode="OBJECT")


@pytest.mark.parametrize("edit", [edit_by_script, edit_in_edit_mode])
def test_an_edited_terrain_is_seen(slope: bpy.types.Scene, part, edit) -> None:
    """Vertices that move, as many as before: rays, normals, results and fingerprints are of the new surface."""
    terrain, reconstruction = part("rockfall_addon.scene.terrain"), part("rockfall_addon.scene.reconstruction")
    (tile,) = terrain.tiles(slope)
    cast = part("core.terrain.raycast").cast_rays
    above, down = np.array([[10.0, 0.0, 500.0]]), np.array([[0.0, 0.0, -1.0]])
    assert cast(terrain.surface_of_scene(slope), above, down).point[0, 2] == pytest.approx(ground(10.0), abs=1e-4)
    assert not any(each.value for each in trail(slope, "A").data.attributes["below_terrain"].data)
    edit(tile)
    update()
    hit = cast(terrain.surface_of_scene(slope), above, down)
    assert hit.point[0, 2] == pytest.approx(ground(10.0) + raised(10.0), abs=1e-4)
    normal = np.array([SLOPE - 0.2, 0.0, 1.0]) / np.hypot(SLOPE - 0.2, 1.0)
    impact = picks_of(slope, "A")[2]
    fresh = reconstruction.reconstruct_scene(slope).impacts
    (row,) = np.flatnonzero((fresh.trajectory == "A") & (fresh.time_s == impact["rockfall_time_s"]))
    np.testing.assert_allclose(fresh.normal[row], normal, atol=1e-6)
    assert impact["rockfall_result"]["rn"][0] == pytest.approx(fresh.rn[row], rel=1e-12)
    assert all(each.value for each in trail(slope, "A").data.attributes["below_terrain"].data)
    # the same terrain again changes nothing, and neither does a file that is opened again
    shown = slope["rockfall_shown"]
    tile.data.update()
    update()
    assert part("rockfall_addon.scene.sync").sync(slope).rebuilt == []
    assert slope["rockfall_shown"] == shown


def test_unit_scale_backside_and_early_picks_are_told(slope: bpy.types.Scene, part) -> None:
    slope.unit_settings.scale_length = 0.01
    part("rockfall_addon.scene.sync").touch(slope)
    assert "unit scale is 0.01" in slope["rockfall_problem"]
    slope.unit_settings.scale_length = 1.0
    part("rockfall_addon.scene.sync").touch(slope)
    assert slope["rockfall_problem"] == ""
    pick = picks_of(slope, "A")[1]
    pick["rockfall_normal"] = [0.0, 0.6, -0.8]
    part("rockfall_addon.scene.sync").touch(slope)
    assert "Trajectory A, 10.731 s: the pick is on the back" in slope["rockfall_problem"]
    del pick["rockfall_normal"]
    slope["rockfall_time_origin_s"] = 10.5
    slope.rockfall.playback = "REAL"
    assert "Trajectory A, 10.000 s: the pick is before the start" in slope["rockfall_problem"]
    assert key_frames(picks_of(slope, "A")[0])[0][0] == pytest.approx(-0.5 * RATE)
    assert "back" not in slope["rockfall_problem"]


def test_errors_of_ours_are_told_once(scene: bpy.types.Scene, part, monkeypatch, capsys) -> None:
    live, problems = part("rockfall_addon.scene.sync"), part("rockfall_addon.scene.problems")

    def broken(*_: object, **__: object) -> None:
        raise ValueError("quite unexpected")

    monkeypatch.setattr(live, "sync", broken)
    for _ in range(5):
        picks_of(scene, "A")[1].location.y += 0.1
        update()
    assert capsys.readouterr().out.count("quite unexpected") == 1
    assert sum("quite unexpected" in remark.text for remark in problems.remarks(scene)) == 1
    monkeypatch.undo()
    problems.forget()
    picks_of(scene, "A")[1].location.y += 0.1
    update()
    check_shown(scene, part)


def test_below_the_terrain_is_red_and_frames_are_ticks(slope: bpy.types.Scene, part) -> None:
    assert not values(trail(slope, "A").data, "below_terrain").any()
    pick = picks_of(slope, "A")[2]
    pick.rockfall_pick.kind = "pass"
    pick.location.z -= 3.0
    update()
    mesh = trail(slope, "A").data
    below = values(mesh, "below_terrain")
    shown = places(mesh)
    deep = shown[:, 2] - (50.0 - SLOPE * shown[:, 0])
    np.testing.assert_array_equal(below, deep < -0.2 * 0.175)
    assert below.any()
    colours = np.empty(4 * len(shown), dtype=np.float32)
    mesh.attributes["speed_colour"].data.foreach_get("color", colours)
    np.testing.assert_allclose(colours.reshape(-1, 4)[below], [[1, 0, 0, 1]] * int(below.sum()))
    ticks = values(mesh, "display_time_s")[values(mesh, "tick")] * RATE
    assert len(ticks) > 50
    np.testing.assert_allclose(ticks, np.round(ticks), atol=1e-3)


def test_beads_are_geometry(scene: bpy.types.Scene) -> None:
    def corners() -> int:
        tube = trail(scene, "A").evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        assert tube.attributes.active_color_name == "speed_colour", "else the 3-D view shows them white"
        return len(tube.vertices)

    bare = corners()
    scene.rockfall.show_ticks = True
    ticks = int(values(trail(scene, "A").data, "tick").sum())
    assert corners() == bare + 12 * ticks
    scene.rockfall.show_ticks = False
    assert corners() == bare


@pytest.mark.parametrize("by", ["SPEED", "ENERGY", "DOUBT"])
def test_colours(scene: bpy.types.Scene, part, by: str) -> None:
    scene.rockfall.colour_by = by
    mesh = trail(scene, "B").data
    colours = np.empty(4 * len(mesh.vertices), dtype=np.float32)
    mesh.attributes["speed_colour"].data.foreach_get("color", colours)
    speed = values(mesh, "speed_mps")
    if by == "SPEED":
        part_of = speed / scene.rockfall.speed_top_mps
    elif by == "ENERGY":
        part_of = 0.5 * trail(scene, "B")["rockfall_mass_kg"] * speed**2 / 1000 / scene.rockfall.energy_top_kj
    else:
        part_of = values(mesh, "doubt")
        time = values(mesh, "display_time_s")
        start = picks_of(scene, "B")[2]["rockfall_key_frame"] / RATE
        assert (part_of[time > start + 1e-3] == 1.0).all(), "beside the doubtful impact"
        assert (part_of[time < start - 0.5] < 1.0).all()
    core = part("core.colours")
    expected = core.srgb_to_linear(core.scale_colours(part_of, 0.0, 1.0))
    np.testing.assert_allclose(colours.reshape(-1, 4)[:, :3], expected, atol=1e-4)


def test_flights_join_centres(slope: bpy.types.Scene, part) -> None:
    slope.rockfall.flights_join = "centres"
    result = part("rockfall_addon.scene.reconstruction").reconstruct_scene(slope)
    assert result.ends == "centres"
    pick = picks_of(slope, "A")[1]
    frame = pick["rockfall_key_frame"]
    slope.frame_set(int(frame), subframe=frame % 1)
    block = next(o for o in slope.objects if o.get("rockfall_role") == "block" and o["rockfall_trajectory"] == "A")
    slope.rockfall.block_scale = 1.0
    update()
    normal = np.array([SLOPE, 0.0, 1.0]) / np.hypot(SLOPE, 1.0)
    expected = np.array(pick["rockfall_position_m"]) + 0.175 * normal
    np.testing.assert_allclose(block.matrix_world.translation, expected, atol=1e-3)


def test_the_table_selects_and_follows_the_selection(scene: bpy.types.Scene, part) -> None:
    rows = part("rockfall_addon.scene.impact_rows")
    assert [(row.trajectory, row.number) for row in scene.rockfall_impacts] == [
        (name, i) for name in "AB" for i in (1, 2, 3)
    ]
    scene.rockfall.impact_index = 4
    pick = picks_of(scene, "B")[2]
    assert bpy.context.view_layer.objects.active == pick
    assert pick.select_get()
    assert scene.frame_current_final == pytest.approx(pick["rockfall_key_frame"], abs=1e-3)
    rows.highlight(scene, picks_of(scene, "A")[1]["rockfall_id"])
    assert scene.rockfall.impact_index == 0


def test_the_table_sorts_and_filters(scene: bpy.types.Scene, part) -> None:
    table = part("rockfall_addon.steps.impacts.table")
    rows = list(scene.rockfall_impacts)

    def listed() -> list:
        shown, order = table.arranged(rows, scene.rockfall, "A")
        return [row for _, row, seen in sorted(zip(order, rows, shown, strict=True), key=lambda x: x[0]) if seen]

    for column in ("r", "theta1_deg", "speed1_mps", "time_s"):
        for down in (False, True):
            scene.rockfall.table_sort, scene.rockfall.table_descending = column, down
            numbers = [getattr(row, column) for row in listed()]
            known = [value for value in numbers if not np.isnan(value)]
            assert known == sorted(known, reverse=down)
            assert np.isfinite(numbers[: len(known)]).all(), "what is not defined comes last"
    scene.rockfall.table_trajectory = True
    assert {row.trajectory for row in listed()} == {"A"}
    scene.rockfall.table_trajectory, scene.rockfall.table_flagged = False, True
    assert [row.flags for row in listed()] == [row.flags for row in listed() if row.flags]
    assert bpy.ops.rockfall.sort_impacts(column="rn") == {"FINISHED"}
    assert (scene.rockfall.table_sort, scene.rockfall.table_descending) == ("rn", False)
    assert bpy.ops.rockfall.sort_impacts(column="rn") == {"FINISHED"}
    assert scene.rockfall.table_descending


def test_a_new_pick(slope: bpy.types.Scene, part) -> None:
    picks, live = part("rockfall_addon.scene.picks"), part("rockfall_addon.scene.sync")
    for time, x in ((50.0, 2.0), (50.8, 6.0), (51.5, 11.0)):
        picks.add_pick(slope, "new run", time, [x, -3.0, ground(x)])
    live.sync(slope)
    check_shown(slope, part)
    assert len(json.loads(slope["rockfall_shown"])) == 3


def test_twins_follow_an_edit(slope: bpy.types.Scene, part) -> None:
    assert bpy.ops.rockfall.show_models(models={"noel_2017"}) == {"FINISHED"}

    def landing() -> list[float]:
        obj = next(o for o in slope.objects if o.get("rockfall_role") == "twin_flights")
        return list(obj.data.vertices[-1].co)

    before = landing()
    picks_of(slope, "B")[3].location.x += 0.7
    update()
    assert landing() != before
    check_shown(slope, part)


@pytest.mark.parametrize("key", ["rockfall_time_s", "rockfall_position_m", "rockfall_id", "rockfall_extra"])
def test_a_pick_that_lost_a_property(scene: bpy.types.Scene, part, key: str) -> None:
    pick = picks_of(scene, "A")[2]
    del pick[key]
    pick.location.y += 0.2
    update()
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("other", None))
    update()
    assert part("rockfall_addon.scene.problems").remarks(scene) == []
    check_shown(scene, part)
    assert len([row for row in scene.rockfall_impacts if row.trajectory == "A"]) == (
        2 if key in ("rockfall_time_s", "rockfall_position_m") else 3
    )


def test_an_unknown_kind_is_told(scene: bpy.types.Scene, part) -> None:
    pick = picks_of(scene, "A")[2]
    pick["rockfall_kind"] = "impakt"
    pick.location.y += 0.2
    update()
    assert "trajectory A: Unknown kind 'impakt'. Did you mean impact?" in scene["rockfall_problem"]
    pick.rockfall_pick.kind = "impact"
    assert scene["rockfall_problem"] == ""
    check_shown(scene, part)


def test_a_key_beyond_the_end_moves_the_end(scene: bpy.types.Scene) -> None:
    end = scene.frame_end
    move_key(picks_of(scene, "B")[-1], 200.0)
    assert scene.frame_end > end


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
    result = part("rockfall_addon.scene.reconstruction").reconstruct_scene(scene)
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
    first.rockfall_pick.time_s = second.rockfall_pick.time_s
    assert "trajectory A" in scene["rockfall_problem"]
    time = third["rockfall_time_s"]
    for curve in curves_of(block_of(scene, "A")):
        nearest(curve, third["rockfall_key_frame"]).co_ui[0] += 3.0
        curve.update()
    update()
    for _ in range(3):
        part("rockfall_addon.scene.sync").sync(scene)
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
    assert part("rockfall_addon.scene.sync").sync(scene, dragging=True).rebuilt == ["A"]
    assert pick["rockfall_time_s"] == time
    held = places(trail(scene, "A").data)
    assert held.shape != before.shape or not np.allclose(held, before, atol=1e-3)
    assert nearest(curves_of(block)[0], frame + 6.0).co[0] == pytest.approx(frame + 6.0)
    part("rockfall_addon.scene.sync").sync(scene)
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

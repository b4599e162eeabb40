# SPDX-License-Identifier: GPL-3.0-or-later
"""What cannot be computed is told, and the rest follows all the same; terrain that changes is seen."""

from pathlib import Path

import bmesh
import bpy
import numpy as np
import pytest
from two_runs import RATE, SLOPE, check_shown, ground, key_frames, picks_of, places, trail, update


def test_two_picks_at_one_time_are_told_and_the_last_good_flights_stay(scene: bpy.types.Scene, part) -> None:
    first, second = picks_of(scene, "A")[1:3]
    shown = places(trail(scene, "A").data)
    second.rockfall_pick.time_s = first.rockfall_pick.time_s
    problem = scene["rockfall_problem"]
    (remark,) = part("rockfall_addon.scene.problems").remarks(scene)
    assert remark.text.startswith(f"{Path(scene['rockfall_picks_source']).name}, row "), "a folder would fill the panel"
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


def test_deleted_terrain_is_told(slope: bpy.types.Scene, part, numbers) -> None:
    (terrain,) = [o for o in slope.objects if o.get("rockfall_role") == "terrain"]
    rn = numbers(picks_of(slope, "A")[1])["rn"]
    bpy.data.objects.remove(terrain)
    update()
    assert "terrain is gone" in slope["rockfall_problem"]
    assert numbers(picks_of(slope, "A")[1])["rn"] == rn, "what was computed stays"
    picks_of(slope, "A")[2].location.y += 0.3
    update()
    assert np.isnan(numbers(picks_of(slope, "A")[1])["rn"])
    assert np.isfinite(numbers(picks_of(slope, "A")[1])["r"])
    assert numbers(picks_of(slope, "B")[1])["rn"] == pytest.approx(rn, abs=1e-12)
    assert "terrain is gone" in slope["rockfall_problem"]


def test_another_terrain_recomputes_all(slope: bpy.types.Scene, part, numbers) -> None:
    (terrain,) = [o for o in slope.objects if o.get("rockfall_role") == "terrain"]
    terrain.location.z -= 0.4
    update()
    update()
    check_shown(slope, part)
    assert numbers(picks_of(slope, "B")[1])["bounce_height_m"] > 0.3


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
def test_an_edited_terrain_is_seen(slope: bpy.types.Scene, part, edit, numbers) -> None:
    """Vertices that move, as many as before: rays, normals, results and fingerprints are of the new surface."""
    terrain, reconstruction = (
        part("rockfall_addon.scene.terrain.terrain"),
        part("rockfall_addon.scene.picks.reconstruction"),
    )
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
    assert numbers(impact)["rn"] == pytest.approx(fresh.rn[row], rel=1e-12)
    assert all(each.value for each in trail(slope, "A").data.attributes["below_terrain"].data)
    # the same terrain again changes nothing, and neither does a file that is opened again
    shown = slope["rockfall_shown"]
    tile.data.update()
    update()
    assert part("rockfall_addon.scene.footage.sync").sync(slope).rebuilt == []
    assert slope["rockfall_shown"] == shown


def test_unit_scale_backside_and_early_picks_are_told(slope: bpy.types.Scene, part) -> None:
    slope.unit_settings.scale_length = 0.01
    part("rockfall_addon.scene.footage.sync").touch(slope)
    assert "unit scale is 0.01" in slope["rockfall_problem"]
    slope.unit_settings.scale_length = 1.0
    part("rockfall_addon.scene.footage.sync").touch(slope)
    assert slope["rockfall_problem"] == ""
    pick = picks_of(slope, "A")[1]
    pick["rockfall_normal"] = [0.0, 0.6, -0.8]
    part("rockfall_addon.scene.footage.sync").touch(slope)
    assert "Trajectory A, 10.731 s: the pick is on the back" in slope["rockfall_problem"]
    del pick["rockfall_normal"]
    slope["rockfall_time_origin_s"] = 10.5
    slope.rockfall.playback = "REAL"
    assert "Trajectory A, 10.000 s: the pick is before the start" in slope["rockfall_problem"]
    assert key_frames(picks_of(slope, "A")[0])[0][0] == pytest.approx(-0.5 * RATE)
    assert "back" not in slope["rockfall_problem"]


def test_errors_of_ours_are_told_once(scene: bpy.types.Scene, part, monkeypatch, capsys) -> None:
    live, problems = part("rockfall_addon.scene.footage.sync"), part("rockfall_addon.scene.problems")

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


def test_an_unknown_kind_is_told(scene: bpy.types.Scene, part) -> None:
    pick = picks_of(scene, "A")[2]
    pick["rockfall_kind"] = "impakt"
    pick.location.y += 0.2
    update()
    assert "Set aside: the kind of A impact 2 ('impakt') is none of impact" in scene["rockfall_problem"]
    assert "(did you mean impact?). Trajectory A goes without it" in scene["rockfall_problem"]
    pick.rockfall_pick.kind = "impact"
    assert scene["rockfall_problem"] == ""
    check_shown(scene, part)

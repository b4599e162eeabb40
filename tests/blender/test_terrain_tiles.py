# SPDX-License-Identifier: GPL-3.0-or-later
"""Several tiles are one terrain: rays, normals and trajectories are those of the undivided one."""

from dataclasses import replace

import bpy
import numpy as np
import pytest


@pytest.fixture
def demo(part):
    """The core's surface, picks and shading of the demo, and the modules that are needed."""
    opening, project = part("core.workflow.opening"), part("core.exchange.project")
    surface, result = opening.open_project(project.read_project(part("rockfall_addon.steps.start.operators").DEMO))
    return surface, result


def halves(part, surface, axis=0):
    """A surface cut in two along the edges of its triangles."""
    centre = surface.vertices[surface.faces].mean(axis=1)[:, axis]
    pieces = []
    for name, which in (("first.ply", centre < np.median(centre)), ("second.ply", centre >= np.median(centre))):
        used, number = np.unique(surface.faces[which], return_inverse=True)
        faces = number.reshape(-1, 3).astype(np.int32)
        pieces.append(replace(surface, vertices=surface.vertices[used], faces=faces, name=name))
    return pieces


def add(part, surfaces):
    shade, terrain = part("core.terrain.shading").shade, part("rockfall_addon.scene.terrain")
    return [terrain.add_terrain(bpy.context.scene, surface, shade(surface)) for surface in surfaces]


@pytest.mark.parametrize("reloaded", [False, True])
def test_two_halves_reconstruct_as_the_whole(part, demo, tmp_path, reloaded: bool) -> None:
    surface, result = demo
    scene = bpy.context.scene
    add(part, halves(part, surface))
    terrain = part("rockfall_addon.scene.terrain")
    if reloaded:  # from single precision then
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "site.blend"))
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "site.blend"))
        scene = bpy.context.scene
        terrain._surfaces.clear()
    joined = terrain.surface_of_scene(scene)
    assert terrain.surface_of_scene(scene) is joined, "joined once"
    assert len(joined.vertices) == len(surface.vertices)
    near = 1e-9 if not reloaded else 2e-4
    rays, normals = part("core.terrain.raycast"), part("core.terrain.orientation")
    above = result.picks.position + np.array([0.3, -0.2, 30.0])
    np.testing.assert_allclose(
        rays.cast_rays(joined, above, (0, 0, -1)).distance,
        rays.cast_rays(surface, above, (0, 0, -1)).distance,
        atol=near,
    )
    for_picks = [normals.block_scale_normals(s, result.picks.position, 1.0).normal for s in (joined, surface)]
    np.testing.assert_allclose(*for_picks, atol=100 * near)
    reconstruct = part("core.reconstruction.trajectory").reconstruct
    ours, whole = (reconstruct(result.picks, surface=s, block=result.block) for s in (joined, surface))
    np.testing.assert_allclose(ours.impacts.rn, whole.impacts.rn, atol=100 * near)
    np.testing.assert_allclose(ours.impacts.normal, whole.impacts.normal, atol=100 * near)


def test_a_tile_in_another_shift_comes_to_the_projects(part, demo) -> None:
    surface, _ = demo
    first, second = halves(part, surface)
    other = part("core.georeference").GlobalShift(surface.shift.x - 1000, surface.shift.y + 500, surface.shift.z)
    add(part, [first, part("core.terrain.joining").moved(second, other)])
    state, terrain = part("rockfall_addon.scene.georeference"), part("rockfall_addon.scene.terrain")
    assert state.read_shift(bpy.context.scene) == surface.shift
    joined = terrain.surface_of_scene(bpy.context.scene)
    np.testing.assert_allclose(joined.bounds, surface.bounds, atol=1e-9)
    assert len(joined.vertices) == len(surface.vertices), "sewn at the seam"


def test_a_deleted_tile_is_gone_and_a_hidden_one_is_not(part, demo) -> None:
    surface, _ = demo
    scene = bpy.context.scene
    first, second = add(part, halves(part, surface))
    terrain = part("rockfall_addon.scene.terrain")
    second.hide_set(True)
    second.hide_viewport = True
    assert len(terrain.surface_of_scene(scene).faces) == len(surface.faces)
    bpy.data.objects.remove(second)
    assert len(terrain.surface_of_scene(scene).faces) == len(first.data.polygons)
    bpy.data.objects.remove(first)
    assert terrain.surface_of_scene(scene) is None
    assert tuple(terrain.downhill(scene)) == (0.0, -1.0, 0.0)


def test_an_emptied_tile_is_left_out_in_words(part, demo) -> None:
    surface, _ = demo
    scene = bpy.context.scene
    first, second = add(part, halves(part, surface))
    terrain = part("rockfall_addon.scene.terrain")
    second.data.clear_geometry()
    assert len(terrain.surface_of_scene(scene).faces) == len(first.data.polygons)
    assert [said for said in terrain.warnings(scene) if "second.ply has no faces" in said]
    first.data.clear_geometry()
    with pytest.raises(part("core.errors").RockfallError, match="has no faces"):
        terrain.surface_of_scene(scene)


def test_a_moved_turned_and_mirrored_tile_is_where_it_is(part, demo) -> None:
    surface, _ = demo
    scene = bpy.context.scene
    (ground,) = add(part, [surface])
    terrain = part("rockfall_addon.scene.terrain")
    ground.location, ground.scale = (10.0, 20.0, 30.0), (-1.0, 1.0, 2.0)
    bpy.context.view_layer.update()
    there = terrain.surface_of_scene(scene)
    np.testing.assert_allclose(there.vertices, surface.vertices * [-1, 1, 2] + [10, 20, 30], atol=1e-3)
    up = np.nansum(surface.face_normals[:, 2] > 0)
    assert np.nansum(there.face_normals[:, 2] > 0) == pytest.approx(up, abs=5), "still out of the ground"
    assert any("is locked, but was moved by" in said for said in terrain.warnings(scene))
    assert bpy.ops.rockfall.lock_terrain() == {"FINISHED"}
    assert not terrain.warnings(scene)
    assert any("Moved, turned or scaled" in said for said in terrain.remarks(scene)), "unlocked: on purpose"
    scene.unit_settings.scale_length = 0.01
    assert any("0.01" in said for said in terrain.remarks(scene))


def test_a_locked_scan_that_a_script_has_moved_is_put_back(part, demo) -> None:
    surface, _ = demo
    scene = bpy.context.scene
    (ground,) = add(part, [surface])
    terrain, following = part("rockfall_addon.scene.terrain"), part("rockfall_addon.scene.next_step")
    assert not bpy.ops.rockfall.put_terrain_back.poll()
    ground.location = (0.0, 0.0, 30.0)
    bpy.context.view_layer.update()
    assert any("moved by 30.00 m" in said for said in terrain.warnings(scene))
    assert following.next_step(scene).actions == ("rockfall.put_terrain_back",)
    assert bpy.ops.rockfall.put_terrain_back() == {"FINISHED"}
    bpy.context.view_layer.update()
    assert not terrain.warnings(scene)
    np.testing.assert_allclose(terrain.surface_of_scene(scene).vertices, surface.vertices, atol=1e-4)


def test_undo_keeps_the_index_of_a_terrain_that_is_as_it_was(part, demo) -> None:
    surface, _ = demo
    scene = bpy.context.scene
    (ground,) = add(part, [surface])
    terrain = part("rockfall_addon.scene.terrain")
    before = terrain.surface_of_scene(scene)
    part("rockfall_addon.scene.terrain_mesh").mistrust()
    assert terrain.surface_of_scene(scene) is before
    ground.data.vertices[0].co.z += 1.0
    part("rockfall_addon.scene.terrain_mesh").mistrust()
    after = terrain.surface_of_scene(scene)
    assert after is not before
    assert after.vertices[0, 2] == pytest.approx(before.vertices[0, 2] + 1.0, abs=1e-4)


def test_far_terrain_is_said_to_be_coarse(part, demo) -> None:
    surface, _ = demo
    far = replace(surface, vertices=surface.vertices + np.array([50_000.0, 0, 0]))
    add(part, [far])
    (said,) = part("rockfall_addon.scene.terrain").warnings(bpy.context.scene)
    assert "50 km" in said
    assert "3.9 mm" in said, "single precision beyond 32 768 m"


def test_a_conflicting_shift_is_refused_in_words(part, demo) -> None:
    surface, _ = demo
    (ground,) = add(part, [surface])
    demo_file = str(part("rockfall_addon.steps.start.operators").DEMO.with_name("terrain.ply"))
    with pytest.raises(RuntimeError, match="all files share the project's"):
        bpy.ops.rockfall.import_terrain(filepath=demo_file, shift_x="1", shift_y="2", shift_z="3")
    assert len(bpy.context.scene.objects) == 1
    shift = surface.shift
    same = {"shift_x": repr(shift.x), "shift_y": repr(shift.y), "shift_z": repr(shift.z)}
    assert bpy.ops.rockfall.import_terrain(filepath=demo_file, **same) == {"FINISHED"}
    second = next(o for o in bpy.context.scene.objects if o != ground)
    low = [[min(c[i] for c in obj.bound_box) for i in range(3)] for obj in (ground, second)]
    np.testing.assert_allclose(*low, atol=1e-4)


PLANES = {"low.obj": 0.0, "high.obj": 0.05}


@pytest.fixture
def planes(tmp_path):
    """Two planes, the second a little higher."""
    for name, height in PLANES.items():
        corners = [(x, y, 50 - 0.7 * x + height) for x, y in ((-10, -20), (60, -20), (60, 30), (-10, 30))]
        lines = [f"v {x} {y} {z}\n" for x, y, z in corners]
        (tmp_path / name).write_text("".join(lines) + "f 1 2 3\nf 1 3 4\n", encoding="utf-8")
    return [str(tmp_path / name) for name in PLANES]


def grounds(part):
    return part("rockfall_addon.scene.store").with_role(bpy.context.scene, "terrain")


def picked(part):
    found = part("rockfall_addon.scene.picks").picks_of(bpy.context.scene)
    return found.position.tolist(), found.time_s.tolist()


def test_a_terrain_is_removed_and_its_picks_stay(part, numbers, table, planes, capfd) -> None:
    assert bpy.ops.rockfall.import_terrain(filepath=planes[0]) == {"FINISHED"}
    assert bpy.ops.rockfall.import_picks(filepath=str(table)) == {"FINISHED"}
    before, scene = picked(part), bpy.context.scene
    before_it = numbers(scene.objects["A impact 2"])
    bpy.ops.ed.undo_push(message="before")
    (tile,) = grounds(part)
    assert bpy.ops.rockfall.remove_terrain(identifier=tile["rockfall_id"]) == {"FINISHED"}
    assert "Removed low.obj. 10 picks stay where they are." in capfd.readouterr().out
    bpy.ops.ed.undo_push(message="removed")
    assert not grounds(part)
    assert picked(part) == before
    assert numbers(scene.objects["A impact 2"]) == before_it
    assert "terrain is gone" in scene["rockfall_problem"]
    assert not bpy.ops.rockfall.remove_terrain.poll()
    bpy.ops.ed.undo()
    bpy.context.view_layer.update()
    assert [tile.name for tile in grounds(part)] == ["low.obj"]
    assert picked(part) == before


def test_one_terrain_takes_the_place_of_another(part, table, planes, capfd) -> None:
    assert bpy.ops.rockfall.import_terrain(filepath=planes[0]) == {"FINISHED"}
    assert bpy.ops.rockfall.import_picks(filepath=str(table)) == {"FINISHED"}
    before, (tile,) = picked(part), grounds(part)
    assert bpy.ops.rockfall.import_terrain(filepath=planes[1], replaces=tile["rockfall_id"]) == {"FINISHED"}
    assert "Replaced low.obj. 10 picks stay where they are." in capfd.readouterr().out
    assert [tile.name for tile in grounds(part)] == ["high.obj"]
    assert picked(part) == before
    missing = bpy.ops.rockfall.import_terrain
    with pytest.raises(RuntimeError, match="not there any more"):
        missing(filepath=planes[0], replaces="nothing")
    assert [tile.name for tile in grounds(part)] == ["high.obj"], "nothing is added when nothing can be replaced"

# SPDX-License-Identifier: GPL-3.0-or-later
"""Vegetation taken out at import, and shown."""

import bpy
import numpy as np


def test_what_the_filter_leaves_out_is_shown_on_request_and_is_no_terrain(part, tmp_path):
    store, terrain = part("rockfall_addon.scene.storage.store"), part("rockfall_addon.scene.terrain.terrain")
    rng = np.random.default_rng(1)
    ground = np.column_stack([rng.random((2_000, 2)) * 20, np.zeros(2_000)])
    plants = np.column_stack([5 + rng.random((300, 2)) * 4, rng.uniform(2, 6, 300)])
    np.savetxt(tmp_path / "cloud.xyz", np.vstack([ground, plants]), fmt="%.3f")
    bpy.ops.rockfall.import_terrain(filepath=str(tmp_path / "cloud.xyz"), ground="FILTER")
    (left_out,) = store.with_role(bpy.context.scene, store.LEFT_OUT_ROLE)
    assert len(left_out.data.vertices) == 300
    assert min(v.co.z for v in left_out.data.vertices) > 1.9
    assert left_out.hide_render
    surface = terrain.surface_of_scene(bpy.context.scene)
    assert surface.bounds[1, 2] < 0.01
    assert not left_out.visible_get(), "the slope is seen first"
    for shown in (True, False, True):
        assert bpy.ops.rockfall.toggle_left_out() == {"FINISHED"}
        assert left_out.visible_get() == shown


def test_trees_that_were_read_as_ground_are_noticed_until_they_are_filtered_out(part, tmp_path):
    rng = np.random.default_rng(2)
    ground = np.column_stack([rng.random((2_000, 2)) * 20, np.zeros(2_000)])
    plants = np.column_stack([5 + rng.random((600, 2)) * 8, rng.uniform(2, 6, 600)])
    np.savetxt(tmp_path / "cloud.xyz", np.vstack([ground, plants]), fmt="%.3f")
    terrain, following = part("rockfall_addon.scene.terrain.terrain"), part("rockfall_addon.scene.next_step")
    panel, scene = bpy.types.ROCKFALL_PT_terrain, bpy.context.scene
    bpy.ops.rockfall.import_terrain(filepath=str(tmp_path / "cloud.xyz"))
    (tile,) = terrain.tiles(scene)
    assert panel.step_state(bpy.context) == "ATTENTION"
    assert any("ground filter" in said for said in terrain.warnings(scene))
    step = following.next_step(scene)
    assert "trees" in step.sentence
    assert (step.actions[0], step.tile) == ("rockfall.import_terrain", tile["rockfall_id"])
    assert len(step.actions) == 2, "one may go on all the same"
    bpy.ops.rockfall.import_terrain(filepath=str(tmp_path / "cloud.xyz"), ground="FILTER", replaces=step.tile)
    assert panel.step_state(bpy.context) == "READY"
    assert "trees" not in following.next_step(scene).sentence

# SPDX-License-Identifier: GPL-3.0-or-later
"""Vegetation taken out at import, and shown."""

import bpy
import numpy as np


def test_what_the_filter_leaves_out_is_shown_on_request_and_is_no_terrain(part, tmp_path):
    store, terrain = part("rockfall_addon.scene.store"), part("rockfall_addon.scene.terrain")
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

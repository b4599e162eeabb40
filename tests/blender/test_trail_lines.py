# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines of the flights are those of the meshes, and only those that changed are read again."""

import bpy
import numpy as np


def points_of(obj):
    return np.array([vertex.co[:] for vertex in obj.data.vertices], dtype=np.float32)


def test_an_edit_reads_its_trajectory_alone_again(part):
    lines, store = part("rockfall_addon.view.trail_lines"), part("rockfall_addon.scene.storage.store")
    assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
    scene = bpy.context.scene
    before = lines.trails_of(scene)
    flights = store.with_role(scene, store.FLIGHTS_ROLE)
    assert len(before.parts) == len(flights) == 15
    np.testing.assert_array_equal(before.position, np.concatenate([points_of(obj) for obj in flights]))
    assert lines.trails_of(scene) is before
    pick = next(obj for obj in store.with_role(scene, store.PICK_ROLE) if obj[store.TRAJECTORY] == "B07")
    pick.location.z += 0.5
    bpy.context.view_layer.update()
    after = lines.trails_of(scene)
    np.testing.assert_array_equal(after.position, np.concatenate([points_of(obj) for obj in flights]))
    assert sum(one is not other for one, other in zip(before.parts, after.parts, strict=True)) == 1
    np.testing.assert_array_equal(after.segment.max(), len(after.position) - 1)
    flights[3].hide_set(True)
    bpy.context.view_layer.update()
    assert len(lines.trails_of(scene).parts) == 14

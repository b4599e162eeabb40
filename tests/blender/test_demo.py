# SPDX-License-Identifier: GPL-3.0-or-later
"""*Load demo* shows the bundled site."""

import bpy
import numpy as np


def test_load_demo(part) -> None:
    assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
    state = part("rockfall_addon.scene.storage.store")
    scene = bpy.context.scene
    (ground,) = state.with_role(scene, "terrain")
    assert 250_000 < len(ground.data.polygons) < 350_000
    assert len(state.with_role(scene, "flights")) == len(state.with_role(scene, "block")) == 15
    picks = state.with_role(scene, "pick")
    impacts = [p for p in picks if "rockfall_result" in p]
    assert 90 <= len(impacts) <= 115
    # the picks lie on the slope that is shown
    surface = part("rockfall_addon.scene.terrain.terrain").surface_of(ground)
    places = np.array([p["rockfall_position_m"] for p in impacts])
    distance = part("core.terrain.raycast").closest_points(surface, places).distance
    assert np.median(distance) < 0.05
    # and the blocks have moved downhill by the end
    block = state.with_role(scene, "block")[0]
    scene.frame_set(0)
    start = block.matrix_world.translation.z
    scene.frame_set(scene.frame_end)
    assert start - block.matrix_world.translation.z > 60


def test_demo_is_not_loaded_over_another_terrain(part) -> None:
    assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
    assert not bpy.ops.rockfall.load_demo.poll()

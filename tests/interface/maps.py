# SPDX-License-Identifier: GPL-3.0-or-later
"""A person computes maps of the demo, looks at them and reads the numbers of a cell under the mouse."""

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Vector


def settings():
    return bpy.context.scene.rockfall_simulation


def case_maps_of_the_demo(window):
    """Compute in the background, read a cell, another map, the light theme, undo and redo."""
    yield from window.show_sidebar()
    with window.override():
        assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
        bpy.ops.ed.undo_push(message="demo")
    yield 1.0
    yield from window.open_panel("ROCKFALL_PT_simulation")
    maps = window.part("rockfall_addon.scene.simulation.hazard_maps")
    job = window.part("rockfall_addon.view.job")
    settings().map_number = 100
    with window.override():
        bpy.ops.rockfall.compute_maps("INVOKE_DEFAULT")
    scene = bpy.context.scene
    yield from window.wait_for(lambda: maps.maps_of(scene) is not None and not job.is_running(), 360, "maps")
    yield 1.0
    found = maps.read(maps.maps_of(scene))
    values = found.layers["Reach_probability"]
    low = np.where(np.arange(values.shape[0])[:, None] < 45, np.nan_to_num(values), 0.0)
    row, column = np.unravel_index(np.argmax(low), low.shape)
    x, y = (np.array([column, row]) + 0.5) * found.cells.size_m + [found.cells.x0_m, found.cells.y0_m]
    surface = window.part("rockfall_addon.scene.simulation.simulation_setup").ground(scene)
    raycast = window.part("core.terrain.raycast")
    z = raycast.cast_rays(surface, [[x, y, 1e4]], [[0, 0, -1]]).point[0, 2]
    region, view = window.region(), window.area().spaces.active.region_3d
    spot = location_3d_to_region_2d(region, view, Vector((x, y, z)))
    yield from window.move(region.x + spot.x, region.y + spot.y)
    yield 1.0
    reach = window.screenshot("1-reach")
    settings().map_layer = "E_95CI"
    yield 0.5
    yield from window.move(region.x + spot.x - 2, region.y + spot.y)
    yield 1.0
    assert window.screenshot("2-energy").read_bytes() != reach.read_bytes(), "another map is painted at once"
    settings().map_on, settings().face_layer = "FACES", "V_max"
    yield 0.5
    yield from window.move(region.x + spot.x + 1, region.y + spot.y)
    yield 1.0
    window.screenshot("3-faces")
    settings().seed = 5
    window.theme("Light")
    yield 1.0
    window.screenshot("4-light-and-old")
    assert maps.is_stale(scene)
    with window.override():
        bpy.ops.ed.undo()
    yield 0.5
    assert maps.maps_of(bpy.context.scene) is None, "undone"
    with window.override():
        bpy.ops.ed.redo()
    yield 0.5
    assert maps.maps_of(bpy.context.scene) is not None, "redone"
    window.screenshot("5-redone")

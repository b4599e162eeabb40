# SPDX-License-Identifier: GPL-3.0-or-later
"""A person gives a part of the ground parameters of its own."""

import bpy
import numpy as np


def case_zone_of_selected_vertices(window):
    """Choose the lower part of a scan in Edit Mode, add a zone, simulate."""
    yield from window.show_sidebar()
    x, y = np.meshgrid(np.arange(0.0, 101.0, 2.0), np.arange(0.0, 101.0, 2.0), indexing="ij")
    corner = (np.arange(50)[:, None] * 51 + np.arange(50)).ravel()
    ring = np.column_stack([corner, corner + 51, corner + 52, corner + 1])
    faces = np.vstack([ring[:, [0, 1, 2]], ring[:, [0, 2, 3]]]).astype(np.int32)
    vertices = np.column_stack([x.ravel(), y.ravel(), -0.7 * x.ravel()])
    surface = window.part("core.terrain.surface").Surface(
        vertices, faces, window.part("core.georeference").GlobalShift(), "slope", ()
    )
    shading = window.part("core.terrain.shading").shade(surface)
    tile = window.part("rockfall_addon.scene.terrain.terrain").add_terrain(bpy.context.scene, surface, shading)
    with window.override():
        bpy.context.view_layer.objects.active = tile
        tile.select_set(True)
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="DESELECT")
        bpy.ops.object.mode_set(mode="OBJECT")
        tile.data.vertices.foreach_set("select", vertices[:, 0] >= 60)
        bpy.ops.object.mode_set(mode="EDIT")
        assert bpy.ops.rockfall.add_zone() == {"FINISHED"}
    yield 1.0
    window.screenshot("1-selected")
    with window.override():
        bpy.ops.object.mode_set(mode="OBJECT")
    settings = bpy.context.scene.rockfall_simulation
    settings.zones[0].friction, settings.zones[0].parameters = 0.9, "rt = 0.4"
    settings.source, settings.steeper_than_deg, settings.number = "STEEP", 20.0, 20
    zones = window.part("rockfall_addon.scene.simulation.simulation_setup").plan(bpy.context.scene).scenario.zones
    assert np.bincount(zones.of_face).tolist() == [2 * 50 * 30 - 50, 2 * 50 * 20 + 50]
    with window.override():
        bpy.ops.rockfall.simulate("INVOKE_DEFAULT")
    job = window.part("rockfall_addon.view.job")
    yield from window.wait_for(lambda: not job.is_running(), 240, "simulated")
    shown = [obj for obj in bpy.context.scene.objects if obj.get("rockfall_role") == "simulated_blocks"]
    assert shown
    yield 1.0
    window.screenshot("2-simulated")

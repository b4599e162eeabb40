# SPDX-License-Identifier: GPL-3.0-or-later
"""A person gives parts of the ground parameters of their own."""

import bpy
import numpy as np


def case_zone_of_selected_vertices(window):
    """Select the lower half of a scan in Edit Mode, add a zone, simulate; its panel is open."""
    panels = window.part("rockfall_addon.steps.simulation.panel")
    for panel in panels.CLASSES:
        bpy.utils.unregister_class(panel)
    shown = (panels.ROCKFALL_PT_simulation, panels.ROCKFALL_PT_simulation_zones)
    before = [panel.bl_options for panel in shown]
    for panel in shown:
        panel.bl_options = set()
        bpy.utils.register_class(panel)
    for name in [name for name in dir(bpy.types) if name.startswith("ROCKFALL_PT_")]:
        panel = getattr(bpy.types, name)
        if panel not in shown and getattr(panel, "bl_parent_id", "") == "":
            bpy.utils.unregister_class(panel)
    yield from window.show_sidebar()
    with window.override():
        x, y = np.meshgrid(np.arange(0.0, 101.0, 2.0), np.arange(0.0, 101.0, 2.0), indexing="ij")
        corner = (np.arange(50)[:, None] * 51 + np.arange(50)).ravel()
        ring = np.column_stack([corner, corner + 51, corner + 52, corner + 1])
        faces = np.vstack([ring[:, [0, 1, 2]], ring[:, [0, 2, 3]]]).astype(np.int32)
        vertices = np.column_stack([x.ravel(), y.ravel(), -0.7 * x.ravel()])
        surface = window.part("core.terrain.surface").Surface(
            vertices, faces, window.part("core.georeference").GlobalShift(), "slope", ()
        )
        shading = window.part("core.terrain.shading").shade(surface)
        tile = window.part("rockfall_addon.scene.terrain").add_terrain(bpy.context.scene, surface, shading)
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
        bpy.ops.object.mode_set(mode="OBJECT")
    zone = bpy.context.scene.rockfall_simulation.zones[0]
    zone.friction, zone.parameters = 0.9, "rt = 0.4"
    plan = window.part("rockfall_addon.scene.simulation_setup").plan
    settings = bpy.context.scene.rockfall_simulation
    settings.source, settings.steeper_than_deg, settings.number = "STEEP", 20.0, 20
    zones = plan(bpy.context.scene).scenario.zones
    assert np.bincount(zones.of_face).tolist() == [2 * 50 * 30 - 50, 2 * 50 * 20 + 50]
    yield 1.0
    window.screenshot("2-zone")
    for panel, options in zip(shown, before, strict=True):
        bpy.utils.unregister_class(panel)
        panel.bl_options = options

# SPDX-License-Identifier: GPL-3.0-or-later
"""A person puts a wall in the way of the blocks."""

import bpy
import numpy as np


def case_wall_across_the_slope(window):
    """Add a plane to a slope, use it as a structure, simulate; then move it."""
    yield from window.show_sidebar()
    x, y = np.meshgrid(np.arange(0.0, 101.0, 2.0), np.arange(0.0, 101.0, 2.0), indexing="ij")
    corner = (np.arange(50)[:, None] * 51 + np.arange(50)).ravel()
    ring = np.column_stack([corner, corner + 51, corner + 52, corner + 1])
    faces = np.vstack([ring[:, [0, 1, 2]], ring[:, [0, 2, 3]]]).astype(np.int32)
    vertices = np.column_stack([x.ravel(), y.ravel(), -0.9 * np.minimum(x.ravel(), 70.0)])
    surface = window.part("core.terrain.surface").Surface(
        vertices, faces, window.part("core.georeference").GlobalShift(), "slope", ()
    )
    shading = window.part("core.terrain.shading").shade(surface)
    window.part("rockfall_addon.scene.terrain.terrain").add_terrain(bpy.context.scene, surface, shading)
    with window.override():
        bpy.ops.rockfall.show_relief(frame_all=True)
        bpy.ops.mesh.primitive_plane_add(size=1.0, location=(75.0, 50.0, -55.0), rotation=(0.0, np.pi / 2, 0.0))
        wall = bpy.context.object
        wall.name, wall.scale = "wall", (40.0, 110.0, 1.0)
        assert bpy.ops.rockfall.use_as_structure() == {"FINISHED"}
    settings = bpy.context.scene.rockfall_simulation
    settings.source, settings.steeper_than_deg, settings.number = "STEEP", 20.0, 20
    yield from window.open_panel("ROCKFALL_PT_simulation")
    window.screenshot("1-marked")
    with window.override():
        bpy.ops.rockfall.simulate("INVOKE_DEFAULT")
    yield 0.5
    window.screenshot("2-at-work")
    job = window.part("rockfall_addon.view.job")
    yield from window.wait_for(lambda: not job.is_running(), 240, "simulated")
    paths = next(obj for obj in bpy.context.scene.objects if obj.get("rockfall_role") == "simulated_paths")
    places = np.empty(3 * len(paths.data.points), dtype=np.float32)
    paths.data.attributes["position"].data.foreach_get("vector", places)
    assert places[0::3].max() < 75.01, "nothing comes past the wall"
    yield 1.0
    window.screenshot("3-held")
    wall.location.x += 5.0
    yield 1.0
    assert window.part("rockfall_addon.scene.simulation.simulation_setup").is_stale(bpy.context.scene)
    window.screenshot("4-moved")

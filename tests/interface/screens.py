# SPDX-License-Identifier: GPL-3.0-or-later
"""A person draws a screen across the slope, makes it a barrier, and reads what passes."""

import sys
from pathlib import Path

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Vector

sys.path.append(str(Path(__file__).parent))  # cases share their helpers


FOOT_X = 66.0


def height(x):
    return -0.9 * np.minimum(x, 70.0)


def on_window(window, place):
    """Pixel of the window at which a place of the scene is seen."""
    region = window.region()
    x, y = location_3d_to_region_2d(region, window.area().spaces.active.region_3d, Vector(place))
    return region.x + x, region.y + y


def case_screen_across_the_slope(window):
    """Draw a screen by clicks, simulate, read what passes; make it a barrier, simulate again."""
    yield from window.show_sidebar()
    x, y = np.meshgrid(np.arange(0.0, 101.0, 2.0), np.arange(0.0, 101.0, 2.0), indexing="ij")
    corner = (np.arange(50)[:, None] * 51 + np.arange(50)).ravel()
    ring = np.column_stack([corner, corner + 51, corner + 52, corner + 1])
    faces = np.vstack([ring[:, [0, 1, 2]], ring[:, [0, 2, 3]]]).astype(np.int32)
    vertices = np.column_stack([x.ravel(), y.ravel(), height(x.ravel())])
    surface = window.part("core.terrain.surface").Surface(
        vertices, faces, window.part("core.georeference").GlobalShift(), "slope", ()
    )
    shading = window.part("core.terrain.shading").shade(surface)
    scene = bpy.context.scene
    window.part("rockfall_addon.scene.terrain.terrain").add_terrain(scene, surface, shading)
    settings = scene.rockfall_simulation
    settings.source, settings.steeper_than_deg, settings.number = "STEEP", 20.0, 60
    with window.override():
        bpy.ops.rockfall.show_relief(frame_all=True)
    yield 1.0
    yield from window.open_panel("ROCKFALL_PT_simulation")
    with window.override():
        bpy.ops.rockfall.draw_screen("INVOKE_DEFAULT")
    yield 0.3
    spots = [on_window(window, (x, y, height(x))) for x, y in ((FOOT_X, 8.0), (FOOT_X + 3, 50.0), (FOOT_X, 92.0))]
    for spot in spots:
        yield from window.click(*spot)
    window.screenshot("1-drawing")
    yield from window.press("RET", *spots[-1])
    assert not window.window.modal_operators
    (screen,) = [obj for obj in scene.objects if obj.get("rockfall_role") == "screen"]
    assert len(screen.data.vertices) == 3
    screen.rockfall_screen.height_m = 4.0
    with window.override():
        bpy.ops.rockfall.simulate("INVOKE_DEFAULT")
    job, setup = (window.part(f"rockfall_addon.{name}") for name in ("view.job", "scene.simulation.simulation_setup"))
    yield from window.wait_for(lambda: setup.screen_results(scene) and not job.is_running(), 240, "simulated")
    (found,) = setup.screen_results(scene)
    assert 0 < found["reach"] <= found["blocks"]
    yield from look_below(window)
    window.screenshot("2-measured")
    screen.rockfall_screen.holds, screen.rockfall_screen.capacity_kj = True, 25.0
    with window.override():
        bpy.ops.rockfall.simulate("INVOKE_DEFAULT")
    yield 0.5
    yield from window.wait_for(lambda: not job.is_running() and not setup.is_stale(scene), 240, "simulated again")
    (found,) = setup.screen_results(scene)
    assert found["held"] + found["over"] + found["through"] == found["hits"]
    window.theme("Light")
    try:
        yield 1.0
        window.screenshot("3-held")
    finally:
        window.theme("Dark")


def look_below(window):
    """Scroll the sidebar to the panel of the screens."""
    sidebar = window.region("UI")
    for _ in range(20):
        window.window.event_simulate(type="WHEELDOWNMOUSE", value="PRESS", x=sidebar.x + 90, y=sidebar.y + 300)
        yield 0.05
    yield 0.5

# SPDX-License-Identifier: GPL-3.0-or-later
"""A person draws a screen across the slope, makes it a barrier, and reads what passes."""

from pathlib import Path

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Vector

DATA = Path(__file__).resolve().parents[1] / "data"


def on_window(window, place):
    """Pixel of the window at which a place of the scene is seen."""
    region = window.region()
    x, y = location_3d_to_region_2d(region, window.area().spaces.active.region_3d, Vector(place))
    return region.x + x, region.y + y


def case_screen_across_the_slope(window):
    """Draw a screen by clicks, simulate, read what passes; make it a barrier, simulate again, undo."""
    yield from window.show_sidebar(width=380)
    with window.override():
        assert bpy.ops.rockfall.import_terrain(filepath=str(DATA / "tschamut_2014_terrain.asc")) == {"FINISHED"}
        bpy.ops.rockfall.show_relief(frame_all=True)
    scene = bpy.context.scene
    settings = scene.rockfall_simulation
    settings.source, settings.steeper_than_deg, settings.number = "STEEP", 42.0, 60
    terrain = next(obj for obj in scene.objects if obj.get("rockfall_role") == "terrain")
    places = np.array([face.center for face in terrain.data.polygons])
    middle = np.median(places[:, 0])
    low = np.quantile(places[:, 2], 0.3)
    level = places[np.abs(places[:, 2] - low) < 1.5]
    level = level[np.argsort(level[:, 0] if np.ptp(level[:, 0]) > np.ptp(level[:, 1]) else level[:, 1])]
    spots = [on_window(window, level[int(part * (len(level) - 1))]) for part in (0.15, 0.5, 0.85)]
    assert np.isfinite(middle)
    yield from window.open_panel("ROCKFALL_PT_simulation")
    with window.override():
        bpy.ops.rockfall.draw_screen("INVOKE_DEFAULT")
    yield 0.3
    for x, y in spots:
        yield from window.click(x, y)
    window.screenshot("1-drawing")
    yield from window.press("RET", *spots[-1])
    assert not window.window.modal_operators
    (screen,) = [obj for obj in scene.objects if obj.get("rockfall_role") == "screen"]
    assert len(screen.data.vertices) == 3
    with window.override():
        bpy.ops.rockfall.simulate("INVOKE_DEFAULT")
    job, setup = (window.part(f"rockfall_addon.{name}") for name in ("view.job", "scene.simulation_setup"))
    yield from window.wait_for(lambda: setup.screen_results(scene) and not job.is_running(), 240, "simulated")
    (found,) = setup.screen_results(scene)
    assert 0 < found["reach"] <= found["blocks"]
    screen.rockfall_screen.height_m = 4.0
    yield from sub_panel_alone(window)
    window.screenshot("2-measured")
    screen.rockfall_screen.holds, screen.rockfall_screen.capacity_kj = True, 200.0
    yield 0.5
    with window.override():
        bpy.ops.rockfall.simulate("INVOKE_DEFAULT")
    yield 0.5
    yield from window.wait_for(lambda: not job.is_running() and not setup.is_stale(scene), 240, "simulated again")
    (found,) = setup.screen_results(scene)
    assert found["held"] + found["over"] + found["through"] == found["hits"]
    bpy.context.preferences.themes[0].view_3d.space.gradients.high_gradient = (0.85, 0.86, 0.88)
    yield 1.0
    window.screenshot("3-held")


def sub_panel_alone(window):
    """Unfold the panel of the screens; what stands above it is scrolled away."""
    sidebar = window.region("UI")
    panels = window.part("rockfall_addon.steps.simulation.panel")
    parent, own = panels.ROCKFALL_PT_simulation, panels.ROCKFALL_PT_simulation_screens
    assert own.bl_parent_id == parent.bl_idname
    yield 0.5
    for _ in range(40):
        window.window.event_simulate(type="WHEELDOWNMOUSE", value="PRESS", x=sidebar.x + 90, y=sidebar.y + 300)
        yield 0.02
    yield 1.0

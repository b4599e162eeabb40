# SPDX-License-Identifier: GPL-3.0-or-later
"""A person simulates whole falls: from a line drawn on a bare scan, and beside the real blocks of the demo."""

from pathlib import Path

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Vector

DATA = Path(__file__).resolve().parents[1] / "data"


def settings():
    return bpy.context.scene.rockfall_simulation


def shown(role="simulated_blocks"):
    return [obj for obj in bpy.context.scene.objects if obj.get("rockfall_role") == role]


def on_window(window, place):
    """Pixel of the window at which a place of the scene is seen."""
    region = window.region()
    x, y = location_3d_to_region_2d(region, window.area().spaces.active.region_3d, Vector(place))
    return region.x + x, region.y + y


def simulated(window):
    job = window.part("rockfall_addon.view.job")
    return window.wait_for(lambda: shown() and not job.is_running(), 360, "simulated")


def case_simulate_from_a_line_on_a_bare_scan(window):
    """Import a scan, draw a line with clicks, simulate, stop, simulate, look at a run, undo, play."""
    yield from window.show_sidebar()
    with window.override():
        assert bpy.ops.rockfall.import_terrain(filepath=str(DATA / "tschamut_2014_terrain.asc")) == {"FINISHED"}
        bpy.ops.rockfall.show_relief(frame_all=True)
        bpy.ops.ed.undo_push(message="terrain")
    yield 2.0
    yield from window.open_panel("ROCKFALL_PT_simulation")
    window.screenshot("1-scan")
    terrain = shown("terrain")[0]
    steep = np.array([face.center for face in terrain.data.polygons if face.normal.z < 0.8])
    level = steep[np.abs(steep[:, 2] - np.quantile(steep[:, 2], 0.85)) < 4.0]
    spots = np.array([on_window(window, place) for place in level[np.argsort(level[:, 0])]])
    left, middle, right = (spots[int(part * len(spots))] for part in (0.35, 0.5, 0.65))
    with window.override():
        bpy.ops.rockfall.draw_release("INVOKE_DEFAULT", kind="line")
    yield 0.5
    for x, y in (left, middle, right):
        yield from window.click(x, y)
    yield from window.move(*(right + 30))
    window.screenshot("2-drawing")
    yield from window.press("BACK_SPACE", *right)
    yield from window.click(*right)
    yield from window.press("RET", *right)
    assert settings().source == "DRAWN"
    assert len(settings().drawn.data.vertices) == 3
    yield 0.5
    settings().number = 200
    settings().models = {"noel_2017", "stevens_1998"}
    with window.override():
        bpy.ops.rockfall.simulate("INVOKE_DEFAULT")
    yield 0.5
    window.screenshot("3-running")
    yield from simulated(window)
    yield 1.0
    window.screenshot("4-simulated")
    settings().colour_by = "SPEED"
    yield 1.0
    window.screenshot("5-speed")
    yield from pick_a_path(window, "6-run")
    bpy.context.scene.frame_set(100)
    yield 1.0
    window.screenshot("7-blocks")
    with window.override():
        bpy.ops.screen.animation_play()
    yield 3.0
    with window.override():
        bpy.ops.screen.animation_cancel(restore_frame=False)
    with window.override():
        bpy.ops.ed.undo()
    yield 1.0
    yield from window.wait_for(lambda: True, 1)


def pick_a_path(window, name):
    """Click the middle of a path of the first model; its numbers are in the panel."""
    paths = shown("simulated_paths")[0]
    simulated_paths = window.part("rockfall_addon.scene.simulation.simulated_paths")
    lines = simulated_paths.lines_of(paths)
    longest = int(np.argmax(lines.figures["length_m"]))
    middle = (lines.first[longest] + lines.first[longest + 1]) // 2
    x, y = on_window(window, lines.position[middle])
    with window.override():
        bpy.ops.rockfall.select_run("INVOKE_DEFAULT")
    yield from window.click(x, y)
    yield from window.press("ESC", x, y)
    assert settings().run > 0, "a path was clicked"
    assert not window.window.modal_operators
    yield 1.0
    window.screenshot(name)


def case_simulate_beside_the_real_blocks(window):
    """The demo: all measured releases, two models; Esc keeps what is finished; undo and redo."""
    yield from window.show_sidebar()
    with window.override():
        assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
        bpy.ops.ed.undo_push(message="demo")
    yield 1.0
    yield from window.open_panel("ROCKFALL_PT_simulation")
    settings().number = 5
    settings().models = {"noel_2017", "observed"}
    with window.override():
        bpy.ops.rockfall.simulate("INVOKE_DEFAULT")
    yield from simulated(window)
    bpy.context.scene.frame_set(130)
    yield 2.0
    window.screenshot("1-demo")
    window.theme("Light")
    yield 1.0
    window.screenshot("1-light")
    with window.override():
        bpy.ops.preferences.reset_default_theme()
    yield 0.5
    with window.override():
        bpy.ops.ed.undo()
    yield 1.0
    assert not shown(), "undo takes it away"
    with window.override():
        bpy.ops.ed.redo()
    yield 1.0
    assert len(shown()) == 2
    yield from pick_a_path(window, "2-redone")
    settings().number = 1600
    with window.override():
        bpy.ops.rockfall.simulate("INVOKE_DEFAULT")
    job = window.part("rockfall_addon.view.job")
    yield from window.wait_for(lambda: not job._running or job._running[0].done > 300, 120, "some are finished")
    x, y = window.centre()
    yield from window.press("ESC", x, y)
    yield from window.wait_for(lambda: not job.is_running(), 60, "stopped")
    yield 1.0
    window.screenshot("3-stopped")
    said = window.part("rockfall_addon.scene.simulation.simulation_setup").remarks(bpy.context.scene)
    assert any("Stopped by you" in remark.text for remark in said)
    with window.override():
        bpy.ops.rockfall.simulate("INVOKE_DEFAULT")
    yield 0.3
    with window.override():
        bpy.ops.wm.read_homefile(use_empty=False)
    yield 2.0
    assert not job.is_running()
    assert not shown()

# SPDX-License-Identifier: GPL-3.0-or-later
"""A person moves the parameters of the models beside the graphs, scores them, fits them, undoes, saves and reopens."""

import json
import statistics
import tempfile
import time
from pathlib import Path

import bpy

MODEL = "noel_2017"


def parameters(key="rockfall_model_parameters"):
    return json.loads(bpy.context.scene.get(key, "{}"))


def wide(window):
    """The demo's graphs with their sidebar."""
    with window.override():
        assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
        bpy.ops.ed.undo_push(message="demo")
        assert bpy.ops.rockfall.open_graphs() == {"FINISHED"}
    yield 2.0
    space = window.area("NODE_EDITOR").spaces.active
    space.show_region_ui = True
    yield 1.0
    window.region("UI", "NODE_EDITOR").active_panel_category = "Rockfall"
    window.redraw()
    yield 1.0


def case_sidebar_of_the_graphs(window):
    """What is in the sidebar, with two sets of parameters and with what a calibration proposes, in both themes."""
    yield from wide(window)
    scene = bpy.context.scene
    with window.override("NODE_EDITOR"):
        bpy.ops.screen.screen_full_area()
    yield 2.0
    scene.rockfall_comparison.models = {"pfeiffer_bowen_1989", MODEL}
    scene.rockfall_comparison.sets = "BOTH"
    scene.rockfall_other_parameters.noel_2017.rt = 0.4
    yield 1.5
    window.screenshot("both")
    window.theme("Light")
    yield 1.5
    window.screenshot("light")
    window.theme("Dark")
    scene.rockfall_comparison.models = {MODEL}
    scene.rockfall_comparison.sets = "A"
    scene.rockfall_comparison.fitted = MODEL
    with window.override("NODE_EDITOR"):
        assert bpy.ops.rockfall.calibrate("EXEC_DEFAULT") == {"FINISHED"}
    sidebar = window.region("UI", "NODE_EDITOR")
    top = sidebar.y + sidebar.height
    yield from window.click(sidebar.x + 60, top - 14, ctrl=True)
    yield 2.0
    window.screenshot("closed")
    yield from window.click(sidebar.x + 60, top - 377, ctrl=True)
    yield 2.0
    window.screenshot("calibrated")
    assert set(window.part("rockfall_addon.scene.models.comparison").comparison_of(scene).predictions) == {"A", "B"}


def spread_of(window):
    """Where the sliders of the one open model are: their left and right ends and the height of the one of μ_T [px]."""
    sidebar = window.region("UI", "NODE_EDITOR")
    left, right = sidebar.x + 24, sidebar.x + sidebar.width - 70
    return left, right, sidebar.y + sidebar.height - 545


def case_drag_a_slider_calibrate_and_undo(window):
    """A slider through its range, Esc of a calibration, a calibration that is applied, undo, save and reopen."""
    yield from wide(window)
    scene = bpy.context.scene
    with window.override():
        bpy.ops.rockfall.show_models("EXEC_DEFAULT", True, models={MODEL})
    yield 1.0
    keep = window.part("rockfall_addon.scene.models.model_parameters")
    moves, original = [], keep.keep

    def timed(*arguments):
        begin = time.perf_counter()
        original(*arguments)
        moves.append(time.perf_counter() - begin)

    keep.keep = timed
    left, right, y = spread_of(window)
    middle = (left + right) / 2
    yield from window.move(middle, y)
    window.window.event_simulate(type="LEFTMOUSE", value="PRESS", x=round(middle), y=round(y))
    yield 0.3
    for x in (*range(int(middle), int(left), -12), *range(int(left), int(right), 12)):
        window.window.event_simulate(type="MOUSEMOVE", value="NOTHING", x=x, y=round(y))
        yield 0.1
    window.screenshot("dragged")
    window.window.event_simulate(type="LEFTMOUSE", value="RELEASE", x=round(right), y=round(y))
    yield 1.0
    keep.keep = original
    values = parameters()
    assert list(values) == [MODEL], values
    (name,) = values[MODEL]
    assert values[MODEL][name] != keep.MODELS[MODEL].parameter(name).default
    print(
        f"{len(moves)} moves of {name} with blocks in the 3-D view: median {1e3 * statistics.median(moves):.1f} ms, "
        f"longest {1e3 * max(moves):.1f} ms, without drawing"
    )
    dragged = flights()
    with window.override():
        bpy.ops.ed.undo()
    yield 1.0
    assert parameters() == {}, "one undo takes the whole drag back"
    assert flights() != dragged
    with window.override():
        bpy.ops.ed.redo()
    yield 1.0
    assert parameters() == values
    assert flights() == dragged

    scene = bpy.context.scene
    scene.rockfall_comparison.fitted = MODEL
    job = window.part("rockfall_addon.view.job")
    with window.override("NODE_EDITOR"):
        bpy.ops.rockfall.calibrate("INVOKE_DEFAULT")
    yield from window.wait_for(lambda: job.is_running() and job._running[0].share > 0, 20, "at work")
    window.screenshot("calibrating")
    yield from window.press("ESC", *window.centre())
    yield from window.wait_for(lambda: not job.is_running(), 60, "stopped")
    assert "rockfall_fit" not in bpy.context.scene
    assert parameters() == values
    with window.override("NODE_EDITOR"):
        bpy.ops.rockfall.calibrate("INVOKE_DEFAULT")
    yield from window.wait_for(lambda: "rockfall_fit" in bpy.context.scene, 240, "calibrated")
    yield 1.0
    assert parameters() == values
    proposed = parameters("rockfall_model_parameters_b")[MODEL]
    sidebar = window.region("UI", "NODE_EDITOR")
    yield from window.click(sidebar.x + 60, sidebar.y + sidebar.height - 12, ctrl=True)
    window.screenshot("proposed")
    with window.override("NODE_EDITOR"):
        bpy.ops.rockfall.apply_fit("EXEC_DEFAULT", True)
    yield 1.0
    assert parameters()[MODEL] == proposed
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "site.blend")
        with window.override():
            bpy.ops.wm.save_as_mainfile(filepath=path)
            bpy.ops.ed.undo()
        yield 1.0
        assert parameters() == values
        assert "rockfall_fit" in bpy.context.scene
        with window.override():
            bpy.ops.rockfall.discard_fit("EXEC_DEFAULT", True)
        yield 0.5
        assert parameters("rockfall_model_parameters_b") == {}
        bpy.ops.wm.open_mainfile(filepath=path)
        yield 3.0
        assert parameters()[MODEL] == proposed
    window.screenshot("reopened")


def flights():
    curve = next(o for o in bpy.context.scene.objects if o.get("rockfall_role") == "twin_flights")
    return [tuple(vertex.co) for vertex in curve.data.vertices]

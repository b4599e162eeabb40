# SPDX-License-Identifier: GPL-3.0-or-later
"""A person asks which parameters make whole falls come out as the observed ones, and lets blocks draw from them."""

import csv
import json
from pathlib import Path

import bpy

KEY = "rockfall_back_analysis"


def case_back_analysis_of_the_demo(window):
    """By its button: progress, Esc, the answer in both themes, the blocks that draw from it, undo."""
    job = window.part("rockfall_addon.view.job")
    with window.override():
        assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
    scene = bpy.context.scene
    settings = scene.rockfall_back_analysis
    settings.model, settings.sets, settings.rounds = "stevens_1998", 300, 2
    settings.priors = "rn = 0.1..0.7; friction = 0.2..0.9"
    scene.rockfall_simulation.models = {"stevens_1998"}
    with window.override():
        bpy.ops.ed.undo_push(message="settings")
    window.unfold("ROCKFALL_PT_back_analysis")
    for name in ("simulated_run", "simulation_screens"):
        window.unfold(f"ROCKFALL_PT_{name}", is_open=False)
    yield from window.show_sidebar()
    yield from window.open_panel("ROCKFALL_PT_simulation")
    yield from window.scroll(60)
    yield 1.0
    window.screenshot("1-question")
    with window.override():
        bpy.ops.rockfall.back_analyse("INVOKE_DEFAULT")
    yield from window.wait_for(lambda: job.is_running() and job._running[0].share > 0.1, 200, "sets are simulated")
    window.screenshot("2-at-work")
    yield from window.press("ESC", *window.centre())
    assert not job.is_running()
    assert KEY not in bpy.context.scene
    with window.override():
        bpy.ops.rockfall.back_analyse("INVOKE_DEFAULT")
    yield from window.wait_for(lambda: not job.is_running(), 200, "analysed")
    yield 1.0
    yield from window.scroll(60)
    scene = bpy.context.scene
    assert len(json.loads(scene[KEY])["rows"]) == 3
    window.screenshot("3-answer")
    window.theme("Light")
    yield 1.0
    window.screenshot("4-light-theme")
    window.theme("Dark")
    scene.rockfall_back_analysis.draw = True
    with window.override():
        bpy.ops.rockfall.simulate("INVOKE_DEFAULT")
    yield from window.wait_for(lambda: not job.is_running(), 60, "simulated")
    yield 1.0
    window.screenshot("5-blocks-draw-from-it")
    with window.override():
        bpy.ops.ed.undo()
        bpy.ops.ed.undo()
    assert KEY not in bpy.context.scene, "a step of undo each"


def case_back_analysis_of_tables(window):
    """Without footage: the tables of Tschamut, releases and stops, chosen in the panel on a terrain of its own."""
    job = window.part("rockfall_addon.view.job")
    data = Path(__file__).parents[1] / "data"
    with window.override():
        assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
    bpy.context.scene.rockfall_back_analysis.source = {"STOPS"}
    window.unfold("ROCKFALL_PT_back_analysis")
    for name in ("simulated_run", "simulation_screens"):
        window.unfold(f"ROCKFALL_PT_{name}", is_open=False)
    yield from window.show_sidebar()
    yield from window.open_panel("ROCKFALL_PT_simulation")
    yield from window.scroll(60)
    yield 1.0
    window.screenshot("1-no-table-yet")
    scene = bpy.context.scene
    picks = [obj for obj in scene.objects if obj.get("rockfall_role") == "pick"]
    x, y, z = (sum(obj.location[axis] for obj in picks) / len(picks) for axis in range(3))
    window.part("rockfall_addon.scene.simulation.screens").make(scene, [(x, y - 20, z), (x, y + 20, z)], "Road")
    scene.rockfall_back_analysis.source = {"SCENE", "STOPS"}
    settings = bpy.context.scene.rockfall_back_analysis
    settings.releases, settings.stops = str(data / "tschamut_2014_releases.csv"), str(data / "tschamut_2014_stops.csv")
    yield from window.scroll(10)
    yield 1.0
    window.screenshot("2-tables-chosen")
    window.theme("Light")
    yield 1.0
    window.screenshot("2-tables-chosen-light")
    window.theme("Dark")
    with window.override():
        bpy.ops.rockfall.back_analyse("INVOKE_DEFAULT")
    yield from window.wait_for(lambda: not job.is_running(), 60, "refused")
    yield 1.0
    window.screenshot("3-tables-of-another-site")
    assert KEY not in bpy.context.scene


def case_back_analysis_of_tables_on_a_bare_terrain(window):
    """Eighty real blocks of which only starts and stops are known: no footage, no picks."""
    job = window.part("rockfall_addon.view.job")
    with window.override():
        assert bpy.ops.rockfall.import_terrain(
            filepath=str(Path(__file__).parents[1] / "data" / "tschamut_2014_terrain.asc")
        ) == {"FINISHED"}
        bpy.ops.rockfall.show_relief(frame_all=True)
    scene = bpy.context.scene
    settings = scene.rockfall_back_analysis
    window.unfold("ROCKFALL_PT_back_analysis")
    for name in ("simulated_run", "simulation_screens"):
        window.unfold(f"ROCKFALL_PT_{name}", is_open=False)
    yield from window.show_sidebar()
    yield from window.open_panel("ROCKFALL_PT_simulation")
    yield from window.scroll(60)
    yield 1.0
    window.screenshot("1-nothing-picked")
    settings.source = {"STOPS"}
    yield 1.0
    yield from window.scroll(60)
    window.screenshot("2-which-tables")
    settings.releases, settings.stops = (str(tables(name)) for name in ("releases", "stops"))
    settings.model, settings.sets, settings.rounds = "stevens_1998", 300, 1
    yield 1.0
    yield from window.scroll(60)
    window.screenshot("3-question")
    with window.override():
        bpy.ops.rockfall.back_analyse("INVOKE_DEFAULT")
    yield from window.wait_for(lambda: not job.is_running(), 200, "analysed")
    yield 1.0
    yield from window.scroll(60)
    kept = json.loads(bpy.context.scene[KEY])
    assert "80 observed runs of releases.csv" in kept["said"]
    assert all(row[5] and row[7] for row in kept["rows"]), "before, and what is left, of each"
    window.screenshot("4-answer")
    window.theme("Light")
    yield 1.0
    window.screenshot("5-light-theme")
    window.theme("Dark")
    with window.override():
        bpy.ops.ed.undo()
    assert KEY not in bpy.context.scene


def tables(name):
    """The rows of Tschamut 2014 as a user would give them: places in plan, so that blocks lie on the terrain."""
    with (Path(__file__).parents[1] / "data" / f"tschamut_2014_{name}.csv").open(
        encoding="utf-8", newline=""
    ) as stream:
        rows = list(csv.DictReader(stream))
    columns = ["x_m", "y_m"] + ["vx_mps", "vy_mps", "vz_mps"] * (name == "releases")
    lines = [",".join(["release", *columns])]
    lines += [",".join([row["trajectory_id"], *(row[column] for column in columns)]) for row in rows]
    path = Path(bpy.app.tempdir) / f"{name}.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path

# SPDX-License-Identifier: GPL-3.0-or-later
"""A person opens every panel of the sidebar, at twice the scale and in both themes, with everything to be shown."""

import sys
from pathlib import Path

import bpy
import numpy as np

sys.path.append(str(Path(__file__).parent))

import workspace

PANELS = ("terrain", "videos", "alignment", "picks", "refinement", "models", "simulation", "playback")
LAST = ("film", "share")
"""Whose headers are below the window's edge at this scale."""
SCALE = 2.0
MOST_PAGES = 8
TURNS = 14
"""Of the wheel, from one page of the sidebar to the next."""


def case_every_panel_at_scale_2(window):
    for panel in list(window.part("rockfall_addon.steps").classes()):
        if issubclass(panel, bpy.types.Panel) and getattr(panel, "bl_parent_id", ""):
            window.unfold(panel.__name__)
    yield from everything(window)
    bpy.context.preferences.view.ui_scale = SCALE
    yield 2.0
    yield from in_both_themes(window, "next")
    for name in PANELS:
        yield from window.open_panel(f"ROCKFALL_PT_{name}")
        yield from in_both_themes(window, name)
    for name in LAST:
        window.unfold(f"ROCKFALL_PT_{name}")
    yield 1.0
    yield from in_both_themes(window, "last")


def in_both_themes(window, name):
    """Pictures from the top of the sidebar to its end."""
    sidebar = window.region("UI")
    yield from window.move(sidebar.x + sidebar.width // 2, sidebar.y + sidebar.height // 2)
    for page in range(MOST_PAGES):
        for theme in ("Light", "Dark"):
            window.theme(theme)
            yield 0.6
            window.screenshot(f"{name}-{page}-{theme.lower()}")
        before = lowest(sidebar)
        yield from turn(window, "WHEELDOWNMOUSE", TURNS)
        if lowest(sidebar) == before:
            break
    yield from turn(window, "WHEELUPMOUSE", TURNS * (page + 1))


def lowest(sidebar):
    return sidebar.view2d.region_to_view(0, 0)[1]


def turn(window, kind, times):
    sidebar = window.region("UI")
    x, y = sidebar.x + sidebar.width // 2, sidebar.y + sidebar.height // 2
    for _ in range(times):
        window.window.event_simulate(type=kind, value="PRESS", x=x, y=y)
        yield 0.02
    yield 0.6


def everything(window):
    """The demo's footage with picks, a screen, a simulation, maps, a back-analysis, a proposal and a film."""
    job = window.part("rockfall_addon.view.job")
    with window.override():
        assert bpy.ops.rockfall.load_footage_demo() == {"FINISHED"}
    yield from workspace.arranged(window)
    scene = bpy.context.scene
    with window.override():
        assert bpy.ops.rockfall.propose_impacts() == {"FINISHED"}
    yield 1.0
    picks = sorted((o for o in scene.objects if o.get("rockfall_role") == "pick"), key=lambda o: o["rockfall_time_s"])
    middle = np.mean([obj.location for obj in picks], axis=0)
    aside = np.array([0.0, 20.0, 0.0])
    window.part("rockfall_addon.scene.simulation.screens").make(scene, [middle - aside, middle + aside], "Road")
    settings, questions = scene.rockfall_simulation, scene.rockfall_back_analysis
    settings.models, settings.number, settings.map_number = {"noel_2017", "stevens_1998"}, 20, 50
    questions.model, questions.sets, questions.rounds, questions.at_screens = "stevens_1998", 150, 1, True
    for operator in ("simulate", "compute_maps", "back_analyse", "refine"):
        with window.override():
            getattr(bpy.ops.rockfall, operator)("INVOKE_DEFAULT")
        yield 1.0
        yield from window.wait_for(lambda: not job.is_running(), 200, operator)
    views = [area.spaces.active.region_3d for area in workspace.views(window)]
    assert [view.view_perspective for view in views] == ["CAMERA", "PERSP"]
    scene.rockfall_film.size = "preview"
    with window.override():
        assert bpy.ops.rockfall.set_up_film() == {"FINISHED"}
    assert [view.view_perspective for view in views] == ["CAMERA", "PERSP"], "the free view stays free"
    window.part("rockfall_addon.scene.picks.impact_rows").go_to(bpy.context, scene, picks[3])
    yield 2.0

# SPDX-License-Identifier: GPL-3.0-or-later
"""A person finds every impact along the timeline, goes to one and moves it in time."""

import sys
from pathlib import Path

import bpy

sys.path.append(str(Path(__file__).parent))

import workspace


def strip_of(window):
    """The strip as it is drawn, and the corner of its region in the window."""
    here = window.region(area="DOPESHEET_EDITOR")
    with window.override("DOPESHEET_EDITOR"):
        return window.part("rockfall_addon.view.strip").strip_of(bpy.context), here


def mark(window, number):
    """Where a mark is in the window, and the pick that it stands for."""
    strip, here = strip_of(window)
    x, y = strip.places()[number]
    pick = window.part("rockfall_addon.scene.picks.picks").with_id(bpy.context.scene, strip.marks.identifier[number])
    return (here.x + x, here.y + y), pick


def case_impact_strip_shows_goes_and_retimes(window):
    scene = bpy.context.scene
    yield from workspace.open_it(window)
    with window.override():
        bpy.ops.rockfall.load_demo()
        bpy.ops.ed.undo_push(message="demo")
    yield 2.0
    strip, _ = strip_of(window)
    picks = [obj for obj in scene.objects if obj.get("rockfall_role") == "pick"]
    assert len(strip.marks.frame) == len(picks)
    assert len(strip.marks.names) == strip.rows == 15, "a row for each trajectory, with nothing selected"
    number = 3
    place, pick = mark(window, number)
    yield from window.move(*place)
    yield 0.5
    window.screenshot("hover")
    yield from window.click(*place)
    assert bpy.context.object == pick
    rate = scene.render.fps / scene.render.fps_base
    assert abs(scene.frame_current + scene.frame_subframe - strip.marks.frame[number]) < 1e-3
    identifier, before = pick["rockfall_id"], pick["rockfall_time_s"]
    pixels = 12
    yield from drag(window, place, pixels, "RELEASE")
    _, pick = mark(window, number)
    moved = pick["rockfall_time_s"] - before
    assert abs(moved - pixels / strip.per_frame / rate) < 0.5 / rate, "as far as the mouse"
    numbers = window.part("rockfall_addon.scene.picks.impact_numbers").of
    speeds = [numbers(obj)["incident_mps"] for obj in picks if obj["rockfall_id"] == identifier]
    assert not window.window.modal_operators, "let go"
    window.screenshot("retimed")
    with window.override():
        bpy.ops.ed.undo()
    yield 1.5
    place, pick = mark(window, number)
    assert pick["rockfall_id"] == identifier
    assert pick["rockfall_time_s"] == before, "one step of undo"
    assert numbers(pick)["incident_mps"] not in speeds, "its trajectory, too"
    yield from drag(window, place, pixels, "ESC")
    _, pick = mark(window, number)
    assert pick["rockfall_time_s"] == before, "Esc takes it back"
    with window.override("DOPESHEET_EDITOR"):
        bpy.ops.rockfall.open_keys()
    yield 1.0
    window.screenshot("channels")
    assert window.area("DOPESHEET_EDITOR").ui_type == "DOPESHEET"
    assert not window.area("DOPESHEET_EDITOR").spaces.active.dopesheet.show_only_selected
    with window.override("DOPESHEET_EDITOR"):
        bpy.ops.rockfall.open_keys()
    assert strip_of(window)[0].rows == 15, "and back to the strip"


def drag(window, place, pixels, end):
    yield from window.move(*place)
    x, y = map(round, place)
    window.window.event_simulate(type="LEFTMOUSE", value="PRESS", x=x, y=y)
    yield 0.3
    for step in (pixels // 2, pixels):
        yield from window.move(x + step, y)
    if end == "ESC":
        window.window.event_simulate(type="ESC", value="PRESS", x=x + pixels, y=y)
        yield 0.3
    window.window.event_simulate(type="LEFTMOUSE", value="RELEASE", x=x + pixels, y=y)
    yield 1.0

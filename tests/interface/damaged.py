# SPDX-License-Identifier: GPL-3.0-or-later
"""A person opens a file that another program has damaged: what is wrong is said first, and one click recovers it."""

import bpy


def picks(role="pick"):
    return [obj for obj in bpy.context.scene.objects if obj.get("rockfall_role") == role]


def damaged(path):
    """The demo with a pick without a time, one without a kind, and a gravity that is none, as if saved elsewhere."""
    first, second, *_ = sorted(picks(), key=lambda obj: obj.name)
    first["rockfall_time_s"] = "soon"
    del second["rockfall_kind"]
    bpy.context.scene["rockfall_gravity_mps2"] = float("nan")
    ours = [each for each in bpy.app.handlers.save_pre if "rockfall" in each.__module__]
    for each in ours:
        bpy.app.handlers.save_pre.remove(each)
    bpy.ops.wm.save_as_mainfile(filepath=path)
    for each in ours:
        bpy.app.handlers.save_pre.append(each)


def case_a_damaged_file(window):
    """The guide names the pick and offers to recover it; undo sets it aside again, redo recovers it."""
    with window.override():
        assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
    yield 0.5
    count, path = len(picks()), f"{bpy.app.tempdir}damaged.blend"
    damaged(path)
    bpy.ops.wm.open_mainfile(filepath=path)
    yield 1.5
    assert (len(picks()), len(picks("pick_set_aside"))) == (count - 2, 2)
    yield from window.show_sidebar("Rockfall")
    window.screenshot("guide")
    yield from window.open_panel("ROCKFALL_PT_picks")
    yield 1.0
    window.screenshot("opened")
    step = window.part("rockfall_addon.scene.next_step").next_step(bpy.context.scene)
    assert step.sentence.startswith("Set aside: the time of")
    with window.override():
        assert bpy.ops.rockfall.recover_picks("INVOKE_DEFAULT", True) == {"FINISHED"}
    yield 0.5
    assert (len(picks()), len(picks("pick_set_aside"))) == (count, 0)
    window.screenshot("recovered")
    with window.override():
        bpy.ops.ed.undo()
    yield 0.5
    assert (len(picks()), len(picks("pick_set_aside"))) == (count - 2, 2)
    with window.override():
        bpy.ops.ed.redo()
    yield 0.5
    assert (len(picks()), len(picks("pick_set_aside"))) == (count, 0)

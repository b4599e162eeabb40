# SPDX-License-Identifier: GPL-3.0-or-later
"""A person loads the demo and watches the blocks fall."""

import bpy


def case_load_demo_and_play(window):
    yield from window.show_sidebar()
    with window.override():
        assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
    yield 3.0
    window.screenshot("loaded")
    scene = bpy.context.scene
    blocks = [o for o in scene.objects if o.get("rockfall_role") == "block"]
    assert len(blocks) == 15
    scene.frame_set(0)
    heights = [block.matrix_world.translation.z for block in blocks]
    with window.override():
        bpy.ops.screen.animation_play()
    yield from window.wait_for(lambda: scene.frame_current > 40, 60, "playing")
    with window.override():
        bpy.ops.screen.animation_cancel(restore_frame=False)
    yield 1.0
    window.screenshot("playing")
    fallen = [before - block.matrix_world.translation.z for before, block in zip(heights, blocks, strict=True)]
    assert max(fallen) > 3.0
    pick = next(o for o in scene.objects if o.name.endswith(" impact 3"))
    bpy.context.view_layer.objects.active = pick
    pick.select_set(True)
    yield 3.0
    window.screenshot("impact")


def case_demo_survives_undo_redo_and_another_frame_rate(window):
    with window.override():
        bpy.ops.ed.undo_push(message="empty")
        bpy.ops.rockfall.load_demo()
        bpy.ops.ed.undo_push(message="demo")
    yield 2.0

    def state():
        picks = window.part("rockfall_addon.scene.picks.picks").picks_of(bpy.context.scene)
        return picks.position.tolist(), picks.time_s.tolist()

    def place(seconds):
        scene = bpy.context.scene
        frame = seconds * scene.render.fps / scene.render.fps_base
        scene.frame_set(int(frame), subframe=frame % 1)
        return [o.matrix_world.translation.copy() for o in scene.objects if o.get("rockfall_role") == "block"]

    before, there = state(), place(3.21)
    with window.override():
        bpy.ops.ed.undo()
    yield 1.0
    assert not [o for o in bpy.context.scene.objects if "rockfall_role" in o]
    with window.override():
        bpy.ops.ed.redo()
    yield 1.0
    assert state() == before
    bpy.context.scene.render.fps = 60  # as a click in the output settings does
    yield 1.0
    assert bpy.context.scene["rockfall_keyed_rate_hz"] == 60, "the keys follow without anything being played"
    assert max((a - b).length for a, b in zip(place(3.21), there, strict=True)) < 1e-3

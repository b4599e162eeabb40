# SPDX-License-Identifier: GPL-3.0-or-later
"""A person shows what two impact models would have the blocks do, beside what they did."""

import bpy


def case_show_models_beside_the_real_blocks(window):
    yield from window.show_sidebar()
    scene = bpy.context.scene
    with window.override():
        assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
        bpy.ops.ed.undo_push(message="demo")
        assert bpy.ops.rockfall.show_models(models={"noel_2017", "observed"}) == {"FINISHED"}
        bpy.ops.ed.undo_push(message="models")
    scene.rockfall.trail_until_now = True
    scene.frame_set(int(7.0 * scene.render.fps))
    yield 3.0
    window.screenshot("shown")
    assert shown() == {"noel_2017", "observed"}
    space = window.area().spaces.active
    block = next(o for o in scene.objects if o.get("rockfall_role") == "twin" and not o.hide_get())
    space.region_3d.view_location = block.matrix_world.translation
    space.region_3d.view_distance = 25.0
    yield 2.0
    window.screenshot("near")
    with window.override():
        bpy.ops.ed.undo()
    yield 1.0
    assert shown() == set(), "undo takes them away"
    assert [o for o in bpy.context.scene.objects if o.get("rockfall_role") == "block"]
    with window.override():
        bpy.ops.ed.redo()
    yield 1.0
    assert shown() == {"noel_2017", "observed"}
    with window.override():
        assert bpy.ops.rockfall.remove_models() == {"FINISHED"}
    yield 1.0
    assert shown() == set()
    window.screenshot("removed")


def shown():
    return {o["rockfall_model"] for o in bpy.context.scene.objects if o.get("rockfall_role") == "twin"}

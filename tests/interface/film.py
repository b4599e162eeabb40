# SPDX-License-Identifier: GPL-3.0-or-later
"""A person dresses the scene for a film, looks through its camera, and takes it off again."""

import bpy


def case_set_up_a_film(window):
    yield from window.show_sidebar()
    with window.override():
        assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
        before = sorted(o.name for o in bpy.context.scene.objects)
        assert bpy.ops.rockfall.set_up_film() == {"FINISHED"}
    scene = bpy.context.scene
    scene.frame_set(150)
    yield 4.0
    assert window.area().spaces.active.region_3d.view_perspective == "CAMERA", "one looks through the film's camera"
    window.screenshot("camera")
    assert scene.camera is not None
    assert len(scene.objects) > len(before)
    with window.override():
        assert bpy.ops.rockfall.remove_film() == {"FINISHED"}
    yield 1.0
    assert sorted(o.name for o in scene.objects) == before

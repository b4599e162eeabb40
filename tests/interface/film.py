# SPDX-License-Identifier: GPL-3.0-or-later
"""A person dresses the scene for a film, looks through its camera, and takes it off again."""

import shutil
import tempfile
from pathlib import Path

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


def case_preview_and_render_a_film(window):
    """Settings in the panel, a preview that tells the time, a film in the background, a second one stopped by Esc."""
    job, stopwatch = window.part("rockfall_addon.view.job"), window.part("rockfall_addon.steps.film.stopwatch")
    folder = Path(tempfile.mkdtemp())
    with window.override():
        assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
    yield from window.show_sidebar(width=300)
    yield from window.open_panel("ROCKFALL_PT_film")
    window.screenshot("1-settings")
    scene = bpy.context.scene
    film = scene.rockfall_film
    film.size, film.engine, film.time_scale, film.file = "preview", "cycles", 20.0, str(folder)
    with window.override():
        bpy.ops.ed.undo_push(message="settings")
        assert bpy.ops.rockfall.set_up_film("INVOKE_DEFAULT", True) == {"FINISHED"}
    scene = bpy.context.scene
    scene.frame_set(scene.frame_end // 2)
    assert window.part("rockfall_addon.steps.film.up_to_date").is_up_to_date(scene)
    yield 1.0
    window.screenshot("2-set-up")
    with window.override():
        assert bpy.ops.rockfall.preview_film("INVOKE_DEFAULT") == {"FINISHED"}
    yield 1.5
    window.screenshot("3-preview")
    for each in bpy.context.window_manager.windows[1:]:
        with bpy.context.temp_override(window=each):
            bpy.ops.wm.window_close()
    assert "frames on this machine" in stopwatch.expected(scene)
    assert not list(folder.iterdir())
    scene.frame_end = 2
    with window.override():
        bpy.ops.rockfall.render_film("INVOKE_DEFAULT")
    yield 1.0
    window.screenshot("4-rendering")
    yield from window.wait_for(lambda: not job.is_running(), 60, "rendered")
    yield 0.5
    window.screenshot("5-rendered")
    path = folder / "rockfall.mp4"
    window.part("core.film.check").check_film(path, 3, (640, 360))
    before = path.read_bytes()
    with window.override():
        bpy.ops.rockfall.render_film()
    yield 0.5
    yield from window.press("ESC", *window.centre())
    assert not job.is_running()
    yield 0.5
    window.screenshot("6-stopped")
    assert [file.name for file in folder.glob("*.mp4")] == ["rockfall.mp4"]
    assert path.read_bytes() == before
    shutil.rmtree(folder)

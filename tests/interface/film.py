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


PICKS = """trajectory,time_s,x_m,y_m,z_m,kind,status
A,0,0,0,40,release,ok
A,0.75,4.1,0.3,36.2,impact,ok
A,1.9,11.3,-0.5,27.9,impact,ok
A,2.4,13.9,0.1,26,stop,ok
"""
SET_UP, PREVIEW, RENDER = 161, 213, 290
"""How far below the panel's header its buttons are [px]."""


def case_preview_and_render_a_film(window):
    """Settings in the panel, a preview that tells the time, a film in the background, a second one stopped by Esc."""
    job, stopwatch = window.part("rockfall_addon.view.job"), window.part("rockfall_addon.steps.film.stopwatch")
    folder = Path(tempfile.mkdtemp())
    table = folder / "picks.csv"
    table.write_text(PICKS, encoding="utf-8")
    with window.override():
        assert bpy.ops.rockfall.import_picks(filepath=str(table)) == {"FINISHED"}
    film = bpy.context.scene.rockfall_film
    assert Path(film.file).name == "rockfall.mp4", "the name is never empty"
    film.size, film.engine, film.time_scale, film.file = "preview", "cycles", 20.0, str(folder)
    with window.override():
        bpy.ops.ed.undo_push(message="settings")
    yield from window.show_sidebar()
    x, header = yield from window.open_panel("ROCKFALL_PT_film")
    yield from window.click(x, header - SET_UP)
    yield 0.5
    scene = bpy.context.scene
    assert window.part("rockfall_addon.steps.film.up_to_date").is_up_to_date(scene)
    window.screenshot("1-set-up")
    scene.frame_set(8)
    yield from window.click(x, header - PREVIEW)
    yield 1.0
    window.screenshot("2-preview")
    assert "frames on this machine" in stopwatch.expected(scene)
    for each in bpy.context.window_manager.windows[1:]:
        with bpy.context.temp_override(window=each):
            bpy.ops.wm.window_close()
    assert [file.name for file in folder.iterdir()] == ["picks.csv"]
    scene.frame_end = 2
    yield from window.click(x, header - RENDER)
    assert job.is_running()
    window.screenshot("3-rendering")
    yield from window.wait_for(lambda: not job.is_running(), 60, "rendered")
    yield 0.5
    window.screenshot("4-rendered")
    path = folder / "rockfall.mp4"
    window.part("core.film.check").check_film(path, 3, (640, 360))
    before = path.read_bytes()
    yield from window.click(x, header - RENDER)
    yield 0.5
    window.screenshot("5-replace")
    yield from window.press("RET", *window.centre())
    assert job.is_running()
    yield from window.press("ESC", *window.centre())
    assert not job.is_running()
    window.screenshot("6-stopped")
    assert path.read_bytes() == before
    yield 0.5
    assert sorted(file.name for file in folder.iterdir()) == ["picks.csv", "rockfall.mp4"]
    with window.override():
        bpy.ops.ed.undo()
    assert not window.part("rockfall_addon.steps.film.remembered").is_set_up(bpy.context.scene)
    assert bpy.context.scene.rockfall_film.size == "preview"
    shutil.rmtree(folder)

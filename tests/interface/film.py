# SPDX-License-Identifier: GPL-3.0-or-later
"""A person sets the scene up for a film, previews and renders it, and takes the set-up off again."""

import shutil
import tempfile
from pathlib import Path

import bpy

PICKS = """trajectory,time_s,x_m,y_m,z_m,kind,status
A,0,0,0,40,release,ok
A,0.75,4.1,0.3,36.2,impact,ok
A,1.9,11.3,-0.5,27.9,impact,ok
A,2.4,13.9,0.1,26,stop,ok
"""
SET_UP, PREVIEW, RENDER, REMOVE = 161, 213, 269, 323
"""How far below the panel's header its buttons are [px]."""


def case_preview_and_render_a_film(window):
    """Settings in the panel, a preview that tells the time, a film in the background, a second one stopped by Esc."""
    job, stopwatch = window.part("rockfall_addon.view.job"), window.part("rockfall_addon.steps.film.stopwatch")
    folder = Path(tempfile.mkdtemp())
    table = folder / "picks.csv"
    table.write_text(PICKS, encoding="utf-8")
    with window.override():
        assert bpy.ops.rockfall.import_picks(filepath=str(table)) == {"FINISHED"}
    before = sorted(obj.name for obj in bpy.context.scene.objects)
    film = bpy.context.scene.rockfall_film
    assert Path(film.file).name == "rockfall.mp4", "the name is never empty"
    film.size, film.engine, film.time_scale, film.file = "preview", "cycles", 20.0, str(folder)
    with window.override():
        bpy.ops.ed.undo_push(message="settings")
    yield from window.show_sidebar()
    x, header = yield from window.open_panel("ROCKFALL_PT_film")
    yield from window.click(x, header - SET_UP)
    scene = bpy.context.scene
    assert window.part("rockfall_addon.steps.film.up_to_date").is_up_to_date(scene)
    assert window.area().spaces.active.region_3d.view_perspective == "CAMERA", "one looks through the film's camera"
    scene.frame_set(8)
    yield from window.click(x, header - PREVIEW)
    yield 1.0
    window.screenshot("1-preview")
    assert "frames on this machine" in stopwatch.expected(scene)
    for each in bpy.context.window_manager.windows[1:]:
        with bpy.context.temp_override(window=each):
            bpy.ops.wm.window_close()
    assert [file.name for file in folder.iterdir()] == ["picks.csv"]
    scene.frame_end = 2
    yield from window.click(x, header - RENDER)
    assert job.is_running()
    window.screenshot("2-rendering")
    yield from window.wait_for(lambda: not job.is_running(), 60, "rendered")
    yield 0.5
    path = folder / "rockfall.mp4"
    window.part("core.film.check").check_film(path, 3, (640, 360))
    film_before = path.read_bytes()
    yield from window.click(x, header - RENDER)
    yield 0.5
    window.screenshot("3-replace")
    yield from window.press("RET", *window.centre())
    assert job.is_running()
    yield from window.press("ESC", *window.centre())
    assert not job.is_running()
    window.screenshot("4-stopped")
    assert path.read_bytes() == film_before
    yield from window.click(x, header - REMOVE)
    scene = bpy.context.scene
    assert sorted(obj.name for obj in scene.objects) == before
    assert scene.rockfall_film.size == "preview", "what was wanted stays"
    assert sorted(file.name for file in folder.iterdir()) == ["picks.csv", "rockfall.mp4"]
    with window.override():
        bpy.ops.ed.undo()
        bpy.ops.ed.undo()
    assert sorted(obj.name for obj in bpy.context.scene.objects) == before
    assert bpy.context.scene.rockfall_film.size == "preview"
    shutil.rmtree(folder)


def case_films_of_the_footage(window):
    """The list with its pictures, a picture made in the background, and what another one lacks."""
    job = window.part("rockfall_addon.view.job")
    folder = Path(tempfile.mkdtemp())
    with window.override():
        assert bpy.ops.rockfall.load_footage_demo() == {"FINISHED"}
        assert bpy.ops.rockfall.propose_impacts() == {"FINISHED"}
    scene = bpy.context.scene
    scene.rockfall_film.file, scene.rockfall_film.size = str(folder / "site.mp4"), "preview"
    scene.rockfall_composed_film.kind = "contact_sheet"
    with window.override():
        bpy.ops.ed.undo_push(message="settings")
    yield from window.show_sidebar()
    yield from window.open_panel("ROCKFALL_PT_film")
    window.screenshot("1-panel")
    yield 0.5
    with window.override():
        bpy.ops.rockfall.make_film("INVOKE_DEFAULT")
    yield 0.5
    window.screenshot("2-drawing")
    yield from window.wait_for(lambda: not job.is_running(), 120, "drawn")
    yield 0.5
    window.screenshot("3-drawn")
    window.part("core.film.check").check_picture(folder / "site_contact_sheet.png", (640, 360))
    scene.rockfall_composed_film.kind = "story"
    with window.override():
        bpy.ops.rockfall.make_film("INVOKE_DEFAULT")
    yield from window.wait_for(lambda: (folder / "site_story.frames" / "000020.png").exists(), 120, "frames")
    yield from window.press("ESC", *window.centre())
    assert not job.is_running()
    yield 0.5
    window.screenshot("4-stopped")
    assert not (folder / "site_story.mp4").exists()
    assert len(list((folder / "site_story.frames").glob("*.png"))) > 20, "finished frames are kept"
    shutil.rmtree(folder)

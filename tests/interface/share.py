# SPDX-License-Identifier: GPL-3.0-or-later
"""A person exports what others look at: the page of the site and the animation, beside other work."""

import json
import re
import tempfile
from pathlib import Path

import bpy


def case_export_page_and_animation(window):
    yield from window.show_sidebar()
    with window.override():
        assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
    yield 2.0
    yield from window.open_panel("ROCKFALL_PT_share")
    window.screenshot("1-panel")
    for name in ("web_page", "animation"):
        with window.override():
            getattr(bpy.ops.rockfall, f"export_{name}")("INVOKE_DEFAULT")
        yield 2.0
        window.screenshot(f"2-dialog-{name}")
        browser = next(one for one in bpy.context.window_manager.windows if one.screen.areas[0].type == "FILE_BROWSER")
        with bpy.context.temp_override(window=browser, area=browser.screen.areas[0]):
            bpy.ops.file.cancel()
        yield 1.0
    job = window.part("rockfall_addon.view.job")
    with tempfile.TemporaryDirectory() as folder:
        page, animation = Path(folder) / "site.html", Path(folder) / "fall.glb"
        with window.override():
            bpy.ops.rockfall.export_web_page(filepath=str(page))
        yield 0.5
        window.screenshot("3-running")
        yield from window.wait_for(lambda: not job.is_running(), 150, "page")
        yield 0.5
        window.screenshot("4-page")
        content = json.loads(re.search(r'id="show">(.*?)</script>', page.read_text(encoding="utf-8"), re.DOTALL)[1])
        assert len(content["blocks"]) == 15
        with window.override():
            bpy.ops.rockfall.export_animation(filepath=str(animation), formats={"glb"})
        yield from window.wait_for(lambda: not job.is_running(), 150, "animation")
        yield 0.5
        window.screenshot("5-animation")
        assert sorted(file.suffix for file in Path(folder).iterdir()) == [".glb", ".html"]

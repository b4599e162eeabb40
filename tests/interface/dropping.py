# SPDX-License-Identifier: GPL-3.0-or-later
"""A person drops files into the 3-D view."""

from pathlib import Path

import bpy

ASSETS = Path(__file__).resolve().parents[2] / "assets" / "demo"


def drop(window, file):
    with window.override():
        bpy.ops.wm.drop_import_file("INVOKE_DEFAULT", directory=str(ASSETS), files=[{"name": file}])


def case_drop_a_slope_and_its_picks(window):
    yield from window.show_sidebar()
    drop(window, "terrain.ply")
    yield 1.0
    window.screenshot("which")  # Blender reads PLY too, and asks
    yield from window.press("T", 80, 40)
    yield 2.0
    window.screenshot("asked")
    yield from window.press("RET", 80, 40)
    yield from window.wait_for(lambda: any("rockfall_role" in o for o in bpy.context.scene.objects), what="imported")
    drop(window, "picks.csv")
    yield from window.wait_for(
        lambda: sum(o.get("rockfall_role") == "flights" for o in bpy.context.scene.objects) == 15, what="reconstructed"
    )
    yield 2.0
    window.screenshot("reconstructed")

# SPDX-License-Identifier: GPL-3.0-or-later
"""A person imports scanned slopes."""

from pathlib import Path

import bpy

DATA = Path(__file__).resolve().parents[1] / "data"


def case_import_ground_classified_tile(window):
    yield from window.show_sidebar()
    window.screenshot("empty")
    with window.override():
        assert bpy.ops.rockfall.import_terrain(filepath=str(DATA / "las_chablais3.laz")) == {"FINISHED"}
    yield 3.0
    window.screenshot("chablais")
    (ground,) = [o for o in bpy.context.scene.objects if o.get("rockfall_role") == "terrain"]
    assert len(ground.data.polygons) > 10_000


def case_import_vegetated_tile_after_asking(window):
    yield from window.show_sidebar()
    with window.override():
        bpy.ops.rockfall.import_terrain("INVOKE_DEFAULT", filepath=str(DATA / "sample_lareunion_epsg2975.laz"))
    yield 2.0
    window.screenshot("dialog")
    x, y = window.centre()
    yield from window.press("RET", x, y)
    yield from window.wait_for(lambda: any("rockfall_role" in o for o in bpy.context.scene.objects), what="imported")
    yield 3.0
    window.screenshot("lareunion")

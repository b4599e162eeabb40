# SPDX-License-Identifier: GPL-3.0-or-later
"""A person sees what was reconstructed: the run in the free view, its lines from afar, the numbers of an impact."""

import sys
from pathlib import Path

import bpy
import numpy as np

sys.path.append(str(Path(__file__).parent))

import workspace
from first_minute import on_region

FAR = 6.0


def coloured(path, area, window):
    """How many pixels of an area of a picture are as colourful as the flights, and not grey as rock."""
    image = bpy.data.images.load(str(path))
    width, height = image.size
    pixels = np.array(image.pixels[:], dtype=np.float32).reshape(height, width, 4)[..., :3]
    bpy.data.images.remove(image)
    part = pixels[area.y + 120 : area.y + area.height - 120, area.x + 20 : area.x + area.width - 120]
    return int((np.ptp(part, axis=2) > 0.35).sum())


def case_result_is_seen(window):
    scene = bpy.context.scene
    with window.override():
        bpy.ops.rockfall.load_footage_demo()
    yield from workspace.arranged(window)
    seen, free = workspace.views(window)
    before = free.spaces.active.region_3d.view_distance
    with bpy.context.temp_override(window=window.window, area=seen, region=workspace.region(seen, "WINDOW")):
        assert bpy.ops.rockfall.propose_impacts() == {"FINISHED"}
    yield 2.5
    (flights,) = [obj for obj in scene.objects if obj.get("rockfall_role") == "flights"]
    here, view = workspace.region(free, "WINDOW"), free.spaces.active.region_3d
    assert view.view_distance < 0.5 * before, "nearer to the run than to the slope"
    places = on_region(free, here, flights)
    assert all(0 <= x <= here.width and 0 <= y <= here.height for x, y in places)
    assert seen.spaces.active.region_3d.view_perspective == "CAMERA", "the footage stays where it is worked in"
    picks = sorted((o for o in scene.objects if o.get("rockfall_role") == "pick"), key=lambda o: o["rockfall_time_s"])
    rows = window.part("rockfall_addon.scene.picks.impact_rows")
    rows.go_to(bpy.context, scene, picks[3])
    yield 1.5
    window.screenshot("card")
    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    bpy.context.view_layer.objects.active = None  # its ring is as colourful as the flights
    yield 1.0
    near = coloured(window.screenshot("near"), free, window)
    view.view_distance *= FAR
    window.redraw()
    yield 1.5
    far = coloured(window.screenshot("far"), free, window)
    print(f"{near} pixels of flights from near, {far} from {FAR:g} times as far")
    assert near > 200
    assert far > 0.5 * near / FAR, "shorter from afar, but not narrower"
    with window.override():
        assert bpy.ops.rockfall.frame_trajectory() == {"FINISHED"}
    assert view.view_distance < before

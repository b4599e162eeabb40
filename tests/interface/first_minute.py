# SPDX-License-Identifier: GPL-3.0-or-later
"""The first minute with one's own data: what a person sees who has just started Blender."""

import sys
from pathlib import Path

import bpy

sys.path.append(str(Path(__file__).parent))

import workspace

ROOT = Path(__file__).resolve().parents[2]
SCAN, FOOTAGE = ROOT / "tests" / "data" / "las_chablais3.laz", ROOT / "assets" / "demo" / "footage" / "footage.mp4"


def import_by_hand(window, file):
    """Choose a file as the file browser does, and accept the dialog; one click each."""
    with window.override():
        bpy.ops.rockfall.import_terrain("INVOKE_DEFAULT", filepath=str(file))
    yield 1.5
    window.screenshot("offer")
    yield from window.press("RET", *window.centre())
    yield from window.wait_for(lambda: grounds(), what="imported")
    yield from workspace.arranged(window)


def grounds():
    return [obj for obj in bpy.context.scene.objects if obj.get("rockfall_role") == "terrain"]


def offered_tools(window):
    with window.override():
        return {tool._bl_tool.idname for tool in window.part("rockfall_addon.view.toolbar")._registered
                if tool.is_needed(bpy.context)}  # fmt: skip


def case_first_import_is_a_clean_start(window):
    """The workspace, no cube, light or grid; the slope fills the free view; a drag of the scan does not move it."""
    assert offered_tools(window) == set(), "nothing to do yet"
    yield from import_by_hand(window, SCAN)
    (ground,) = grounds()
    cube, light = bpy.data.objects["Cube"], bpy.data.objects["Light"]
    assert window.part("rockfall_addon.view.workspace").is_open(bpy.context)
    assert cube.hide_get()
    assert light.hide_get()
    assert bpy.context.view_layer.objects.active is None
    assert offered_tools(window) == {"rockfall.pick_tool"}
    window.screenshot("scan")
    for area in workspace.views(window):
        assert not area.spaces.active.overlay.show_floor
        here = workspace.region(area, "WINDOW")
        places = on_region(area, here, ground)
        assert all(0 <= x <= here.width and 0 <= y <= here.height for x, y in places), "the slope is framed"
        assert max(x for x, _ in places) - min(x for x, _ in places) > here.width / 3
    yield from window.press("A", *middle(workspace.views(window)[1]))
    yield from window.press("G", *middle(workspace.views(window)[1]))
    yield from window.move(500, 500)
    yield from window.click(600, 600)
    assert ground.location.length == 0, "a scan cannot be dragged"
    with window.override():
        bpy.ops.rockfall.add_video("INVOKE_DEFAULT", filepath=str(FOOTAGE))
    yield 3.0
    assert offered_tools(window) == {"rockfall.pick_tool", "rockfall.align_tool"}
    seen, free = workspace.views(window)
    assert seen.spaces.active.region_3d.view_perspective == "CAMERA"
    assert free.spaces.active.region_3d.view_perspective == "PERSP"
    window.screenshot("video")


def case_file_browser_opens_where_the_last_file_was(window):
    with window.override():
        assert bpy.ops.rockfall.import_terrain(filepath=str(SCAN)) == {"FINISHED"}
    yield 0.5
    with window.override():
        bpy.ops.rockfall.add_video("INVOKE_DEFAULT")
    yield from window.wait_for(lambda: browsers() and browsers()[0].params is not None, what="the browser")
    window.screenshot("browser")
    assert Path(browsers()[0].params.directory.decode()) == SCAN.parent
    yield from window.press("ESC", *window.centre())


def browsers():
    areas = (area for each in bpy.context.window_manager.windows for area in each.screen.areas)
    return [area.spaces.active for area in areas if area.type == "FILE_BROWSER"]


def middle(area):
    here = workspace.region(area, "WINDOW")
    return here.x + here.width // 2, here.y + here.height // 2


def on_region(area, here, obj):
    """Where the corners of an object are in a region."""
    from bpy_extras.view3d_utils import location_3d_to_region_2d
    from mathutils import Vector

    view = area.spaces.active.region_3d
    return [tuple(location_3d_to_region_2d(here, view, obj.matrix_world @ Vector(corner))) for corner in obj.bound_box]


def case_trees_that_were_read_as_ground_are_noticed(window):
    """A cloud that nobody has classified: the guide says so, and offers to read it again with the ground filter."""
    scan = ROOT / "tests" / "data" / "sample_lareunion_epsg2975.laz"
    following = window.part("rockfall_addon.scene.next_step")
    yield from import_by_hand(window, scan)
    window.screenshot("trees")
    step = following.next_step(bpy.context.scene)
    assert step.tile == grounds()[0]["rockfall_id"], step.sentence
    height = grounds()[0].dimensions.z
    with window.override():
        bpy.ops.rockfall.import_terrain("INVOKE_DEFAULT", filepath=str(scan), replaces=step.tile, ground="FILTER")
    yield 1.5
    window.screenshot("again")
    yield from window.press("RET", *window.centre())
    job = window.part("rockfall_addon.view.job")
    yield from window.wait_for(lambda: len(grounds()[0].data.polygons) < 10_000 and not job.is_running(), what="read")
    yield 2.0
    window.screenshot("ground")
    window.theme("Light")
    yield 1.5
    window.screenshot("ground-light")
    assert len(grounds()) == 1
    assert grounds()[0].dimensions.z < height
    assert not following.next_step(bpy.context.scene).tile

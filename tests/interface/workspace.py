# SPDX-License-Identifier: GPL-3.0-or-later
"""A person opens the workspace with one click, at either interface scale, and loads the demo's footage."""

import bpy


def views(window):
    areas = [area for area in window.window.screen.areas if area.type == "VIEW_3D"]
    return sorted(areas, key=lambda area: area.x)


def region(area, kind):
    return next(region for region in area.regions if region.type == kind)


def open_it(window):
    with window.override():
        assert bpy.ops.rockfall.open_workspace() == {"FINISHED"}
    workspace = window.part("rockfall_addon.bridge.workspace")
    yield from window.wait_for(lambda: workspace.KEY in window.window.workspace, what="the workspace")
    yield 1.5


def check(window):
    """Two views beside each other, the tab open in the left one, the timeline below."""
    seen, free = views(window)
    assert seen.width > 1.5 * free.width
    sidebar = region(seen, "UI")
    assert sidebar.active_panel_category == "Rockfall"
    assert 100 < sidebar.width / bpy.context.preferences.system.ui_scale < 400
    timeline = window.area("DOPESHEET_EDITOR")
    assert timeline.ui_type == "TIMELINE"
    assert timeline.y < seen.y


def case_workspace_at_both_scales(window):
    yield from open_it(window)
    window.screenshot("empty")
    check(window)
    bpy.context.preferences.view.ui_scale = 2.0
    yield 1.5
    window.screenshot("empty-twice")
    check(window)
    with window.override():
        bpy.ops.rockfall.load_demo()
    yield 2.0
    window.screenshot("demo-twice")
    bpy.context.preferences.view.ui_scale = 1.0
    yield 1.5
    window.screenshot("demo")


def case_workspace_with_the_footage(window):
    """One click; the whole picture is seen beside the sidebar; a second opening finds the same workspace."""
    with window.override():
        assert bpy.ops.rockfall.load_footage_demo() == {"FINISHED"}
    yield 3.0
    window.screenshot("footage")
    check(window)
    scene, (seen, free) = bpy.context.scene, views(window)
    assert seen.spaces.active.region_3d.view_perspective == "CAMERA"
    assert free.spaces.active.region_3d.view_perspective == "PERSP"
    view = window.part("rockfall_addon.bridge.image_view")
    camera = window.part("rockfall_addon.bridge.videos").active_camera(scene)
    here, sidebar = region(seen, "WINDOW"), region(seen, "UI")
    rectangle = view.image_rectangle(here, seen.spaces.active.region_3d, scene, camera)
    assert rectangle.left >= 0
    assert rectangle.left + rectangle.width <= sidebar.x - here.x
    assert rectangle.width > 0.85 * (sidebar.x - here.x - region(seen, "TOOLS").width)
    window.window.workspace = bpy.data.workspaces["Layout"]
    yield 1.0
    yield from open_it(window)
    assert [one.name for one in bpy.data.workspaces if one.name.startswith("Rockfall")] == ["Rockfall"]

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
    store = window.part("rockfall_addon.scene.storage.store")
    yield from window.wait_for(lambda: store.WORKSPACE in window.window.workspace, what="the workspace")
    yield 1.5


def arranged(window):
    """Wait until the demo's footage is arranged; the first drawing takes long without a graphics card."""
    arranging = window.part("rockfall_addon.view.arranging")
    yield from window.wait_for(lambda: not arranging.is_waiting(), 60, "arranged")
    yield 2.0


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
    yield from arranged(window)
    window.screenshot("footage")
    check(window)
    scene, (seen, free) = bpy.context.scene, views(window)
    assert seen.spaces.active.region_3d.view_perspective == "CAMERA"
    assert free.spaces.active.region_3d.view_perspective == "PERSP"
    view = window.part("rockfall_addon.view.image_view")
    camera = window.part("rockfall_addon.scene.footage.videos").active_camera(scene)
    here, sidebar = region(seen, "WINDOW"), region(seen, "UI")
    rectangle = view.image_rectangle(here, seen.spaces.active.region_3d, scene, camera)
    assert rectangle.left >= 0
    assert rectangle.left + rectangle.width <= sidebar.x - here.x
    assert rectangle.width > 0.85 * (sidebar.x - here.x - region(seen, "TOOLS").width)
    window.window.workspace = bpy.data.workspaces["Layout"]
    yield 1.0
    yield from open_it(window)
    assert [one.name for one in bpy.data.workspaces if one.name.startswith("Rockfall")] == ["Rockfall"]


def case_tutorial_of_the_manual(window):
    """From the demo's footage to a refined trajectory, by the clicks that docs/manual counts."""
    scene = bpy.context.scene
    following = window.part("rockfall_addon.scene.next_step")

    def press(operator):
        assert operator in following.next_step(scene).actions, "not offered as the next step"
        seen, _ = views(window)
        module, name = operator.split(".")
        with bpy.context.temp_override(window=window.window, area=seen, region=region(seen, "WINDOW")):
            assert getattr(getattr(bpy.ops, module), name)() == {"FINISHED"}
        window.redraw()  # as after a click on the button

    with window.override():
        bpy.ops.rockfall.load_footage_demo()  # menu Rockfall > Load Footage Demo: 2 clicks
    yield from arranged(window)
    window.screenshot("1-loaded")
    press("rockfall.propose_impacts")
    yield 3.0
    window.screenshot("2-proposed")
    picks = [obj for obj in scene.objects if obj.get("rockfall_role") == "pick"]
    assert len(picks) >= 7
    assert [obj for obj in scene.objects if obj.get("rockfall_role") == "flights"]
    press("rockfall.refine")
    yield 3.0
    window.screenshot("3-refined")
    press("rockfall.apply_refinement")
    yield 3.0
    said = window.part("rockfall_addon.scene.problems").remarks(scene)
    assert not [remark for remark in said if "went wrong" in remark.text], said
    window.screenshot("4-applied")
    assert following.next_step(scene).sentence.startswith("Play")


def case_first_clicks_of_the_manual(window):
    """The menu Rockfall in a fresh Blender, and the first picks by hand, with real clicks."""
    scene = bpy.context.scene
    with window.override():
        bpy.ops.wm.call_menu(name="ROCKFALL_MT_main")
    yield 1.0
    window.screenshot("menu")
    yield from window.press("ESC", *window.centre())
    with window.override():
        bpy.ops.rockfall.load_footage_demo()
    yield from arranged(window)
    seen, _ = views(window)
    here = region(seen, "WINDOW")
    view = window.part("rockfall_addon.view.image_view")
    camera = window.part("rockfall_addon.scene.footage.videos").active_camera(scene)
    rectangle = view.image_rectangle(here, seen.spaces.active.region_3d, scene, camera)
    for pixel, presses in (((921.974, 114.007), 38), ((726.5, 346.1), 0)):  # the first two impacts
        x, y = view.to_region(rectangle, (1280, 720), pixel)
        yield from window.click(here.x + x, here.y + y)
        yield 1.0
        for _ in range(presses):
            window.window.event_simulate(type="RIGHT_ARROW", value="PRESS", x=round(here.x + x), y=round(here.y + y))
            yield 0.05
            window.window.event_simulate(type="RIGHT_ARROW", value="RELEASE", x=round(here.x + x), y=round(here.y + y))
            yield 0.05
        yield 1.0
    yield 2.0
    window.screenshot("by-hand")
    picks = [obj for obj in scene.objects if obj.get("rockfall_role") == "pick"]
    assert len(picks) == 2
    assert scene.frame_current == 89
    assert [obj for obj in scene.objects if obj.get("rockfall_role") == "flights"]

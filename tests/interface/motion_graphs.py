# SPDX-License-Identifier: GPL-3.0-or-later
"""A person looks at the motion graphs: points, clicks and drags the time, selects, zooms, plays, drags a pick."""

import bpy

TREE = "RockfallMotionGraphs"


def open_graphs(window, *, demo="load_demo"):
    """The motion graphs beside the 3-D view, with a demo."""
    with window.override():
        assert getattr(bpy.ops.rockfall, demo)() == {"FINISHED"}
        bpy.ops.ed.undo_push(message="demo")
        assert bpy.ops.rockfall.open_motion_graphs() == {"FINISHED"}
    yield 2.0


def region(window):
    return window.region("WINDOW", "NODE_EDITOR")


def canvas(window):
    return window.part("rockfall_addon.view.graphs.editor")._canvases[region(window).as_pointer()]


def place(window, number, time_s, value):
    """A point of a graph, as a pixel of the window."""
    x, y = canvas(window).frames[number].to_pixels([[time_s, value]])[0]
    return region(window).x + x, region(window).y + y


def case_motion_graphs_first_look(window):
    yield from open_graphs(window)
    window.screenshot("dark")
    assert len(canvas(window).frames) == 3
    window.theme("Light")
    yield 1.0
    window.screenshot("light")


def alone(courses, speed):
    """A trajectory, and a time [s] at which no other one is as quick, far from its impacts."""
    for course in courses:
        for time_s in (course.impact_time_s[:-1] + course.impact_time_s[1:]) / 2:
            others = [one.at(speed, time_s) for one in courses if one is not course]
            apart = min((abs(value - course.at(speed, time_s)) for value in others if value == value), default=9.0)
            if apart > 2.5 and abs(course.impact_time_s - time_s).min() > 0.3:
                return course, float(time_s)
    raise AssertionError("no trajectory is ever alone")


def case_motion_graphs_move_the_time(window):
    """Click, drag, Esc, Shift, a click on a line and one on an impact; zoom and reset; undo brings the time back."""
    yield from open_graphs(window)
    scene, rate = bpy.context.scene, bpy.context.scene.render.fps
    yield from window.click(*place(window, 0, 6.0, 22.0))
    assert abs(scene.frame_current - 6.0 * rate) <= 1
    first = place(window, 1, 8.0, 7.7)
    yield from window.move(*first)
    window.window.event_simulate(type="LEFTMOUSE", value="PRESS", x=round(first[0]), y=round(first[1]))
    yield 0.3
    for time_s in (9.0, 10.0, 12.0):
        yield from window.move(*place(window, 1, time_s, 7.0))
    window.screenshot("dragging")
    assert abs(scene.frame_current - 12.0 * rate) <= 1
    yield from window.press("ESC", *place(window, 1, 12.0, 7.0))
    assert abs(scene.frame_current - 6.0 * rate) <= 1
    window.window.event_simulate(type="LEFTMOUSE", value="RELEASE", x=round(first[0]), y=round(first[1]))
    yield 0.3

    motion = window.part("rockfall_addon.scene.models.motion").motion_of(scene)
    speed = window.part("core.analysis.motion_graphs").SPEED
    course, time_s = alone(motion.courses, speed)
    yield from window.move(*place(window, 0, time_s, course.at(speed, time_s)))
    assert canvas(window).hit == (course.trajectory, 0), canvas(window).hit
    yield 1.0
    window.screenshot("hover")
    yield from window.click(*place(window, 0, time_s, course.at(speed, time_s)))
    assert [obj.name for obj in bpy.context.selected_objects] == [f"{course.trajectory} block"]
    assert abs(scene.frame_current - time_s * rate) <= 1.5
    yield 0.5
    window.screenshot("selected")
    impact = float(course.impact_time_s[course.impact_time_s > time_s][0])
    yield from window.click(*place(window, 0, impact, course.at(speed, impact) + 1.0))
    assert bpy.context.object["rockfall_trajectory"] == course.trajectory
    assert bpy.context.object["rockfall_role"] == "pick"
    assert abs(scene.frame_current + scene.frame_subframe - impact * rate) < 1e-3

    x, y = place(window, 0, 8.0, 10.0)
    for _ in range(4):
        window.window.event_simulate(type="WHEELUPMOUSE", value="PRESS", x=round(x), y=round(y))
        yield 0.2
    limits = canvas(window).frames[2].x.limits
    assert limits[1] - limits[0] < 12.0, "all graphs zoom along the time"
    window.screenshot("zoomed")
    yield from window.press("HOME", x, y)
    assert canvas(window).frames[0].x.limits[0] <= 0.5


def case_motion_graphs_follow(window):
    """The playback, a pick that is dragged, another unit of the time, a scale of the interface."""
    yield from open_graphs(window)
    scene = bpy.context.scene
    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    pick = sorted(
        (o for o in scene.objects if o.get("rockfall_role") == "pick" and o["rockfall_trajectory"] == "B03"),
        key=lambda o: o["rockfall_time_s"],
    )[3]
    pick.select_set(True)
    bpy.context.view_layer.objects.active = pick
    motion = window.part("rockfall_addon.scene.models.motion")
    before = {one.trajectory: one for one in motion.motion_of(scene).courses}
    x, y = window.centre()
    yield from window.press("G", x, y)
    for step in (20, 40, 60):
        yield from window.move(x + step, y)
    yield 0.5
    window.screenshot("dragging_a_pick")
    during = {one.trajectory: one for one in motion.motion_of(scene).courses}
    assert during["B03"] is not before["B03"], "the graphs follow while the pick is held"
    assert during["B04"] is before["B04"]
    yield from window.press("ESC", x + 60, y)
    yield 0.5
    scene.rockfall_motion.in_frames = True
    bpy.context.preferences.view.ui_scale = 1.6
    yield 1.0
    window.screenshot("frames_at_scale_1.6")
    assert canvas(window).frames[0].x.label == "Frame"
    with window.override():
        bpy.ops.screen.animation_play()
    start = scene.frame_current
    yield from window.wait_for(lambda: scene.frame_current > start + 3, 60.0, "the scene plays")
    window.screenshot("playing")
    with window.override():
        bpy.ops.screen.animation_play()
    yield 0.5


def case_motion_graphs_without_motion(window):
    """An empty file says what to do; picks without flights, too; small windows stay readable."""
    with window.override():
        bpy.ops.rockfall.open_motion_graphs()
    yield 1.5
    window.screenshot("nothing")
    assert canvas(window).buttons
    assert not canvas(window).frames


def case_motion_graphs_of_footage(window):
    """Tracked footage: the residual over time, the number of the picture at the cursor, a click goes to its moment."""
    with window.override():
        assert bpy.ops.rockfall.load_footage_demo() == {"FINISHED"}
    yield 3.0
    with window.override():
        bpy.ops.rockfall.open_motion_graphs()
    yield 1.5
    assert canvas(window).buttons, "it is said what to do next"
    with window.override():
        bpy.ops.rockfall.propose_impacts()
    yield 3.0
    scene = bpy.context.scene
    assert len(canvas(window).frames) == 4
    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    bpy.data.objects["B10 block"].select_set(True)
    time_s = 3.0
    yield from window.click(*place(window, 3, time_s, 1.0))
    yield 2.0
    assert abs(scene.frame_current - time_s * scene.render.fps / scene.render.fps_base) <= 1
    window.screenshot("footage")


def case_motion_graphs_and_those_of_impacts_change_places(window):
    """One click in the header shows the other kind of graphs in the same area, and one more the first again."""
    yield from open_graphs(window)
    header = window.region("HEADER", "NODE_EDITOR")
    scale = bpy.context.preferences.system.ui_scale
    y = header.y + header.height // 2
    window.screenshot("motion")
    yield from window.click(header.x + 90 * scale, y)
    yield 1.0
    assert window.area("NODE_EDITOR").ui_type == "RockfallImpactGraphs"
    window.screenshot("impacts")
    yield from window.click(header.x + 150 * scale, y)
    yield 1.0
    assert window.area("NODE_EDITOR").ui_type == TREE

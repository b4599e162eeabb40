# SPDX-License-Identifier: GPL-3.0-or-later
"""A person aligns the demo's footage: clicks in the picture and on the terrain, corrects, undoes."""

import time
from pathlib import Path

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Vector

DEMO = Path(__file__).resolve().parents[2] / "assets" / "demo"
FOOTAGE = DEMO / "footage"


def start(window):
    """The demo's terrain, its footage, and both side by side."""
    yield from window.show_sidebar()
    scene = bpy.context.scene
    opening, project = window.part("core.workflow.opening"), window.part("core.exchange.project")
    surface, result = opening.open_project(project.read_project(DEMO / "project.toml"))
    window.part("rockfall_addon.scene.georeference").write_shift(scene, result.picks.shift)
    shading = window.part("core.terrain.shading").shade(surface)
    window.part("rockfall_addon.scene.terrain").add_terrain(scene, surface, shading)
    camera = window.part("rockfall_addon.scene.new_videos").add_video(scene, FOOTAGE / "footage.mp4")
    yield 1.0
    with window.override():
        assert bpy.ops.rockfall.align_views() == {"FINISHED"}
        bpy.ops.ed.undo_push(message="start")
    yield 2.0
    for area in views(window):
        area.spaces.active.overlay.show_text = False
    assert camera.name in bpy.data.objects


def views(window):
    found = [area for area in window.window.screen.areas if area.type == "VIEW_3D"]
    return sorted(found, key=lambda area: area.x)


def region_of(area):
    return next(region for region in area.regions if region.type == "WINDOW")


def table(window):
    shift = window.part("rockfall_addon.scene.georeference").read_shift(bpy.context.scene)
    return window.part("core.exchange.cameras").read_pairs(FOOTAGE / "pairs.csv", shift)


def the_camera(window):
    return window.part("rockfall_addon.scene.videos").active_camera(bpy.context.scene)


def in_picture(window, pixel):
    """Where a pixel of the footage is in the window."""
    view, area = window.part("rockfall_addon.view.image_view"), views(window)[0]
    region, camera = region_of(area), the_camera(window)
    rectangle = view.image_rectangle(region, area.spaces.active.region_3d, bpy.context.scene, camera)
    assert rectangle is not None, "the left view looks through the camera"
    x, y = view.to_region(rectangle, (1280, 720), pixel)
    return region.x + x, region.y + y


def on_terrain(window, point):
    """Where a point is in the window, in the free view."""
    area = views(window)[1]
    region = region_of(area)
    spot = location_3d_to_region_2d(region, area.spaces.active.region_3d, Vector(point))
    return region.x + spot.x, region.y + spot.y


def look_at(window, points):
    """Turn the free view towards the points, from where the film was shot."""
    view = views(window)[1].spaces.active.region_3d
    centre = np.mean(points, axis=0)
    view.view_location = centre
    view.view_rotation = Vector((0.2, -0.85, 0.4)).to_track_quat("Z", "Y")
    view.view_distance = 85.0


def sidebar(window, shown):
    """The sidebar of the free view would lie over the points."""
    views(window)[1].spaces.active.show_region_ui = shown
    yield 0.5
    if shown:
        region = next(region for region in views(window)[1].regions if region.type == "UI")
        x, y = region.x + region.width // 2, region.y + region.height // 2
        yield from window.move(x, y)
        for _ in range(25):
            window.window.event_simulate(type="WHEELDOWNMOUSE", value="PRESS", x=x, y=y)
            yield 0.03
        yield 0.5


def case_align_with_clicks(window):
    yield from start(window)
    aligned, pairs, camera_paths = (
        window.part(f"rockfall_addon.scene.{name}") for name in ("alignment", "pairs", "camera_paths")
    )
    ground = table(window)
    look_at(window, ground.point)
    yield 1.0
    window.screenshot("1-start")
    yield from sidebar(window, False)
    order = [1, 4, 7, 11, 5, 9]
    for count, i in enumerate(order):
        pixel, place = in_picture(window, ground.pixel[i]), on_terrain(window, ground.point[i])
        first, second = (pixel, place) if count % 2 == 0 else (place, pixel)
        yield from window.click(*first)
        if count == 0:
            yield 0.5
            window.screenshot("2-half-pair")
        pair = pairs.open_pair(the_camera(window))
        assert pair is not None, f"pair {count} is open"
        if count < 5:
            yield from window.click(*second)
            assert pairs.open_pair(the_camera(window)) is None, f"pair {count} is complete"
    camera = the_camera(window)
    assert camera_paths.is_solved(camera), aligned.solution_of(camera).problem
    pair = pairs.open_pair(camera)
    assert pair.proposed == "pixel", "five pairs solve the camera, so the sixth is predicted"
    yield 1.0
    window.screenshot("3-predicted")
    x, y = in_picture(window, pair.pixel)
    goal = in_picture(window, ground.pixel[order[-1]])
    yield from window.move(x, y)
    window.window.event_simulate(type="LEFTMOUSE", value="PRESS", x=round(x), y=round(y))
    yield 0.2
    times = []
    for share in (0.3, 0.6, 1.0):
        begun = time.perf_counter()
        yield from window.move(x + share * (goal[0] - x) + 4 * (share < 1), y + share * (goal[1] - y))
        times.append(time.perf_counter() - begun)
    window.window.event_simulate(type="LEFTMOUSE", value="RELEASE", x=round(goal[0]), y=round(goal[1]))
    yield 0.5
    camera = the_camera(window)
    assert pairs.open_pair(camera) is None
    assert sum(pair.is_complete for pair in pairs.pairs_of(camera)) == 6
    focal, rmse = aligned.focal_px(camera), aligned.solution_of(camera).rmse_px
    print(f"focal {focal:.0f} px, rmse {rmse:.2f} px, {' '.join(map(str, aligned.solution_of(camera).remarks))}")
    yield from sidebar(window, True)
    camera = the_camera(window)
    camera.rockfall_alignment.blend = 0.5
    camera.rockfall_alignment.magnify = True
    yield 1.5
    window.screenshot("4-solved-blended")
    camera.rockfall_alignment.magnify = False
    camera.rockfall_alignment.use_wipe = True
    yield 1.5
    window.screenshot("5-wipe")
    camera.rockfall_alignment.use_wipe = False
    with window.override():
        bpy.ops.ed.undo_push(message="look")
    for left in (6, 5):
        yield from window.press("X", *in_picture(window, (640, 600)))
        yield 0.5
        assert len(pairs.pairs_of(the_camera(window))) == left - 1
    for expected in (5, 6):
        with window.override():
            bpy.ops.ed.undo()
        yield 0.7
        assert len(pairs.pairs_of(the_camera(window))) == expected
    assert len(the_camera(window).rockfall_alignment.rows) == 6
    assert abs(aligned.focal_px(the_camera(window)) - focal) < 1e-6, "undo brings the solution back"
    for _ in range(2):
        with window.override():
            bpy.ops.ed.undo()
        yield 0.7
    assert pairs.open_pair(the_camera(window)).proposed == "pixel", "the drag is one step, and so is each click"
    predicted = pairs.open_pair(the_camera(window)).pixel
    x, y = in_picture(window, predicted)
    yield from held(window, (x, y))
    yield from window.move(x + 2, y + 1)
    yield from let_go(window, (x + 2, y + 1))
    taken = pairs.pairs_of(the_camera(window))[-1]
    assert (taken.agreed, taken.pixel) == ("pixel", predicted), "a click takes it, though the mouse trembles"
    assert aligned.ready_pairs(bpy.context.scene, the_camera(window)) == 5, "it only checks the camera"
    yield from sidebar(window, True)
    window.screenshot("6-as-predicted")
    remarks = window.part("rockfall_addon.scene.problems").remarks(bpy.context.scene)
    assert all("rests on" in str(remark) for remark in remarks), "few pairs, and nothing else"


def case_align_by_eye(window):
    """Footage that cannot be solved: the view is taken; then terrain that shines through is dragged into place."""
    yield from start(window)
    aligned, pairs = (window.part(f"rockfall_addon.scene.{name}") for name in ("alignment", "pairs"))
    ground = table(window)
    yield from sidebar(window, False)
    window.window.cursor_warp(800, 500)
    free = views(window)[1]
    view = free.spaces.active.region_3d
    place, target = Vector((35.0, -15.0, 62.0)), Vector((20.0, 62.0, 27.0))
    view.view_rotation = (place - target).to_track_quat("Z", "Y")
    view.view_distance = (place - target).length
    view.view_location = target
    yield 1.0
    with bpy.context.temp_override(window=window.window, area=free, region=region_of(free)):
        assert bpy.ops.rockfall.use_view("INVOKE_DEFAULT") == {"FINISHED"}
        bpy.ops.ed.undo_push(message="by eye")
    view.view_perspective = "PERSP"
    look_at(window, ground.point)
    yield 1.5
    camera = the_camera(window)
    assert aligned.placement(camera) == "eye"
    window.screenshot("1-by-eye")
    x, y = in_picture(window, (640, 360))
    yield from window.click(x, y, shift=True)
    pair = pairs.open_pair(the_camera(window))
    assert pair.proposed == "pixel"
    assert np.allclose(pair.pixel, (640, 360), atol=2), "what shines through there"
    surface = window.part("rockfall_addon.scene.terrain").surface_of_scene(bpy.context.scene)
    assert window.part("core.terrain.raycast").closest_points(surface, [pair.point]).distance[0] < 1e-6
    window.window.event_simulate(type="MOUSEMOVE", value="NOTHING", x=round(x), y=round(y))
    window.window.event_simulate(type="LEFTMOUSE", value="PRESS", x=round(x), y=round(y))
    yield 0.3
    window.window.event_simulate(type="MOUSEMOVE", value="NOTHING", x=round(x) + 100, y=round(y), shift=True)
    yield 0.3
    window.window.event_simulate(type="LEFTMOUSE", value="RELEASE", x=round(x) + 100, y=round(y))
    yield 0.5
    pair = pairs.pairs_of(the_camera(window))[0]
    assert pair.is_complete
    width = in_picture(window, (1280, 0))[0] - in_picture(window, (0, 0))[0]
    assert abs(pair.pixel[0] - 640 - 10 * 1280 / width) < 3, "Shift moves a tenth"
    yield from sidebar(window, True)
    window.screenshot("2-one-pair")


def held(window, place):
    """Press the mouse, and leave it."""
    yield from window.move(*place)
    window.window.event_simulate(type="LEFTMOUSE", value="PRESS", x=round(place[0]), y=round(place[1]))
    yield 0.3


def let_go(window, place):
    window.window.event_simulate(type="LEFTMOUSE", value="RELEASE", x=round(place[0]), y=round(place[1]))
    yield 0.3


def seen_state(window):
    """What Esc must bring back: pairs, and the camera as it is kept and as Blender has it."""
    camera = the_camera(window)
    keys = ("rockfall_solved", "rockfall_placed", "rockfall_camera", "rockfall_reference_pose")
    kept = [
        repr(camera[key].to_list() if hasattr(camera[key], "to_list") else camera[key]) for key in keys if key in camera
    ]
    marked = [repr(pair.to_dict()) for pair in camera.get("rockfall_pairs", ())]
    return marked, kept, [tuple(row) for row in camera.matrix_world], camera.data.lens


def case_align_escape(window):
    """Esc while a mark is held takes it back, and the camera that was solved with it."""
    yield from start(window)
    camera_paths, ground = window.part("rockfall_addon.scene.camera_paths"), table(window)
    look_at(window, ground.point)
    yield from sidebar(window, False)
    for i in (1, 4, 7, 11):
        yield from window.click(*in_picture(window, ground.pixel[i]))
        yield from window.click(*on_terrain(window, ground.point[i]))
    yield from window.click(*in_picture(window, ground.pixel[5]))
    yield 0.5
    before, place = seen_state(window), on_terrain(window, ground.point[5])
    assert not camera_paths.is_solved(the_camera(window))
    yield from held(window, place)
    assert camera_paths.is_solved(the_camera(window)), "the fifth pair solves the camera"
    yield from window.press("ESC", *place)
    yield from let_go(window, place)
    assert seen_state(window) == before
    yield from window.click(*place)
    yield 0.5
    before = seen_state(window)
    assert camera_paths.is_solved(the_camera(window))
    x, y = in_picture(window, ground.pixel[7])
    yield from held(window, (x, y))
    yield from window.move(x + 60, y - 20)
    assert seen_state(window) != before
    yield from window.press("ESC", x + 60, y - 20)
    yield from let_go(window, (x + 60, y - 20))
    assert seen_state(window) == before
    yield 0.5
    window.screenshot("1-as-before")


def case_align_follow_hand_held(window):
    yield from start(window)
    aligned, camera_paths = (window.part(f"rockfall_addon.scene.{name}") for name in ("alignment", "camera_paths"))
    with window.override():
        assert bpy.ops.rockfall.import_pairs(filepath=str(FOOTAGE / "pairs.csv")) == {"FINISHED"}
    camera = the_camera(window)
    camera.rockfall_alignment.motion = "ROTATION"
    yield 1.0
    window.screenshot("1-imported")
    job = window.part("rockfall_addon.view.job")
    with window.override():
        bpy.ops.rockfall.follow_background("INVOKE_DEFAULT")
    yield 4.0
    assert job.is_running()
    window.screenshot("2-running")
    yield from window.press("ESC", *window.centre())
    yield 1.0
    assert not job.is_running()
    assert len(the_camera(window)["rockfall_pose_times_s"]) == 1
    begun = time.perf_counter()
    with window.override():
        bpy.ops.rockfall.follow_background("INVOKE_DEFAULT")
    yield from window.wait_for(lambda: not job.is_running(), 150, "followed")
    print(f"followed in {time.perf_counter() - begun:.1f} s")
    yield 1.0
    assert len(the_camera(window)["rockfall_pose_times_s"]) == 300
    scene = bpy.context.scene
    scene.frame_set(150)
    the_camera(window).rockfall_alignment.blend = 0.6
    yield 1.5
    window.screenshot("3-frame-150")
    with window.override():
        assert bpy.ops.rockfall.propose_pairs() == {"FINISHED"}
    yield 1.0
    window.screenshot("4-correct-here")
    assert camera_paths.is_solved(the_camera(window))
    assert aligned.hint(scene, the_camera(window))

# SPDX-License-Identifier: GPL-3.0-or-later
"""A person picks impacts in the demo's footage, drags one, steps, undoes, and refines."""

import csv
import time
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
FOOTAGE = ROOT / "assets" / "demo" / "footage"
OFFSET_S = 465.499
ORIGIN = (988400.0, 6375600.0, 1500.0)


def rows(name):
    with (FOOTAGE / "truth" / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def local(row, *names):
    return np.array([float(row[name]) for name in names]) - ORIGIN


def camera_of(window):
    return window.part("rockfall_addon.scene.footage.videos").cameras(bpy.context.scene)[0]


def open_site(window):
    """Terrain, footage, the camera as it truly was; the view looks through it with our tool."""
    scene = bpy.context.scene
    with window.override():
        bpy.ops.object.select_all(action="SELECT")
        bpy.ops.object.delete()
    new_videos = window.part("rockfall_addon.scene.footage.new_videos")
    clocks = window.part("rockfall_addon.scene.footage.clocks")
    camera_paths = window.part("rockfall_addon.scene.footage.camera_paths")
    model = window.part("core.camera.model")
    shift = window.part("core.georeference").GlobalShift(*ORIGIN)
    surface = window.part("core.terrain.readers").read_terrain(ROOT / "assets" / "demo" / "terrain.ply", shift=shift)
    shading = window.part("core.terrain.shading").shade(surface)
    window.part("rockfall_addon.scene.terrain.terrain").add_terrain(scene, surface, shading)
    camera = new_videos.add_video(scene, FOOTAGE / "footage.mp4")
    poses = rows("camera.csv")
    place = np.array([local(row, "x_m", "y_m", "z_m") for row in poses])
    turn = np.array([[float(row[f"r{i}{j}"]) for i in "123" for j in "123"] for row in poses]).reshape(-1, 3, 3)
    lens = model.Camera(1280, 720, 2100.0, 2100.0, 640.0, 360.0, position=place[0], rotation=turn[0], shift=shift)
    times, nothing = np.array([float(row["time_s"]) for row in poses]), np.zeros(len(poses))
    scene["rockfall_time_origin_s"] = OFFSET_S
    clocks.set_clock(camera, window.part("core.footage.clock").Clock(OFFSET_S))
    path = window.part("core.camera.path").CameraPath(lens, times, place, turn, nothing, nothing)
    camera_paths.set_camera_path(scene, camera, path)
    scene.camera = camera
    camera.data.background_images[0].display_depth = "FRONT"
    camera.data.background_images[0].alpha = 0.9
    scene.rockfall.block_diameter_m, scene.rockfall.normal_radius_m = 0.39, 0.6
    scene.rockfall_picking.trajectory = "B10"
    yield from window.show_sidebar()
    with window.override():
        bpy.ops.rockfall.look_through()
        bpy.ops.view3d.view_center_camera()
        bpy.ops.wm.tool_set_by_id(name="rockfall.pick_tool")
        bpy.ops.ed.undo_push(message="site")
    yield 1.5


def on_screen(window, pixel):
    """Where a pixel of the footage is in the window."""
    view = window.part("rockfall_addon.view.image_view")
    region, camera = window.region(), camera_of(window)
    rectangle = view.image_rectangle(region, window.area().spaces.active.region_3d, bpy.context.scene, camera)
    assert rectangle is not None
    x, y = view.to_region(rectangle, (1280, 720), np.asarray(pixel, dtype=float))
    return region.x + x, region.y + y


def picks():
    found = [obj for obj in bpy.context.scene.objects if obj.get("rockfall_role") == "pick"]
    return sorted(found, key=lambda obj: obj["rockfall_time_s"])


def no_trouble(window):
    said = window.part("rockfall_addon.scene.problems").remarks(bpy.context.scene)
    assert not [remark for remark in said if "went wrong" in remark.text], said


def pick_impacts(window, count, first=0):
    block = {int(row["frame"]): row for row in rows("block.csv")}
    impacts = [row for row in rows("impacts.csv") if float(row["time_s"]) > 1.3][first:][:count]
    frames = [round(float(row["time_s"]) * 30) for row in impacts]
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        yield 0.5
        x, y = on_screen(window, [float(block[frame]["u_px"]), float(block[frame]["v_px"])])
        yield from window.click(x, y)
        yield 0.5
    return frames, impacts


def case_pick_impacts_in_the_footage(window):
    yield from open_site(window)
    scene = bpy.context.scene
    frames, impacts = yield from pick_impacts(window, 3)
    window.screenshot("three")
    assert [obj["rockfall_extra"]["frame"] for obj in picks()] == [str(frame) for frame in frames]
    for obj, row in zip(picks(), impacts, strict=True):
        contact = local(row, "contact_x_m", "contact_y_m", "contact_z_m")
        off = float(np.linalg.norm(np.array(obj["rockfall_position_m"]) - contact))
        assert off < 0.5, (obj.name, off)
    no_trouble(window)

    # drag the last one, in its picture
    obj = picks()[-1]
    before, identifier = list(obj["rockfall_position_m"]), obj["rockfall_id"]
    with window.override():
        pointing = window.part("rockfall_addon.view.pointing")
        spot = pointing.on_screen(bpy.context, [before])[0]
    x, y = window.region().x + spot[0], window.region().y + spot[1]
    yield from window.move(x, y)
    window.window.event_simulate(type="LEFTMOUSE", value="PRESS", x=round(x), y=round(y))
    yield 0.3
    for step in range(1, 7):
        yield from window.move(x + 6 * step, y)
    window.screenshot("dragging")
    assert window.part("rockfall_addon.scene.footage.sync").is_dragging()
    window.window.event_simulate(type="LEFTMOUSE", value="RELEASE", x=round(x + 36), y=round(y))
    yield 1.0
    after = list(picks()[-1]["rockfall_position_m"])
    way = np.linalg.norm(np.subtract(after, before))
    assert 0.5 < way < 4.0, way
    yield 2.0
    window.screenshot("dragged")
    with window.override():
        bpy.ops.ed.undo()
    yield 1.0
    (undone,) = [one for one in picks() if one["rockfall_id"] == identifier]
    assert list(undone["rockfall_position_m"]) == before, "the drag is one step"
    assert len(picks()) == 3
    with window.override():
        bpy.ops.ed.redo()
    yield 1.0
    assert list(picks()[-1]["rockfall_position_m"]) == after
    with window.override():
        bpy.ops.ed.undo()
        bpy.ops.ed.undo()
    yield 1.0
    assert len(picks()) == 2, "each pick is one step"
    with window.override():
        bpy.ops.ed.redo()
    yield 1.0
    assert len(picks()) == 3
    scene = bpy.context.scene

    # keys: a tenth of a frame, kinds, steps, remove
    x, y = on_screen(window, [300, 500])
    moment = picks()[-1]["rockfall_time_s"]
    with window.override():
        window.part("rockfall_addon.view.pointing").select(bpy.context, picks()[-1])
    yield from window.press("RIGHT_BRACKET", x, y)
    assert abs(picks()[-1]["rockfall_time_s"] - moment - 0.1 / 30) < 1e-6, picks()[-1]["rockfall_time_s"] - moment
    yield from window.press("THREE", x, y)
    assert scene.rockfall_picking.kind == "pass"
    yield from window.press("ONE", x, y)
    assert scene.rockfall_picking.kind == "impact"
    frame = scene.frame_current
    yield from window.press("RIGHT_ARROW", x, y)
    assert scene.frame_current == frame + 1
    yield from window.press("RIGHT_ARROW", x, y)

    # the block leaves the ground two pictures later and a little farther down
    yield from window.press("SIX", x, y)
    assert scene.rockfall_picking.kind == "takeoff"
    with window.override():
        spot = pointing.on_screen(bpy.context, [list(picks()[-1]["rockfall_position_m"])])[0]
    yield from window.click(window.region().x + spot[0] + 12, window.region().y + spot[1] - 6)
    yield 1.0
    assert [obj["rockfall_kind"] for obj in picks()] == ["impact", "impact", "impact", "takeoff"]
    assert scene.rockfall_picking.kind == "impact", "an impact has one take-off"
    no_trouble(window)
    window.screenshot("take-off")
    yield from window.press("X", x, y)
    assert len(picks()) == 3
    with window.override():
        window.part("rockfall_addon.view.pointing").select(bpy.context, picks()[-1])
    yield from window.press("X", x, y)
    assert len(picks()) == 2
    window.screenshot("keys")
    no_trouble(window)


def case_pick_refine(window):
    yield from open_site(window)
    scene = bpy.context.scene
    yield from pick_impacts(window, 5)
    table = window.part("core.exchange.footage_tables").read_track(FOOTAGE / "track.csv")
    one = np.ones(len(table))
    track = window.part("core.footage.tracking").BlockTrack(
        table.frame, table.time_s, table.pixel, table.sigma_px, one, table.pixel, 9 * one, ("", "")
    )
    window.part("rockfall_addon.scene.footage.sightings").keep_track(camera_of(window), "B10", track)
    picks()[1]["rockfall_time_s"] += 0.03
    window.part("rockfall_addon.scene.footage.sync").sync(scene)
    with window.override():
        bpy.ops.ed.undo_push(message="track")
    scene.frame_set(80)
    window.redraw()
    yield 1.5
    window.screenshot("tracked")
    with window.override():
        assert bpy.ops.rockfall.refine() == {"FINISHED"}
    region = window.region("UI")
    with bpy.context.temp_override(window=window.window, area=window.area(), region=region):
        for _ in range(120):
            bpy.ops.view2d.scroll_down(deltax=0, deltay=60)
    window.redraw()
    yield 1.5
    window.screenshot("proposed")
    found = window.part("rockfall_addon.scene.picks.proposal").read(scene)
    assert found.after_px < 1.5 < found.before_px, found
    with window.override():
        assert bpy.ops.rockfall.apply_refinement() == {"FINISHED"}
        bpy.ops.ed.undo_push(message="applied")
    window.redraw()
    yield 1.5
    window.screenshot("applied")
    no_trouble(window)
    view = window.part("rockfall_addon.view.footage_view")
    start = time.perf_counter()
    for _ in range(20):
        view.draw(scene, camera_of(window), picks()[1])
    each = (time.perf_counter() - start) / 20
    assert each < 0.1, f"what is drawn over the footage takes {1000 * each:.1f} ms"
    # free view: the pick's ball, and a click on the terrain
    with window.override():
        space = window.area().spaces.active
        space.region_3d.view_perspective = "PERSP"
        window.part("rockfall_addon.view.pointing").select(bpy.context, picks()[2])
        bpy.ops.view3d.view_selected()
    space.region_3d.view_distance = 8.0
    yield 1.5
    window.screenshot("free")
    count = len(picks())
    scene.frame_set(230)
    x, y = window.centre()
    yield from window.click(x - 150, y - 100)
    yield 1.0
    assert len(picks()) == count + 1
    window.screenshot("free-clicked")
    no_trouble(window)


def case_pick_fine_and_cancelled(window):
    """Shift moves a tenth of the way; Esc takes back what the mouse did; Enter ends the tool."""
    yield from open_site(window)
    yield from pick_impacts(window, 1, 2)
    ways = []
    (obj,) = picks()
    before = list(obj["rockfall_position_m"])
    with window.override():
        x, y = window.part("rockfall_addon.view.pointing").handle_of(bpy.context, obj)
    x, y = window.region().x + x, window.region().y + y
    yield from window.move(x + 3, y)
    for value, to in (("PRESS", x + 3), ("NOTHING", x + 6), ("NOTHING", x + 3), ("RELEASE", x + 3)):
        kind = "MOUSEMOVE" if value == "NOTHING" else "LEFTMOUSE"
        window.window.event_simulate(type=kind, value=value, x=round(to), y=round(y))
        yield 0.3
    off = np.linalg.norm(np.subtract(picks()[0]["rockfall_position_m"], before))
    assert off < 0.03, f"taken and put back it has not jumped: {off} m"
    for modifiers in ({}, {"shift": True}):
        with window.override():
            spot = window.part("rockfall_addon.view.pointing").on_screen(
                bpy.context, [list(picks()[0]["rockfall_position_m"])]
            )[0]
        x, y = window.region().x + spot[0], window.region().y + spot[1]
        held = list(picks()[0]["rockfall_position_m"])
        yield from window.move(x, y)
        window.window.event_simulate(type="LEFTMOUSE", value="PRESS", x=round(x), y=round(y), **modifiers)
        yield 0.3
        for step in range(1, 5):
            window.window.event_simulate(
                type="MOUSEMOVE", value="NOTHING", x=round(x + 10 * step), y=round(y), **modifiers
            )
            yield 0.2
        window.window.event_simulate(type="LEFTMOUSE", value="RELEASE", x=round(x + 40), y=round(y), **modifiers)
        yield 0.7
        ways.append(np.linalg.norm(np.subtract(picks()[0]["rockfall_position_m"], held)))
    assert 0.05 < ways[1] / ways[0] < 0.2, ways
    held = list(picks()[0]["rockfall_position_m"])
    x, y = on_screen(window, [300, 400])
    yield from window.move(x, y)
    window.window.event_simulate(type="LEFTMOUSE", value="PRESS", x=round(x), y=round(y))
    yield 0.5
    assert list(picks()[0]["rockfall_position_m"]) != held, "a click elsewhere in the picture moves its pick"
    yield from window.press("ESC", x, y)
    window.window.event_simulate(type="LEFTMOUSE", value="RELEASE", x=round(x), y=round(y))
    yield 0.5
    assert list(picks()[0]["rockfall_position_m"]) == held
    bpy.context.scene.frame_set(80)
    yield 0.5
    yield from window.move(x, y)
    window.window.event_simulate(type="LEFTMOUSE", value="PRESS", x=round(x), y=round(y))
    yield 0.5
    assert len(picks()) == 2
    yield from window.press("ESC", x, y)
    window.window.event_simulate(type="LEFTMOUSE", value="RELEASE", x=round(x), y=round(y))
    yield 0.5
    assert len(picks()) == 1, "a new pick that is cancelled is gone"
    yield from window.press("RET", x, y)
    with window.override():
        tool = bpy.context.workspace.tools.from_space_view3d_mode("OBJECT")
    assert tool.idname != "rockfall.pick_tool"
    no_trouble(window)


def case_pick_track_the_block(window):
    """Two clicks on the block in flight, tracked beside the window's work, stopped by Esc, then proposed impacts."""
    yield from open_site(window)
    scene = bpy.context.scene
    block = {int(row["frame"]): row for row in rows("block.csv")}
    scene.rockfall_picking.kind = "pass"
    for frame in (70, 100):
        scene.frame_set(frame)
        yield 0.5
        x, y = on_screen(window, [float(block[frame]["u_px"]), float(block[frame]["v_px"])])
        yield from window.click(x, y)
        yield 0.3
    camera, sightings = camera_of(window), window.part("rockfall_addon.scene.footage.sightings")
    assert not picks(), "in flight the pixel is kept, not a place"
    assert sightings.seen_in(camera, "B10").frame.tolist() == [70, 100]
    scene.rockfall_picking.whole_video, scene.rockfall_picking.track_frames = False, 55

    job = window.part("rockfall_addon.view.job")
    with window.override():
        bpy.ops.rockfall.track_block("INVOKE_DEFAULT")
    yield 1.0
    assert job.is_running()
    assert not bpy.ops.rockfall.track_block.poll(), "one at a time"
    window.screenshot("running")
    yield from window.press("ESC", x, y)
    yield from window.wait_for(lambda: not job.is_running(), 60.0, "tracking stops")
    assert len(sightings.seen_in(camera, "B10")) == 2, "nothing has changed"
    with window.override():
        bpy.ops.rockfall.track_block("INVOKE_DEFAULT")
    other = bpy.data.scenes.new("Other")
    window.window.scene = other
    yield from window.wait_for(lambda: not job.is_running(), 150.0, "tracking ends")
    window.window.scene = scene
    bpy.data.scenes.remove(other)
    yield 0.5
    camera = camera_of(window)
    seen = sightings.seen_in(camera, "B10")
    assert len(seen) > 60, len(seen)
    with window.override():
        assert bpy.ops.rockfall.propose_impacts() == {"FINISHED"}
    window.redraw()
    yield 1.0
    window.screenshot("proposed")
    times = np.array([obj["rockfall_time_s"] for obj in picks() if obj["rockfall_kind"] == "impact"]) - OFFSET_S
    truth = np.array([[float(row["time_s"]), float(row["leave_time_s"])] for row in rows("impacts.csv")]).ravel()
    assert len(times)
    ends = np.array([obj["rockfall_time_s"] for obj in picks() if obj["rockfall_kind"] == "pass"]) - OFFSET_S
    np.testing.assert_allclose(ends, seen.time_s[[0, -1]], atol=1e-6)
    assert np.abs(times[:, None] - truth).min(axis=1).max() < 0.02, times
    no_trouble(window)


def case_pick_in_two_views(window):
    """A pick of one video is a curve in the other; clicked there too, the rays meet in a point."""
    yield from open_site(window)
    scene = bpy.context.scene
    _, impacts = yield from pick_impacts(window, 1, 2)
    truth = local(impacts[0], "x_m", "y_m", "z_m")
    new_videos = window.part("rockfall_addon.scene.footage.new_videos")
    clocks = window.part("rockfall_addon.scene.footage.clocks")
    camera_paths = window.part("rockfall_addon.scene.footage.camera_paths")
    model = window.part("core.camera.model")
    second = new_videos.add_video(scene, FOOTAGE / "footage.mp4")
    clocks.set_clock(second, window.part("core.footage.clock").Clock(OFFSET_S))
    lens = model.look_at(1280, 720, truth + np.array([60.0, -50.0, 30.0]), truth, focal_px=1500)
    lens = replace(lens, shift=window.part("core.georeference").GlobalShift(*ORIGIN))
    camera_paths.set_camera_path(scene, second, window.part("core.camera.path").fixed(lens))
    scene.camera = second
    with window.override():
        bpy.ops.rockfall.look_through()
        bpy.ops.view3d.view_center_camera()
        bpy.ops.ed.undo_push(message="second video")
    yield 1.0
    view = window.part("rockfall_addon.view.image_view")
    region = window.region()
    rectangle = view.image_rectangle(region, window.area().spaces.active.region_3d, scene, second)
    x, y = view.to_region(rectangle, (1280, 720), model.project(lens, truth[None])[0])
    window.screenshot("curve")
    held = list(picks()[0]["rockfall_position_m"])
    scene.rockfall_picking.show_loupe = False
    yield from window.click(region.x + x + 4, region.y + y + 2)  # on the pick's own ring
    yield 1.0
    window.screenshot("diamond")
    (obj,) = picks()
    assert list(obj["rockfall_position_m"]) == held, "the pick stays until it is told to move"
    clicks = window.part("rockfall_addon.scene.footage.clicks")
    found = clicks.triangulated(scene, obj)
    assert 0.001 < found.miss_distance[0] < 2.0, found.miss_distance
    with window.override():
        assert bpy.ops.rockfall.use_triangulated() == {"FINISHED"}
    assert list(picks()[0]["rockfall_position_m"]) != held
    no_trouble(window)

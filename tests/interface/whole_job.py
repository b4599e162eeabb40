# SPDX-License-Identifier: GPL-3.0-or-later
"""A person does the whole job, from an empty window to a refined trajectory in a file that is opened again."""

import sys
import tempfile
import time
from pathlib import Path

import bpy
import numpy as np

sys.path.append(str(Path(__file__).parent))

import alignment as aligning
import picking
import workspace

DEMO = Path(__file__).resolve().parents[2] / "assets" / "demo"
FOOTAGE = DEMO / "footage"
PAIRS = (1, 4, 7, 11, 5, 9)  # rows of pairs.csv
NAME = "B10"
FOCAL_PX = 2100.0
NEAR_M = 12.0
DRAGGED_PX = 8


def case_whole_job(window):
    yield from import_demo(window)
    yield from align(window)
    yield from follow(window)
    yield from pick(window)
    yield from drag_undo_redo(window)
    yield from refine(window)
    file = Path(tempfile.mkdtemp()) / "job.blend"
    with window.override():
        assert bpy.ops.wm.save_as_mainfile(filepath=str(file)) == {"FINISHED"}
    before = remembered(window)
    bpy.ops.wm.open_mainfile(filepath=str(file))
    yield 1.0
    yield from reopened(window, before)


def in_left_view(window):
    area = aligning.views(window)[0]
    return bpy.context.temp_override(window=window.window, area=area, region=aligning.region_of(area))


def import_demo(window):
    """An empty scene in our workspace, the terrain and the video."""
    with window.override():
        bpy.ops.object.select_all(action="SELECT")
        bpy.ops.object.delete()
    yield from workspace.open_it(window)
    window.screenshot("1-workspace")
    with in_left_view(window):
        assert bpy.ops.rockfall.import_terrain(filepath=str(DEMO / "terrain.ply")) == {"FINISHED"}
    yield 2.0
    with in_left_view(window):
        assert bpy.ops.rockfall.add_video(filepath=str(FOOTAGE / "footage.mp4")) == {"FINISHED"}
    yield 2.0
    scene = bpy.context.scene
    scene.rockfall.block_diameter_m, scene.rockfall.normal_radius_m = 0.39, 0.6
    scene.rockfall_picking.trajectory = NAME
    for area in aligning.views(window):
        area.spaces.active.show_region_ui = False  # all the room for the pictures
    yield 0.5
    with in_left_view(window):
        assert bpy.ops.rockfall.align_views() == {"FINISHED"}
        assert bpy.ops.rockfall.fit_footage() == {"FINISHED"}
        bpy.ops.ed.undo_push(message="imported")
    yield 2.0
    window.screenshot("2-imported")
    assert not window.part("rockfall_addon.scene.footage.camera_paths").is_solved(aligning.the_camera(window))


def align(window):
    """Six pairs: five of two clicks; of the sixth, the predicted mark is dragged to where the place is seen."""
    aligned, pairs = (window.part(f"rockfall_addon.scene.{name}") for name in ("footage.alignment", "footage.pairs"))
    ground = aligning.table(window)
    for count, i in enumerate(PAIRS):
        aligning.look_at(window, ground.point[[i]])
        aligning.views(window)[1].spaces.active.region_3d.view_distance = NEAR_M
        yield 0.7
        goal, place = aligning.in_picture(window, ground.pixel[i]), aligning.on_terrain(window, ground.point[i])
        yield from window.click(*place)
        pair = pairs.open_pair(aligning.the_camera(window))
        assert pair is not None, f"pair {count} is open"
        if count + 1 < len(PAIRS):
            yield from window.click(*goal)
        else:
            assert pair.proposed == "pixel", "five pairs solve the camera, so the sixth is predicted"
            window.screenshot("3-predicted")
            yield from drag(window, aligning.in_picture(window, pair.pixel), goal)
        assert pairs.open_pair(aligning.the_camera(window)) is None, f"pair {count} is complete"
    camera = aligning.the_camera(window)
    assert window.part("rockfall_addon.scene.footage.camera_paths").is_solved(camera), aligned.solution_of(
        camera
    ).problem
    assert sum(pair.is_complete for pair in pairs.pairs_of(camera)) == len(PAIRS)
    focal = aligned.focal_px(camera)
    print(f"focal length {focal:.0f} px, {aligned.solution_of(camera).rmse_px:.2f} px left")
    assert abs(focal / FOCAL_PX - 1) < 0.03, focal
    aligning.look_at(window, ground.point)
    camera.rockfall_alignment.blend = 0.5
    yield 1.5
    window.screenshot("4-aligned")
    camera.rockfall_alignment.blend = 0.9


def drag(window, start, goal, steps=3):
    yield from window.move(*start)
    window.window.event_simulate(type="LEFTMOUSE", value="PRESS", x=round(start[0]), y=round(start[1]))
    yield 0.3
    for step in range(1, steps + 1):
        part = step / steps
        yield from window.move(*(a + part * (b - a) + 4 * (part < 1) for a, b in zip(start, goal, strict=True)))
    window.window.event_simulate(type="LEFTMOUSE", value="RELEASE", x=round(goal[0]), y=round(goal[1]))
    yield 1.0


def follow(window):
    """The camera was held by hand: from the pairs of frame 0 through the video."""
    aligning.the_camera(window).rockfall_alignment.motion = "ROTATION"
    yield 0.5
    begun, job = time.perf_counter(), window.part("rockfall_addon.view.job")
    with in_left_view(window):
        bpy.ops.rockfall.follow_background("INVOKE_DEFAULT")
    yield 1.0
    yield from window.wait_for(lambda: not job.is_running(), 150, "followed")
    print(f"background followed in {time.perf_counter() - begun:.0f} s")
    assert len(aligning.the_camera(window)["rockfall_pose_times_s"]) == 300
    with in_left_view(window):
        bpy.ops.wm.tool_set_by_id(name="rockfall.pick_tool")
        bpy.ops.ed.undo_push(message="followed")
    yield 1.0


def impacts():
    """The first three impacts that are seen: rows of the truth."""
    return [row for row in picking.rows("impacts.csv") if float(row["time_s"]) > 1.3][:3]


def misses(window):
    """Distances of the picks from where the block truly touched the ground [m]."""
    shift = window.part("rockfall_addon.scene.terrain.georeference").read_shift(bpy.context.scene).vector
    axes = ("contact_x_m", "contact_y_m", "contact_z_m")
    truth = np.array([[float(row[name]) for name in axes] for row in impacts()]) - shift
    return np.linalg.norm([list(obj["rockfall_position_m"]) for obj in picking.picks()] - truth, axis=1)


def pick(window):
    block = {int(row["frame"]): row for row in picking.rows("block.csv")}
    for row in impacts():
        frame = round(float(row["time_s"]) * 30)
        bpy.context.scene.frame_set(frame - 2)
        yield 0.5
        x, y = aligning.in_picture(window, [float(block[frame][name]) for name in ("u_px", "v_px")])
        for _ in range(2):
            yield from window.press("RIGHT_ARROW", x, y)
        assert bpy.context.scene.frame_current == frame
        yield from window.click(x, y)
        yield 1.0
    window.screenshot("5-picked")
    off = misses(window)
    print(f"picks are {np.array2string(off, precision=2)} m off")
    assert off.max() < 0.5, off
    picking.no_trouble(window)


def places():
    return [list(obj["rockfall_position_m"]) for obj in picking.picks()]


def drag_undo_redo(window):
    before, flights = places(), path()
    with in_left_view(window):
        region, pointing = bpy.context.region, window.part("rockfall_addon.view.pointing")
        x, y = pointing.on_screen(bpy.context, [before[-1]])[0]
    x, y = region.x + x, region.y + y
    yield from drag(window, (x, y), (x + DRAGGED_PX, y))
    after, dragged = places(), path()
    way = float(np.linalg.norm(np.subtract(after[-1], before[-1])))
    print(f"dragged by {way:.2f} m")
    assert 0.1 < way < 2.0, way
    assert after[:-1] == before[:-1]
    assert dragged != flights
    yield from window.press("Z", x, y, ctrl=True)
    yield 1.0
    assert places() == before
    assert path() == flights
    yield from window.press("Z", x, y, ctrl=True, shift=True)
    yield 1.0
    assert places() == after
    assert path() == dragged
    window.screenshot("6-dragged")
    picking.no_trouble(window)


def refine(window):
    """The track of the block tells better than the clicks, and better than the drag."""
    table = window.part("core.exchange.footage_tables").read_track(FOOTAGE / "track.csv")
    one, scene = np.ones(len(table)), bpy.context.scene
    track = window.part("core.footage.tracking").BlockTrack(
        table.frame, table.time_s, table.pixel, table.sigma_px, one, table.pixel, 9 * one, ("", "")
    )
    window.part("rockfall_addon.scene.footage.sightings").keep_track(aligning.the_camera(window), NAME, track)
    with in_left_view(window):
        bpy.ops.ed.undo_push(message="track")
        assert bpy.ops.rockfall.refine() == {"FINISHED"}
        bpy.ops.ed.undo_push(message="refined")
    found = window.part("rockfall_addon.scene.picks.proposal").read(scene)
    yield from window.move(*window.centre("DOPESHEET_EDITOR"))  # the loupe is not to hide the path
    yield 1.0
    window.screenshot("7-proposed")
    with in_left_view(window):
        assert bpy.ops.rockfall.apply_refinement() == {"FINISHED"}
        bpy.ops.ed.undo_push(message="applied")
    yield 1.5
    window.screenshot("8-refined")
    off, wrong = misses(window), speed_errors(window)
    print(f"{found.before_px:.2f} px before, {found.after_px:.2f} px after refinement")
    print(f"refined picks are {np.array2string(off, precision=2)} m off")
    print(f"refined speeds are {np.array2string(100 * wrong, precision=2)} % off")
    assert found.after_px < found.before_px
    assert off.max() < 0.5, off
    assert np.abs(wrong).max() < 0.03, wrong
    picking.no_trouble(window)


def speed_errors(window):
    """Relative errors of the speeds at which the two flights begin and end."""
    flights = window.part("rockfall_addon.scene.picks.reconstruction").reconstruct_scene(bpy.context.scene).flights
    states = window.part("core.reconstruction.flight").flight_states
    rows, count = impacts(), len(flights.start_time_s)
    assert count == len(rows) - 1
    ends = []
    for i in range(count):
        _, velocity = states(flights, np.array([i, i]), np.array([flights.start_time_s[i], flights.end_time_s[i]]))
        for row, key, got in ((rows[i], "v2", velocity[0]), (rows[i + 1], "v1", velocity[1])):
            true = np.linalg.norm([float(row[f"{key}{axis}_mps"]) for axis in "xyz"])
            ends.append(float(np.linalg.norm(got)) / true - 1)
    return np.array(ends)


def path():
    """Vertices of the trajectory that is shown."""
    (obj,) = [one for one in bpy.context.scene.objects if one.get("rockfall_role") == "flights"]
    return [tuple(vertex.co) for vertex in obj.data.vertices]


def remembered(window):
    """Everything that a file must keep, as plain values."""
    scene, camera = bpy.context.scene, aligning.the_camera(window)
    kept = {"path": path(), "frame": scene.frame_current, "ends": (scene.frame_start, scene.frame_end)}
    owners = {"scene": scene, "camera": camera} | {one["rockfall_id"]: one for one in picking.picks()}
    for name, owner in owners.items():
        for key in owner.keys():  # noqa: SIM118 - of Blender's properties
            if key.startswith("rockfall_") and not isinstance(owner[key], bpy.types.ID):
                kept[f"{name}.{key}"] = plain(owner[key])
    for group in (scene.rockfall, scene.rockfall_picking, scene.rockfall_terrain, camera.rockfall_alignment):
        for one in group.bl_rna.properties:
            if one.type in ("BOOLEAN", "INT", "FLOAT", "STRING", "ENUM"):
                kept[f"{type(group).__name__}.{one.identifier}"] = plain(getattr(group, one.identifier))
    kept["matrix"] = [tuple(row) for row in camera.matrix_world]
    kept["speeds"] = speed_errors(window).tolist()
    return kept


def plain(value):
    """Text of a value, exact for doubles."""
    if isinstance(value, list):
        return [plain(each) for each in value]
    for name in ("to_dict", "to_list"):
        if hasattr(value, name):
            return repr(getattr(value, name)())
    return sorted(value) if isinstance(value, set) else repr(value)


def reopened(window, before):
    yield from window.wait_for(lambda: bpy.context.scene is not None, what="the file")
    yield 3.0
    window.screenshot("9-reopened")
    after = remembered(window)
    changed = {key: (before.get(key), after.get(key)) for key in before | after if before.get(key) != after.get(key)}
    assert not changed, changed
    assert len(picking.picks()) == 3
    assert len([key for key in after if key.endswith(".rockfall_position_m")]) == 3
    picking.no_trouble(window)
    bpy.context.scene.frame_set(bpy.context.scene.frame_current + 5)  # the footage plays on
    yield 1.5
    window.screenshot("10-goes-on")
    picking.no_trouble(window)

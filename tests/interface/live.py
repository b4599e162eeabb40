# SPDX-License-Identifier: GPL-3.0-or-later
"""A person drags a pick, undoes, redoes, moves its key: the trajectory follows."""

import time

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d


def picks_of(name):
    found = [o for o in bpy.context.scene.objects if o.get("rockfall_role") == "pick"]
    return sorted((o for o in found if o["rockfall_trajectory"] == name), key=lambda o: o["rockfall_time_s"])


def trail_of(name):
    objects = (o for o in bpy.context.scene.objects if o.get("rockfall_role") == "flights")
    return next(o for o in objects if o["rockfall_trajectory"] == name)


def distance(place, name):
    mesh = trail_of(name).data
    points = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("co", points)
    return float(np.linalg.norm(points.reshape(-1, 3) - np.array(place), axis=1).min())


def load(window):
    with window.override():
        assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
        bpy.ops.ed.undo_push(message="demo")
    yield 3.0


def consistent(window, name, held=False):
    """What is shown is what the picks give; while they are held, where they are held."""
    reconstruction = window.part("rockfall_addon.scene.picks.reconstruction")
    result = reconstruction.reconstruct_scene(bpy.context.scene)
    for pick in () if held else picks_of(name):
        rows = np.flatnonzero(result.picks.time_s == pick["rockfall_time_s"])
        rows = [i for i in rows if result.picks.trajectory[i] == name]
        assert len(rows) == 1, (pick.name, pick["rockfall_time_s"])
        assert result.picks.position[rows[0]].tolist() == list(pick["rockfall_position_m"])
    which = np.flatnonzero(result.flights.trajectory == name)
    worst = max(distance(place, name) for place in result.flights.start_position[which])
    assert worst < 1e-3, f"the trail is {worst} m off"


def select(window, pick):
    for other in bpy.context.selected_objects:
        other.select_set(False)
    pick.select_set(True)
    bpy.context.view_layer.objects.active = pick


def on_screen(window, place):
    region = window.region()
    spot = location_3d_to_region_2d(region, window.area().spaces.active.region_3d, place)
    return region.x + spot.x, region.y + spot.y


def zoom_to(window, pick):
    with window.override():
        select(window, pick)
        bpy.ops.view3d.view_selected()
    window.area().spaces.active.region_3d.view_distance = 25.0
    yield 1.0


def case_live_drag_undo_redo(window):
    yield from window.show_sidebar()
    yield from load(window)
    pick = picks_of("B03")[3]
    identifier, before = pick["rockfall_id"], list(pick["rockfall_position_m"])
    yield from zoom_to(window, pick)
    x, y = on_screen(window, pick.location)
    window.screenshot("before")
    yield from window.press("G", x, y)
    times = []
    for step in range(1, 9):
        yield from window.move(x + 12 * step, y + 4 * step)
        times.append(time.perf_counter())
    yield 0.5
    dragged = picks_of("B03")[3]
    assert list(dragged["rockfall_position_m"]) == before, "while it is dragged nothing is written"
    assert window.part("rockfall_addon.scene.footage.sync").is_dragging()
    moved = (dragged.location - dragged.location.__class__(before)).length
    assert moved > 0.5
    surface = window.part("rockfall_addon.scene.picks.reconstruction").ground(bpy.context.scene)
    near = window.part("core.terrain.raycast").closest_points(surface, np.array([dragged.location]))
    assert distance(near.point[0], "B03") < 0.02, "the flights follow while it is dragged"
    window.screenshot("dragging")
    yield from window.click(x + 96, y + 32)
    yield 1.0
    pick = picks_of("B03")[3]
    after = list(pick["rockfall_position_m"])
    assert np.linalg.norm(np.subtract(after, before)) > 0.5
    height = window.part("core.terrain.raycast").closest_points(surface, np.array([after])).distance[0]
    assert height < 1e-6, "it lies on the terrain"
    consistent(window, "B03")
    window.screenshot("dropped")
    scene = bpy.context.scene
    scene.frame_set(scene.frame_current + 5)
    yield 0.5
    assert np.allclose(picks_of("B03")[3].location, after, atol=1e-4), "the key is where the pick is"

    with window.override():
        bpy.ops.ed.undo()
    yield 1.0
    pick = next(o for o in picks_of("B03") if o["rockfall_id"] == identifier)
    assert list(pick["rockfall_position_m"]) == before, "one step takes the whole edit back"
    consistent(window, "B03")
    window.screenshot("undone")
    with window.override():
        bpy.ops.ed.redo()
    yield 1.0
    pick = next(o for o in picks_of("B03") if o["rockfall_id"] == identifier)
    assert np.allclose(pick["rockfall_position_m"], after, atol=1e-5), "and one brings it again"
    consistent(window, "B03")
    assert not window.part("rockfall_addon.scene.problems").remarks(bpy.context.scene)


def case_live_key_in_the_dope_sheet(window):
    yield from load(window)
    pick = picks_of("B03")[3]
    yield from zoom_to(window, pick)
    select(window, pick)
    timeline = window.area()  # the large one
    timeline.ui_type = "DOPESHEET"
    timeline.spaces.active.dopesheet.show_only_selected = True
    yield 1.0
    region = next(r for r in timeline.regions if r.type == "WINDOW")
    before = pick["rockfall_time_s"]
    where = [list(one["rockfall_position_m"]) for one in picks_of("B03")]
    with bpy.context.temp_override(window=window.window, area=timeline, region=region):
        bpy.ops.action.select_all(action="SELECT")
        bpy.ops.action.view_selected()
        bpy.ops.ed.undo_push(message="keys selected")
    yield 0.5
    window.screenshot("keys")
    x, y = region.x + region.width // 2, region.y + region.height // 2
    yield from window.press("G", x, y)
    frame = pick["rockfall_key_frame"]
    for step in range(1, 6):
        yield from window.move(x + step, y)
    assert picks_of("B03")[3]["rockfall_time_s"] == before, "while the key is held nothing is written"
    consistent(window, "B03", held=True)
    window.screenshot("key-held")
    yield from window.click(x + 5, y)
    yield 1.0
    rate = bpy.context.scene.render.fps
    pick = picks_of("B03")[3]
    moved = pick["rockfall_key_frame"] - frame
    assert 0.1 < abs(moved) < 12, moved
    assert abs(pick["rockfall_time_s"] - before - moved / rate) < 1e-6
    assert [list(one["rockfall_position_m"]) for one in picks_of("B03")] == where
    consistent(window, "B03")
    window.screenshot("key-moved")
    with bpy.context.temp_override(window=window.window, area=timeline, region=region):
        bpy.ops.ed.undo()
    yield 1.0
    assert picks_of("B03")[3]["rockfall_time_s"] == before
    consistent(window, "B03")


def block_of(name):
    objects = (o for o in bpy.context.scene.objects if o.get("rockfall_role") == "block")
    return next(o for o in objects if o["rockfall_trajectory"] == name)


def choose_keys(block, frames):
    """Select the keys of a block at these frames, and no other."""
    bag = block.animation_data.action.layers[0].strips[0].channelbag(block.animation_data.action_slot)
    for axis in range(3):
        for point in bag.fcurves.find("location", index=axis).keyframe_points:
            chosen = any(abs(point.co[0] - frame) < 0.01 for frame in frames)
            point.select_control_point = point.select_left_handle = point.select_right_handle = chosen


def keys_at(block):
    bag = block.animation_data.action.layers[0].strips[0].channelbag(block.animation_data.action_slot)
    return [[point.co[0] for point in bag.fcurves.find("location", index=axis).keyframe_points] for axis in range(3)]


def in_step(window, name):
    """The block has a key at each pick, and the picks are where the flights are."""
    frames = [pick["rockfall_key_frame"] for pick in picks_of(name)]
    for axis in keys_at(block_of(name)):
        assert np.allclose(axis, frames, atol=1e-3), (axis, frames)
    consistent(window, name)


def case_live_keys_of_the_block(window):
    """All impacts of a run in one row: drag one key, stretch several, duplicate one, delete one; undo each."""
    yield from load(window)
    block = block_of("B03")
    yield from zoom_to(window, block)
    sheet = window.area()
    sheet.ui_type = "DOPESHEET"
    sheet.spaces.active.dopesheet.show_only_selected = True
    yield 1.0
    region = next(r for r in sheet.regions if r.type == "WINDOW")
    x, y = region.x + region.width // 2, region.y + region.height // 2
    here = {"window": window.window, "area": sheet, "region": region}
    known = {pick["rockfall_id"]: pick["rockfall_time_s"] for pick in picks_of("B03")}
    where = [list(pick["rockfall_position_m"]) for pick in picks_of("B03")]
    frames = [pick["rockfall_key_frame"] for pick in picks_of("B03")]
    with bpy.context.temp_override(**here):
        bpy.ops.action.select_all(action="SELECT")
        bpy.ops.action.view_selected()
        choose_keys(block, frames[3:4])
        bpy.ops.ed.undo_push(message="one key chosen")
    yield 0.5

    def undo():
        with bpy.context.temp_override(**here):
            bpy.ops.ed.undo()
        yield 1.0
        assert {pick["rockfall_id"]: pick["rockfall_time_s"] for pick in picks_of("B03")} == known
        in_step(window, "B03")

    # one key is dragged
    trail = trail_of("B03")
    before = np.array([vertex.co[:] for vertex in trail.data.vertices])
    yield from window.press("G", x, y)
    for step in range(1, 6):
        yield from window.move(x + 2 * step, y)
    assert {pick["rockfall_id"]: pick["rockfall_time_s"] for pick in picks_of("B03")} == known, "nothing is written yet"
    after = np.array([vertex.co[:] for vertex in trail.data.vertices])
    assert before.shape != after.shape or np.abs(after - before).max() > 0.01, "the flights follow while it is dragged"
    window.screenshot("key-held")
    yield from window.press("RET", x + 10, y)
    yield 1.0
    pick = picks_of("B03")[3]
    moved = pick["rockfall_key_frame"] - frames[3]
    assert 0.1 < moved < 30, moved
    assert abs(pick["rockfall_time_s"] - known[pick["rockfall_id"]] - moved / bpy.context.scene.render.fps) < 1e-6
    assert [list(one["rockfall_position_m"]) for one in picks_of("B03")] == where
    in_step(window, "B03")
    window.screenshot("key-moved")
    yield from undo()
    with bpy.context.temp_override(**here):
        bpy.ops.ed.redo()
    yield 1.0
    assert abs(picks_of("B03")[3]["rockfall_key_frame"] - frames[3] - moved) < 1e-3
    in_step(window, "B03")
    yield from undo()

    # Esc takes a held key back
    block = block_of("B03")
    choose_keys(block, frames[3:4])
    yield from window.press("G", x, y)
    yield from window.move(x + 20, y)
    yield from window.press("ESC", x + 20, y)
    yield 1.0
    assert {pick["rockfall_id"]: pick["rockfall_time_s"] for pick in picks_of("B03")} == known
    in_step(window, "B03")

    # all keys are stretched about the playhead
    bpy.context.scene.frame_set(round(frames[0]))
    block = block_of("B03")
    choose_keys(block, frames)
    with bpy.context.temp_override(**here):
        bpy.ops.ed.undo_push(message="all keys chosen")
    yield from window.press("S", x + 200, y)
    for step in range(1, 6):
        yield from window.move(x + 200 + 6 * step, y)
    yield from window.press("RET", x + 230, y)
    yield 1.0
    stretched = np.array([pick["rockfall_key_frame"] for pick in picks_of("B03")]) - round(frames[0])
    factor = stretched[-1] / (frames[-1] - round(frames[0]))
    assert factor > 1.01, factor
    assert np.allclose(stretched, factor * (np.array(frames) - round(frames[0])), atol=1.01), "to whole frames"
    in_step(window, "B03")
    window.screenshot("stretched")
    yield from undo()

    # a duplicate is a new pick
    block = block_of("B03")
    choose_keys(block, frames[2:3])
    with bpy.context.temp_override(**here):
        bpy.ops.ed.undo_push(message="one key chosen")
    yield from window.move(x, y)
    with bpy.context.temp_override(**here):
        bpy.ops.action.duplicate_move("INVOKE_DEFAULT")
    yield 0.3
    for step in range(1, 4):
        yield from window.move(x + 2 * step, y)
    assert len(picks_of("B03")) == len(frames), "not while it is being placed"
    yield from window.press("RET", x + 6, y)
    yield 1.0
    found = picks_of("B03")
    assert len(found) == len(frames) + 1
    (new,) = [pick for pick in found if pick["rockfall_id"] not in known]
    assert list(new["rockfall_position_m"]) == where[2]
    in_step(window, "B03")
    window.screenshot("duplicated")
    yield from undo()

    # a deleted key deletes its pick
    block = block_of("B03")
    choose_keys(block, frames[4:5])
    with bpy.context.temp_override(**here):
        bpy.ops.ed.undo_push(message="one key chosen")
        assert bpy.ops.action.delete(confirm=False) == {"FINISHED"}
        bpy.ops.ed.undo_push(message="Delete Keyframes")
    yield 1.0
    assert len(picks_of("B03")) == len(frames) - 1
    in_step(window, "B03")
    window.screenshot("deleted")
    yield from undo()
    with bpy.context.temp_override(**here):
        bpy.ops.ed.redo()
    yield 1.0
    assert len(picks_of("B03")) == len(frames) - 1
    in_step(window, "B03")
    yield from undo()
    assert not window.part("rockfall_addon.scene.problems").remarks(bpy.context.scene)


def case_live_undo_after_scrubbing(window):
    """The playhead is moved between two edits, so that more of the file differs between the two steps."""
    yield from load(window)
    scene = bpy.context.scene
    pick = picks_of("B03")[3]
    identifier, before = pick["rockfall_id"], pick["rockfall_time_s"]
    scene.frame_set(scene.frame_current + 11)
    yield 0.5
    pick.rockfall_pick.time_s = repr(before + 0.2)
    bpy.ops.ed.undo_push(message="Time")  # as Blender does for a field of a panel, before anything else happens
    yield 1.0
    assert abs(picks_of("B03")[3]["rockfall_time_s"] - before - 0.2) < 1e-9
    in_step(window, "B03")
    with window.override():
        bpy.ops.ed.undo()
    yield 1.0
    pick = next(one for one in picks_of("B03") if one["rockfall_id"] == identifier)
    assert pick["rockfall_time_s"] == before
    in_step(window, "B03")


def case_live_table_and_numbers(window):
    yield from window.show_sidebar()
    yield from load(window)
    scene = bpy.context.scene
    region = window.region("UI")
    pick = picks_of("B03")[3]
    select(window, pick)
    pick.rockfall_pick.confidence = "2"
    yield 1.0
    row = scene.rockfall_impacts[scene.rockfall.impact_index]
    assert row.pick == pick["rockfall_id"], "selecting in the view highlights the row"
    for area_panel in ("ROCKFALL_PT_terrain", "ROCKFALL_PT_picks"):
        assert hasattr(bpy.types, area_panel)
    scene.rockfall.impact_index = 5
    yield 0.5
    assert bpy.context.view_layer.objects.active["rockfall_id"] == scene.rockfall_impacts[5].pick
    select(window, pick)
    scene.rockfall.colour_by = "DOUBT"
    scene.rockfall.show_ticks = True
    yield from zoom_to(window, pick)
    region.tag_redraw()
    yield 1.0
    with bpy.context.temp_override(window=window.window, area=window.area(), region=region):
        for _ in range(9):
            bpy.ops.view2d.scroll_down(deltay=60)
    yield 1.0
    window.screenshot("numbers")
    with window.override():
        bpy.ops.rockfall.impact_table("INVOKE_DEFAULT")
    yield 1.0
    window.screenshot("table")
    x, y = window.centre()
    yield from window.press("ESC", x, y)
    bpy.context.preferences.view.ui_scale = 2.0
    yield 1.0
    with window.override():
        bpy.ops.rockfall.impact_table("INVOKE_DEFAULT")
    yield 1.0
    window.screenshot("table-scale-2")


def case_live_undo_brings_flights_back_and_takes_them(window):
    """Flights and block of a run go and come with its picks, also when that is undone and done again."""
    yield from load(window)

    def shown():
        found = [o for o in bpy.context.scene.objects if o.get("rockfall_trajectory") == "B03"]
        return sorted(o["rockfall_role"] for o in found if o["rockfall_role"] != "pick")

    def history(*steps):
        for name, expected, kinds in steps:
            with window.override():
                getattr(bpy.ops.ed, name)()
            yield 1.0
            assert (shown(), [pick["rockfall_kind"] for pick in picks_of("B03")]) == (expected, kinds), name
            bpy.context.scene.frame_set(bpy.context.scene.frame_current + 1)
            yield 0.5

    both = ["block", "flights"]
    assert shown() == both
    start = [pick["rockfall_kind"] for pick in picks_of("B03")]
    for pick in picks_of("B03"):
        pick.rockfall_pick.kind = "stop"
    bpy.ops.ed.undo_push(message="Kind")  # as Blender does for a field of a panel, before anything else happens
    yield from window.wait_for(lambda: not shown(), what="without flights")
    none = [pick["rockfall_kind"] for pick in picks_of("B03")]
    bpy.ops.ed.undo_push(message="Another step, so that the next finds the collections as they are")
    picks_of("B03")[3].rockfall_pick.kind = "impact"
    bpy.ops.ed.undo_push(message="Kind")
    yield from window.wait_for(lambda: shown() == both, what="flights again")
    again = [pick["rockfall_kind"] for pick in picks_of("B03")]
    back = ("undo", [], none), ("undo", [], none), ("undo", both, start)
    there = ("redo", [], none), ("redo", [], none), ("redo", both, again)
    yield from history(("undo", [], none), ("redo", both, again), *back, *there)
    consistent(window, "B03")
    yield from history(*back, *there)
    consistent(window, "B03")
    assert not window.part("rockfall_addon.scene.problems").remarks(bpy.context.scene)

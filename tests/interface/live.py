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
    things = (o for o in bpy.context.scene.objects if o.get("rockfall_role") == "flights")
    return next(o for o in things if o["rockfall_trajectory"] == name)


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
    reconstruction = window.part("rockfall_addon.scene.reconstruction")
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
    assert window.part("rockfall_addon.scene.sync").is_dragging()
    moved = (dragged.location - dragged.location.__class__(before)).length
    assert moved > 0.5
    surface = window.part("rockfall_addon.scene.reconstruction").ground(bpy.context.scene)
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
    assert not window.part("rockfall_addon.scene.problems").sentences(bpy.context.scene)


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

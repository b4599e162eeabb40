# SPDX-License-Identifier: GPL-3.0-or-later
"""A person looks at the graphs of the impacts: chooses variables, points, selects, zooms, undoes, saves and reopens."""

import csv
import random

import bpy

TREE = "RockfallImpactGraphs"


def open_graphs(window, *, load=True):
    """The graphs beside the 3-D view, with the demo's impacts."""
    with window.override():
        if load:
            assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
            bpy.ops.ed.undo_push(message="demo")
        assert bpy.ops.rockfall.open_graphs() == {"FINISHED"}
    yield 2.0


def canvas(window):
    region = window.region("WINDOW", "NODE_EDITOR")
    return window.part("rockfall_addon.view.graphs.editor")._canvases[region.as_pointer()]


def spot(window, x, y):
    """A pixel of the graphs' region, in the window."""
    region = window.region("WINDOW", "NODE_EDITOR")
    return region.x + x, region.y + y


def case_graphs_first_look(window):
    yield from open_graphs(window)
    window.screenshot("dark")
    seen = canvas(window)
    assert sorted(seen.frames) == [0, 1, 2, 3]


def case_statistics_beside_the_graphs(window):
    yield from open_graphs(window)
    window.area("NODE_EDITOR").spaces.active.show_region_ui = True
    yield 0.5
    sidebar = window.region("UI", "NODE_EDITOR")
    sidebar.active_panel_category = "Rockfall"
    with window.override():
        bpy.ops.rockfall.colour_graphs(column="theta1_deg")
    yield 1.0
    kept = window.part("rockfall_addon.scene.picks.statistics")._kept
    assert not kept, "a folded panel computes nothing"
    yield from window.open_panel("ROCKFALL_PT_graph_statistics", "NODE_EDITOR")
    window.screenshot("dark")
    (_, found), *_ = kept.values()
    assert [one.used for one in found.groups.values()] == [30, 29, 24]
    with window.override("NODE_EDITOR"):
        bpy.ops.rockfall.test_groups("INVOKE_DEFAULT")
    yield from window.wait_for(lambda: next(iter(kept.values()))[1].tests is not None, 30.0, "the groups are tested")
    yield 1.0
    window.screenshot("tested")
    window.theme("Light")
    yield 1.0
    window.screenshot("light")
    # Blender 5.2.2 crashes, also without extensions and in its Shader Editor, when a new file comes with the mouse on a
    # panel of a sidebar that was just opened or folded.
    yield from window.move(*window.centre())
    yield 1.0


def case_graphs_in_both_themes(window):
    """Dark and light, interface scales 1 and 2, large and 400 × 300 pixels."""
    yield from open_graphs(window)
    scene, preferences = bpy.context.scene, bpy.context.preferences
    area = window.area("NODE_EDITOR")
    for name in ("Dark", "Light"):
        window.theme(name)
        for scale in (1.0, 2.0):
            preferences.view.ui_scale = scale
            for models in ({"noel_2017"}, {"noel_2017", "dorren_2015", "pfeiffer_bowen_1989", "wyllie_2014"}):
                scene.rockfall_comparison.models = models
                yield 1.5
                window.screenshot(f"{name}-{scale:g}-{len(models)}")
        preferences.view.ui_scale = 1.0
    with bpy.context.temp_override(window=window.window, area=area, region=window.region("WINDOW", "NODE_EDITOR")):
        bpy.ops.screen.area_split(direction="HORIZONTAL", factor=0.38)
    yield 1.0
    small = min((one for one in window.window.screen.areas if one.type == "NODE_EDITOR"), key=lambda one: one.height)
    print("small", small.width, small.height)
    for name in ("Light", "Dark"):
        window.theme(name)
        yield 1.5
        window.screenshot(f"{name}-small")


def drawn(window, number):
    """A graph as it is drawn, and its axes on the screen."""
    sheet = window.part("rockfall_addon.view.graphs.impact_sheet")
    return sheet.drawn_graph(bpy.context.scene, number), canvas(window).frames[number]


def own_points(window, number):
    """Row → pixel in the window of each of the scene's own impacts that has a point."""
    graph, frame = drawn(window, number)
    (own,) = [one for one in graph.drawn if not one.series.model]
    spots = graph.pixels(frame)[own.start : own.start + own.series.row.size]
    return {
        int(row): spot(window, float(x), float(y)) for row, (x, y) in zip(own.series.row, spots, strict=True) if x == x
    }


def lonely(points):
    """Rows whose points are farthest from their neighbours."""

    def room(row):
        x, y = points[row]
        return min((points[other][0] - x) ** 2 + (points[other][1] - y) ** 2 for other in points if other != row)

    return sorted(points, key=room, reverse=True)


def selected_rows(window):
    compared = window.part("rockfall_addon.scene.models.comparison").comparison_of(bpy.context.scene)
    ids = {o.get("rockfall_id") for o in bpy.context.selected_objects if o.get("rockfall_role") == "pick"}
    return {row for row, identifier in enumerate(compared.pick) if identifier in ids}


def drag(window, path, button="LEFTMOUSE"):
    """Press at the first place, move along a path, release at the last."""
    yield from window.move(*path[0])
    window.window.event_simulate(type=button, value="PRESS", x=round(path[0][0]), y=round(path[0][1]))
    yield 0.2
    for x, y in path[1:]:
        window.window.event_simulate(type="MOUSEMOVE", value="NOTHING", x=round(x), y=round(y))
        yield 0.1
    window.window.event_simulate(type=button, value="RELEASE", x=round(path[-1][0]), y=round(path[-1][1]))
    yield 0.4


def case_select_in_graphs(window):
    """Hover, click, shift-click, box, lasso; what is selected in the scene is highlighted in the graphs."""
    yield from open_graphs(window)
    scene = bpy.context.scene
    scene.rockfall_comparison.models = set()
    scene.rockfall_graphs.fits = False
    yield 1.0
    points = own_points(window, 2)
    first, second = lonely(points)[:2]
    yield from window.move(*points[first])
    yield 0.5
    assert canvas(window).hit.row == first
    window.screenshot("card")
    yield from window.click(*points[first])
    yield 0.6
    assert selected_rows(window) == {first}
    pick = bpy.context.object
    assert pick["rockfall_role"] == "pick"
    assert abs(scene.frame_current_final - pick["rockfall_key_frame"]) < 1e-3, "the timeline goes to its moment"
    assert scene.rockfall_impacts[scene.rockfall.impact_index].pick == pick["rockfall_id"], "so does the table"
    yield from window.click(*points[second], shift=True)
    yield 0.6
    assert selected_rows(window) == {first, second}
    window.screenshot("two")
    _, frame = drawn(window, 2)
    plot = frame.plot
    corners = spot(window, plot.left + 2, plot.bottom + 2), spot(window, plot.left + plot.width / 2, plot.top - 2)
    yield from drag(window, [corners[0], ((corners[0][0] + corners[1][0]) / 2, corners[0][1] + 30), corners[1]])
    expected = {row for row, (x, y) in points.items() if x <= corners[1][0] and y <= corners[1][1]}
    assert selected_rows(window) == expected
    assert 5 < len(expected) < len(points)
    yield 1.0
    window.screenshot("box")
    with window.override():
        bpy.ops.ed.undo()
    yield 1.0
    assert selected_rows(window) == {first, second}, "one undo takes the box back"
    bpy.context.scene.rockfall_graphs.drag_selects = "LASSO"
    x, y = own_points(window, 2)[first]
    yield from drag(window, [(x + 9 * a, y + 9 * b) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    assert selected_rows(window) == {first}
    yield 1.0
    window.screenshot("lasso")
    pick = window.part("rockfall_addon.scene.models.comparison").comparison_of(bpy.context.scene).pick
    some = sorted(points)[10:13]
    others = [o for o in bpy.context.scene.objects if o.get("rockfall_id") in {pick[row] for row in some}]
    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    for obj in others:
        obj.select_set(True)
    yield 1.0
    selection = window.part("rockfall_addon.view.graphs.selection")
    assert {row for _, row in selection.selected(bpy.context)} == set(some) == selected_rows(window)
    window.screenshot("from-the-scene")
    yield from window.press("A", *spot(window, plot.left + 20, plot.bottom + 20), alt=True)
    yield 0.5
    assert selected_rows(window) == set()


def case_zoom_and_variables_of_graphs(window):
    """Wheel, middle button, Home, double click, the list of an axis; saved and opened again."""
    yield from open_graphs(window)
    scene = bpy.context.scene
    _, before = drawn(window, 2)
    middle = spot(window, before.plot.left + 0.25 * before.plot.width, before.plot.bottom + 0.5 * before.plot.height)
    held = before.to_data([(middle[0] - spot(window, 0, 0)[0], middle[1] - spot(window, 0, 0)[1])])[0]
    for _ in range(3):
        yield from window.click(*middle, button="WHEELUPMOUSE")
    yield 0.5
    _, zoomed = drawn(window, 2)
    assert zoomed.x.limits[1] - zoomed.x.limits[0] < 0.7 * (before.x.limits[1] - before.x.limits[0])
    moved = zoomed.to_pixels(held[None])[0] + spot(window, 0, 0)
    assert abs(moved - middle).max() < 2.0, "the place under the mouse stays"
    assert not scene.rockfall_graphs.graph_1.x_fixed, "the other graphs stay as they are"
    window.screenshot("zoomed")
    yield from drag(window, [middle, (middle[0] + 20, middle[1] + 10), (middle[0] + 40, middle[1] + 20)], "MIDDLEMOUSE")
    _, panned = drawn(window, 2)
    moved = panned.to_pixels(held[None])[0] + spot(window, 0, 0)
    assert abs(moved - (middle[0] + 40, middle[1] + 20)).max() < 2.0
    yield from window.press("HOME", *middle)
    yield 0.5
    assert drawn(window, 2)[1].x.limits == before.x.limits
    label = spot(window, before.plot.left + before.plot.width / 2, before.tile.bottom + 8)
    yield from window.click(*label)
    yield 1.0
    window.screenshot("list-of-an-axis")
    for key in ("DOWN_ARROW", "DOWN_ARROW", "RET"):
        yield from window.press(key, *label)
    yield 0.5
    assert scene.rockfall_graphs.graph_3.x != "vt1_mps", "the list of the axis sets another variable"
    assert drawn(window, 2)[1].x.label != before.x.label
    scene.rockfall_graphs.graph_3.x = "kinetic1_j"
    scene.rockfall_graphs.graph_3.x_log = True
    scene.rockfall_graphs.colour_by = "trajectory"
    yield 1.0
    window.screenshot("energy-by-trajectory")
    with window.override("NODE_EDITOR"):  # a double click cannot be simulated
        assert bpy.ops.rockfall.maximise_graph(graph=3) == {"FINISHED"}
    yield 1.0
    assert scene.rockfall_graphs.maximised == 3
    assert list(canvas(window).frames) == [2]
    window.screenshot("maximised")
    path = f"{bpy.app.tempdir}graphs.blend"
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    yield 3.0
    settings = bpy.context.scene.rockfall_graphs
    assert (settings.graph_3.x, settings.graph_3.x_log, settings.maximised) == ("kinetic1_j", True, 3)
    assert list(canvas(window).frames) == [2]
    window.screenshot("reopened")


def case_what_graphs_say_when_there_is_nothing(window):
    """No impact, picks without an impact, a hidden table, a variable that nothing has: what to do next."""
    scene = bpy.context.scene
    yield from open_graphs(window, load=False)
    window.screenshot("nothing")
    buttons = {one.operator: one.area for one in canvas(window).buttons}
    assert "rockfall.load_demo" in buttons
    area = buttons["rockfall.load_demo"]
    yield from window.click(*spot(window, area.left + area.width / 2, area.bottom + area.height / 2))
    yield from window.wait_for(lambda: len(canvas(window).frames) == 4, 60, "the demo is loaded")
    yield 1.0
    window.screenshot("loaded")
    scene = bpy.context.scene
    scene.rockfall_graphs.graph_2.x = "scar_depth_m"
    yield 1.0
    window.screenshot("no-scars")
    one = scene.rockfall_graphs.filters.add()
    one.column, one.low = "v1_mps", "1000"
    yield 1.0
    window.screenshot("hidden")
    assert [button.operator for button in canvas(window).buttons] == ["rockfall.clear_graph_filters"]
    area = canvas(window).buttons[0].area
    yield from window.click(*spot(window, area.left + 5, area.bottom + 5))
    yield 1.0
    assert len(canvas(window).frames) == 4
    picks = sorted((o for o in scene.objects if o.get("rockfall_role") == "pick"), key=lambda o: o["rockfall_time_s"])
    keep = [o for o in picks if o["rockfall_trajectory"] == picks[0]["rockfall_trajectory"]]
    for count in (3, 1):
        gone = [o for o in scene.objects if o.get("rockfall_role") == "pick" and o not in keep[:count]]
        bpy.data.batch_remove(gone)
        yield 2.0
        window.screenshot(f"{count}-picks")
    assert not canvas(window).frames


def case_graphs_workspace(window):
    """In the free third of the workspace; as a tab of their own; the view comes back."""
    with window.override():
        assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
        assert bpy.ops.rockfall.open_workspace() == {"FINISHED"}
    yield 3.0
    with window.override():
        assert bpy.ops.rockfall.open_graphs() == {"FINISHED"}
    yield 2.0
    window.screenshot("third")
    assert len(canvas(window).frames) == 4
    with window.override():
        assert bpy.ops.rockfall.open_graphs_workspace() == {"FINISHED"}
    yield 3.0
    assert window.window.workspace.name == "Graphs"
    window.screenshot("new")
    region = window.region("UI", "NODE_EDITOR")
    assert region.active_panel_category == "Rockfall", "what is ours is seen at once"
    window.screenshot("own")
    assert len(canvas(window).frames) == 4
    window.window.workspace = bpy.data.workspaces["Rockfall"]
    yield 1.0
    with window.override():
        assert bpy.ops.rockfall.open_graphs() == {"FINISHED"}
    yield 1.0
    assert not [area for area in window.window.screen.areas if area.ui_type == TREE]
    with window.override():
        assert bpy.ops.rockfall.open_graphs_workspace() == {"FINISHED"}
    yield 1.0
    assert [one.name for one in bpy.data.workspaces if one.name.startswith("Graphs")] == ["Graphs"]


def case_a_hundred_thousand_impacts(window):
    """A table of other sites beside the scene's own impacts: drawn, pointed at, selected, zoomed."""
    yield from open_graphs(window)
    scene, tables = bpy.context.scene, window.part("core.exchange.tables")
    impacts = window.part("rockfall_addon.scene.models.comparison").comparison_of(scene).impacts
    path = f"{bpy.app.tempdir}many.csv"
    write_many(tables, impacts, path, 100_000)
    with window.override():
        assert bpy.ops.rockfall.add_database(filepath=path) == {"FINISHED"}
        bpy.ops.ed.undo_push(message="table")
    yield 3.0
    window.screenshot("drawn")
    graph, frame = drawn(window, 2)
    assert sum(one.series.row.size for one in graph.measured) == 100_000 + len(impacts)
    plot = frame.plot
    yield from drag(window, [spot(window, plot.left + 5, plot.bottom + 5), spot(window, plot.right - 5, plot.top - 5)])
    yield 2.0
    selection = window.part("rockfall_addon.view.graphs.selection")
    assert len(selection.selected(bpy.context)) > 50_000
    window.screenshot("selected")
    with window.override():
        bpy.ops.ed.undo()
    yield 2.0
    assert not selection.selected(bpy.context)
    middle = spot(window, plot.left + plot.width / 2, plot.bottom + plot.height / 2)
    for _ in range(8):
        yield from window.click(*middle, button="WHEELUPMOUSE")
    yield 1.0
    window.screenshot("zoomed")


def write_many(tables, impacts, path, count):
    """The same impacts again and again, of another site, a little apart."""
    tables.write_impacts(impacts, path)
    with open(path, encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    draw = random.Random(4)
    with open(path, "w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, rows[0])
        table.writeheader()
        for number in range(count):
            row = dict(rows[number % len(rows)])
            row["site"], row["trajectory"] = "Elsewhere", f"{row['trajectory']}-{number // len(rows)}"
            for name in ("rn", "rt", "r", "vt1_mps", "vt2_mps", "vn1_mps", "theta1_deg", "theta_dev_deg"):
                if row.get(name):
                    row[name] = f"{float(row[name]) * draw.gauss(1.0, 0.15):.5g}"
            table.writerow(row)


def case_graphs_of_flagged_impacts(window):
    """All picks are doubtful: flags in the card. All are discarded: said, with what to do. Interface scale 2.5."""
    yield from open_graphs(window)
    picks = [o for o in bpy.context.scene.objects if o.get("rockfall_role") == "pick"]
    for obj in picks:
        obj.rockfall_pick.status = "doubtful"
    yield 3.0
    points = own_points(window, 2)
    yield from window.move(*points[lonely(points)[0]])
    yield 1.0
    window.screenshot("doubtful")
    assert canvas(window).hit is not None
    bpy.context.preferences.view.ui_scale = 2.5
    yield 2.0
    window.screenshot("scale-2.5")
    assert len(canvas(window).frames) == 4
    bpy.context.preferences.view.ui_scale = 1.0
    for obj in picks:
        obj.rockfall_pick.status = "discarded"
    yield 4.0
    window.screenshot("discarded")
    assert not own_points(window, 2)

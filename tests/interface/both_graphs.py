# SPDX-License-Identifier: GPL-3.0-or-later
"""Both editors of graphs at once: selection, deletion, renaming, undo, a file, a new one; graphs as files."""

import csv
import sys
from pathlib import Path
from xml.etree import ElementTree

import bpy
import numpy as np

sys.path.append(str(Path(__file__).parent))  # cases share their helpers

from graphs import lonely
from graphs import open_graphs as open_impact_graphs

IMPACTS, MOTION = "RockfallImpactGraphs", "RockfallMotionGraphs"


def area_of(window, tree):
    return next(area for area in window.window.screen.areas if area.ui_type == tree)


def canvas_of(window, tree):
    region = next(one for one in area_of(window, tree).regions if one.type == "WINDOW")
    return region, window.part("rockfall_addon.view.graphs.editor")._canvases.get(region.as_pointer())


def open_both(window, *, load=True):
    """The impact graphs above the motion graphs, with the demo."""
    yield from open_impact_graphs(window, load=load)
    area = area_of(window, IMPACTS)
    with bpy.context.temp_override(window=window.window, area=area):
        bpy.ops.screen.area_split(direction="HORIZONTAL", factor=0.45)
    min((one for one in window.window.screen.areas if one.ui_type == IMPACTS), key=lambda one: one.y).ui_type = MOTION
    yield 1.5


def impact_points(window, number):
    """Row → pixel of the window of the scene's own impacts in an impact graph."""
    sheet = window.part("rockfall_addon.view.graphs.impact_sheet")
    region, seen = canvas_of(window, IMPACTS)
    graph, frame = sheet.drawn_graph(bpy.context.scene, number), seen.frames[number]
    (own,) = [one for one in graph.drawn if not one.series.model]
    spots = graph.pixels(frame)[own.start : own.start + own.series.row.size]
    return {
        int(row): (region.x + x, region.y + y)
        for row, (x, y) in zip(own.series.row, spots.tolist(), strict=True)
        if x == x
    }


def drawn_courses(window):
    """Trajectories in the first motion graph: those that stand out, and the others."""
    sheet = window.part("rockfall_addon.view.graphs.motion_sheet")
    graph = next(iter(sheet._kept(bpy.context.scene).graphs.values()))
    return tuple({one.trajectory for one in each.courses} for each in (graph.chosen, graph.others))


def selected_rows(window):
    return {row for _, row in window.part("rockfall_addon.view.graphs.selection").selected(bpy.context)}


def table(window):
    return window.part("rockfall_addon.scene.models.comparison").comparison_of(bpy.context.scene)


def picks_of(name):
    found = (o for o in bpy.context.scene.objects if o.get("rockfall_role") == "pick")
    return sorted((o for o in found if o["rockfall_trajectory"] == name), key=lambda o: o["rockfall_time_s"])


def select_only(objects):
    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    for obj in objects:
        obj.select_set(True)
    bpy.context.view_layer.objects.active = objects[0]


def case_both_graphs_follow_the_scene(window):
    """Selecting here shows there; a trajectory that is deleted, comes back, is renamed; a new file."""
    yield from open_both(window)
    bpy.context.scene.rockfall_comparison.models = {"noel_2017"}
    yield 1.0
    everyone = set.union(*drawn_courses(window))
    picks = picks_of("B03")
    select_only([picks[2]])
    yield 1.0
    ids = table(window).pick
    assert drawn_courses(window) == ({"B03"}, everyone - {"B03"})
    assert selected_rows(window) == {ids.index(picks[2]["rockfall_id"])}
    window.screenshot("from_the_scene")

    points = impact_points(window, 2)
    row = next(one for one in lonely(points) if table(window).impacts.trajectory[one] != "B03")
    name = str(table(window).impacts.trajectory[row])
    yield from window.click(*points[row])
    yield 0.8
    assert drawn_courses(window)[0] == {name}
    motion_sheet = window.part("rockfall_addon.view.graphs.motion_sheet")
    cursor = bpy.context.scene.frame_current_final / bpy.context.scene.render.fps
    course = next(one for one in motion_sheet._kept(bpy.context.scene).shown.courses if one.trajectory == name)
    assert abs(course.impact_time_s - cursor).min() < 1e-3, "the cursor is at the impact that was clicked"
    window.screenshot("from_the_graph")

    before = len(table(window).impacts)
    own = int((table(window).impacts.trajectory == name).sum())
    select_only(picks_of(name))
    yield 0.5
    yield from window.press("X", *window.centre())
    yield from window.press("RET", *window.centre())
    yield from window.wait_for(lambda: name not in set.union(*drawn_courses(window)), 20, f"{name} is gone")
    assert len(table(window).impacts) == before - own
    assert not selected_rows(window)
    window.screenshot("deleted")
    with window.override():
        bpy.ops.ed.undo()
    yield 1.0
    assert set.union(*drawn_courses(window)) == everyone
    assert len(table(window).impacts) == before

    for obj in picks_of(name):
        obj["rockfall_trajectory"] = "renamed"
        obj.update_tag()
    yield from window.wait_for(lambda: "renamed" in set.union(*drawn_courses(window)), 20, "renamed")
    assert set.union(*drawn_courses(window)) == everyone - {name} | {"renamed"}
    assert int((table(window).impacts.trajectory == "renamed").sum()) == own
    select_only(picks_of("renamed"))
    yield 0.8
    assert drawn_courses(window)[0] == {"renamed"}
    assert len(selected_rows(window)) == own
    window.screenshot("renamed")

    yield from window.move(*window.centre())
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    yield 1.0
    yield from open_both(window, load=False)
    for tree in (IMPACTS, MOTION):
        _, seen = canvas_of(window, tree)
        assert not seen.frames, "nothing of the file before is left"
        assert [one.operator for one in seen.buttons], "it is said what to do next"
    window.screenshot("new_file")


def settings(scene):
    graphs, compared, motion = scene.rockfall_graphs, scene.rockfall_comparison, scene.rockfall_motion
    return (
        [(one.x, one.y, one.x_log, one.y_fixed) for one in (graphs.graph_1, graphs.graph_2, graphs.graph_3)],
        (graphs.count, graphs.colour_by, graphs.drag_selects, graphs.error_bars),
        (set(compared.models), compared.points, compared.replicates, compared.seed),
        (set(motion.quantities), motion.only_selected, motion.in_frames, scene.get("rockfall_motion_limits")),
    )


def limits(window):
    return [
        (tree, number, one.x.limits, one.y.limits)
        for tree in (IMPACTS, MOTION)
        for number, one in canvas_of(window, tree)[1].frames.items()
    ]


def case_both_graphs_are_saved_and_exported(window):
    """Settings come back after undo and redo, and from the file with both editors open; SVG, PNG and CSV."""
    yield from open_both(window)
    scene = bpy.context.scene
    scene.rockfall_comparison.models = {"noel_2017", "dorren_2015"}
    scene.rockfall_comparison.points = "DRAW"
    scene.rockfall_graphs.graph_1.x, scene.rockfall_graphs.graph_1.x_log = "kinetic1_j", True
    scene.rockfall_graphs.drag_selects, scene.rockfall_graphs.colour_by = "LASSO", "trajectory"
    scene.rockfall_motion.in_frames = True
    region, seen = canvas_of(window, MOTION)
    plot = seen.frames[0].plot
    x, y = region.x + plot.left + plot.width / 3, region.y + plot.bottom + plot.height / 2
    for _ in range(3):
        window.window.event_simulate(type="WHEELUPMOUSE", value="PRESS", x=round(x), y=round(y))
        yield 0.2
    yield 0.5
    with window.override():
        bpy.ops.ed.undo_push(message="set up")
        scene.rockfall_graphs.graph_2.y = "v2_mps"
        bpy.ops.ed.undo_push(message="changed")
        bpy.ops.ed.undo()
    yield 0.5
    wanted, shown = settings(bpy.context.scene), limits(window)
    with window.override():
        bpy.ops.ed.redo()
    assert settings(bpy.context.scene) != wanted
    with window.override():
        bpy.ops.ed.undo()
    yield 0.5
    assert settings(bpy.context.scene) == wanted
    path = f"{bpy.app.tempdir}both.blend"
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    yield 1.0
    bpy.ops.wm.open_mainfile(filepath=path)
    yield 3.0
    assert settings(bpy.context.scene) == wanted
    assert limits(window) == shown, "both editors are open again, with the same axes"
    window.screenshot("reopened")
    for kind in ("IMPACTS", "MOTION"):
        yield from exported(window, kind)


def exported(window, kind):
    """The same graphs as files."""
    folder = Path(bpy.app.tempdir) / kind
    folder.mkdir(exist_ok=True)
    for name, colours in (
        ("paper.png", "PAPER"),
        ("screen.png", "SCREEN"),
        ("graphs.svg", "PAPER"),
        ("all.csv", "PAPER"),
    ):
        with window.override():
            done = bpy.ops.rockfall.export_graphs(
                filepath=str(folder / name), kind=kind, colours=colours, width=700, height=500, scale=1.5
            )
        assert done == {"FINISHED"}
        yield 0.3
    corners = {}
    for name in ("paper.png", "screen.png"):
        image = bpy.data.images.load(str(folder / name))
        assert tuple(image.size) == (1050, 750)
        pixels = np.empty(1050 * 750 * 4, dtype=np.float32)
        image.pixels.foreach_get(pixels)
        pixels = pixels.reshape(750, 1050, 4)
        assert (pixels[..., 3] == 1.0).all(), "nothing shines through"
        corners[name] = pixels[0, 0, :3]
        drawn = (np.abs(pixels[..., :3] - corners[name]).max(axis=2) > 0.2).reshape(3, 250, 3, 350).mean(axis=(1, 3))
        assert (drawn > 0.002).all(), f"something is drawn in every ninth of {name}: {drawn}"
        assert (drawn < 0.6).all()
        bpy.data.images.remove(image)
    assert corners["paper.png"].min() == 1.0
    assert corners["screen.png"].max() < 0.5
    root = ElementTree.fromstring((folder / "graphs.svg").read_text(encoding="utf-8"))
    assert (root.get("width"), root.get("height")) == ("700", "500")
    titles = [one.text for one in root.iter("{http://www.w3.org/2000/svg}text")]
    with (folder / "all.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    if kind == "IMPACTS":
        assert any("inetic energy" in (text or "") for text in titles)
        assert {row["x_variable"] for row in rows if row["graph"] == "1"} == {"kinetic1_j"}
    else:
        assert "Speed [m/s]" in titles
        assert {row["trajectory"] for row in rows} == set(table(window).impacts.trajectory.tolist())


def case_motion_graphs_small_and_large(window):
    """400 × 300 pixels, and an interface scale of 2.5, in both themes; a click goes to its time there, too."""
    yield from open_both(window)
    preferences, scene = bpy.context.preferences, bpy.context.scene
    area = area_of(window, MOTION)
    with bpy.context.temp_override(window=window.window, area=area):
        bpy.ops.screen.area_split(direction="HORIZONTAL", factor=0.68)
    yield 0.5
    area = max((one for one in window.window.screen.areas if one.ui_type == MOTION), key=lambda one: one.height)
    with bpy.context.temp_override(window=window.window, area=area):
        bpy.ops.screen.area_split(direction="VERTICAL", factor=0.66)
    select_only([next(o for o in scene.objects if o.get("rockfall_role") == "block")])
    yield 1.0
    for name in ("Dark", "Light"):
        window.theme(name)
        yield 1.0
        window.screenshot(f"{name}_small")
        preferences.view.ui_scale = 2.5
        yield 1.5
        window.screenshot(f"{name}_2.5")
        preferences.view.ui_scale = 1.0
        yield 0.5
        if name == "Dark":
            canvases = window.part("rockfall_addon.view.graphs.editor")._canvases
            areas = [one for one in window.window.screen.areas if one.ui_type == MOTION]
            areas.sort(key=lambda one: one.height)
            regions = [next(one for one in area.regions if one.type == "WINDOW") for area in areas]
            seen = [canvases[region.as_pointer()].frames for region in regions]
            assert len(seen[0]) == 1, "where there is room for one graph, it is not a line beside two others"
            assert [len(one) for one in seen[1:]] == [3, 3]
            assert min(frame.plot.height for frames in seen[1:] for frame in frames.values()) > 20
    region, plot = regions[1], seen[1][0].plot
    yield from window.click(region.x + plot.left + plot.width / 2, region.y + plot.bottom + plot.height / 2)
    time_s = sum(seen[1][0].x.limits) / 2
    assert abs(scene.frame_current - time_s * scene.render.fps) <= 4, "one pixel is several frames here"

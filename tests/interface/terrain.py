# SPDX-License-Identifier: GPL-3.0-or-later
"""A person imports scanned slopes."""

import tempfile
from pathlib import Path

import bpy
import numpy as np

DATA = Path(__file__).resolve().parents[1] / "data"


def case_import_ground_classified_tile(window):
    yield from window.show_sidebar()
    window.screenshot("empty")
    with window.override():
        assert bpy.ops.rockfall.import_terrain(filepath=str(DATA / "las_chablais3.laz")) == {"FINISHED"}
    yield 3.0
    window.screenshot("chablais")
    (ground,) = [o for o in bpy.context.scene.objects if o.get("rockfall_role") == "terrain"]
    assert len(ground.data.polygons) > 10_000


def case_import_vegetated_tile_after_asking(window):
    yield from window.show_sidebar()
    with window.override():
        bpy.ops.rockfall.import_terrain("INVOKE_DEFAULT", filepath=str(DATA / "sample_lareunion_epsg2975.laz"))
    yield 2.0
    window.screenshot("dialog")
    x, y = window.centre()
    yield from window.press("RET", x, y)
    yield from window.wait_for(lambda: any("rockfall_role" in o for o in bpy.context.scene.objects), what="imported")
    yield 3.0
    window.screenshot("lareunion")


def case_the_ground_filter_works_beside_the_window_and_esc_stops_it(window):
    yield from window.show_sidebar()
    job, scene = window.part("rockfall_addon.view.job"), bpy.context.scene
    for stopped, cell_m in ((True, 0.1), (False, 1.0)):
        objects = len(scene.objects)
        with window.override():
            bpy.ops.rockfall.import_terrain(
                "INVOKE_DEFAULT", filepath=str(DATA / "las_chablais3.laz"), ground="FILTER", filter_m=cell_m
            )
        yield 0.5
        yield from window.press("RET", *window.centre())
        if stopped:
            yield from window.wait_for(
                lambda: job.is_running() and job._running[0].share > 0, what="a cloth that falls"
            )
            window.screenshot("at-work")
            yield from window.press("ESC", *window.centre())
            assert not job.is_running()
            assert len(scene.objects) == objects
        else:
            yield from window.wait_for(lambda: any("rockfall_role" in o for o in scene.objects), what="imported")
    window.screenshot("filtered")


def case_a_slope_that_stands_upright_asks_whether_y_points_up(window):
    file = Path(tempfile.mkdtemp()) / "upright.obj"
    x, y = (each.ravel() for each in np.meshgrid(np.arange(0, 41, 4.0), np.arange(0, 41, 4.0)))
    corners = np.arange(121).reshape(11, 11)
    corners = np.stack([corners[:-1, :-1], corners[:-1, 1:], corners[1:, 1:], corners[1:, :-1]], axis=-1).reshape(-1, 4)
    rows = [f"v {a} {30 - 0.2 * a} {-b}" for a, b in zip(x, y, strict=True)]
    rows += [f"f {a} {b} {c} {d}" for a, b, c, d in corners + 1]
    file.write_text("\n".join(rows) + "\n")
    with window.override():
        bpy.ops.rockfall.import_terrain("INVOKE_DEFAULT", filepath=str(file))
    yield 1.0
    window.screenshot("question")
    yield from window.press("RET", *window.centre())
    yield from window.wait_for(lambda: any("rockfall_role" in o for o in bpy.context.scene.objects), what="imported")


def case_the_terrain_takes_the_colours_of_the_footage(window):
    """By its button, in the background; the camera's view then lies on the terrain, also from another place."""
    job = window.part("rockfall_addon.view.job")
    colours = window.part("rockfall_addon.scene.terrain.terrain_colours")
    with window.override():
        assert bpy.ops.rockfall.load_footage_demo() == {"FINISHED"}
        bpy.ops.rockfall.show_relief()
    window.unfold("ROCKFALL_PT_relief")
    yield from window.show_sidebar()
    yield from window.open_panel("ROCKFALL_PT_terrain")
    yield 1.0
    window.screenshot("1-rock")
    with window.override():
        bpy.ops.rockfall.colour_from_footage("INVOKE_DEFAULT")
    yield from window.wait_for(lambda: not job.is_running(), 60, "coloured")
    yield 1.0
    scene = bpy.context.scene
    assert colours.have(scene, "footage_colours")
    window.screenshot("2-footage")
    window.theme("Light")
    yield 1.0
    window.screenshot("3-light-theme")
    window.theme("Dark")
    camera = next(obj for obj in scene.objects if "rockfall_poses" in obj)
    poses = list(camera["rockfall_poses"])
    camera["rockfall_poses"] = [poses[0] + 1.0, *poses[1:]]
    yield 0.5
    window.area().tag_redraw()
    yield 0.5
    window.screenshot("4-a-camera-has-moved")
    camera["rockfall_poses"] = poses
    with window.override():
        bpy.ops.ed.undo()
    assert not colours.have(bpy.context.scene, "footage_colours"), "one step of undo"


def case_relief_sliders_at_their_ends(window):
    yield from window.show_sidebar()
    scene = bpy.context.scene
    with window.override():
        assert bpy.ops.rockfall.import_terrain(filepath=str(DATA / "las_chablais3.laz")) == {"FINISHED"}
        bpy.ops.ed.undo_push(message="terrain")
    yield 2.0
    window.screenshot("usual")
    before = colour_sum()
    for name, values in {
        "flat": {"hillshade": 0.0, "eye_dome": 0.0, "thin": 0.0},
        "full": {"hillshade": 1.0, "eye_dome": 1.0, "thin": 1.0},
        "contrast": {"hillshade": 0.75, "eye_dome": 0.75, "thin": 0.7, "contrast": 2.5},
    }.items():
        for slider, value in values.items():
            setattr(scene.rockfall_terrain, slider, value)
        yield 1.5
        window.screenshot(name)
    with window.override():
        bpy.ops.ed.undo_push(message="sliders")
        bpy.ops.ed.undo()
    yield 1.5
    assert bpy.context.scene.rockfall_terrain.contrast == 1.0
    assert colour_sum() == before, "undo takes the colours back with the sliders"
    nodes = bpy.data.materials["Rockfall terrain"].node_tree.nodes
    assert nodes["contrast"].outputs[0].default_value == 1.0
    with window.override():
        bpy.ops.ed.redo()
    yield 1.0
    assert bpy.context.scene.rockfall_terrain.contrast == 2.5
    assert colour_sum() != before


def case_coarse_view_switched_and_undone(window):
    yield from window.show_sidebar()
    with window.override():
        assert bpy.ops.rockfall.import_terrain(filepath=str(DATA / "las_chablais3.laz")) == {"FINISHED"}
        bpy.ops.ed.undo_push(message="terrain")
    yield 2.0
    full = drawn()
    bpy.context.scene.rockfall_terrain.view_limit = full // 2
    with window.override():
        bpy.ops.ed.undo_push(message="limit")
    yield 2.0
    window.screenshot("coarse")
    coarse = drawn()
    assert coarse < full / 4
    with window.override():
        bpy.ops.rockfall.toggle_full_terrain()
        bpy.ops.ed.undo_push(message="full")
    yield 1.0
    assert drawn() == full
    window.screenshot("full")
    for expected in (coarse, full):
        with window.override():
            bpy.ops.ed.undo()
        yield 1.0
        assert drawn() == expected
    with window.override():
        bpy.ops.ed.redo()
    yield 1.0
    assert drawn() == coarse
    (ground,) = [o for o in bpy.context.scene.objects if o.get("rockfall_role") == "terrain"]
    region = window.region()
    for locked in (True, False):
        with window.override():
            bpy.ops.object.select_all(action="DESELECT")
            bpy.ops.view3d.select(location=(region.width // 2, region.height // 2))
            assert ground.select_get() != locked, "a click on the coarse view selects the terrain that is not locked"
            bpy.ops.rockfall.lock_terrain()


def colour_sum():
    (ground,) = [o for o in bpy.context.scene.objects if o.get("rockfall_role") == "terrain"]
    colours = np.empty(4 * len(ground.data.vertices), dtype=np.float32)
    ground.data.attributes["relief"].data.foreach_get("color", colours)
    return colours.tobytes()


def drawn():
    (ground,) = [o for o in bpy.context.scene.objects if o.get("rockfall_role") == "terrain"]
    return len(ground.evaluated_get(bpy.context.evaluated_depsgraph_get()).data.polygons)


def case_a_scan_in_millimetres_is_noticed(window):
    """Before it is imported, where it cannot be metres at all; else after it, with the way to read it again."""
    x, y = (each.ravel() for each in np.meshgrid(np.arange(0, 41, 2.0), np.arange(0, 41, 2.0)))
    corners = np.arange(441).reshape(21, 21)
    corners = np.stack([corners[:-1, :-1], corners[:-1, 1:], corners[1:, 1:], corners[1:, :-1]], axis=-1).reshape(-1, 4)
    folder, scene = Path(tempfile.mkdtemp()), bpy.context.scene
    for name, east, north in (("survey", 2.6e6, 1.2e6), ("local", 0.0, 0.0)):
        rows = [
            f"v {1e3 * (a + east):.1f} {1e3 * (b + north):.1f} {1e3 * (30 - 0.5 * a):.1f}"
            for a, b in zip(x, y, strict=True)
        ]
        rows += [f"f {a} {b} {c} {d}" for a, b, c, d in corners + 1]
        (folder / f"{name}.obj").write_text("\n".join(rows) + "\n")

    def grounds():
        return [obj for obj in scene.objects if obj.get("rockfall_role") == "terrain"]

    with window.override():
        bpy.ops.rockfall.import_terrain("INVOKE_DEFAULT", filepath=str(folder / "survey.obj"))
    yield 1.5
    window.screenshot("1-beyond-every-survey")
    yield from window.press("RET", *window.centre())
    yield from window.wait_for(grounds, what="imported")
    yield 1.0
    (ground,) = grounds()
    assert abs(ground.dimensions.x - 40) < 0.01, "read in millimetres"
    with window.override():
        bpy.ops.rockfall.remove_terrain()
        window.part("rockfall_addon.scene.terrain.georeference").forget_shift(scene)
        assert bpy.ops.rockfall.import_terrain(filepath=str(folder / "local.obj"), unit_m=1.0) == {"FINISHED"}
    with window.override("VIEW_3D"):
        window.part("rockfall_addon.view.look").show_relief(bpy.context, frame_all=True)
        space = bpy.context.space_data
        assert space.clip_end > space.region_3d.view_distance > 2e4, "it is seen, large as it is"
    yield from window.show_sidebar()
    yield 1.0
    window.screenshot("2-two-kilometres-apart")
    step = window.part("rockfall_addon.scene.next_step").next_step(scene)
    assert "is its file in another unit?" in step.sentence
    with window.override():
        again = {"replaces": step.tile, "unit_m": step.unit_m}
        bpy.ops.rockfall.import_terrain("INVOKE_DEFAULT", filepath=str(folder / "local.obj"), **again)
    yield 1.5
    window.screenshot("3-again")
    yield from window.press("RET", *window.centre())
    yield from window.wait_for(lambda: abs(grounds()[0].dimensions.x - 40) < 0.01, what="read again")
    yield 1.0
    window.screenshot("4-read-again")

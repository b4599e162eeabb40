# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings of the graphs, what is stored of them, and the selection that scene and graphs share."""

from pathlib import Path

import bpy
import numpy as np
import pytest

PAPER = [("theta1_deg", "rn"), ("vn1_mps", "rn"), ("vt1_mps", "vt2_mps"), ("theta_dev_deg", "r")]


@pytest.fixture
def demo(rockfall, part) -> bpy.types.Scene:
    assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
    return bpy.context.scene


def _rows_selected(part, scene: bpy.types.Scene) -> set[int]:
    pick = part("rockfall_addon.scene.models.comparison").comparison_of(scene).pick
    ids = {obj["rockfall_id"] for obj in bpy.context.selected_objects if "rockfall_id" in obj}
    return {row for row, identifier in enumerate(pick) if identifier in ids}


def test_the_four_graphs_of_the_paper_without_anything_stored(rockfall, part) -> None:
    settings, scene = part("rockfall_addon.scene.models.graph_settings"), bpy.context.scene
    specs = [settings.spec_of(settings.graph(scene, number)) for number in settings.shown(scene)]
    assert [(spec.x, spec.y) for spec in specs] == PAPER
    assert all(spec.x_limits is spec.y_limits is None for spec in specs)
    assert not [key for key in scene.keys() if "graph" in key]  # noqa: SIM118 - a scene is no dictionary


def test_settings_are_saved_by_name(rockfall, part, tmp_path: Path) -> None:
    settings, scene = part("rockfall_addon.scene.models.graph_settings"), bpy.context.scene
    graph = settings.graph(scene, 1)
    graph.x, graph.y, graph.trend = "kinetic1_j", "v2_mps", "exponential"
    graph.y_log = True
    settings.set_limits(scene, 1, (10.0, 2500.0), None)
    scene.rockfall_graphs.colour_by, scene.rockfall_graphs.count = "trajectory", 2
    scene.rockfall_graphs.filters.add().column = "v1_mps"
    scene.rockfall_graphs.filters[0].low = "2.000000001"
    settings.choose_elsewhere(scene, frozenset({("/tmp/other.csv", 4), ("/tmp/other.csv", 2)}))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "kept.blend"))
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "kept.blend"), load_ui=False)
    scene = bpy.context.scene
    spec = settings.spec_of(settings.graph(scene, 1))
    assert (spec.x, spec.y, spec.trend, spec.x_log, spec.y_log) == ("kinetic1_j", "v2_mps", "exponential", False, True)
    assert spec.x_limits == (10.0, 2500.0)
    assert settings.shown(scene) == (0, 1)
    (found,) = settings.filters_of(scene)
    assert (found.column, found.low, found.high) == ("v1_mps", 2.000000001, np.inf)
    assert settings.chosen_elsewhere(scene) == {("/tmp/other.csv", 4), ("/tmp/other.csv", 2)}
    settings.choose_elsewhere(scene, frozenset())
    assert "rockfall_graph_chosen" not in scene


def test_numbers_of_choices_do_not_depend_on_their_order(rockfall, part) -> None:
    """A file keeps the number: another variable before it must not change what the graph shows."""
    choices = part("rockfall_addon.scene.models.graph_settings").VARIABLE_CHOICES
    numbers = {name: number for name, *_, number in choices}
    assert len(set(numbers.values())) == len(numbers)
    assert all(np.float32(number) == number for number in numbers.values()), "a button of a menu holds such a number"
    assert list(numbers.values()) != sorted(numbers.values()), "they are no counts"


def test_a_variable_takes_its_own_axis(rockfall, part) -> None:
    settings, scene = part("rockfall_addon.scene.models.graph_settings"), bpy.context.scene
    settings.set_limits(scene, 0, (5.0, 20.0), (1.0, 2.0))
    graph = settings.graph(scene, 0)
    graph.x_log = True
    assert settings.spec_of(graph).x_limits == (5.0, 20.0)
    graph.x = "v1_mps"
    spec = settings.spec_of(graph)
    assert (spec.x_limits, spec.x_log, spec.y_limits) == (None, False, (1.0, 2.0))
    settings.set_limits(scene, 0, (-3.0, 20.0), None)
    graph.x_log = True
    assert settings.spec_of(graph).x_limits is None, "a logarithmic axis cannot start below zero"
    graph.y_limits = (3.0, 1.0)
    assert settings.spec_of(graph).y_limits is None, "limits in the wrong order are none"
    settings.reset(scene, 0)
    assert settings.spec_of(graph).y_limits is None


def test_one_graph_alone(rockfall, part) -> None:
    settings, scene = part("rockfall_addon.scene.models.graph_settings"), bpy.context.scene
    scene.rockfall_graphs.maximised = 3
    assert settings.shown(scene) == (2,)
    scene.rockfall_graphs.count = 2
    assert settings.shown(scene) == (0, 1), "a graph that is not shown is not shown alone"


def test_scene_and_graphs_share_one_selection(demo, part) -> None:
    selection, picks = part("rockfall_addon.view.graphs.selection"), part("rockfall_addon.scene.picks.picks")
    compared = part("rockfall_addon.scene.models.comparison").comparison_of(demo)
    assert len(set(compared.pick)) == len(compared.impacts) == 104
    chosen = frozenset({(0, 3), (0, 50)})
    selection.select(bpy.context, chosen, (0, 50))
    assert _rows_selected(part, demo) == {3, 50}
    assert bpy.context.view_layer.objects.active == picks.with_id(demo, compared.pick[50])
    assert selection.selected(bpy.context) == chosen
    assert selection.active(bpy.context) == (0, 50)
    picks.with_id(demo, compared.pick[50]).select_set(False)
    bpy.context.view_layer.update()
    selection.notice()
    assert selection.selected(bpy.context) == {(0, 3)}
    selection.go_to(bpy.context, 3)
    assert demo.frame_current_final == pytest.approx(picks.with_id(demo, compared.pick[3])["rockfall_key_frame"])
    selection.select(bpy.context, frozenset())
    assert not _rows_selected(part, demo)


def test_selecting_leaves_what_is_no_pick_or_hidden(demo, part) -> None:
    selection, picks = part("rockfall_addon.view.graphs.selection"), part("rockfall_addon.scene.picks.picks")
    compared = part("rockfall_addon.scene.models.comparison").comparison_of(demo)
    hidden = picks.with_id(demo, compared.pick[7])
    hidden.hide_set(True)
    block = next(obj for obj in demo.objects if obj.get("rockfall_role") == "block")
    block.select_set(True)
    selection.select(bpy.context, frozenset({(0, 7), (0, 8)}), (0, 8))
    assert _rows_selected(part, demo) == {8}, "a hidden object cannot be selected"
    assert not block.select_get(), "nothing else is selected, as after a click in the 3-D view"


def test_the_graphs_have_panels_and_an_editor_type(rockfall, part) -> None:
    editor = part("rockfall_addon.view.graphs.editor")
    tree = bpy.types.NodeTree.bl_rna_get_subclass_py(editor.IMPACTS)
    assert tree.bl_label == "Rockfall Graphs"
    panels = [
        cls for cls in part("rockfall_addon.steps").classes() if getattr(cls, "bl_space_type", "") == "NODE_EDITOR"
    ]
    assert {"ROCKFALL_PT_graph_axes", "ROCKFALL_PT_graph_points", "ROCKFALL_PT_graph_filters"} <= {
        cls.bl_idname for cls in panels
    }


def test_the_header_of_other_node_editors_stays_blenders(clean_blender, installation) -> None:
    theirs = bpy.types.NODE_HT_header.draw
    installation.enable()
    assert bpy.types.NODE_HT_header.draw is not theirs
    installation.disable()
    assert bpy.types.NODE_HT_header.draw is theirs


def test_columns_colour_and_filter(demo, part) -> None:
    assert bpy.ops.rockfall.colour_graphs(column="trajectory") == {"FINISHED"}
    sheet, comparison = part("rockfall_addon.view.graphs.impact_sheet"), part("rockfall_addon.scene.models.comparison")
    compared = comparison.comparison_of(demo)
    assert sheet.rows_of(demo, compared)[0].all()
    assert bpy.ops.rockfall.add_graph_filter(column="trajectory") == {"FINISHED"}
    assert sheet.rows_of(demo, compared)[0].all(), "a filter that asks for nothing hides nothing"
    for name in ("B01", "B02"):
        assert bpy.ops.rockfall.filter_graph_text(number=0, text=name) == {"FINISHED"}
    kept = sheet.rows_of(demo, compared)[0]
    assert set(compared.impacts.trajectory[kept]) == {"B01", "B02"}
    assert bpy.ops.rockfall.filter_graph_text(number=0, text="B01") == {"FINISHED"}
    assert set(compared.impacts.trajectory[sheet.rows_of(demo, compared)[0]]) == {"B02"}
    demo.rockfall_graphs.filters[0].used = False
    assert sheet.rows_of(demo, compared)[0].all()
    assert bpy.ops.rockfall.clear_graph_filters() == {"FINISHED"}
    assert not bpy.ops.rockfall.clear_graph_filters.poll()

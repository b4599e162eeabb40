# SPDX-License-Identifier: GPL-3.0-or-later
"""The workspace's file, the menus, and the order of the steps."""

import re
from pathlib import Path

import bpy
import pytest

POINTED = {"rockfall.mark_pair", "rockfall.drag_pick", "rockfall.mark_spin"}
"""What only the tools call: they need a mouse on the terrain or the footage."""
WITH_PANEL = {
    "rockfall.compare_model",
    "rockfall.choose_fitted", "rockfall.choose_back_analysed",
    "rockfall.use_ground",
    "rockfall.sort_impacts", "rockfall.remove_video", "rockfall.choose_simulated_model", "rockfall.next_run",
    "rockfall.add_zone", "rockfall.remove_zone", "rockfall.remove_structure", "rockfall.remove_screen",
    "rockfall.reset_parameter",
    "rockfall.go_to_spin_mark",
}  # fmt: skip
"""What works on a row of a panel's list, or is another name of what the menu has."""
OVER_GRAPHS = {
    "rockfall.point_in_graph", "rockfall.leave_graphs", "rockfall.press_in_graph", "rockfall.graph_menu",
    "rockfall.zoom_graph", "rockfall.pan_graph", "rockfall.reset_graphs", "rockfall.show_all_points",
    "rockfall.maximise_graph", "rockfall.select_in_graphs", "rockfall.colour_graphs", "rockfall.add_graph_filter",
    "rockfall.filter_graph_text", "rockfall.remove_graph_filter", "rockfall.clear_graph_filters",
    "rockfall.press_in_motion", "rockfall.test_groups", "rockfall.press_in_strip", "rockfall.point_in_strip",
    "rockfall.leave_strip",
}  # fmt: skip
"""What the editors of graphs and the timeline have in menus, keys and panels of its own."""
BY_ITSELF = {"rockfall.show_result", "rockfall.dismiss_problem"}
"""What a background job calls, or has in its message."""
LARGEST_WORKSPACE_BYTES = 200_000


def operators(part) -> dict[str, type]:
    classes = part("rockfall_addon.steps").classes()
    return {cls.bl_idname: cls for cls in classes if issubclass(cls, bpy.types.Operator)}


def in_menus(part) -> dict[str, list[str | None]]:
    """Operator → the texts of its entries; None for its own label."""
    menus = part("rockfall_addon.menus")
    found: dict[str, list[str | None]] = {name: [None] for name in (*menus.DEMOS, "rockfall.open_workspace")}
    for _, _, entries in menus.STEPS:
        for entry in filter(None, entries):
            name, text = (entry, None) if isinstance(entry, str) else entry[:2]
            found.setdefault(name, []).append(text)
    return found


def test_every_operator_is_in_a_menu_and_says_what_it_does(rockfall, part) -> None:
    known, reachable = operators(part), in_menus(part)
    assert len(known) > 40
    for name, cls in known.items():
        said = getattr(bpy.ops.rockfall, name.removeprefix("rockfall.")).get_rna_type().description
        assert cls.bl_label.strip(), name
        assert len(said) > 12, f"{name} has no description"
        assert not said.endswith("."), f"{name}: Blender adds the full stop"
    assert set(known) - set(reachable) - POINTED - WITH_PANEL - OVER_GRAPHS - BY_ITSELF == set()
    assert {name for name in reachable if name.startswith("rockfall.")} <= set(known)


def test_entries_of_the_menus_are_different(rockfall, part) -> None:
    known = operators(part)
    shown = [
        text or known[name].bl_label
        for name, texts in in_menus(part).items()
        if name in known and name != "rockfall.show_relief"  # is in two menus
        for text in texts
    ]
    assert len(shown) == len(set(shown)), [text for text in shown if shown.count(text) > 1]


def test_entries_exist_with_their_properties(rockfall, part) -> None:
    menus = part("rockfall_addon.menus")
    entries = [entry for _, _, step in menus.STEPS for entry in step if entry is not None]
    for entry in (*entries, *menus.IMPORTS, *menus.EXPORTS):
        name, _, values = (entry, None, {}) if isinstance(entry, str) else entry
        module, function = name.split(".")
        properties = getattr(getattr(bpy.ops, module), function).get_rna_type().properties
        for key, value in values.items():
            assert key in properties, f"{name} has no {key}"
            if properties[key].type == "ENUM" and properties[key].enum_items:
                assert value in properties[key].enum_items
        if name in menus.CHOOSING:
            assert properties[menus.CHOOSING[name]].type == "ENUM"


def test_tools_of_the_menus_are_there(rockfall, part) -> None:
    known = {tool.bl_idname for tool in part("rockfall_addon.steps").tools()}
    asked = {
        entry[2]["name"]
        for _, _, step in part("rockfall_addon.menus").STEPS
        for entry in step
        if isinstance(entry, tuple) and entry[0] == "wm.tool_set_by_id"
    }
    assert asked == known


def test_menus_come_and_go(clean_blender, installation) -> None:
    installation.enable()
    found = installation.traces()["menus"]
    assert len(found) == 4
    assert hasattr(bpy.types, "ROCKFALL_MT_main")
    installation.disable()
    assert not hasattr(bpy.types, "ROCKFALL_MT_main")
    assert not installation.traces()["menus"]


def _panels(part) -> list[type]:
    return [cls for cls in part("rockfall_addon.steps").classes() if issubclass(cls, bpy.types.Panel)]


def test_steps_are_numbered_in_their_order(rockfall, part) -> None:
    panels = _panels(part)
    labels = [cls.bl_label for cls in panels]
    numbered = [re.fullmatch(r"(\d+)  (\S.*)", label) for label in labels if label[:1].isdigit()]
    assert [int(match[1]) for match in numbered] == list(range(1, 11))
    assert len(set(labels)) == len(labels)
    titles = [title for _, title, _ in part("rockfall_addon.menus").STEPS]
    for title, match in zip(titles, numbered, strict=True):
        number, word = title.split()[:2]
        assert number == match[1]
        assert match[2].startswith(word)


def test_each_step_has_a_state_before_and_after(rockfall, part) -> None:
    base, panels = part("rockfall_addon.view.panel"), _panels(part)
    steps = {cls.bl_label.split()[0]: cls for cls in panels if getattr(cls, "bl_label", "")[:1].isdigit()}

    def states() -> dict[str, str]:
        return {
            number: cls.step_state(bpy.context)
            for number, cls in steps.items()
            if not hasattr(cls, "poll") or cls.poll(bpy.context)
        }

    before = states()
    assert before["1"] == before["4"] == "TO_DO"
    bpy.ops.rockfall.load_demo()
    after = states()
    assert after["1"] == after["4"] == "READY"
    assert set(after) == {str(number) for number in range(1, 11)}
    assert set(after.values()) <= set(base.MARKS), after


def test_the_file_of_the_workspace(rockfall, part, tmp_path: Path) -> None:
    workspace = part("rockfall_addon.view.workspace")
    assert workspace.FILE.stat().st_size < LARGEST_WORKSPACE_BYTES
    with bpy.data.libraries.load(str(workspace.FILE)) as (there, here):
        assert there.workspaces == [workspace.NAME]
        assert not there.objects
        assert not there.scenes
        here.workspaces = there.workspaces
    (ours,) = here.workspaces
    assert part("rockfall_addon.scene.storage.store").WORKSPACE in ours
    (screen,) = ours.screens
    views = sorted((area for area in screen.areas if area.type == "VIEW_3D"), key=lambda area: area.x)
    assert len(views) == 2
    assert any(area.ui_type == "TIMELINE" and area.spaces.active.show_seconds for area in screen.areas)
    assert [view.spaces.active.region_3d.view_perspective for view in views] == ["CAMERA", "PERSP"]
    assert views[0].width > 1.5 * views[1].width
    assert views[0].spaces.active.show_region_ui
    bpy.data.batch_remove([ours, screen])


def test_the_next_step_leads_from_the_footage_to_the_end(rockfall, part) -> None:
    following, scene = part("rockfall_addon.scene.next_step"), bpy.context.scene
    looks = part("rockfall_addon.steps.start.panel").LOOKS
    for expected in (
        "rockfall.load_footage_demo",
        "rockfall.propose_impacts",
        "rockfall.refine",
        "rockfall.apply_refinement",
    ):
        step = following.next_step(scene)
        assert step.sentence.endswith(".")
        assert expected in step.actions, (expected, step.sentence)
        assert set(step.actions) <= set(looks), "each has its text and icon"
        for identifier in set(step.actions) - {following.PICK_TOOL}:
            module, name = identifier.split(".")
            assert getattr(getattr(bpy.ops, module), name).get_rna_type()
        assert getattr(bpy.ops.rockfall, expected.removeprefix("rockfall."))() == {"FINISHED"}
    assert following.next_step(scene).sentence.startswith("Play")


def test_opening_needs_a_window(rockfall) -> None:
    if not bpy.app.background:
        pytest.skip("has a window")
    assert not bpy.ops.rockfall.open_workspace.poll()


def test_footage_demo_is_ready_to_be_picked(rockfall, part) -> None:
    assert bpy.ops.rockfall.load_footage_demo() == {"FINISHED"}
    scene = bpy.context.scene
    videos = part("rockfall_addon.scene.footage.videos")
    camera_paths = part("rockfall_addon.scene.footage.camera_paths")
    clocks = part("rockfall_addon.scene.footage.clocks")
    (camera,) = videos.cameras(scene)
    assert camera_paths.is_solved(camera)
    assert scene.camera == camera
    assert clocks.video_time(scene, camera) == pytest.approx(51 / 30, abs=1e-6)
    sightings = part("rockfall_addon.scene.footage.sightings")
    assert sightings.names_in(camera) == ["B10"]
    assert part("rockfall_addon.scene.picks.places").trajectory(scene) == "B10"
    assert not bpy.ops.rockfall.load_footage_demo.poll()

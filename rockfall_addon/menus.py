# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything in menus, by the steps of the sidebar; F3 finds what is in a menu. Menus name operators by their ids."""

import bpy

from .view import toolbar

DEMOS = ("rockfall.load_demo", "rockfall.load_footage_demo", "rockfall.open_project")
STEPS = (
    ("terrain", "1  Terrain", (
        "rockfall.import_terrain", "rockfall.show_relief", "rockfall.reset_relief", "rockfall.toggle_full_terrain",
        "rockfall.colour_from_footage", "rockfall.remove_footage_colours",
        "rockfall.lock_terrain", "rockfall.put_terrain_back", "rockfall.toggle_left_out",
        "rockfall.remove_terrain",
    )),
    ("videos", "2  Videos", (
        "rockfall.add_video", "rockfall.look_through", "rockfall.fit_footage", None,
        ("rockfall.step_frame", "Previous Picture", {"step": -1}), ("rockfall.step_frame", "Next Picture", {"step": 1}),
        None,
        ("rockfall.time_origin_here", "Begin the Timeline Here", {"what": "SCENE"}),
        ("rockfall.time_origin_here", "Time 0 of All Videos Here", {"what": "CLOCK"}),
        "rockfall.mark_event", "rockfall.reference_video", "rockfall.synchronise_videos", None,
        "rockfall.use_video_rate", "rockfall.use_named_capture_rate",
        "rockfall.use_video_size", "rockfall.build_proxy", "rockfall.relink_video",
    )),
    ("alignment", "3  Alignment", (
        "rockfall.align_views", ("wm.tool_set_by_id", "Tool: Align Camera", {"name": "rockfall.align_tool"}),
        ("rockfall.use_view", "Place Camera from This View", {}), None,
        "rockfall.accept_pair", "rockfall.go_to_pair", "rockfall.delete_pair", "rockfall.import_pairs",
        "rockfall.export_pairs", None,
        "rockfall.follow_background", "rockfall.stop_job", "rockfall.propose_pairs", None,
        "rockfall.import_camera", "rockfall.export_camera",
    )),
    ("picking", "4  Picking", (
        ("wm.tool_set_by_id", "Tool: Pick Impacts", {"name": "rockfall.pick_tool"}), "rockfall.pick_kind",
        "rockfall.remove_pick",
        ("rockfall.nudge_pick_time", "A Tenth of a Frame Earlier", {"frames": -0.1}),
        ("rockfall.nudge_pick_time", "A Tenth of a Frame Later", {"frames": 0.1}),
        ("rockfall.show_impact", "Go to the Pick's Moment", {}), "rockfall.use_triangulated", None,
        "rockfall.track_block", "rockfall.propose_impacts", "rockfall.clear_track", None,
        ("wm.tool_set_by_id", "Tool: Mark Spin", {"name": "rockfall.spin_tool"}), "rockfall.remove_spin_mark",
        "rockfall.clear_spin_marks", "rockfall.measure_spin", "rockfall.set_spin_axis", "rockfall.count_turns", None,
        "rockfall.import_picks", "rockfall.reconstruct", "rockfall.impact_table", None,
        "rockfall.recover_picks", "rockfall.select_set_aside", "rockfall.remove_set_aside",
    )),
    ("refinement", "5  Refinement", (
        "rockfall.refine", "rockfall.apply_refinement", "rockfall.discard_refinement",
    )),
    ("models", "6  Models", (
        "rockfall.open_graphs", "rockfall.open_graphs_workspace", None,
        "rockfall.show_models", "rockfall.remove_models", None,
        "rockfall.load_parameters", "rockfall.save_parameters",
        ("rockfall.copy_parameters", "Copy Parameters A to B", {"way": "A_TO_B"}),
        ("rockfall.copy_parameters", "Copy Parameters B to A", {"way": "B_TO_A"}),
        ("rockfall.copy_parameters", "Swap Parameters A and B", {"way": "SWAP"}), None,
        "rockfall.calibrate", "rockfall.find_equivalent", "rockfall.apply_fit", "rockfall.discard_fit", None,
        "rockfall.add_database", "rockfall.remove_database",
    )),
    ("simulation", "7  Simulation", (
        ("rockfall.draw_release", "Draw Release Line", {"kind": "line"}),
        ("rockfall.draw_release", "Draw Release Area", {"kind": "polygon"}),
        ("rockfall.draw_release", "Draw Release Points", {"kind": "points"}),
        "rockfall.use_as_structure", "rockfall.draw_screen", None,
        "rockfall.simulate", "rockfall.select_run", "rockfall.remove_simulation", None,
        "rockfall.compute_maps", "rockfall.export_maps", "rockfall.remove_maps", None,
        "rockfall.back_analyse", "rockfall.use_medians", "rockfall.remove_back_analysis",
    )),
    ("playback", "8  Playback", (
        ("screen.animation_play", "Play or Pause", {}), "rockfall.frame_trajectory",
        "rockfall.open_motion_graphs", "rockfall.open_keys", "rockfall.show_relief",
    )),
    ("film", "9  Film", (
        "rockfall.set_up_film", "rockfall.preview_film", "rockfall.render_film", "rockfall.remove_film", None,
        "rockfall.make_film",
    )),
    ("share", "10  Share", (
        "rockfall.export_tables", "rockfall.export_graphs", "rockfall.export_simulation",
        "rockfall.design_sheet", "rockfall.export_project", None,
        "rockfall.export_web_page", "rockfall.export_animation",
    )),
)  # fmt: skip
"""Name, title and entries of each menu: an operator, or an operator with its text and properties; None is a line."""

CHOOSING = {"rockfall.pick_kind": "kind", "rockfall.set_spin_axis": "axis"}
"""Operators whose entry opens the list of a property."""

IMPORTS = (
    ("rockfall.open_project", "Rockfall Project (.toml)", {}),
    ("rockfall.import_terrain", "Rockfall Terrain (mesh, grid, cloud)", {}),
    ("rockfall.add_video", "Rockfall Video", {}),
    ("rockfall.import_pairs", "Rockfall Pairs (.csv)", {}),
    ("rockfall.import_camera", "Rockfall Camera (.toml)", {}),
    ("rockfall.import_picks", "Rockfall Picks (.csv)", {}),
)
EXPORTS = (
    ("rockfall.export_tables", "Rockfall Tables (.csv)", {}),
    ("rockfall.export_simulation", "Rockfall Simulation (.csv)", {}),
    ("rockfall.export_project", "Rockfall Project (.toml)", {}),
    ("rockfall.export_web_page", "Rockfall Web Page (.html)", {}),
    ("rockfall.export_animation", "Rockfall Animation (.glb/.usdc/.abc)", {}),
)

Entry = str | tuple[str, str, dict[str, object]] | None


def draw_entry(layout: bpy.types.UILayout, entry: Entry) -> None:
    """One line of a menu."""
    if entry is None:
        layout.separator()
        return
    identifier, text, values = (entry, None, {}) if isinstance(entry, str) else entry
    if identifier in CHOOSING:
        layout.operator_menu_enum(identifier, CHOOSING[identifier])
        return
    if identifier == "wm.tool_set_by_id" and not toolbar.is_offered(bpy.context, values["name"]):
        layout = layout.row()
        layout.enabled = False
    button = layout.operator(identifier, text=text) if text else layout.operator(identifier)
    for name, value in values.items():
        setattr(button, name, value)


class _Step:
    """Mix-in: draws the entries of one step."""

    entries: tuple[Entry, ...] = ()

    def draw(self, context: bpy.types.Context) -> None:
        for entry in self.entries:
            draw_entry(self.layout, entry)


class ROCKFALL_MT_main(bpy.types.Menu):
    """The menu Rockfall of the 3-D view."""

    bl_idname = "ROCKFALL_MT_main"
    bl_label = "Rockfall"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        for identifier in (*DEMOS, "rockfall.open_workspace"):
            layout.operator(identifier)
        layout.separator()
        for menu in STEP_MENUS:
            layout.menu(menu.bl_idname)


STEP_MENUS = tuple(
    type(
        f"ROCKFALL_MT_{name}",
        (_Step, bpy.types.Menu),
        {"bl_idname": f"ROCKFALL_MT_{name}", "bl_label": title, "entries": entries, "__module__": __name__},
    )
    for name, title, entries in STEPS
)


def _draw_main(self: bpy.types.Menu, context: bpy.types.Context) -> None:
    if context.mode == "OBJECT":
        self.layout.menu(ROCKFALL_MT_main.bl_idname)


def _draw_window(self: bpy.types.Menu, context: bpy.types.Context) -> None:
    self.layout.separator()
    self.layout.operator("rockfall.open_workspace", icon="WORKSPACE")
    self.layout.operator("rockfall.open_graphs_workspace", icon="GRAPH")


def _draw_imports(self: bpy.types.Menu, context: bpy.types.Context) -> None:
    for entry in IMPORTS:
        draw_entry(self.layout, entry)


def _draw_exports(self: bpy.types.Menu, context: bpy.types.Context) -> None:
    for entry in EXPORTS:
        draw_entry(self.layout, entry)


PLACES = (
    ("VIEW3D_MT_editor_menus", _draw_main),
    ("TOPBAR_MT_window", _draw_window),
    ("TOPBAR_MT_file_import", _draw_imports),
    ("TOPBAR_MT_file_export", _draw_exports),
)
"""Menus of Blender, and what they get."""


def register() -> None:
    for menu in (*STEP_MENUS, ROCKFALL_MT_main):
        bpy.utils.register_class(menu)
    for name, draw in PLACES:
        getattr(bpy.types, name).append(draw)


def unregister() -> None:
    for name, draw in reversed(PLACES):
        getattr(bpy.types, name).remove(draw)
    for menu in reversed((*STEP_MENUS, ROCKFALL_MT_main)):
        bpy.utils.unregister_class(menu)

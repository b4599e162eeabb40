# SPDX-License-Identifier: GPL-3.0-or-later
"""The header of the editor of impact graphs, and its menus."""

import bpy

from ...scene.models import graph_settings


class ROCKFALL_MT_graphs_view(bpy.types.Menu):
    """How graphs are shown."""

    bl_idname = "ROCKFALL_MT_graphs_view"
    bl_label = "View"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.rockfall_graphs
        layout.prop(context.space_data, "show_region_ui")
        layout.separator()
        layout.operator("rockfall.reset_graphs", icon="HOME").graph = 0
        layout.operator("rockfall.show_all_points", icon="ZOOM_ALL").graph = 0
        if settings.maximised:
            layout.operator("rockfall.maximise_graph", text="Show All Graphs", icon="FULLSCREEN_EXIT")
        layout.separator()
        layout.prop(settings, "count")
        for name in ("links", "fits", "legend"):
            layout.prop(settings, name)
        layout.prop_menu_enum(settings, "error_bars")
        layout.separator()
        layout.operator("screen.screen_full_area", text="Maximise Area")


class ROCKFALL_MT_graphs_select(bpy.types.Menu):
    """Which impacts are selected."""

    bl_idname = "ROCKFALL_MT_graphs_select"
    bl_label = "Select"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.operator_enum("rockfall.select_in_graphs", "what")
        layout.separator()
        layout.prop(context.scene.rockfall_graphs, "drag_selects", expand=True)


class ROCKFALL_MT_graphs_variables(bpy.types.Menu):
    """What each graph shows."""

    bl_idname = "ROCKFALL_MT_graphs_variables"
    bl_label = "Variables"

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        for number in graph_settings.shown(scene):
            graph = graph_settings.graph(scene, number)
            layout.label(text=f"Graph {number + 1}")
            for axis in ("x", "y"):
                layout.prop_menu_enum(graph, axis, text=f"{axis}: {_label(graph, axis)}")
            layout.prop_menu_enum(graph, "trend", text="Fit")


class ROCKFALL_MT_graphs_export(bpy.types.Menu):
    """Files of the graphs."""

    bl_idname = "ROCKFALL_MT_graphs_export"
    bl_label = "Export"

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.operator("rockfall.export_graphs", icon="EXPORT")
        self.layout.operator("rockfall.export_tables", icon="EXPORT")


def draw_header(context: bpy.types.Context, layout: bpy.types.UILayout) -> None:
    """Menus to the left, what is often changed to the right."""
    settings = context.scene.rockfall_graphs
    row = layout.row(align=True)
    for menu in MENUS:
        row.menu(menu.bl_idname)
    layout.separator_spacer()
    if settings.maximised:
        layout.operator("rockfall.maximise_graph", text="All Graphs", icon="FULLSCREEN_EXIT")
    layout.row(align=True).prop(settings, "drag_selects", expand=True, icon_only=True)
    layout.menu("ROCKFALL_MT_graph_colours", text="", icon="COLOR")
    layout.popover("ROCKFALL_PT_graph_filters", text="", icon="FILTER")


def _label(graph: bpy.types.PropertyGroup, axis: str) -> str:
    return graph.bl_rna.properties[axis].enum_items[getattr(graph, axis)].name


MENUS = (
    ROCKFALL_MT_graphs_view,
    ROCKFALL_MT_graphs_select,
    ROCKFALL_MT_graphs_variables,
    ROCKFALL_MT_graphs_export,
)
CLASSES = MENUS

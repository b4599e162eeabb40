# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar of the editor of impact graphs: axes, points, filters."""

import bpy

from ...scene.models import graph_settings
from ...view.graphs.panel import GraphPanel
from . import showing


class ROCKFALL_PT_graph_axes(GraphPanel, bpy.types.Panel):
    """Variables, scales, limits and fit of each graph."""

    bl_label = "Axes"
    bl_idname = "ROCKFALL_PT_graph_axes"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        layout.prop(scene.rockfall_graphs, "count")
        for number in graph_settings.shown(scene):
            graph = graph_settings.graph(scene, number)
            header, body = layout.panel(f"ROCKFALL_graph_axes_{number}", default_closed=number > 0)
            header.label(text=f"Graph {number + 1}")
            if body is None:
                continue
            for axis in ("x", "y"):
                column = body.column(align=True)
                row = column.row(align=True)
                row.prop(graph, axis, text="")
                row.prop(graph, f"{axis}_log", text="log", toggle=True)
                row = column.row(align=True)
                row.prop(
                    graph, f"{axis}_fixed", text="", icon="LOCKED" if getattr(graph, f"{axis}_fixed") else "UNLOCKED"
                )
                limits = row.row(align=True)
                limits.enabled = getattr(graph, f"{axis}_fixed")
                limits.prop(graph, f"{axis}_limits", text="")
            body.prop(graph, "trend")


class ROCKFALL_PT_graph_points(GraphPanel, bpy.types.Panel):
    """How points are drawn."""

    bl_label = "Points"
    bl_idname = "ROCKFALL_PT_graph_points"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.rockfall_graphs
        layout.menu("ROCKFALL_MT_graph_colours", text=f"Colour by: {settings.colour_by or 'one colour'}")
        layout.prop(settings, "error_bars")
        row = layout.row(align=True)
        for name in ("links", "fits", "legend"):
            row.prop(settings, name, toggle=True)


class ROCKFALL_PT_graph_filters(GraphPanel, bpy.types.Panel):
    """Which impacts are shown."""

    bl_label = "Filters"
    bl_idname = "ROCKFALL_PT_graph_filters"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        for number, row in enumerate(scene.rockfall_graphs.filters):
            groups = showing.groups_of(scene, row.column)
            box = layout.box().column(align=True)
            head = box.row(align=True)
            head.prop(row, "used", text=row.column)
            head.operator("rockfall.remove_graph_filter", text="", icon="X", emboss=False).number = number
            if groups is None:
                limits = box.row(align=True)
                limits.prop(row, "low")
                limits.prop(row, "high")
            elif len(groups) > MOST_BUTTONS:
                box.prop(row, "texts", text="")
            else:
                chosen = showing.texts_of(row)
                flow = box.grid_flow(columns=0, even_columns=True, align=True)
                for group in groups:
                    on = group in chosen or not chosen
                    button = flow.operator("rockfall.filter_graph_text", text=group or "empty", depress=on)
                    button.number, button.text = number, group
        row = layout.row(align=True)
        row.menu("ROCKFALL_MT_graph_filters", icon="ADD")
        row.operator("rockfall.clear_graph_filters", text="", icon="X")


MOST_BUTTONS = 24
"""Of more texts in a column, those that are shown are typed."""

CLASSES = (ROCKFALL_PT_graph_axes, ROCKFALL_PT_graph_points, ROCKFALL_PT_graph_filters)

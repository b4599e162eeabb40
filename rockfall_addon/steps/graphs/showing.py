# SPDX-License-Identifier: GPL-3.0-or-later
"""What colours the points, and which of them are shown."""

import bpy
from bpy.props import IntProperty, StringProperty

from ....core.analysis.columns import column_titles, find_column
from ....core.errors import RockfallError
from ...scene.models import comparison
from ...view.reporting import reported


def tables(scene: bpy.types.Scene) -> list:
    """The tables whose impacts are shown."""
    compared = comparison.comparison_of(scene)
    return [one for one in (compared.impacts, *(other.impacts for other in compared.others)) if one is not None]


class ROCKFALL_OT_colour_graphs(bpy.types.Operator):
    """Colour the measured points by this column"""

    bl_idname = "rockfall.colour_graphs"
    bl_label = "Colour Graphs By"
    bl_options = {"INTERNAL", "UNDO"}

    column: StringProperty(description="Empty for one colour")

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        context.scene.rockfall_graphs.colour_by = self.column
        return {"FINISHED"}


class ROCKFALL_OT_add_graph_filter(bpy.types.Operator):
    """Show only the impacts with some values of this column"""

    bl_idname = "rockfall.add_graph_filter"
    bl_label = "Add Filter"
    bl_options = {"INTERNAL", "UNDO"}

    column: StringProperty()

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        context.scene.rockfall_graphs.filters.add().column = self.column
        return {"FINISHED"}


class ROCKFALL_OT_filter_graph_text(bpy.types.Operator):
    """Show or hide the impacts with this text"""

    bl_idname = "rockfall.filter_graph_text"
    bl_label = "Filter by Text"
    bl_options = {"INTERNAL", "UNDO"}

    number: IntProperty()
    text: StringProperty()

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        filters = context.scene.rockfall_graphs.filters
        if not 0 <= self.number < len(filters):
            raise RockfallError(f"There is no filter {self.number + 1}.")
        row = filters[self.number]
        chosen = texts_of(row)
        others = [one for one in chosen if one != self.text]
        row.texts = ", ".join(others if self.text in chosen else [*chosen, self.text])
        return {"FINISHED"}


class ROCKFALL_OT_remove_graph_filter(bpy.types.Operator):
    """Remove this filter"""

    bl_idname = "rockfall.remove_graph_filter"
    bl_label = "Remove Filter"
    bl_options = {"INTERNAL", "UNDO"}

    number: IntProperty()

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        context.scene.rockfall_graphs.filters.remove(self.number)
        return {"FINISHED"}


class ROCKFALL_OT_clear_graph_filters(bpy.types.Operator):
    """Remove all filters of the graphs: every impact is shown"""

    bl_idname = "rockfall.clear_graph_filters"
    bl_label = "Clear Filters"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(context.scene.rockfall_graphs.filters)

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        context.scene.rockfall_graphs.filters.clear()
        return {"FINISHED"}


class ROCKFALL_MT_graph_colours(bpy.types.Menu):
    """Columns that can colour the points."""

    bl_idname = "ROCKFALL_MT_graph_colours"
    bl_label = "Colour By"

    def draw(self, context: bpy.types.Context) -> None:
        layout, now = self.layout, context.scene.rockfall_graphs.colour_by
        layout.operator("rockfall.colour_graphs", text="One Colour", icon=_dot(not now)).column = ""
        layout.separator()
        for name, title in column_titles(tables(context.scene)).items():
            layout.operator("rockfall.colour_graphs", text=title, icon=_dot(name == now)).column = name


class ROCKFALL_MT_graph_filters(bpy.types.Menu):
    """Columns that can filter the points."""

    bl_idname = "ROCKFALL_MT_graph_filters"
    bl_label = "Add Filter"

    def draw(self, context: bpy.types.Context) -> None:
        for name, title in column_titles(tables(context.scene)).items():
            self.layout.operator("rockfall.add_graph_filter", text=title).column = name


def texts_of(row: bpy.types.PropertyGroup) -> list[str]:
    """The texts of a filter."""
    return [text for text in (part.strip() for part in row.texts.split(",")) if text]


def groups_of(scene: bpy.types.Scene, name: str) -> list[str] | None:
    """The different texts of a column; None for a column of numbers."""
    found: dict[str, None] = {}
    for table in tables(scene):
        if name in column_titles([table]):
            column = find_column(table, name)
            if column.texts is None:
                return None
            found |= dict.fromkeys(column.groups)
    return list(found)


def _dot(on: bool) -> str:
    return "RADIOBUT_ON" if on else "RADIOBUT_OFF"


CLASSES = (
    ROCKFALL_OT_colour_graphs,
    ROCKFALL_OT_add_graph_filter,
    ROCKFALL_OT_filter_graph_text,
    ROCKFALL_OT_remove_graph_filter,
    ROCKFALL_OT_clear_graph_filters,
    ROCKFALL_MT_graph_colours,
    ROCKFALL_MT_graph_filters,
)

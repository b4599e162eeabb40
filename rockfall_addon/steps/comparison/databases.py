# SPDX-License-Identifier: GPL-3.0-or-later
"""Impacts of other sites beside the scene's own: tables are added, and taken away."""

import bpy
from bpy.props import IntProperty, StringProperty

from ...scene.storage import databases
from ...view.from_file import FromFile
from ...view.panel import Rows
from ...view.reporting import possible, reported


class ROCKFALL_OT_add_database(FromFile, bpy.types.Operator):
    """Show the impacts of another site in the graphs: impacts.csv of a project, or of rockfall merge"""

    bl_idname = "rockfall.add_database"
    bl_label = "Add Impacts of Other Sites"
    bl_options = {"REGISTER", "UNDO"}

    filter_glob: StringProperty(default="*.csv", options={"HIDDEN"})

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        table = databases.add(context.scene, self.chosen(context).absolute())
        self.report({"INFO"}, f"{len(table.impacts)} impacts of {', '.join(table.sites)}.")
        return {"FINISHED"}


class ROCKFALL_OT_remove_database(bpy.types.Operator):
    """Take this table out of the graphs; the file stays"""

    bl_idname = "rockfall.remove_database"
    bl_label = "Remove Impacts of Other Sites"
    bl_options = {"REGISTER", "UNDO"}

    place: IntProperty(default=-1, description="Row of the list; -1 for the chosen one")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(cls, len(context.scene.rockfall_comparison.databases), "There is none in the list")

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.rockfall_comparison
        rows = settings.databases
        place = settings.database if self.place < 0 else self.place
        rows.remove(min(place, len(rows) - 1))
        settings.database = max(0, min(settings.database, len(rows) - 1))
        return {"FINISHED"}


class ROCKFALL_UL_databases(Rows, bpy.types.UIList):
    """The tables of other sites."""

    bl_idname = "ROCKFALL_UL_databases"

    def draw_row(self, layout: bpy.types.UILayout, item: bpy.types.PropertyGroup) -> None:
        row = layout.row(align=True)
        table = databases.of_row(item)
        row.prop(item, "shown", text="")
        name = ", ".join(table.sites[:2]) + (" …" if len(table.sites) > 2 else "") or table.path.name
        row.label(text=name, icon="ERROR" if table.problem else "NONE")
        if table.impacts is not None:
            row.label(text=f"{len(table.impacts)} impacts")


CLASSES = (ROCKFALL_OT_add_database, ROCKFALL_OT_remove_database, ROCKFALL_UL_databases)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The impact table: sort it, see it in a wide window; the selected pick: go to its moment, move it in time."""

import bpy
from bpy.props import FloatProperty, StringProperty

from ....core.errors import RockfallError
from ...scene.footage import sync
from ...scene.picks import impact_rows
from ...scene.storage import store
from ...view.reporting import possible, reported

WIDE = 760  # pixels at interface scale 1


class ROCKFALL_OT_sort_impacts(bpy.types.Operator):
    """Sort the impact table by this column; again for the other direction"""

    bl_idname = "rockfall.sort_impacts"
    bl_label = "Sort"
    bl_options = {"INTERNAL"}
    looks_only = True

    column: StringProperty()

    @classmethod
    def description(cls, context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        """What the numbers below this heading are, which has no room for that."""
        column = context.scene.rockfall.bl_rna.properties["table_sort"].enum_items.get(properties.column)
        return f"{column.description}.\n{cls.__doc__}" if column is not None else str(cls.__doc__)

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.rockfall
        if self.column not in settings.bl_rna.properties["table_sort"].enum_items:
            raise RockfallError(f"The impact table has no column {self.column!r}.")
        settings.table_descending = settings.table_sort == self.column and not settings.table_descending
        settings.table_sort = self.column
        return {"FINISHED"}


class ROCKFALL_OT_impact_table(bpy.types.Operator):
    """Show the impact table with all its columns"""

    bl_idname = "rockfall.impact_table"
    bl_label = "Impact Table"
    bl_options = {"INTERNAL"}
    looks_only = True

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(
            cls, len(context.scene.rockfall_impacts), "There are no impacts yet: import picks first, or load the demo"
        )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        return context.window_manager.invoke_popup(self, width=self._width(context))

    def draw(self, context: bpy.types.Context) -> None:
        bpy.types.ROCKFALL_PT_impact_table.draw_table(self.layout, context, self._width(context))

    @staticmethod
    def _width(context: bpy.types.Context) -> int:
        room = context.window.width / context.preferences.system.ui_scale - 40
        return int(min(WIDE, room))

    def execute(self, context: bpy.types.Context) -> set[str]:
        return {"FINISHED"}


def _has_pick(context: bpy.types.Context) -> bool:
    return context.object is not None and context.object.get(store.ROLE) == store.PICK_ROLE


class ROCKFALL_OT_show_impact(bpy.types.Operator):
    """Go to the moment of the selected pick"""

    bl_idname = "rockfall.show_impact"
    bl_label = "Go to This Moment"
    bl_options = {"REGISTER", "UNDO"}
    looks_only = True

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _has_pick(context) and store.KEY_FRAME in context.object

    def execute(self, context: bpy.types.Context) -> set[str]:
        frame = float(context.object[store.KEY_FRAME])
        context.scene.frame_set(int(frame // 1), subframe=float(frame % 1))
        return {"FINISHED"}


class ROCKFALL_OT_nudge_pick_time(bpy.types.Operator):
    """Move the selected pick in time by a part of a frame"""

    bl_idname = "rockfall.nudge_pick_time"
    bl_label = "Nudge Time"
    bl_options = {"REGISTER", "UNDO"}

    frames: FloatProperty(name="Frames", description="Of the scene; negative is earlier", default=0.1, precision=2)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(cls, _has_pick(context), "Select a pick first")

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        pick = impact_rows.selected(context)
        sync.nudge(context.scene, pick, store.double(self.frames))
        return {"FINISHED"}


CLASSES = (
    ROCKFALL_OT_sort_impacts,
    ROCKFALL_OT_impact_table,
    ROCKFALL_OT_show_impact,
    ROCKFALL_OT_nudge_pick_time,
)

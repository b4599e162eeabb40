# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes are made walls, fences, houses that blocks meet, and are let off again."""

import bpy

from ....core.errors import RockfallError
from ...scene.simulation import structures
from ...view.reporting import possible, reported


class ROCKFALL_OT_use_as_structure(bpy.types.Operator):
    """Blocks meet the selected meshes: walls, fences, ditches, roads, houses"""

    bl_idname = "rockfall.use_as_structure"
    bl_label = "Use as Structure"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(cls, any(map(structures.can_be, _selected(context))), "Select meshes that are not terrain")

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        chosen = [obj for obj in _selected(context) if structures.can_be(obj)]
        structures.mark(chosen)
        self.report({"INFO"}, f"Blocks meet {', '.join(obj.name for obj in chosen)}.")
        return {"FINISHED"}


class ROCKFALL_OT_remove_structure(bpy.types.Operator):
    """Blocks do not meet this object any more; it stays in the scene"""

    bl_idname = "rockfall.remove_structure"
    bl_label = "Remove Structure"
    bl_options = {"INTERNAL", "UNDO"}

    name: bpy.props.StringProperty()

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        obj = next((obj for obj in structures.objects_of(context.scene) if obj.name == self.name), None)
        if obj is None:
            raise RockfallError(f"There is no structure {self.name}.")
        structures.unmark(obj)
        return {"FINISHED"}


def _selected(context: bpy.types.Context) -> list[bpy.types.Object]:
    return [] if context.view_layer is None else list(context.view_layer.objects.selected)


CLASSES = (ROCKFALL_OT_use_as_structure, ROCKFALL_OT_remove_structure)

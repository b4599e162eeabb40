# SPDX-License-Identifier: GPL-3.0-or-later
"""Screens are drawn across the slope, and taken away."""

import bpy

from ....core.errors import RockfallError
from ...scene.simulation import screens
from ...scene.storage import store
from ...view.reporting import reported
from .drawing import Drawing


class ROCKFALL_OT_draw_screen(Drawing, bpy.types.Operator):
    """Click along a line across the slope: what passes there is measured, or held; Enter ends, Esc leaves"""

    bl_idname = "rockfall.draw_screen"
    bl_label = "Draw Screen"
    bl_options = {"REGISTER", "UNDO"}

    kind = "line"
    help = "Click along the screen or barrier, across the slope"

    def made(self, context: bpy.types.Context) -> None:
        obj = screens.make(context.scene, self.points)
        store.look_again()
        self.report({"INFO"}, f"{obj.name} measures what passes at the next simulation.")


class ROCKFALL_OT_remove_screen(bpy.types.Operator):
    """Remove this screen"""

    bl_idname = "rockfall.remove_screen"
    bl_label = "Remove Screen"
    bl_options = {"INTERNAL", "UNDO"}

    name: bpy.props.StringProperty()

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        obj = next((obj for obj in screens.objects_of(context.scene) if obj.name == self.name), None)
        if obj is None:
            raise RockfallError(f"There is no screen {self.name}.")
        store.remove_objects([obj])
        return {"FINISHED"}


CLASSES = (ROCKFALL_OT_draw_screen, ROCKFALL_OT_remove_screen)

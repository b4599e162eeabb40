# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 1: the terrain."""

import bpy

from ..bridge import state
from .base import RockfallPanel, advise, facts


class ROCKFALL_PT_terrain(RockfallPanel, bpy.types.Panel):
    bl_label = "1  Terrain"
    bl_idname = "ROCKFALL_PT_terrain"

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        grounds = state.with_role(scene, state.TERRAIN_ROLE)
        if not grounds:
            advise(context, layout, False, "Import your scan, or begin with the demo.")
            column = layout.column(align=True)
            column.scale_y = 1.4
            column.operator("rockfall.load_demo", icon="PLAY")
            column.operator("rockfall.import_terrain", icon="IMPORT")
            return
        advise(context, layout, True, "Ready.")
        shift = state.read_shift(scene)
        ground = grounds[0]
        rows = [
            ("Terrain", ground.name),
            ("Triangles", f"{len(ground.data.polygons):,}".replace(",", " ")),
            ("Shift X", f"{shift.x:.2f} m"),
            ("Shift Y", f"{shift.y:.2f} m"),
            ("Shift Z", f"{shift.z:.2f} m"),
        ]
        facts(layout, [*rows, ("System", shift.crs or "unknown")])
        row = layout.row(align=True)
        row.operator("rockfall.show_relief", icon="SHADING_SOLID")
        row.operator("rockfall.import_terrain", text="Add", icon="IMPORT")


CLASSES = (ROCKFALL_PT_terrain,)

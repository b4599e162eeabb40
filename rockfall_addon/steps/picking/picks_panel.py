# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 4: picks and trajectories."""

import bpy

from ...scene import problems, store
from ...view.panel import RockfallPanel, State, advise, paragraph


class ROCKFALL_PT_picks(RockfallPanel, bpy.types.Panel):
    bl_label = "4  Picks and Trajectories"
    bl_idname = "ROCKFALL_PT_picks"

    @staticmethod
    def step_state(context: bpy.types.Context) -> State:
        if not store.with_role(context.scene, store.PICK_ROLE):
            return "TO_DO"
        return "ATTENTION" if problems.sentences(context.scene) else "READY"

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        picks = store.with_role(scene, store.PICK_ROLE)
        flights = store.with_role(scene, store.FLIGHTS_ROLE)
        if not picks:
            with_video = bool(store.with_role(scene, store.CAMERA_ROLE))
            way = "Click the block at its impacts in the footage, or import" if with_video else "Import"
            advise(context, layout, False, f"{way} a table of timed picks (picks.csv).")
            layout.operator("rockfall.import_picks", icon="IMPORT")
            return
        for sentence in problems.sentences(scene):
            paragraph(context, layout, sentence, "ERROR")
        runs = "trajectory" if len(flights) == 1 else "trajectories"
        advise(context, layout, True, f"{len(picks)} picks, {len(flights)} {runs}.")
        layout.use_property_split = True
        settings = scene.rockfall
        column = layout.column(align=True)
        for name in ("block_diameter_m", "density_kgpm3", "normal_radius_m", "use_drag", "flights_join"):
            column.prop(settings, name)
        layout.operator("rockfall.reconstruct", icon="FILE_REFRESH")


CLASSES = (ROCKFALL_PT_picks,)

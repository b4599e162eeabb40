# SPDX-License-Identifier: GPL-3.0-or-later
"""From trajectories to a film."""

import bpy

from ...scene import store
from ...view.panel import RockfallPanel, State
from . import remembered


class ROCKFALL_PT_film(RockfallPanel, bpy.types.Panel):
    bl_label = "9  Film"
    bl_idname = "ROCKFALL_PT_film"
    bl_options = {"DEFAULT_CLOSED"}
    needs = store.FLIGHTS_ROLE

    @staticmethod
    def step_state(context: bpy.types.Context) -> State:
        return "READY" if remembered.is_set_up(context.scene) else "TO_DO"

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        ready = remembered.is_set_up(scene)
        row = layout.row(heading="Graphs")
        row.prop(scene.rockfall, "film_graphs", expand=True)
        layout.operator("rockfall.set_up_film", text="Update Set-up" if ready else "Set Up Film", icon="VIEW_CAMERA")
        if ready:
            rate = scene.render.fps / scene.render.fps_base
            frames = scene.frame_end - scene.frame_start + 1
            size = f"{scene.render.resolution_x} × {scene.render.resolution_y}"
            layout.label(text=f"{frames / rate:.0f} s of film, {frames} frames, {size}")
            layout.operator("rockfall.render_film", icon="RENDER_ANIMATION")
            layout.operator("rockfall.remove_film", icon="X")


CLASSES = (ROCKFALL_PT_film,)

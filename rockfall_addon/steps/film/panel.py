# SPDX-License-Identifier: GPL-3.0-or-later
"""From trajectories to a film."""

import bpy

from ...scene.storage import store
from ...view import job
from ...view.panel import RockfallPanel, State, fields, paragraph
from . import remembered, stopwatch, up_to_date
from .written import draw_written


class ROCKFALL_PT_film(RockfallPanel, bpy.types.Panel):
    bl_label = "9  Film"
    bl_idname = "ROCKFALL_PT_film"
    bl_options = {"DEFAULT_CLOSED"}
    needs = store.FLIGHTS_ROLE

    @staticmethod
    def step_state(context: bpy.types.Context) -> State:
        if not remembered.is_set_up(context.scene):
            return "TO_DO"
        return "READY" if up_to_date.is_up_to_date(context.scene) else "ATTENTION"

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        settings, ready = scene.rockfall_film, remembered.is_set_up(scene)
        fields(layout, settings, ("size", "engine", "time_scale", "graphs"))
        layout.prop(settings, "file", text="", icon="FILE_MOVIE")
        layout.operator("rockfall.set_up_film", text="Update Set-up" if ready else "Set Up Film", icon="VIEW_CAMERA")
        if ready:
            self._draw_film(context)

    def _draw_film(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        if up_to_date.is_up_to_date(scene):
            rate = scene.render.fps / scene.render.fps_base
            frames = scene.frame_end - scene.frame_start + 1
            layout.label(text=f"{frames / rate:.1f} s of film, {frames} frames", icon="TIME")
        else:
            paragraph(context, layout, "Something has changed since: press Update Set-up.", "ERROR")
        layout.operator("rockfall.preview_film", icon="RENDER_STILL")
        expected = stopwatch.expected(scene)
        paragraph(context, layout, f"{expected}." if expected else "A preview tells how long the film will take.")
        row = layout.row()
        row.scale_y = 1.4
        row.operator("rockfall.render_film", icon="RENDER_ANIMATION")
        job.draw(context, layout, "film")
        draw_written(layout, scene)
        layout.operator("rockfall.remove_film", icon="X")


CLASSES = (ROCKFALL_PT_film,)

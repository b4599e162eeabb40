# SPDX-License-Identifier: GPL-3.0-or-later
"""How the blocks are played and drawn."""

import bpy

from ...scene.storage import store
from ...view.panel import RockfallPanel, State


class ROCKFALL_PT_playback(RockfallPanel, bpy.types.Panel):
    bl_label = "8  Playback"
    bl_idname = "ROCKFALL_PT_playback"
    bl_options = {"DEFAULT_CLOSED"}
    needs = store.FLIGHTS_ROLE

    @staticmethod
    def step_state(context: bpy.types.Context) -> State:
        return "ANY_TIME"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.rockfall
        playing = context.screen is not None and context.screen.is_animation_playing
        row = layout.row(align=True)
        row.scale_y = 1.4
        row.operator("screen.animation_play", text="Pause" if playing else "Play", icon="PAUSE" if playing else "PLAY")
        layout.operator("rockfall.frame_trajectory", icon="ZOOM_SELECTED")
        layout.operator("rockfall.open_motion_graphs", icon="FCURVE")
        layout.operator("rockfall.open_keys", icon="ACTION")
        layout.use_property_split, layout.use_property_decorate = True, False
        layout.prop(settings, "playback", expand=True)
        column = layout.column(align=True)
        if settings.playback == "TOGETHER":
            column.prop(settings, "stagger_s")
        for name in ("block_scale", "trail_radius_m", "marker_radius_m"):
            column.prop(settings, name)
        column.prop(settings, "colour_by")
        column = layout.column(heading="Trails", align=True)
        column.prop(settings, "trail_until_now")
        column.prop(settings, "show_ticks")
        column.prop(settings, "show_legend")


CLASSES = (ROCKFALL_PT_playback,)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Which impact models are shown beside the real blocks."""

import bpy

from ....core.impact_models.registry import MODELS
from ...scene.models import models
from ...scene.storage import store
from ...view import parameters
from ...view.panel import RockfallPanel, State, paragraph

QUESTION = "Where would the blocks fly if a model were right? Same impacts, same incident velocity."


class ROCKFALL_PT_models(RockfallPanel, bpy.types.Panel):
    bl_label = "6  Models"
    bl_idname = "ROCKFALL_PT_models"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        scene = context.scene
        return store.has_role(scene, store.FLIGHTS_ROLE) and store.has_role(scene, store.TERRAIN_ROLE)

    @staticmethod
    def step_state(context: bpy.types.Context) -> State:
        return "READY" if models.shown_models(context.scene) else "TO_DO"

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        shown = models.shown_models(scene)
        paragraph(context, layout, QUESTION, "QUESTION")
        column = layout.column(align=True)
        for name in models.ORDER:
            on = name in shown
            button = column.operator(
                "rockfall.show_models",
                text=MODELS[name].title,
                icon="CHECKBOX_HLT" if on else "CHECKBOX_DEHLT",
                depress=on,
            )
            button.models = set(shown) ^ {name}
        row = layout.row(align=True)
        row.scale_y = 1.4
        row.operator("rockfall.open_graphs", text="Open Graphs", icon="GRAPH")
        row.operator("rockfall.open_graphs_workspace", text="", icon="WORKSPACE")
        for name in shown:
            header, body = layout.panel(f"ROCKFALL_shown_parameters_{name}", default_closed=True)
            own = " (own values)" if models.parameters_of(scene).get(name) else ""
            header.label(text=f"{MODELS[name].title}{own}")
            if body is not None:
                parameters.draw(body, scene, name)


CLASSES = (ROCKFALL_PT_models,)

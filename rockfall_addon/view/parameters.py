# SPDX-License-Identifier: GPL-3.0-or-later
"""The parameters of an impact model in a panel: each with its unit, range and source in the tooltip, and a reset."""

import bpy
from bpy.props import StringProperty

from ...core.impact_models.registry import MODELS
from ..scene import model_parameters
from .reporting import reported


class ROCKFALL_OT_reset_parameter(bpy.types.Operator):
    """Give the parameter its default again"""

    bl_idname = "rockfall.reset_parameter"
    bl_label = "Reset Parameter"
    bl_options = {"INTERNAL", "UNDO"}

    model: StringProperty()
    parameter: StringProperty(description="Empty for all of the model")

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        names = [self.parameter] if self.parameter else [spec.name for spec in MODELS[self.model].parameters]
        for name in names:
            model_parameters.keep(context.scene, self.model, name, None)
        return {"FINISHED"}


def draw(layout: bpy.types.UILayout, scene: bpy.types.Scene, model: str) -> None:
    """A row for each parameter of a model."""
    group = getattr(scene.rockfall_parameters, model)
    column = layout.column(align=True)
    for spec in MODELS[model].parameters:
        row = column.row(align=True)
        row.prop(group, spec.name)
        reset = row.row(align=True)
        reset.enabled = model_parameters.is_own(scene, model, spec.name)
        button = reset.operator("rockfall.reset_parameter", text="", icon="LOOP_BACK")
        button.model, button.parameter = model, spec.name


CLASSES = (ROCKFALL_OT_reset_parameter,)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The parameters of an impact model in a panel: each with its unit, range and source in the tooltip, and a reset."""

import bpy
from bpy.props import EnumProperty, StringProperty

from ...core.errors import RockfallError
from ...core.impact_models.presets import Preset, presets_of
from ...core.impact_models.registry import MODELS, find_model
from ..scene.models import model_parameters, models
from .reporting import reported

_items: dict[str, list[tuple[str, str, str]]] = {}  # Blender does not keep the texts of a menu


class OfModel:
    """Mix-in of operators about one model: the tooltip says whose it is."""

    model: StringProperty()

    @classmethod
    def description(cls, context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        model = MODELS[properties.model]
        return f"{model.title} ({model.name}): {model.reference}"


class ROCKFALL_OT_reset_parameter(bpy.types.Operator):
    """Give the parameter its default again"""

    bl_idname = "rockfall.reset_parameter"
    bl_label = "Reset Parameter"
    bl_options = {"INTERNAL", "UNDO"}

    model: StringProperty()
    parameter: StringProperty(description="Empty for all of the model")
    which: StringProperty(default="A", description="Set of parameters")

    @classmethod
    def description(cls, context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        if properties.parameter:
            spec = MODELS[properties.model].parameter(properties.parameter)
            return f"Give {properties.parameter} its default again: {spec.default}"
        return f"Give all parameters of {MODELS[properties.model].title} their defaults again"

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        names = [self.parameter] if self.parameter else [spec.name for spec in find_model(self.model).parameters]
        model_parameters.keep(context.scene, self.model, dict.fromkeys(names), self.which)
        return {"FINISHED"}


def _grounds(self: bpy.types.Operator, context: bpy.types.Context | None) -> list[tuple[str, str, str]]:
    model = self.model
    if model not in _items:
        _items[model] = [
            (str(place), preset.ground, f"{_values(preset)}. {preset.source}")
            for place, preset in enumerate(presets_of(model))
        ]
    return _items[model]


def _values(preset: Preset) -> str:
    return ", ".join(f"{name} {value}" for name, value in preset.values.items())


class ROCKFALL_OT_use_ground(bpy.types.Operator):
    """Give the model the published values for a kind of ground; the tooltip of each says where they are from"""

    bl_idname = "rockfall.use_ground"
    bl_label = "Use Values for a Ground"
    bl_options = {"INTERNAL", "UNDO"}

    model: StringProperty()
    which: StringProperty(default="A", description="Set of parameters")
    ground: EnumProperty(name="Ground", items=_grounds)

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        if not self.ground:
            raise RockfallError("There are no values for a ground of this model.")
        preset = presets_of(self.model)[int(self.ground)]
        model_parameters.use_preset(context.scene, preset, self.which)
        self.report({"INFO"}, f"{preset.ground}: {_values(preset)} ({preset.source}).")
        return {"FINISHED"}


def draw(layout: bpy.types.UILayout, scene: bpy.types.Scene, model: str, which: str = "A") -> None:
    """The values for kinds of ground, then a row for each parameter of a model."""
    presets, own = presets_of(model), models.parameters_of(scene, which).get(model, {})
    row = layout.row(align=True)
    if presets:
        used = next((one for one in presets if model_parameters.has_preset(scene, one, which)), None)
        menu = row.operator_menu_enum(
            "rockfall.use_ground", "ground", text=_capital(used.ground) if used else "Values for a ground"
        )
        menu.model, menu.which = model, which
    else:
        row.label(text="Published values" if not own else "Own values")
    reset = row.row(align=True)
    reset.enabled = bool(own)
    button = reset.operator("rockfall.reset_parameter", text="Defaults", icon="LOOP_BACK")
    button.model, button.parameter, button.which = model, "", which
    group = model_parameters.group_of(scene, model, which)
    column = layout.column(align=True)
    for spec in MODELS[model].parameters:
        row = column.row(align=True)
        if spec.choices:
            part = row.split(factor=0.5, align=True)
            part.label(text=model_parameters.label(spec))
            part.prop(group, spec.name, text="")
        else:
            row.prop(group, spec.name, slider=True)
        reset = row.row(align=True)
        reset.enabled = spec.name in own
        button = reset.operator("rockfall.reset_parameter", text="", icon="LOOP_BACK")
        button.model, button.parameter, button.which = model, spec.name, which


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


CLASSES = (ROCKFALL_OT_reset_parameter, ROCKFALL_OT_use_ground)

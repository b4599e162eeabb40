# SPDX-License-Identifier: GPL-3.0-or-later
"""Which models the graphs show, and two sets of parameters side by side."""

import bpy
from bpy.props import EnumProperty, StringProperty
from bpy_extras.io_utils import ExportHelper

from ....core.exchange.parameters import write_parameters
from ....core.impact_models.registry import MODELS, find_model
from ...scene.models import model_parameters, models
from ...scene.storage import store
from ...view.parameters import OfModel
from ...view.reporting import possible, reported
from ...view.to_file import asked_file


class ROCKFALL_OT_compare_model(OfModel, bpy.types.Operator):
    """Show this model in the graphs, or leave it out"""

    bl_idname = "rockfall.compare_model"
    bl_label = "Compare Model"
    bl_options = {"INTERNAL", "UNDO"}

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.rockfall_comparison
        settings.models = set(settings.models) ^ {find_model(self.model).name}
        return {"FINISHED"}


class ROCKFALL_OT_copy_parameters(bpy.types.Operator):
    """Give all models in one set the parameters that they have in the other one"""

    bl_idname = "rockfall.copy_parameters"
    bl_label = "Copy Parameters"
    bl_options = {"REGISTER", "UNDO"}

    way: EnumProperty(
        name="Way",
        items=[
            ("A_TO_B", "A to B", "Set B becomes what set A is"),
            ("B_TO_A", "B to A", "The scene's parameters, set A, become what set B is"),
            ("SWAP", "Swap", "Each set becomes what the other one is"),
        ],
    )

    @classmethod
    def description(cls, context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        return cls.bl_rna.properties["way"].enum_items[properties.way].description

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        if store.FIT in scene:
            self.report({"ERROR"}, "Set B shows what was fitted: apply or discard that first.")
            return {"CANCELLED"}
        a, b = (models.parameters_of(scene, which) for which in ("A", "B"))
        if self.way != "A_TO_B":
            model_parameters.keep_all(scene, b, "A")
        if self.way != "B_TO_A":
            model_parameters.keep_all(scene, a, "B")
        return {"FINISHED"}


class ROCKFALL_OT_save_parameters(bpy.types.Operator, ExportHelper):
    """Write the parameters of the models in the graphs to a file, which Load Parameters and the command line read"""

    bl_idname = "rockfall.save_parameters"
    bl_label = "Save Parameters"
    bl_options = {"REGISTER"}
    looks_only = True

    filename_ext = ".toml"
    filter_glob: StringProperty(default="*.toml", options={"HIDDEN"})
    which: EnumProperty(name="Set", items=[("A", "A", "The scene's parameters"), ("B", "B", "The second set")])

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(cls, context.scene.rockfall_comparison.models, "No model is in the graphs")

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        own = models.parameters_of(scene, self.which)
        chosen = [name for name in models.ORDER if name in scene.rockfall_comparison.models]
        path = asked_file(self.filepath)
        write_parameters({name: MODELS[name].settings(own.get(name)) for name in chosen}, path)
        self.report({"INFO"}, f"Parameters of {len(chosen)} models in {path}.")
        return {"FINISHED"}


CLASSES = (ROCKFALL_OT_compare_model, ROCKFALL_OT_copy_parameters, ROCKFALL_OT_save_parameters)

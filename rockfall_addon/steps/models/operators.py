# SPDX-License-Identifier: GPL-3.0-or-later
"""Impact models beside reality: the blocks that leave each impact as a model says."""

import bpy
import numpy as np
from bpy.props import EnumProperty, StringProperty

from ....core.analysis.predicted_flights import score_landings
from ....core.exchange.parameters import read_parameters
from ....core.impact_models.registry import MODELS
from ...scene.models import models
from ...scene.picks import reconstruction
from ...scene.storage import store
from ...view.from_file import FromFile
from ...view.reporting import reported


class ROCKFALL_OT_show_models(bpy.types.Operator):
    """Show beside the real blocks those that leave the same impacts as a model says, flown to where they land"""

    bl_idname = "rockfall.show_models"
    bl_label = "Show Models"
    bl_options = {"REGISTER", "UNDO"}

    models: EnumProperty(
        name="Models",
        description="Whose blocks to show",
        items=models.CHOICES,
        options={"ENUM_FLAG"},
        default={"noel_2017"},
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not store.has_role(context.scene, store.PICK_ROLE):
            cls.poll_message_set("Import picks first, or load the demo")
            return False
        if not store.has_role(context.scene, store.TERRAIN_ROLE):
            cls.poll_message_set("The blocks of the models land on the terrain: import one first")
            return False
        return True

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        if not self.models:
            models.remove_models(scene)
            return {"FINISHED"}
        chosen = [name for name in models.ORDER if name in self.models]
        result, left_out = reconstruction.reconstruct_good(scene)
        marks = score_landings(models.show_models(scene, result, chosen))
        scene.rockfall_comparison.models |= set(chosen)
        said = [
            f"{MODELS[mark.model].title}: {mark.median_offset_m:.1f} m"
            for mark in marks
            if np.isfinite(mark.median_offset_m)
        ]
        if left_out:
            self.report({"WARNING"}, f"Something is missing: {left_out[0].text}")
        if said:
            self.report({"INFO"}, f"Median distance of the landings from the real ones: {', '.join(said)}.")
        return {"FINISHED"}


class ROCKFALL_OT_load_parameters(FromFile, bpy.types.Operator):
    """Give the models the parameters of a file that rockfall explore or rockfall calibrate has saved"""

    bl_idname = "rockfall.load_parameters"
    bl_label = "Load Parameters"
    bl_options = {"REGISTER", "UNDO"}

    filter_glob: StringProperty(default="*.toml", options={"HIDDEN"})

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        models.keep_parameters(scene, read_parameters(self.chosen(context)))
        if models.shown_models(scene):
            models.follow(scene, reconstruction.reconstruct_good(scene)[0])
        return {"FINISHED"}


class ROCKFALL_OT_remove_models(bpy.types.Operator):
    """Show the real blocks only"""

    bl_idname = "rockfall.remove_models"
    bl_label = "Remove Models"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(models.shown_models(context.scene))

    def execute(self, context: bpy.types.Context) -> set[str]:
        models.remove_models(context.scene)
        return {"FINISHED"}


CLASSES = (ROCKFALL_OT_show_models, ROCKFALL_OT_load_parameters, ROCKFALL_OT_remove_models)

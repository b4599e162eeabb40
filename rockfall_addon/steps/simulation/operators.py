# SPDX-License-Identifier: GPL-3.0-or-later
"""Simulate in the background, and take away what is shown."""

import bpy

from ....core.impact_models.registry import find_model
from ....core.progress import Progress
from ...scene.simulation import simulated_sources, simulation, simulation_setup
from ...scene.storage import store
from ...view import job, look
from ...view.job import InBackground, Work
from ...view.parameters import OfModel
from ...view.reporting import possible, reported


class ROCKFALL_OT_simulate(InBackground, bpy.types.Operator):
    """Let the blocks fall, in the background; the same seed gives the same blocks"""

    bl_idname = "rockfall.simulate"
    bl_label = "Simulate"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        lacking = simulation_setup.missing(context.scene)
        return possible(cls, not lacking, lacking) and job.is_free(cls)

    def prepare(self, context: bpy.types.Context) -> Work:
        scene = context.scene
        if scene.rockfall_simulation.source == "PICK":
            scene.rockfall_simulation.pick = simulated_sources.selected_pick(scene)[store.ID]
        plan = simulation_setup.plan(scene)

        def compute(progress: Progress) -> object:
            return simulation_setup.run(plan, progress)

        def keep(scene: bpy.types.Scene, found: object) -> str:
            first = not simulation.blocks_of(scene)
            simulation.show_prepared(scene, found.prepared, plan.origins, plan.scenario.trees)
            simulation_setup.keep(scene, plan.said, found.remarks, found.at_screens)
            if first:
                with job.in_window_of(scene) as there:
                    look.frame(there, store.with_role(scene, store.SIMULATED_PATHS_ROLE), beside=True)
            return found.remarks[0].text

        return Work("simulation", compute, keep, keeps_part=True)


class ROCKFALL_OT_remove_simulation(bpy.types.Operator):
    """Show no simulated blocks and paths"""

    bl_idname = "rockfall.remove_simulation"
    bl_label = "Remove Simulation"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(cls, simulation.blocks_of(context.scene), "Nothing simulated is shown")

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        simulation_setup.forget(context.scene)
        return {"FINISHED"}


class ROCKFALL_OT_choose_simulated_model(OfModel, bpy.types.Operator):
    """Simulate with this model, or leave it out"""

    bl_idname = "rockfall.choose_simulated_model"
    bl_label = "Choose Model"
    bl_options = {"INTERNAL", "UNDO"}

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.rockfall_simulation
        settings.models = set(settings.models) ^ {find_model(self.model).name}
        return {"FINISHED"}


CLASSES = (ROCKFALL_OT_simulate, ROCKFALL_OT_remove_simulation, ROCKFALL_OT_choose_simulated_model)

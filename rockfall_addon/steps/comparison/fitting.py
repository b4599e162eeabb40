# SPDX-License-Identifier: GPL-3.0-or-later
"""Fit parameters to the impacts, or to another model, in the background; then apply or discard what was found."""

import bpy
from bpy.props import StringProperty

from ....core.analysis.calibration import calibrate
from ....core.analysis.equivalence import equivalent
from ....core.impact_models.registry import MODELS
from ....core.progress import Progress
from ...scene.models import comparison, fit
from ...scene.storage import store
from ...view import job
from ...view.job import InBackground, Work
from ...view.reporting import possible, reported


class _Fit(InBackground):
    """Mix-in: impacts are there, and nothing else is at work."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        there = comparison.measured_of(context.scene).courses is not None
        return possible(
            cls, there, "Pick impacts first: there is none that a model can be asked about"
        ) and job.is_free(cls)


class ROCKFALL_OT_calibrate(_Fit, bpy.types.Operator):
    """Find the parameters with which the model comes nearest to the impacts, in the background, and propose them"""

    bl_idname = "rockfall.calibrate"
    bl_label = "Calibrate"

    def prepare(self, context: bpy.types.Context) -> Work:
        question = fit.ask(context.scene)

        def compute(progress: Progress) -> object:
            return calibrate(
                question.impacts, question.model, question.names, question.fixed, question.options, progress=progress
            )

        return _work(question, compute)


class ROCKFALL_OT_find_equivalent(_Fit, bpy.types.Operator):
    """Find the parameters with which the model behaves most like another one, on the scene's impacts"""

    bl_idname = "rockfall.find_equivalent"
    bl_label = "Find Equivalent Parameters"

    def prepare(self, context: bpy.types.Context) -> Work:
        question = fit.ask(context.scene, like=True)

        def compute(progress: Progress) -> object:
            return equivalent(
                question.impacts,
                question.imitated,
                question.like,
                question.model,
                question.names,
                question.fixed,
                question.options,
                progress=progress,
            )

        return _work(question, compute)


def _work(question: fit.Question, compute: object) -> Work:
    def keep(scene: bpy.types.Scene, found: object) -> str:
        fit.keep(scene, question, found)
        proposal = fit.proposal_of(scene)
        what = f"like {MODELS[question.imitated].title}" if question.imitated else f"to {proposal.impacts} impacts"
        return f"{MODELS[question.model].title} fitted {what}. Set B shows it: apply or discard it. {proposal.stale}"

    return Work("comparison", compute, keep)


class ROCKFALL_OT_choose_fitted(bpy.types.Operator):
    """Fit this parameter, or leave it as it is"""

    bl_idname = "rockfall.choose_fitted"
    bl_label = "Choose Parameter to Fit"
    bl_options = {"INTERNAL", "UNDO"}

    model: StringProperty()
    parameter: StringProperty()

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        fit.toggle(context.scene, self.model, self.parameter)
        return {"FINISHED"}


class _OfProposal:
    """Mix-in: decides on what was fitted."""

    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        there = store.FIT in context.scene
        return possible(cls, there, "Nothing was fitted, or it is applied or discarded already")


class ROCKFALL_OT_apply_fit(_OfProposal, bpy.types.Operator):
    """Make the fitted values the scene's own: for the graphs, the blocks in the 3-D view and the simulation"""

    bl_idname = "rockfall.apply_fit"
    bl_label = "Apply Fitted Parameters"

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        fit.apply(context.scene)
        return {"FINISHED"}


class ROCKFALL_OT_discard_fit(_OfProposal, bpy.types.Operator):
    """Forget the fitted values; the second set is what it was before"""

    bl_idname = "rockfall.discard_fit"
    bl_label = "Discard Fitted Parameters"

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        fit.discard(context.scene)
        return {"FINISHED"}


CLASSES = (
    ROCKFALL_OT_calibrate,
    ROCKFALL_OT_find_equivalent,
    ROCKFALL_OT_choose_fitted,
    ROCKFALL_OT_apply_fit,
    ROCKFALL_OT_discard_fit,
)

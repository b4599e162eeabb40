# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 5: refinement: fit, look at before and after, apply or discard."""

import bpy

from ...scene.picks import places, proposal
from ...scene.storage import store
from ...view import job, pointing
from ...view.reporting import possible, reported
from . import fitting


class ROCKFALL_OT_refine(job.InBackground, bpy.types.Operator):
    """Fit places and times of the picks to where the block was seen; the result is shown beside what there is"""

    bl_idname = "rockfall.refine"
    bl_label = "Refine"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        lacking = proposal.lacking(context.scene)
        return possible(cls, not lacking, lacking) and job.is_free(cls)

    def prepare(self, context: bpy.types.Context) -> job.Work:
        scene, settings = context.scene, context.scene.rockfall_picking
        names = None
        if settings.scope == "ACTIVE":
            obj = pointing.active_pick(context)
            names = [places.trajectory(scene) if obj is None else obj[store.TRAJECTORY]]
        return fitting.work(scene, names, sorted(settings.free))


class _OfProposal:
    """Mix-in: decides on a proposal."""

    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(cls, proposal.is_there(context.scene), "Refine first")


class ROCKFALL_OT_apply_refinement(_OfProposal, bpy.types.Operator):
    """Give the picks the refined places, times and standard deviations"""

    bl_idname = "rockfall.apply_refinement"
    bl_label = "Apply Refinement"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        found = proposal.read(context.scene)
        said = "Refine first" if found is None else "The picks were changed since: refine again"
        return possible(cls, found is not None and not found.stale, said)

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        count = proposal.apply(context.scene)
        self.report({"INFO"}, f"{count} picks are refined.")
        return {"FINISHED"}


class ROCKFALL_OT_discard_refinement(_OfProposal, bpy.types.Operator):
    """Forget the refined places and times; the picks stay as they are"""

    bl_idname = "rockfall.discard_refinement"
    bl_label = "Discard Refinement"

    def execute(self, context: bpy.types.Context) -> set[str]:
        proposal.discard(context.scene)
        return {"FINISHED"}


CLASSES = (ROCKFALL_OT_refine, ROCKFALL_OT_apply_refinement, ROCKFALL_OT_discard_refinement)

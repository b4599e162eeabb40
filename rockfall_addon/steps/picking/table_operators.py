# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 4: timed picks from a table, and the trajectories between them."""

from contextlib import nullcontext

import bpy
from bpy.props import StringProperty

from ....core.errors import RockfallError
from ....core.exchange.tables import read_picks
from ....core.progress import Progress, silent
from ....core.reconstruction.picks import Picks
from ....core.reconstruction.trajectory import Reconstruction
from ....core.workflow.uprightness import turned_picks
from ...scene import problems
from ...scene.footage import sync
from ...scene.picks import reconstruction
from ...scene.storage import store
from ...scene.terrain import georeference
from ...view import job, look
from ...view.from_file import FromFile
from ...view.reporting import possible, reported

MANY_PICKS = 2000
"""More than these are computed beside Blender: with the first ray on a large terrain that takes seconds."""


class ROCKFALL_OT_import_picks(FromFile, bpy.types.Operator):
    """Import a table of timed impacts (picks.csv) and reconstruct the trajectories between them"""

    bl_idname = "rockfall.import_picks"
    bl_label = "Import Picks"
    bl_options = {"REGISTER", "UNDO"}

    filter_glob: StringProperty(default="*.csv", options={"HIDDEN"})

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        return self.execute(context) if self.filepath else super().invoke(context, event)

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        known = georeference.read_shift(scene) if georeference.has_shift(scene) else None
        picks, turned = turned_picks(read_picks(self.chosen(context), known), reconstruction.ground(scene))
        work = _work(scene, picks, turned)
        if len(picks) > MANY_PICKS and not bpy.app.background:
            job.begin(work, self.bl_label, scene)
            return {"INTERFACE"}  # the result is an undo step of its own
        self.report({"INFO"}, job.kept(work.keep(scene, work.compute(silent))))
        return {"FINISHED"}


def _work(scene: bpy.types.Scene, picks: Picks, turned: tuple[str, ...]) -> job.Work:
    """The import of picks, which were turned or not: to compute their trajectories, then to show them."""
    reconstruct = reconstruction.reconstruction_of(scene, picks)

    def compute(progress: Progress) -> Reconstruction:
        progress("Computing the trajectories", 0, 0)
        return reconstruct()

    def keep(scene: bpy.types.Scene, result: object) -> job.Showing:
        if not georeference.has_shift(scene):
            georeference.write_shift(scene, picks.shift)
        elif georeference.read_shift(scene) != picks.shift:
            raise RockfallError("The scene got another origin while the picks were computed. Import them again.")
        with nullcontext() if bpy.app.background else store.out_of_view(scene, "Trajectories"):
            yield from reconstruction.show_in_steps(scene, result)
        sync.follow_spins(scene)
        with job.in_window_of(scene) as context:
            look.show_relief(context, frame_all=True)
        count = len(set(picks.trajectory.tolist()))
        return " ".join((*turned, f"{len(picks)} picks: {count} trajectories, {len(result.impacts)} impacts."))

    return job.Work("picking", compute, keep)


class ROCKFALL_OT_reconstruct(bpy.types.Operator):
    """Compute the trajectories and impacts again from the picks where they now are"""

    bl_idname = "rockfall.reconstruct"
    bl_label = "Reconstruct"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(cls, store.has_role(context.scene, store.PICK_ROLE), "Import picks first, or load the demo")

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        sync.recompute(context.scene)
        grave = [remark.text for remark in problems.remarks(context.scene) if remark.severity == "problem"]
        if grave:
            self.report({"WARNING"}, f"Not all could be computed: {grave[0]}")
        return {"FINISHED"}


class ROCKFALL_FH_picks(bpy.types.FileHandler):
    """Drop a table of picks into the 3-D view"""

    bl_idname = "ROCKFALL_FH_picks"
    bl_label = "Rockfall picks"
    bl_import_operator = "rockfall.import_picks"
    bl_file_extensions = ".csv"

    @classmethod
    def poll_drop(cls, context: bpy.types.Context) -> bool:
        return context.area is not None and context.area.type == "VIEW_3D"


CLASSES = (ROCKFALL_OT_import_picks, ROCKFALL_OT_reconstruct, ROCKFALL_FH_picks)

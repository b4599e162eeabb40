# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 4: timed picks from a table, and the trajectories between them."""

import bpy
from bpy.props import StringProperty

from ....core.exchange.tables import read_picks
from ...scene import georeference, problems, reconstruction, store, sync
from ...view import look
from ...view.from_file import FromFile
from ...view.reporting import possible, reported


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
        picks = read_picks(self.chosen(context), known)
        result = reconstruction.reconstruct_scene(scene, picks)
        if not georeference.has_shift(scene):
            georeference.write_shift(scene, picks.shift)
        reconstruction.show(scene, result)
        sync.follow_spins(scene)
        look.show_relief(context, frame_all=True)
        count = len(set(picks.trajectory.tolist()))
        self.report({"INFO"}, f"{len(picks.time_s)} picks: {count} trajectories, {len(result.impacts.rn)} impacts.")
        return {"FINISHED"}


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

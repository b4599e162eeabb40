# SPDX-License-Identifier: GPL-3.0-or-later
"""Export what was reconstructed."""

from pathlib import Path

import bpy
from bpy.props import StringProperty

from ....core.exchange.output import output_folder
from ....core.exchange.tables import write_impacts, write_picks, write_trajectories
from ....core.reconstruction.sampling import sample_trajectories
from ...scene import project, reconstruction, store, terrain, trails
from ...view.reporting import possible, reported


class _IntoFolder:
    """Mix-in: writes what the picks gave into a folder."""

    bl_options = {"REGISTER"}

    directory: StringProperty(subtype="DIR_PATH")
    filter_folder: bpy.props.BoolProperty(default=True, options={"HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(
            cls,
            store.with_role(context.scene, store.PICK_ROLE),
            "There is nothing to export: import picks first, or load the demo",
        )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}


class ROCKFALL_OT_export_tables(_IntoFolder, bpy.types.Operator):
    """Write picks.csv, impacts.csv and trajectories.csv in survey coordinates"""

    bl_idname = "rockfall.export_tables"
    bl_label = "Export Tables"

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        result = reconstruction.reconstruct_scene(scene)
        samples = sample_trajectories(result, trails.SAMPLE_STEP_S, surface=terrain.surface_of_scene(scene))
        with output_folder(Path(bpy.path.abspath(self.directory))) as folder:
            write_picks(result.picks, folder / "picks.csv")
            write_impacts(result.impacts, folder / "impacts.csv")
            write_trajectories(samples, folder / "trajectories.csv")
        self.report({"INFO"}, f"picks.csv, impacts.csv and trajectories.csv are in {self.directory}.")
        return {"FINISHED"}


class ROCKFALL_OT_export_project(_IntoFolder, bpy.types.Operator):
    """Write project.toml with the picks and the terrain: all that the command line, or another file, needs"""

    bl_idname = "rockfall.export_project"
    bl_label = "Export Project"

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        written = project.save_project(context.scene, Path(bpy.path.abspath(self.directory)))
        self.report({"INFO"}, f"{written.name} is in {self.directory}.")
        return {"FINISHED"}


CLASSES = (ROCKFALL_OT_export_tables, ROCKFALL_OT_export_project)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Export what was reconstructed."""

from collections.abc import Sequence

import bpy
from bpy.props import StringProperty

from ....core.exchange.spin_tables import write_spins
from ....core.exchange.tables import write_impacts, write_picks, write_trajectories
from ....core.output import output_folder
from ....core.progress import Progress
from ....core.reconstruction.sampling import sample_trajectories
from ....core.remarks import Remark
from ...scene import project
from ...scene.picks import reconstruction, spins, trails
from ...scene.simulation import design_sheet, simulation, simulation_setup
from ...scene.storage import store
from ...scene.terrain import terrain
from ...view import job
from ...view.job import InBackground, Work
from ...view.reporting import possible, reported
from ...view.to_file import asked_folder

FACTORS = [(name, title, "") for name, title in design_sheet.factor_tables()]


class _IntoFolder:
    """Mix-in: writes what the picks gave into a folder."""

    bl_options = {"REGISTER"}

    directory: StringProperty(subtype="DIR_PATH")
    filter_folder: bpy.props.BoolProperty(default=True, options={"HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(
            cls,
            store.has_role(context.scene, store.PICK_ROLE),
            "There is nothing to export: import picks first, or load the demo",
        )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}


class ROCKFALL_OT_export_tables(_IntoFolder, bpy.types.Operator):
    """Write picks.csv, impacts.csv, trajectories.csv and, of measured spins, spin.csv in survey coordinates"""

    bl_idname = "rockfall.export_tables"
    bl_label = "Export Tables"

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        measured = spins.measure_all(scene)
        result, left_out = reconstruction.reconstruct_good(scene)
        samples = sample_trajectories(result, trails.SAMPLE_STEP_S, surface=terrain.surface_of_scene(scene))
        with output_folder(asked_folder(self.directory)) as folder:
            write_picks(result.picks, folder / "picks.csv")
            write_impacts(result.impacts, folder / "impacts.csv")
            write_trajectories(samples, folder / "trajectories.csv")
            if measured:
                write_spins(measured, folder / "spin.csv")
        names = "picks.csv, impacts.csv, trajectories.csv" + (", spin.csv" if measured else "")
        _report(self, f"{names} are in {self.directory}.", left_out)
        return {"FINISHED"}


class ROCKFALL_OT_export_simulation(InBackground, _IntoFolder, bpy.types.Operator):
    """Write runs.csv, impacts.csv, trajectories.csv and summary.json of the shown simulation, in survey coordinates"""

    bl_idname = "rockfall.export_simulation"
    bl_label = "Export Simulation"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        scene = context.scene
        if not possible(cls, simulation.blocks_of(scene), "Nothing simulated is shown: simulate first, in step 7"):
            return False
        return possible(cls, not simulation_setup.is_stale(scene), "Settings have changed since: simulate again first")

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        return _IntoFolder.invoke(self, context, event)

    def prepare(self, context: bpy.types.Context) -> Work:
        plan, folder = simulation_setup.plan(context.scene), asked_folder(self.directory)
        counts = simulation_setup.shown_counts(context.scene)

        def compute(progress: Progress) -> object:
            return simulation_setup.export(plan, counts, folder, progress)

        def keep(scene: bpy.types.Scene, written: object) -> str:
            return f"{', '.join(written)} are in {folder}."

        return Work("share", compute, keep)

    def execute(self, context: bpy.types.Context) -> set[str]:
        return InBackground.execute(self, context) if bpy.app.background else self._begin(context)


class ROCKFALL_OT_design_sheet(InBackground, _IntoFolder, bpy.types.Operator):
    """Write the design sheet of the drawn screens: what barriers there must have, with the measured evidence"""

    bl_idname = "rockfall.design_sheet"
    bl_label = "Design Sheet"

    factors: bpy.props.EnumProperty(
        name="Partial factors", description="Editable tables, to be checked against the standard", items=FACTORS
    )
    holdout: bpy.props.BoolProperty(
        name="Predict left-out trajectories", default=True,
        description="How well each model predicts measured trajectories that it was not fitted to; takes longer",
    )  # fmt: skip

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        lacking = design_sheet.missing(context.scene)
        return possible(cls, not lacking, lacking) and job.is_free(cls)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        return _IntoFolder.invoke(self, context, event)

    def prepare(self, context: bpy.types.Context) -> Work:
        asked = design_sheet.ask(context.scene, self.factors, self.holdout)
        folder = asked_folder(self.directory)

        def compute(progress: Progress) -> object:
            return design_sheet.write(asked, folder, progress)

        def keep(scene: bpy.types.Scene, written: object) -> str:
            return f"{', '.join(written)} are in {folder}."

        return Work("share", compute, keep)

    def execute(self, context: bpy.types.Context) -> set[str]:
        return InBackground.execute(self, context) if bpy.app.background else self._begin(context)


class ROCKFALL_OT_export_project(_IntoFolder, bpy.types.Operator):
    """Write project.toml with the picks and the terrain: all that the command line, or another file, needs"""

    bl_idname = "rockfall.export_project"
    bl_label = "Export Project"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        there = any(store.has_role(context.scene, role) for role in (store.PICK_ROLE, store.TERRAIN_ROLE))
        return possible(cls, there, "There is nothing to export: import a terrain or picks first, or load the demo")

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        written, left_out = project.save_project(context.scene, asked_folder(self.directory))
        _report(self, f"{written.name} is in {self.directory}.", left_out)
        return {"FINISHED"}


def _report(operator: bpy.types.Operator, text: str, left_out: Sequence[Remark]) -> None:
    """Say what was written; when something is missing in it, that first."""
    if not left_out:
        operator.report({"INFO"}, text)
        return
    more = f" {len(left_out) - 1} more remarks are in step 4." if len(left_out) > 1 else ""
    operator.report({"WARNING"}, f"Something is missing: {left_out[0].text}{more} The rest is written: {text}")


CLASSES = (
    ROCKFALL_OT_export_tables,
    ROCKFALL_OT_export_simulation,
    ROCKFALL_OT_design_sheet,
    ROCKFALL_OT_export_project,
)

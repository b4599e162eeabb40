# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps are computed in the background, taken away, and written for a GIS."""

import bpy
from bpy.props import BoolProperty, StringProperty

from ....core.exchange.face_maps import write_face_maps
from ....core.exchange.map_output import draw_maps, write_maps
from ....core.impact_models.registry import find_model
from ....core.output import output_folder
from ....core.progress import Progress
from ....core.workflow.simulation_output import WITH_BARRIERS
from ...scene import georeference, hazard_maps, simulation_setup, store
from ...view import job
from ...view.job import InBackground, Work
from ...view.reporting import possible
from ...view.to_file import asked_folder


class ROCKFALL_OT_compute_maps(InBackground, bpy.types.Operator):
    """Let many blocks fall, in the background, and count in each cell of the terrain what passes"""

    bl_idname = "rockfall.compute_maps"
    bl_label = "Compute Maps"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        lacking = simulation_setup.missing(context.scene, [context.scene.rockfall_simulation.map_model])
        return possible(cls, not lacking, lacking) and job.is_free(cls)

    def prepare(self, context: bpy.types.Context) -> Work:
        planned, said = hazard_maps.plan(context.scene), hazard_maps.fingerprint(context.scene)

        def compute(progress: Progress) -> object:
            return hazard_maps.run(planned, progress)

        def keep(scene: bpy.types.Scene, found: object) -> str:
            hazard_maps.show(scene, found, planned.model, said)
            return found.remarks[0].text

        return Work("maps", compute, keep, keeps_part=True)


class ROCKFALL_OT_remove_maps(bpy.types.Operator):
    """Take the maps off the terrain, and out of the file"""

    bl_idname = "rockfall.remove_maps"
    bl_label = "Remove Maps"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(cls, hazard_maps.maps_of(context.scene), "There are no maps")

    def execute(self, context: bpy.types.Context) -> set[str]:
        hazard_maps.remove(context.scene)
        return {"FINISHED"}


class ROCKFALL_OT_export_maps(InBackground, bpy.types.Operator):
    """Write all maps as GeoTIFF with styles for QGIS, those of the faces as GeoPackage and table, and figures of the
    most important ones"""

    bl_idname = "rockfall.export_maps"
    bl_label = "Export Maps"
    bl_options = {"REGISTER"}

    directory: StringProperty(subtype="DIR_PATH")
    filter_folder: BoolProperty(default=True, options={"HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not possible(cls, hazard_maps.maps_of(context.scene), "There are no maps: compute them first, in step 7"):
            return False
        return possible(cls, not hazard_maps.is_stale(context.scene), "Settings have changed since: compute them again")

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def prepare(self, context: bpy.types.Context) -> Work:
        scene, folder = context.scene, asked_folder(self.directory)
        obj = hazard_maps.maps_of(scene)
        maps, model, held = hazard_maps.read(obj), str(obj[store.MODEL]), hazard_maps.with_barriers(obj)
        faces = hazard_maps.faces_of(scene)
        surface, shift = simulation_setup.ground(scene), georeference.read_shift(scene)
        seed = str(scene.rockfall_simulation.seed)

        def compute(progress: Progress) -> object:
            with output_folder(folder) as staged:
                place, about, said = staged, {"MODEL": model, "SEED": seed}, find_model(model).title
                if held:  # the same names as on the command line
                    place, said = staged / WITH_BARRIERS, f"{said}, with the barriers"
                    about["BARRIERS"] = "yes"
                written = write_maps(maps, surface, place, shift, about, progress)
                written += [] if faces is None else write_face_maps(faces, place, shift, about)
                return written + draw_maps(maps, surface, place, said=said, progress=progress)

        def keep(scene: bpy.types.Scene, written: object) -> str:
            return f"{len(written)} files of {len(maps.layers)} maps are in {folder}."

        return Work("maps", compute, keep)

    def execute(self, context: bpy.types.Context) -> set[str]:
        return InBackground.execute(self, context) if bpy.app.background else self._begin(context)


CLASSES = (ROCKFALL_OT_compute_maps, ROCKFALL_OT_remove_maps, ROCKFALL_OT_export_maps)

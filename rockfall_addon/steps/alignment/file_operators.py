# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 3: pairs and cameras from files and to files."""

from pathlib import Path

import bpy
import numpy as np
from bpy.props import BoolProperty, StringProperty
from bpy_extras.io_utils import ExportHelper

from ....core.errors import RockfallError
from ...scene.footage import alignment, pairs, videos
from ...view.from_file import FromFile
from ...view.of_video import OfVideo, has_solved, has_video
from ...view.reporting import possible, reported
from ...view.to_file import asked_file
from . import files


class _IntoFile(ExportHelper):
    """Mix-in: `write` puts what is known of the shown camera into the chosen file, and says what it wrote."""

    bl_options = {"REGISTER"}

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            written = self.write(context.scene, videos.active_camera(context.scene))
        except OSError as error:
            raise RockfallError(
                f"{Path(self.filepath).name} cannot be written there: {error.strerror}. Choose another place."
            ) from None
        self.report({"INFO"}, written)
        return {"FINISHED"}


class ROCKFALL_OT_import_pairs(OfVideo, FromFile, bpy.types.Operator):
    """Import pairs of pixels and surveyed points (pairs.csv) for the shown camera"""

    bl_idname = "rockfall.import_pairs"
    bl_label = "Import Pairs"

    filter_glob: StringProperty(default="*.csv", options={"HIDDEN"})

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene, camera = context.scene, videos.active_camera(context.scene)
        said = files.import_pairs(scene, camera, self.chosen(context))
        solution = alignment.solution_of(camera)
        fit = f" They fit to {solution.rmse_px:.2f} px." if np.isfinite(solution.rmse_px) else ""
        self.report({"INFO"}, f"{' '.join(said)}{fit}")
        return {"FINISHED"}


class ROCKFALL_OT_export_pairs(_IntoFile, bpy.types.Operator):
    """Write the complete pairs, with survey coordinates"""

    bl_idname = "rockfall.export_pairs"
    bl_label = "Export Pairs"

    filename_ext = ".csv"
    filter_glob: StringProperty(default="*.csv", options={"HIDDEN"})
    filepath: StringProperty(subtype="FILE_PATH", default="pairs.csv")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not has_video(cls, context):
            return False
        return possible(cls, pairs.complete_of(videos.active_camera(context.scene)), "There are no complete pairs")

    def write(self, scene: bpy.types.Scene, camera: bpy.types.Object) -> str:
        path = asked_file(self.filepath)
        return f"{files.export_pairs(scene, camera, path)} pairs written to {path.name}"


class ROCKFALL_OT_import_camera(OfVideo, FromFile, bpy.types.Operator):
    """Take a solved camera, or a calibrated lens, from camera.toml"""

    bl_idname = "rockfall.import_camera"
    bl_label = "Import Camera"

    filter_glob: StringProperty(default="*.toml", options={"HIDDEN"})
    lens_only: BoolProperty(
        name="Lens only", description="Take the focal length, the centre and the distortion, and leave the place"
    )

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene, camera = context.scene, videos.active_camera(context.scene)
        files.import_camera(scene, camera, self.chosen(context), lens_only=self.lens_only)
        return {"FINISHED"}


class ROCKFALL_OT_export_camera(_IntoFile, bpy.types.Operator):
    """Write the camera as camera.toml, and beside it what is left of its pairs as pairs_residuals.csv"""

    bl_idname = "rockfall.export_camera"
    bl_label = "Export Camera"

    filename_ext = ".toml"
    filter_glob: StringProperty(default="*.toml", options={"HIDDEN"})
    filepath: StringProperty(subtype="FILE_PATH", default="camera.toml")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_solved(cls, context, "The camera is not solved yet")

    def write(self, scene: bpy.types.Scene, camera: bpy.types.Object) -> str:
        return f"Written: {', '.join(files.export_camera(scene, camera, asked_file(self.filepath)))}"


CLASSES = (
    ROCKFALL_OT_import_pairs,
    ROCKFALL_OT_export_pairs,
    ROCKFALL_OT_import_camera,
    ROCKFALL_OT_export_camera,
)

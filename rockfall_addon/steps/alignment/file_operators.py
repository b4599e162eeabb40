# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 3: pairs and cameras from files and to files."""

from pathlib import Path

import bpy
import numpy as np
from bpy.props import BoolProperty, StringProperty
from bpy_extras.io_utils import ExportHelper, ImportHelper

from ....core.errors import RockfallError
from ...scene import alignment, camera_paths, pairs, videos
from ...view.of_video import OfVideo, has_video
from ...view.reporting import reported
from . import files


class ROCKFALL_OT_import_pairs(OfVideo, bpy.types.Operator, ImportHelper):
    """Import pairs of pixels and surveyed points (pairs.csv) for the shown camera"""

    bl_idname = "rockfall.import_pairs"
    bl_label = "Import Pairs"

    filter_glob: StringProperty(default="*.csv", options={"HIDDEN"})
    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene, camera = context.scene, videos.active_camera(context.scene)
        count = files.import_pairs(scene, camera, self.filepath)
        solution = alignment.solution_of(camera)
        fit = f" They fit to {solution.rmse_px:.2f} px." if np.isfinite(solution.rmse_px) else ""
        self.report({"INFO"}, f"{count} pairs.{fit}")
        return {"FINISHED"}


class ROCKFALL_OT_export_pairs(bpy.types.Operator, ExportHelper):
    """Write the complete pairs, with survey coordinates"""

    bl_idname = "rockfall.export_pairs"
    bl_label = "Export Pairs"
    bl_options = {"REGISTER"}

    filename_ext = ".csv"
    filter_glob: StringProperty(default="*.csv", options={"HIDDEN"})
    filepath: StringProperty(subtype="FILE_PATH", default="pairs.csv")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not has_video(cls, context):
            return False
        if pairs.complete_of(videos.active_camera(context.scene)):
            return True
        cls.poll_message_set("There are no complete pairs")
        return False

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        camera = videos.active_camera(context.scene)
        count = _written(files.export_pairs, context.scene, camera, self.filepath)
        self.report({"INFO"}, f"{count} pairs written to {Path(self.filepath).name}")
        return {"FINISHED"}


class ROCKFALL_OT_import_camera(OfVideo, bpy.types.Operator, ImportHelper):
    """Take a solved camera, or a calibrated lens, from camera.toml"""

    bl_idname = "rockfall.import_camera"
    bl_label = "Import Camera"

    filter_glob: StringProperty(default="*.toml", options={"HIDDEN"})
    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    lens_only: BoolProperty(
        name="Lens only", description="Take the focal length, the centre and the distortion, and leave the place"
    )

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene, camera = context.scene, videos.active_camera(context.scene)
        files.import_camera(scene, camera, self.filepath, lens_only=self.lens_only)
        return {"FINISHED"}


class ROCKFALL_OT_export_camera(bpy.types.Operator, ExportHelper):
    """Write the camera as camera.toml and what is left of its pairs as pairs_residuals.csv"""

    bl_idname = "rockfall.export_camera"
    bl_label = "Export Camera"
    bl_options = {"REGISTER"}

    filename_ext = ".toml"
    filter_glob: StringProperty(default="*.toml", options={"HIDDEN"})
    filepath: StringProperty(subtype="FILE_PATH", default="camera.toml")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not has_video(cls, context):
            return False
        if camera_paths.is_solved(videos.active_camera(context.scene)):
            return True
        cls.poll_message_set("The camera is not solved yet")
        return False

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        camera = videos.active_camera(context.scene)
        names = _written(files.export_camera, context.scene, camera, self.filepath)
        self.report({"INFO"}, f"Written: {', '.join(names)}")
        return {"FINISHED"}


def _written(write: object, scene: bpy.types.Scene, camera: bpy.types.Object, path: str) -> object:
    try:
        return write(scene, camera, path)
    except OSError as error:
        raise RockfallError(
            f"{Path(path).name} cannot be written there: {error.strerror}. Choose another place."
        ) from None


CLASSES = (
    ROCKFALL_OT_import_pairs,
    ROCKFALL_OT_export_pairs,
    ROCKFALL_OT_import_camera,
    ROCKFALL_OT_export_camera,
)

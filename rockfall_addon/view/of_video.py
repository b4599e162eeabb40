# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators share that work on the active camera's video."""

import bpy

from ..scene.footage import camera_paths, videos
from .reporting import possible


def has_video(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Whether there is a video; if not, what to do."""
    return possible(cls, videos.active_camera(context.scene) is not None, "Add a video first")


def has_solved(
    cls: type[bpy.types.Operator], context: bpy.types.Context, otherwise: str = "First solve the camera in one frame"
) -> bool:
    """Whether the video's camera is solved; if not, what to do."""
    if not has_video(cls, context):
        return False
    return possible(cls, camera_paths.is_solved(videos.active_camera(context.scene)), otherwise)


class OfVideo:
    """Mix-in: works on the active camera's video."""

    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_video(cls, context)

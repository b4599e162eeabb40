# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators share that work on the active camera's video."""

import bpy

from ..scene import videos


def has_video(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Whether there is a video; if not, what to do."""
    if videos.active_camera(context.scene) is not None:
        return True
    cls.poll_message_set("Add a video first")
    return False


class OfVideo:
    """Mix-in: works on the active camera's video."""

    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_video(cls, context)

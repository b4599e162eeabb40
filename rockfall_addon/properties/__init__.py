# SPDX-License-Identifier: GPL-3.0-or-later
"""What is stored in the .blend: the scene's settings. Doubles and picks are ID properties, see `bridge`."""

import bpy

from .settings import SceneSettings


def register() -> None:
    bpy.utils.register_class(SceneSettings)
    bpy.types.Scene.rockfall = bpy.props.PointerProperty(type=SceneSettings)


def unregister() -> None:
    del bpy.types.Scene.rockfall
    bpy.utils.unregister_class(SceneSettings)

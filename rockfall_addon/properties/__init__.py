# SPDX-License-Identifier: GPL-3.0-or-later
"""What is stored in the .blend: the scene's settings. Doubles and picks are ID properties, see `bridge`."""

import bpy

from . import alignment
from .impacts import ImpactRow, PickProperties
from .picking import PickingSettings
from .settings import SceneSettings
from .terrain import TerrainSettings
from .videos import VideoProperties, VideoSettings

GROUPS = {
    "rockfall": SceneSettings,
    "rockfall_terrain": TerrainSettings,
    "rockfall_videos": VideoSettings,
    "rockfall_picking": PickingSettings,
}
"""Property of a scene → its group."""


def register() -> None:
    for name, group in GROUPS.items():
        bpy.utils.register_class(group)
        setattr(bpy.types.Scene, name, bpy.props.PointerProperty(type=group))
    bpy.utils.register_class(ImpactRow)
    bpy.types.Scene.rockfall_impacts = bpy.props.CollectionProperty(type=ImpactRow)
    bpy.utils.register_class(PickProperties)
    bpy.types.Object.rockfall_pick = bpy.props.PointerProperty(type=PickProperties)
    bpy.utils.register_class(VideoProperties)
    bpy.types.Object.rockfall_video = bpy.props.PointerProperty(type=VideoProperties)
    alignment.register()


def unregister() -> None:
    alignment.unregister()
    del bpy.types.Object.rockfall_video
    bpy.utils.unregister_class(VideoProperties)
    del bpy.types.Object.rockfall_pick
    bpy.utils.unregister_class(PickProperties)
    del bpy.types.Scene.rockfall_impacts
    bpy.utils.unregister_class(ImpactRow)
    for name, group in reversed(GROUPS.items()):
        delattr(bpy.types.Scene, name)
        bpy.utils.unregister_class(group)

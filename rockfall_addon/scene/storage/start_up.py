# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender's own start-up scene holds, which is in the way of a slope."""

import bpy

from . import store

CUBE_VERTICES = 8


def is_untouched(scene: bpy.types.Scene) -> bool:
    """Whether nothing of ours is in the scene yet."""
    return not any(store.ROLE in obj for obj in scene.objects)


def put_away(scene: bpy.types.Scene) -> None:
    """Hide the cube, the light and the camera of the start-up scene; the cube is no longer the active object."""
    for obj in scene.objects:
        cube = obj.name == "Cube" and obj.type == "MESH" and len(obj.data.vertices) == CUBE_VERTICES
        if store.ROLE in obj or not (cube or (obj.name, obj.type) in (("Light", "LIGHT"), ("Camera", "CAMERA"))):
            continue
        for layer in scene.view_layers:
            if obj.name not in layer.objects:
                continue
            if layer.objects.active == obj and obj.mode == "OBJECT":
                layer.objects.active = None
            obj.hide_set(True, view_layer=layer)
        obj.hide_render = True

# SPDX-License-Identifier: GPL-3.0-or-later
"""Footage and terrain in one view: the footage lies in front, more or less transparent, or left of a line."""

import bpy

from ..storage import store


def background_of(camera: bpy.types.Object) -> bpy.types.CameraBackgroundImage | None:
    """The footage of a camera; None when somebody took it away."""
    return next(iter(camera.data.background_images), None)


def blend_of(camera: bpy.types.Object) -> float:
    """How much the footage covers, 0…1."""
    background = background_of(camera)
    if background is None:
        return 0.0
    return (
        float(camera.get(store.IMAGE_BLEND, background.alpha))
        if camera.rockfall_alignment.use_wipe
        else background.alpha
    )


def set_blend(camera: bpy.types.Object, value: float) -> None:
    """Lay the footage over the terrain, more or less transparent."""
    background = background_of(camera)
    if background is None:
        return
    background.display_depth = "FRONT"
    camera.data.show_background_images = True
    if camera.rockfall_alignment.use_wipe:
        camera[store.IMAGE_BLEND] = float(value)
    else:
        background.alpha = value


def follow_wipe(camera: bpy.types.Object) -> None:
    """While there is a wipe, the footage is drawn by our overlay and not by Blender."""
    background = background_of(camera)
    if background is None:
        return
    if camera.rockfall_alignment.use_wipe:
        camera[store.IMAGE_BLEND] = float(background.alpha)
        background.alpha = 0.0
    else:
        background.display_depth = "FRONT"
        background.alpha = float(camera.get(store.IMAGE_BLEND, 1.0))

# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene's settings before it was set up for a film, so that they can be put back."""

import bpy

from ...scene.storage import store

SETTINGS = (
    "render.engine", "render.resolution_x", "render.resolution_y", "render.resolution_percentage",
    "render.frame_map_old", "render.frame_map_new", "render.fps", "render.fps_base", "render.filepath",
    "render.image_settings.media_type", "render.image_settings.file_format", "render.film_transparent",
    "render.use_persistent_data", "view_settings.view_transform", "view_settings.look",
    "rockfall.playback", "rockfall.stagger_s", "rockfall.block_scale", "rockfall.trail_radius_m",
    "rockfall.trail_until_now", "frame_start", "frame_end", "frame_current",
)  # fmt: skip


def is_set_up(scene: bpy.types.Scene) -> bool:
    return store.BEFORE_FILM in scene


def remember(scene: bpy.types.Scene) -> None:
    """Keep the settings, unless they are kept already."""
    if store.BEFORE_FILM not in scene:
        values = {name: getattr(*owner(scene, name)) for name in SETTINGS}
        scene[store.BEFORE_FILM] = {**values, "camera": scene.camera.name if scene.camera else ""}


def put_back(scene: bpy.types.Scene) -> None:
    """Restore what was kept."""
    before = scene[store.BEFORE_FILM].to_dict()
    del scene[store.BEFORE_FILM]
    scene.pop(store.FILM_OF, None)
    scene.camera = scene.objects.get(before.pop("camera"))
    for name, value in before.items():
        place, attribute = owner(scene, name)
        if getattr(place, attribute) != value:
            setattr(place, attribute, value)


def owner(scene: bpy.types.Scene, name: str) -> tuple[bpy.types.bpy_struct, str]:
    """What has a setting, and the setting's name there."""
    path, _, attribute = name.rpartition(".")
    return (scene.path_resolve(path) if path else scene), attribute


def value(scene: bpy.types.Scene, name: str) -> object:
    """A setting as it was before."""
    return scene[store.BEFORE_FILM][name]

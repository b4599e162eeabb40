# SPDX-License-Identifier: GPL-3.0-or-later
"""Small copies of large footage, which Blender writes and plays in place of it."""

import bpy

from ....core.errors import RockfallError
from ...scene.footage import video_files

SIZES = (25, 50)


def build(context: bpy.types.Context, camera: bpy.types.Object, percent: int) -> None:
    """Let Blender write a copy of `percent` of the size, and show it behind the camera.

    Raises
    ------
    RockfallError : the file has moved, its footage is gone, or there is no window: Blender builds proxies in one only.
    """
    video_files.video_of(camera)
    clip = video_files.clip_of(camera)
    if clip is None:
        raise RockfallError(f"{camera.name} has no footage behind it any more. Use Find the File to get it back.")
    area = max(context.screen.areas, key=lambda one: one.width * one.height) if context.screen else None
    if area is None:
        raise RockfallError("Blender builds proxies in a window only. Open the file in Blender's window and try again.")
    clip.use_proxy = True
    for size in (25, 50, 75, 100):
        setattr(clip.proxy, f"build_{size}", size == percent)
    for name in ("build_undistorted_25", "build_undistorted_50", "build_undistorted_75", "build_undistorted_100"):
        setattr(clip.proxy, name, False)
    before = area.ui_type
    area.type = "CLIP_EDITOR"
    try:
        area.spaces.active.clip = clip
        region = next(region for region in area.regions if region.type == "WINDOW")
        with context.temp_override(area=area, region=region, space_data=area.spaces.active):
            bpy.ops.clip.rebuild_proxy()
    finally:
        area.ui_type = before
    use(camera, percent)


def use(camera: bpy.types.Object, percent: int) -> None:
    """Show the proxy of a size behind a camera, or, for 100, the full pictures."""
    clip = video_files.clip_of(camera)
    for background in camera.data.background_images:
        if background.clip is not None and background.clip == clip:
            background.clip_user.proxy_render_size = "FULL" if percent == 100 else f"PROXY_{percent}"


def shown(camera: bpy.types.Object) -> str:
    """Which copy is shown, in words; empty when there are none."""
    clip = video_files.clip_of(camera)
    if clip is None or not clip.use_proxy:
        return ""
    sizes = [b.clip_user.proxy_render_size for b in camera.data.background_images if b.clip == clip]
    return "the full pictures" if not sizes or sizes[0] == "FULL" else f"a copy of {sizes[0].split('_')[1]} %"

# SPDX-License-Identifier: GPL-3.0-or-later
"""The loupe: the raw pixels of the video under the mouse, while one of our tools is used in the camera's view."""

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ...core.camera.model import rays
from ...core.errors import RockfallError
from ...core.terrain.raycast import cast_ray
from ...core.vectors import Array
from ..scene import problems
from ..scene.footage import camera_paths, pictures, video_files, videos
from ..scene.picks import places, reconstruction
from . import drawing, footage_view, image_view, pointing, workspace

SHOWN_BY = {"rockfall.pick_tool", "rockfall.spin_tool", "rockfall.align_tool"}
SIDE = 25
"""Pixels of the video along each side."""
OUTSIDE = 40  # grey level
AWAY = 26  # pixels at interface scale 1, between the mouse and the loupe

_handles: list[object] = []


def register() -> None:
    if not bpy.app.background:
        _handles.append(bpy.types.WindowManager.draw_cursor_add(_draw, (), "VIEW_3D", "WINDOW"))


def unregister() -> None:
    while _handles:
        bpy.types.WindowManager.draw_cursor_remove(_handles.pop())


def crop(picture: np.ndarray, pixel: Array) -> np.ndarray:
    """(SIDE, SIDE, 3) uint8 about the pixel in the middle, dark outside of the picture."""
    height, width = picture.shape[:2]
    column, row = (int(value) for value in np.floor(pixel) - SIDE // 2)
    found = np.full((SIDE, SIDE, 3), OUTSIDE, dtype=np.uint8)
    top, left = max(row, 0), max(column, 0)
    bottom, right = min(row + SIDE, height), min(column + SIDE, width)
    if top < bottom and left < right:
        found[top - row : bottom - row, left - column : right - column] = picture[top:bottom, left:right]
    return found


def outline(scene: bpy.types.Scene, camera: bpy.types.Object, pixel: Array) -> Array | None:
    """(49, 2) pixels: the block's outline when it is clicked here; None when that is not on the terrain."""
    surface = reconstruction.ground(scene)
    if surface is None or not camera_paths.is_solved(camera):
        return None
    _, video_s = pictures.picture_time(scene, camera)
    lens = pictures.posed(camera, video_s)
    origin, direction = rays(lens, pixel[None])
    if not np.isfinite(direction).all():
        return None
    hit = cast_ray(surface, origin[0], direction[0])
    if hit is None:
        return None
    radius = places.block_of(scene, places.trajectory(scene)).radius_m
    if scene.rockfall_picking.aim == "CONTACT":
        centre = hit.point + radius * surface.face_normals[hit.face]
    else:
        slope = abs(float(surface.face_normals[hit.face] @ direction[0]))
        centre = hit.point - radius / max(slope, 0.1) * direction[0]
    found = footage_view.ball(lens, centre, radius)
    return found[np.isfinite(found[:, 0])]


@problems.guarded
def _draw(mouse: tuple[int, int]) -> None:
    context = bpy.context
    region, scene = context.region, context.scene
    settings = scene.rockfall_picking
    if region is None or context.region_data is None or not settings.show_loupe or context.mode != "OBJECT":
        return
    tool = context.workspace.tools.from_space_view3d_mode("OBJECT")
    camera = pointing.camera_of(context)
    if tool is None or tool.idname not in SHOWN_BY or camera is None:
        return
    spot = np.array([mouse[0] - region.x, mouse[1] - region.y], dtype=np.float64)
    rectangle = image_view.image_rectangle(region, context.region_data, scene, camera)
    if rectangle is None or not ((spot >= 0) & (spot <= (region.width, region.height))).all():
        return
    pixel = image_view.to_pixel(rectangle, videos.size_of(camera), spot)
    if not ((pixel >= 0) & (pixel <= videos.size_of(camera))).all():
        return
    scale = context.preferences.system.ui_scale
    zoom = settings.loupe_zoom * scale
    frame, _ = pictures.picture_time(scene, camera)
    try:
        part = crop(video_files.picture(camera, frame), pixel)
    except RockfallError:
        return  # the panel Videos tells that the file is gone
    side = SIDE * zoom
    _, _, right, top = workspace.free_part(context.area, region)
    left = mouse[0] + AWAY * scale
    if spot[0] + AWAY * scale + side > right:
        left = mouse[0] - AWAY * scale - side
    low = mouse[1] + AWAY * scale
    if spot[1] + AWAY * scale + side > top:
        low = mouse[1] - AWAY * scale - side
    _picture(part, left, low, side)
    edge = outline(scene, camera, pixel) if tool.idname == "rockfall.pick_tool" else None
    _cross(pixel, left, low, side, zoom, scale, edge)


def _picture(part: np.ndarray, left: float, low: float, side: float) -> None:
    values = np.ones((*part.shape[:2], 4), dtype=np.float32)
    values[:, :, :3] = part[::-1] / 255.0
    data = gpu.types.Buffer("FLOAT", values.size, values.ravel())
    texture = gpu.types.GPUTexture((part.shape[1], part.shape[0]), format="RGBA8", data=data)
    texture.filter_mode(False)
    shader = gpu.shader.from_builtin("IMAGE")
    right, high = left + side, low + side
    corners = [(left, low, 0), (right, low, 0), (left, high, 0), (right, high, 0)]
    batch = batch_for_shader(shader, "TRI_STRIP", {"pos": corners, "texCoord": [(0, 0), (1, 0), (0, 1), (1, 1)]})
    shader.uniform_sampler("image", texture)
    batch.draw(shader)


def _cross(
    pixel: np.ndarray, left: float, low: float, side: float, zoom: float, scale: float, block: np.ndarray | None
) -> None:
    """Frame, crosshair at the very pixel, and the block's outline there."""
    first = np.floor(pixel) - SIDE // 2
    corner = np.array([left, low + side])

    def to_screen(pixels: np.ndarray) -> np.ndarray:
        return corner + (pixels - first) * (zoom, -zoom)

    middle = to_screen(pixel)
    arm, gap = 0.5 * side, 2.0 * zoom
    lines = [
        (middle + (way * gap) * axis, np.clip(middle + way * arm * axis, (left, low), (left + side, low + side)))
        for axis in np.eye(2)
        for way in (-1.0, 1.0)
    ]
    edge = [np.array(one) for one in ((left, low), (left + side, low), (left + side, low + side), (left, low + side))]
    gpu.state.blend_set("ALPHA")
    _plain(np.array(lines), (1.0, 1.0, 1.0, 0.7), scale)
    _plain(np.array([(edge[i], edge[(i + 1) % 4]) for i in range(4)]), (0.0, 0.0, 0.0, 0.9), 2 * scale)
    if block is not None and len(block):
        points = np.clip(to_screen(block), (left, low), (left + side, low + side))
        _plain(np.stack([points[:-1], points[1:]], axis=1), (1.0, 1.0, 0.35, 0.9), 1.5 * scale)
    gpu.state.blend_set("NONE")


def _plain(segments: np.ndarray, colour: tuple[float, float, float, float], width: float) -> None:
    drawing.segments(segments, np.broadcast_to(colour, (*segments.shape[:2], 4)), width)

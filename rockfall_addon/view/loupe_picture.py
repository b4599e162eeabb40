# SPDX-License-Identifier: GPL-3.0-or-later
"""What the loupe shows: the video's raw pixels about one, and how large the block is there."""

import bpy
import numpy as np

from ...core.camera.model import rays
from ...core.terrain.raycast import cast_rays
from ...core.vectors import Array
from ..scene import pictures, places, reconstruction, videos
from . import footage_view

SIDE = 25
"""Pixels of the video along each side."""
OUTSIDE = 40


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
    if surface is None or not videos.is_solved(camera):
        return None
    _, video_s = pictures.picture_time(scene, camera)
    lens = pictures.posed(camera, video_s)
    origin, direction = rays(lens, pixel[None])
    if not np.isfinite(direction).all():
        return None
    hits = cast_rays(surface, origin, direction)
    if hits.face[0] < 0:
        return None
    radius = places.block_of(scene, places.trajectory(scene)).radius_m
    if scene.rockfall_picking.aim == "CONTACT":
        normal = surface.face_normals[hits.face[0]]
        centre = hits.point[0] + radius * normal
    else:
        slope = abs(float(surface.face_normals[hits.face[0]] @ direction[0]))
        centre = hits.point[0] - radius / max(slope, 0.1) * direction[0]
    found = footage_view.ball(lens, centre, radius)
    return found[np.isfinite(found[:, 0])]

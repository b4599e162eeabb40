# SPDX-License-Identifier: GPL-3.0-or-later
"""Blocks in a composed film: solids lit by the sun, with their shadow on the terrain, as the lens shows them.

Every pixel is a ray through the camera, so what is drawn lies where the camera model says, distortion included.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...camera.model import Camera, project, rays
from ...terrain.raycast import any_hit, cast_rays
from ...terrain.surface import Surface
from ...vectors import Array, cross, norm, unit
from .canvas import Canvas
from .look import INK, Colour
from .sight import LEAST_SLACK_M
from .solids import ROUND

AMBIENT = 0.42
SHADOW = 0.6
SUN_DISC = 0.03
"""How soft shadows are: tangent of the angle of the sun's disc, larger than the real one [-]."""
SUN_POINTS = 5
SUBPIXELS, BLURRED_SUBPIXELS = 4, 2
"""Rays across and down a pixel; where the block moves, less for each of the moments."""
ROUND_RIM = 48
UPRIGHT = 0.9
LARGEST_WINDOW = 900
"""A block that fills more pixels across is drawn with one ray a pixel."""


@dataclass(frozen=True, eq=False)
class Pose:
    """Where a block is and how it is turned.

    Attributes
    ----------
    place : (3,) of its centre [m].
    turn : (3, 3) from its own axes to the world.
    """

    place: Array
    turn: Array


def sun_direction(azimuth_deg: float, elevation_deg: float) -> Array:
    """(3,) unit vector towards the sun; the azimuth from north, clockwise."""
    azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
    return np.array([np.sin(azimuth) * np.cos(elevation), np.cos(azimuth) * np.cos(elevation), np.sin(elevation)])


def draw_shadow(canvas: Canvas, camera: Camera, terrain: Surface, solid: Surface, pose: Pose, sun: Array) -> None:
    """The block's shadow on the terrain, soft as the sun is no point."""
    reach = float(norm(solid.vertices).max())
    rim = pose.place + reach * _circle(sun)
    fallen = cast_rays(terrain, rim, -sun).point
    seen = project(camera, fallen[np.isfinite(fallen[:, 0])])
    seen = seen[np.isfinite(seen[:, 0])]
    if not len(seen):
        return
    box = _pixels_about(seen, 2.0 + SUN_DISC * 2 * reach, canvas)
    if box is None:
        return
    left, top, right, bottom = box
    origins, towards = _rays_of(camera, box, 1)
    ground = cast_rays(terrain, origins, towards).point
    known = np.isfinite(ground[:, 0])
    share = np.zeros(len(ground))
    suns = [sun, *(unit(sun + SUN_DISC * side) for side in _circle(sun, SUN_POINTS))]
    from_block = (ground[known] - pose.place) @ pose.turn
    for one in suns:
        share[known] += any_hit(solid, from_block, np.broadcast_to(one @ pose.turn, from_block.shape)) / len(suns)
    mask = np.round(255 * share.reshape(bottom - top, right - left)).astype(np.uint8)
    canvas.shade(mask, left, top, INK, SHADOW)


def draw_block(
    canvas: Canvas,
    camera: Camera,
    terrain: Surface | None,
    solid: Surface,
    poses: Sequence[Pose],
    colour: Colour,
    sun: Array,
    opacity: float = 1.0,
) -> None:
    """A block, where no terrain hides it.

    Parameters
    ----------
    solid : about its centre, convex or not.
    poses : at moments evenly spread over the exposure; one for a sharp picture.
    """
    reach = float(norm(solid.vertices).max())
    towards_camera = [unit(camera.position - pose.place) for pose in poses]
    rim = np.concatenate([pose.place + reach * _circle(side) for pose, side in zip(poses, towards_camera, strict=True)])
    seen = project(camera, rim)
    seen = seen[np.isfinite(seen[:, 0])]
    box = _pixels_about(seen, 1.0, canvas) if len(seen) else None
    if box is None:
        return
    left, top, right, bottom = box
    fine = 1 if right - left > LARGEST_WINDOW else SUBPIXELS if len(poses) == 1 else BLURRED_SUBPIXELS
    origins, directions = _rays_of(camera, box, fine)
    smooth = solid.name == ROUND
    light, cover = np.zeros(len(origins)), np.zeros(len(origins))
    for pose in poses:
        hits = cast_rays(solid, (origins - pose.place) @ pose.turn, directions @ pose.turn)
        met = np.flatnonzero(hits.face >= 0)
        if terrain is not None and met.size:
            room = np.maximum(hits.distance[met] - LEAST_SLACK_M, 0.0)
            met = met[~any_hit(terrain, origins[met], directions[met], room)]
        normal = unit(hits.point[met] / _squares(solid)) if smooth else solid.face_normals[hits.face[met]]
        shade = AMBIENT + (1 - AMBIENT) * np.maximum(normal @ (pose.turn.T @ sun), 0.0)
        light[met] += shade / len(poses)
        cover[met] += 1 / len(poses)
    shape = (bottom - top, fine, right - left, fine)
    light, cover = (values.reshape(shape).mean(axis=(1, 3)) * opacity for values in (light, cover))
    under = canvas.picture[top:bottom, left:right]
    paint = 255 * np.array(colour[::-1]) * light[:, :, None]
    under[...] = np.clip(under * (1 - cover[:, :, None]) + paint + 0.5, 0, 255).astype(np.uint8)


def block_pixels(camera: Camera, place: Array, radius_m: float) -> tuple[Array, float]:
    """Centre (2,) and radius [px] of a ball's outline as the camera shows it; NaN where it is not seen."""
    rim = project(camera, place + radius_m * _circle(unit(camera.position - place)))
    centre = project(camera, place[None])[0]
    return centre, float(np.mean(np.hypot(*(rim - centre).T)))


def _squares(solid: Surface) -> Array:
    """(3,) of the half axes of a solid that is an ellipsoid [m²]: its normal is that of x²/a² + y²/b² + z²/c²."""
    return np.abs(solid.vertices).max(axis=0) ** 2


def _circle(axis: Array, points: int = ROUND_RIM) -> Array:
    """(n, 3) unit vectors at right angles to an axis."""
    aside = unit(cross(axis, np.eye(3)[2 if abs(axis[2]) < UPRIGHT else 0]))
    angle = np.linspace(0.0, 2 * np.pi, points, endpoint=False)[:, None]
    return np.cos(angle) * aside + np.sin(angle) * cross(axis, aside)


def _pixels_about(seen: Array, around: float, canvas: Canvas) -> tuple[int, int, int, int] | None:
    """Left, top, right and bottom of the picture's part with some places and a border; None for nothing."""
    height, width = canvas.picture.shape[:2]
    low, high = np.floor(seen.min(axis=0) - around), np.ceil(seen.max(axis=0) + around)
    (left, top), (right, bottom) = np.clip(low, 0, (width, height)), np.clip(high, 0, (width, height))
    return (int(left), int(top), int(right), int(bottom)) if right > left and bottom > top else None


def _rays_of(camera: Camera, box: tuple[int, int, int, int], fine: int) -> tuple[Array, Array]:
    """Origins and directions through a part of the picture, row by row, `fine` × `fine` a pixel."""
    left, top, right, bottom = box
    u = left + (np.arange((right - left) * fine) + 0.5) / fine
    v = top + (np.arange((bottom - top) * fine) + 0.5) / fine
    return rays(camera, np.column_stack([np.tile(u, v.size), np.repeat(v, u.size)]))

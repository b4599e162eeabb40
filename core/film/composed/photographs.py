# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours of the terrain from pictures of it, whose cameras are known: only where it is seen."""

from dataclasses import dataclass

import numpy as np

from ...camera.model import Camera, project
from ...opencv import opencv
from ...terrain.raycast import any_hit
from ...terrain.surface import Surface
from ...vectors import Array, dot, norm
from .canvas import Picture

LIFT_M = 0.05
"""Above the ground, where it is asked what is seen from it: scans have noise."""
FLATTEST = 0.12
"""Sine of the angle at which a photograph meets the ground: below it, it is smeared."""
LEAST_WEIGHT = 0.02
BORDER = 0.03
"""Part of a photograph at its border over which it fades out."""
ROW = 4096


@dataclass(frozen=True, eq=False)
class Photograph:
    """A picture of the slope and the camera that took it.

    Attributes
    ----------
    picture : (h, w, 3) BGR uint8, without moving things.
    camera : of that picture.
    """

    picture: Picture
    camera: Camera


def photographed(
    surface: Surface, photographs: tuple[Photograph, ...], behind: Surface | None = None
) -> tuple[Array, Array]:
    """The colours of a terrain in photographs, and how much each counts.

    Parameters
    ----------
    photographs : where several show a place, the median of them: what moves is gone where three do.
    behind : what hides places from the cameras; the terrain itself when None.

    Returns
    -------
    (n, 3) sRGB of the vertices, 0…1, and (n,) from 0, where no photograph shows them, to 1.
    """
    normals = np.nan_to_num(surface.vertex_normals, nan=0.0)
    hiding = surface if behind is None else behind
    shown = [_photographed(surface, hiding, normals, photograph) for photograph in photographs]
    colours, weight = np.zeros((len(normals), 3)), np.zeros(len(normals))
    if not shown:
        return colours, weight
    weights = np.array([one for _, one in shown])
    known = weights > LEAST_WEIGHT
    each = np.where(known[:, :, None], np.array([colour for colour, _ in shown]), np.nan)
    seen = known.any(axis=0)
    colours[seen] = np.nanmedian(each[:, seen], axis=0)
    weight[seen] = weights.max(axis=0)[seen]
    return colours, weight


def _photographed(
    surface: Surface, hiding: Surface, normals: Array, photograph: Photograph
) -> tuple[np.ndarray, Array]:
    """For each vertex: the photograph's colour (n, 3), and how much it counts (n,)."""
    camera, (height, width) = photograph.camera, photograph.picture.shape[:2]
    where = project(camera, surface.vertices)
    inside = np.isfinite(where).all(axis=1) & (where > 0).all(axis=1) & (where < [width, height]).all(axis=1)
    away = surface.vertices - camera.position
    distance = norm(away)
    square = np.where(inside, -dot(normals, away) / np.maximum(distance, 1e-9), 0.0)
    asked = np.flatnonzero(inside & (square > 0))
    hidden = any_hit(hiding, camera.position, away[asked], np.maximum(distance[asked] - 4 * LIFT_M, 0.0))
    seen = np.zeros(len(where), dtype=bool)
    seen[asked[~hidden]] = True
    colour = _sampled(photograph.picture, np.nan_to_num(where, nan=-1.0))
    border = np.minimum(where, [width, height] - where).min(axis=1) / (BORDER * min(width, height))
    weight = np.where(seen, np.clip(border, 0, 1) * np.clip(square / (2 * FLATTEST), 0, 1), 0.0)
    return colour[:, ::-1].astype(np.float32) / 255, smoothed(surface, np.nan_to_num(weight))


def _sampled(picture: Picture, where: Array) -> Picture:
    """(n, 3) of a picture at pixels (n, 2), in rows that are not too long for OpenCV."""
    cv2, n = opencv(), len(where)
    grid = np.resize(where - 0.5, (-(-n // ROW), ROW, 2)).astype(np.float32)
    found: Picture = cv2.remap(
        picture,
        np.ascontiguousarray(grid[..., 0]),
        np.ascontiguousarray(grid[..., 1]),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return found.reshape(-1, 3)[:n]


def smoothed(surface: Surface, values: Array) -> Array:
    """Values (n,) of vertices, mixed with those around them: the borders of shadows and pictures are soft."""
    corners = surface.faces.ravel()
    number = np.maximum(np.bincount(corners, minlength=len(values)), 1)
    for _ in range(2):
        of_faces = np.repeat(values[surface.faces].mean(axis=1), 3)
        values = np.where(number > 0, np.bincount(corners, of_faces, len(values)) / number, values)
    return values

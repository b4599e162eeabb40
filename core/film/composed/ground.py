# SPDX-License-Identifier: GPL-3.0-or-later
"""The terrain in a composed film: every pixel is a ray, so that a lens bends it as it bends the footage."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, get_args

import numpy as np

from ...camera.model import Camera, rays
from ...compiled import in_chunks
from ...errors import InputError
from ...terrain.raycast import any_hit, cast_rays
from ...terrain.surface import Surface
from ...vectors import Array, Mask, norm
from .canvas import Picture
from .photographs import LIFT_M, Photograph, photographed, smoothed

ROCK = np.array([0.70, 0.67, 0.62])
"""sRGB of the ground whose colour nothing tells."""
TerrainColours = Literal["auto", "footage", "scan", "none"]
"""Where a terrain has its colours from: the footage, where that shows it, else the scan; one of them; none."""
FROM_FOOTAGE, FROM_SCAN = ("auto", "footage"), ("auto", "scan")
SCAN_SHADE, SCAN_LIGHT = 0.55, 0.6
"""Colours of a scan have a light of their own; so much of them is left in the shade, and so much more in the sun."""
SKY_TOP, SKY_LOW = np.array([0.52, 0.63, 0.74]), np.array([0.86, 0.89, 0.91])
AMBIENT = 0.46
EDGE = 0.01
"""A pixel at which 1/distance bends by more than this part is at an edge, and gets more rays."""
EDGE_RAYS = 3
NEAREST_M = 1.0
ROWS = 64
"""Of a picture that are cast at once: memory stays small."""


@dataclass(frozen=True, eq=False)
class Ground:
    """A terrain that is ready to be drawn.

    Attributes
    ----------
    surface : the terrain.
    colours : (n, 3) sRGB of its vertices, light and shadow included, 0…1.
    """

    surface: Surface
    colours: Array

    @cached_property
    def bgr(self) -> np.ndarray:
        """(n, 3) float32, 0…255, blue first."""
        return np.ascontiguousarray((255 * self.colours[:, ::-1]).astype(np.float32))


def check_terrain_colours(name: str) -> TerrainColours:
    """A name as a choice.

    Raises
    ------
    InputError : there is no such choice.
    """
    for known in get_args(TerrainColours):
        if name == known:
            return known
    raise InputError(
        f"Terrain colours cannot be from {name!r}", advice=f"Choose one of {', '.join(get_args(TerrainColours))}"
    )


def coloured(surface: Surface, wanted: TerrainColours) -> Surface:
    """A terrain without its own colours, if they are not wanted.

    Raises
    ------
    InputError : they alone are, and it has none.
    """
    if wanted == "scan" and surface.colours is None:
        raise InputError(
            f"The terrain {surface.name} has no colours",
            advice="Export the scan with the colours of its points, or take those of the footage",
        )
    return surface if wanted in FROM_SCAN or surface.colours is None else replace(surface, colours=None)


def lit_ground(surface: Surface, sun: Array, photographs: tuple[Photograph, ...] = ()) -> Ground:
    """A terrain in the light of the sun, in its own colours if it has any.

    Where a photograph shows it, it is in the photograph's, which have their own light.

    Parameters
    ----------
    sun : (3,) unit vector towards it.
    photographs : where several show a place, the median of them: what moves is gone where three do.
    """
    normals = np.nan_to_num(surface.vertex_normals, nan=0.0)
    faces_sun = normals @ sun
    places = surface.vertices + LIFT_M * normals
    lit = np.zeros(len(places))
    towards = faces_sun > 0
    lit[towards] = ~any_hit(surface, places[towards], np.broadcast_to(sun, (int(towards.sum()), 3)))
    lit = smoothed(surface, lit)
    light = AMBIENT + (1 - AMBIENT) * np.clip(faces_sun, 0, 1) * lit
    # Curved ground from above is lighter than hollows: a little sky light, which shows relief in the shade.
    light *= 0.82 + 0.18 * np.clip(normals[:, 2], 0, 1)
    if surface.colours is None:
        colours = np.clip(ROCK * (1.12 * light)[:, None], 0, 1)
    else:
        colours = np.clip(surface.colours / 255 * (SCAN_SHADE + SCAN_LIGHT * light)[:, None], 0, 1)
    if photographs:
        shown, weight = photographed(surface, photographs)
        colours += weight[:, None] * (shown - colours)
    return Ground(surface, colours)


def ground_picture(ground: Ground, camera: Camera) -> tuple[Picture, Array]:
    """What a camera sees of a terrain, before the sky.

    Returns
    -------
    (h, w, 3) BGR uint8, and (h, w) distances along the rays [m], inf where there is sky.
    """
    width, height = camera.width, camera.height
    colour, distance = np.empty((height, width, 3), np.float32), np.empty((height, width))
    columns = np.arange(width) + 0.5
    for top in range(0, height, ROWS):
        rows = np.arange(top, min(top + ROWS, height)) + 0.5
        at = np.column_stack([np.tile(columns, rows.size), np.repeat(rows, width)])
        shown, far = _cast(ground, camera, at)
        colour[top : top + ROWS] = shown.reshape(-1, width, 3)
        distance[top : top + ROWS] = far.reshape(-1, width)
    edge = _edges(distance)
    if edge.any():
        row, column = np.nonzero(edge)
        steps = (np.arange(EDGE_RAYS) + 0.5) / EDGE_RAYS
        offset = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
        at = (np.column_stack([column, row])[:, None] + offset).reshape(-1, 2)
        colour[edge] = _cast(ground, camera, at)[0].reshape(-1, EDGE_RAYS**2, 3).mean(axis=1)
    return np.clip(colour + 0.5, 0, 255).astype(np.uint8), distance


def _cast(ground: Ground, camera: Camera, at: Array) -> tuple[np.ndarray, Array]:
    """(n, 3) float32 colours and (n,) distances through pixels (n, 2)."""
    from .ground_kernels import mix_corners

    surface = ground.surface
    origins, directions = rays(camera, at)
    hits = cast_rays(surface, origins, directions)
    missed = hits.face < 0
    colour = np.empty((len(at), 3), np.float32)
    colour[missed] = _sky(directions[missed])
    in_chunks(
        lambda i, j: mix_corners(hits.point, hits.face, surface.vertices, surface.faces, ground.bgr, colour, i, j),
        len(at),
    )
    return colour, np.where(missed, np.inf, hits.distance)


def _sky(directions: Array) -> np.ndarray:
    up = np.clip(directions[:, 2] / np.maximum(norm(directions), 1e-12), 0, 0.5)[:, None] / 0.5
    return (255 * (SKY_LOW + (SKY_TOP - SKY_LOW) * up))[:, ::-1].astype(np.float32)


def _edges(distance: Array) -> Mask:
    """(h, w) whether the ground is bent or torn there: on a plane, 1/distance changes evenly from pixel to pixel."""
    near = np.where(np.isfinite(distance), 1 / np.maximum(distance, NEAREST_M), 0.0)
    edge = np.zeros(distance.shape, dtype=bool)
    for axis in (0, 1):
        before, here, after = (
            near[i : near.shape[0] - 2 + i] if axis == 0 else near[:, i : near.shape[1] - 2 + i] for i in range(3)
        )
        torn = np.abs(before - 2 * here + after) > EDGE * np.maximum(np.maximum(before, here), after)
        inner = (slice(1, -1), slice(None)) if axis == 0 else (slice(None), slice(1, -1))
        edge[inner] |= torn
    return edge

# SPDX-License-Identifier: GPL-3.0-or-later
"""Shading that shows a slope's relief and where its data are thin, as in figure 3 of Noël et al. 2018."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import InputError
from ..vectors import Array, Mask, dot, norm, unit
from .surface import Surface

EYE_DOME_STEPS = (1, 4, 16)
"""Scales of the eye-dome value, in smoothing steps over neighbours; a scale spans about the root of its steps."""
NOISE_STEPS = 4
CONTRAST = 0.75


@dataclass(frozen=True, eq=False)
class Shading:
    """Values per vertex, (n,).

    Attributes
    ----------
    hillshade : 0 (away from the light) … 1 (facing it).
    eye_dome : 0 (crevice) … 0.5 (even) … 1 (edge).
    density : points per square metre of spanned surface [1/m²].
    thin : where the surface is guessed rather than measured: sparse points, long edges, borders of holes.
    roughness : root mean square distance of the neighbourhood from its own smoothed surface [m].
    """

    hillshade: Array
    eye_dome: Array
    density: Array
    thin: Mask
    roughness: Array


def shade(
    surface: Surface, *, azimuth_deg: float = 315.0, altitude_deg: float = 45.0, thin_spacings: float = 3.0
) -> Shading:
    """Shade a surface from its local orientation.

    Parameters
    ----------
    azimuth_deg, altitude_deg : of the light [°], clockwise from north (y), above the horizon.
    thin_spacings : data are thin where points are this many times further apart than is usual (median) in the file.

    Raises
    ------
    InputError : a light or a multiple that is no number, or a multiple that is not over 1.

    Notes
    -----
    The eye-dome value resembles eye-dome lighting (Boucheny 2009) without a viewpoint: how far a vertex stands out
    of, or lies in, the mean of its neighbours along the normal, at several scales, each relative to what is usual.
    """
    if not (np.isfinite([azimuth_deg, altitude_deg]).all() and np.isfinite(thin_spacings) and thin_spacings > 1):
        raise InputError("The shading needs a light direction in degrees and a multiple of the spacing over 1")
    azimuth, altitude = np.radians([azimuth_deg, altitude_deg])
    light = np.array([np.sin(azimuth) * np.cos(altitude), np.cos(azimuth) * np.cos(altitude), np.sin(altitude)])
    normals = np.nan_to_num(surface.vertex_normals, nan=0.0)
    mean, border, longest = _neighbourhood(surface)

    standing_out, residual = _relief(surface.vertices, normals, mean)
    roughness = np.sqrt(mean @ (mean @ residual**2))

    # The vector area around a vertex is not inflated by noise or vegetation, as the area of its faces would be.
    spanned = surface.vertex_vector_areas
    for _ in range(NOISE_STEPS):
        spanned = mean @ spanned
    density = 1.0 / np.maximum(norm(spanned), 1e-200)
    sparse = density * thin_spacings**2 < np.median(density)
    thin = border | sparse | (longest > thin_spacings * np.median(longest))
    return Shading(np.clip(normals @ light, 0.0, 1.0), 0.5 + 0.5 * np.tanh(standing_out), density, thin, roughness)


def thin_share(surface: Surface, shading: Shading) -> float:
    """The share of a surface's area that is shaded as thin data: 0 … 1."""
    areas = surface.face_areas
    return float(areas @ shading.thin[surface.faces].mean(axis=1) / max(areas.sum(), 1e-200))


def _relief(vertices: Array, normals: Array, mean: Any) -> tuple[Array, Array]:
    """How far vertices stand out over all scales [-], and the residual from the smoothed surface [m]; (n,) each."""
    smooth, orientation = vertices - vertices.mean(axis=0), normals
    origin = smooth
    total, residual = np.zeros(len(vertices)), np.zeros(len(vertices))
    for step in range(1, max(EYE_DOME_STEPS) + 1):
        smooth, orientation = mean @ smooth, mean @ orientation
        if step == NOISE_STEPS:
            residual = dot(unit(orientation), origin - smooth)
        if step in EYE_DOME_STEPS:
            height = np.nan_to_num(dot(unit(orientation), origin - smooth), nan=0.0)
            usual = 1.4826 * np.median(np.abs(height))
            # Heights far below a micrometre are rounding: an even surface stays even.
            total += height / max(usual, 1e-6) * (CONTRAST / len(EYE_DOME_STEPS))
    return total, np.nan_to_num(residual, nan=0.0)


def _neighbourhood(surface: Surface) -> tuple[Any, Mask, Array]:
    """Mean over a vertex and its neighbours (n, n), whether it is on a border (n,), its longest edge [m] (n,)."""
    from scipy.sparse import csr_array, diags_array

    n, faces = len(surface.vertices), surface.faces
    a, b = faces[:, [0, 1, 2]].ravel(), faces[:, [1, 2, 0]].ravel()
    ones = np.ones(2 * len(a), np.float64)
    edges = csr_array((ones, (np.concatenate([a, b]), np.concatenate([b, a]))), shape=(n, n))
    edges.sum_duplicates()
    row = np.repeat(np.arange(n), np.diff(edges.indptr))
    length = norm(surface.vertices[row] - surface.vertices[edges.indices])
    border, longest = np.zeros(n, np.bool_), np.zeros(n)
    border[row[edges.data == 1.0]] = True
    occupied = np.diff(edges.indptr) > 0
    longest[occupied] = np.maximum.reduceat(length, edges.indptr[:-1][occupied])
    edges.data[:] = 1.0
    weights = diags_array(1.0 / (1.0 + np.diff(edges.indptr)))
    mean = (weights @ (edges + diags_array(np.ones(n)))).tocsr()
    return mean, border, longest

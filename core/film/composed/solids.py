# SPDX-License-Identifier: GPL-3.0-or-later
"""The solid that stands for a block in a composed film: made by rule, or scanned; its size is the block's."""

from dataclasses import replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...georeference import GlobalShift
from ...terrain.surface import Surface
from ...vectors import Array

type Solid = Literal["sphere", "ellipsoid", "box", "rock", "eota_111", "eota_221"]
SOLIDS: tuple[str, ...] = get_args(Solid.__value__)
ROUND = "ellipsoid"
"""Name of a surface that is drawn smooth."""
ROUND_POINTS = 600
ROCK_POINTS = 34
"""Corners of an angular block of limestone, about: what of them lies inside the hull is none."""
ROUGH = 0.12
EOTA_EDGE = 1 / 3
"""Side of the squares of the norm block, in parts of its outer size (EAD 340059-00-0106, annex A)."""


def solid(kind: str, diameters_m: Array, seed: int = 0) -> Surface:
    """A closed convex solid about its centre.

    Parameters
    ----------
    kind : one of `SOLIDS`; "rock" is an angular block, another one for each seed; the norm blocks have the proportions
        1:1:1 and 2:2:1, whatever the three diameters, and their volume.
    diameters_m : (3,) along its axes [m].

    Raises
    ------
    InputError : there is no such solid.
    """
    if kind not in SOLIDS:
        raise InputError(f"There is no solid {kind!r}", advice=f"Known solids: {', '.join(SOLIDS)}")
    axes = np.asarray(diameters_m, dtype=np.float64)
    if kind in ("eota_111", "eota_221"):
        side = np.array([1.0, 1.0, 1.0 if kind == "eota_111" else 0.5])
        unit_solid = _hull(_eota())
        # The volume of the ellipsoid that the diameters state, in the norm's proportions.
        wanted = float(np.pi / 6 * axes.prod())
        return _scaled(unit_solid, side * (wanted / (_volume(unit_solid) * side.prod())) ** (1 / 3))
    if kind == "box":
        return _scaled(
            _hull(np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])), axes
        )
    if kind == "rock":
        return _scaled(_hull(_rock(seed)), axes)
    diameters = axes if kind == "ellipsoid" else np.full(3, axes.mean())
    return replace(_scaled(_hull(0.5 * _even(ROUND_POINTS)), diameters), name=ROUND)


def _even(n: int) -> Array:
    """(n, 3) unit vectors spread evenly: a Fibonacci lattice."""
    height = 1 - (2 * np.arange(n) + 1) / n
    angle = np.pi * (1 + np.sqrt(5)) * np.arange(n)
    across = np.sqrt(1 - height**2)
    return np.column_stack([across * np.cos(angle), across * np.sin(angle), height])


def _rock(seed: int) -> Array:
    """Corners of an angular block that touches the sides of the unit cube: planes broken off a ball at random."""
    random = np.random.default_rng(seed)
    points = _even(ROCK_POINTS) @ np.linalg.qr(random.normal(size=(3, 3)))[0].T
    points *= 1 + ROUGH * random.uniform(-1, 1, (ROCK_POINTS, 1))
    low, high = points.min(axis=0), points.max(axis=0)
    return (points - (low + high) / 2) / (high - low)


def _eota() -> Array:
    """The 24 corners of the norm block of outer size 1: a cube whose edges and corners are cut off."""
    signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
    corners = signs * [0.5, EOTA_EDGE / 2, EOTA_EDGE / 2]
    return np.concatenate([np.roll(corners, axis, axis=1) for axis in range(3)])


def _hull(points: Array) -> Surface:
    """The convex hull of points, its faces counter-clockwise seen from outside."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    used, corners = np.unique(hull.simplices, return_inverse=True)
    vertices = points[used]
    faces: NDArray[np.int32] = np.asarray(corners.reshape(-1, 3), dtype=np.int32)
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    faces[inward] = faces[inward][:, ::-1]
    return Surface(vertices, faces, GlobalShift(), "solid")


def _scaled(unit_solid: Surface, size: Array) -> Surface:
    return Surface(np.ascontiguousarray(unit_solid.vertices * size), unit_solid.faces, GlobalShift(), "solid")


def _volume(surface: Surface) -> float:
    a, b, c = (surface.vertices[surface.faces[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)

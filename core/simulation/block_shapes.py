# SPDX-License-Identifier: GPL-3.0-or-later
"""The solid that a block is, by its shape and three diameters: volume, moments of inertia.

The ground is met by the sphere of the mean diameter, r = (d1 + d2 + d3)/6, whatever the shape. The solid decides the
mass and the inertia:

    ellipsoid   V = π/6 d1 d2 d3     I1 = m (d2² + d3²)/20
    box         V = d1 d2 d3         I1 = m (d2² + d3²)/12

and so on for I2 and I3. A sphere and a cube are those of three equal diameters, I = 2/5 m r² and 2/3 m r².
"""

from typing import Literal

import numpy as np

from ..vectors import Array, Names

Shape = Literal["sphere", "cube", "box", "ellipsoid"]
SHAPES: tuple[Shape, ...] = ("sphere", "cube", "box", "ellipsoid")
ROUND: tuple[Shape, ...] = ("sphere", "cube")
"""Shapes of three equal diameters."""
_CORNERED = ("cube", "box")


def volumes(shape: Names, axes_m: Array) -> Array:
    """(n,) [m³] of solids with the diameters (n, 3)."""
    return axes_m.prod(axis=1) * np.where(np.isin(shape, _CORNERED), 1.0, np.pi / 6)


def principal_moments(shape: Names, axes_m: Array, mass_kg: Array) -> Array:
    """(n, 3) moments of inertia about the three axes of the solid [kg m²]."""
    square = axes_m**2
    others = square.sum(axis=1, keepdims=True) - square
    return others * (mass_kg / np.where(np.isin(shape, _CORNERED), 12.0, 20.0))[:, None]


def mean_inertia(shape: Names, axes_m: Array) -> Array:
    """(n,) the one number c in c m r², of the mean of the three moments, where r is the radius of contact."""
    mean = principal_moments(shape, axes_m, np.ones(len(axes_m))).mean(axis=1)
    return mean / (axes_m.mean(axis=1) / 2) ** 2

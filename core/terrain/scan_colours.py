# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours that a scan or a mesh has at its points: what files keep them as, and those of the vertices made of them."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..vectors import Array
from .cleaning import point_hashes

type Colours = NDArray[np.uint8]
"""(n, 3) sRGB, red first."""

NAMES = (("red", "green", "blue"), ("r", "g", "b"), ("diffuse_red", "diffuse_green", "diffuse_blue"))
"""Of columns and properties, in small letters."""
EIGHT_BITS, SIXTEEN_BITS = 255.0, 65535.0


def colour_columns(names: Sequence[str]) -> list[int]:
    """Where red, green and blue stand among the names of columns; empty when they do not."""
    small = [name.lower() for name in names]
    found = next((three for three in NAMES if all(name in small for name in three)), ())
    return [small.index(name) for name in found]


def colours_of(values: Any) -> tuple[Colours | None, str]:
    """Colours from numbers (n, 3) as a file has them, and a sentence on them where one is needed.

    Parts of one, 8 and 16 bits are told apart by the type of the numbers and the greatest of them. All black is no
    colour: programs write zeros where they know none.
    """
    values = np.asarray(values)
    if not values.size:
        return None, ""
    low, high = float(values.min()), float(values.max())
    if not (low >= 0 and high <= SIXTEEN_BITS):  # NaN included
        return None, f"The colours of the points are left out: numbers from {low:g} to {high:g} are none."
    if high == 0:
        return None, ""
    if values.dtype.kind == "f" and high <= 1:
        values = np.rint(EIGHT_BITS * values)
    elif high > EIGHT_BITS:
        values = np.rint(values * (EIGHT_BITS / SIXTEEN_BITS))
    return np.ascontiguousarray(values, dtype=np.uint8), ""


def colours_at(vertices: Array, points: Array, colours: Colours) -> Colours:
    """(k, 3) of vertices (k, 3): those of the same point, else of the nearest of (n, 3) points.

    Meshing and cleaning leave points out and join them, but do not move them.
    """
    if vertices is points:
        return colours
    hashed = point_hashes(points)
    order = np.argsort(hashed, kind="stable")
    wanted = point_hashes(vertices)
    place = np.minimum(np.searchsorted(hashed[order], wanted), len(points) - 1)
    source = order[place]
    other = np.flatnonzero((points[source] != vertices).any(axis=1))
    if other.size:
        from scipy.spatial import cKDTree

        source[other] = cKDTree(points).query(vertices[other])[1]
    return np.ascontiguousarray(colours[source])


def joined_colours(parts: Sequence[tuple[Colours | None, str]]) -> tuple[Colours | None, str]:
    """Colours of several files as of one, (colours, name of the file) each, and a sentence where they are lost."""
    without = [name for colours, name in parts if colours is None]
    if not without:
        return np.concatenate([colours for colours, _ in parts if colours is not None]), ""
    if len(without) == len(parts):
        return None, ""
    return None, f"Colours are left out: {', '.join(without[:3])}{' …' if len(without) > 3 else ''} have none."

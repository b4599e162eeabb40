# SPDX-License-Identifier: GPL-3.0-or-later
"""How much of lines and areas in plan has terrain below it: what lies beside it is said, never left out in silence."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ..errors import InputError
from ..remarks import Remark
from ..terrain.cloud import Cloud, heights_above_points
from ..terrain.misplaced import unit_hint
from ..terrain.raycast import cast_rays
from ..terrain.surface import Surface
from ..vectors import Array, Mask
from .polygons import Polygon

PLACES = 4096
"""Looked at in an area, and along a line: a share of a thousandth is found."""
EDGE_M = 1e-3
GOLDEN = (5**0.5 - 1) / 2
ADVICE = "Check its coordinates, take it out, or give a terrain that reaches so far"


def heights_at(terrain: Surface | Cloud, places: Array) -> Array:
    """(n,) of the highest ground at places in plan (n, 2), local [m]; NaN where there is none."""
    points = terrain.vertices if isinstance(terrain, Surface) else terrain.points
    top = float(points[:, 2].max()) + 1.0
    above = np.column_stack([places, np.full(len(places), top)])
    if isinstance(terrain, Cloud):
        return top - heights_above_points(terrain, above)
    down: Array = cast_rays(terrain, above, (0, 0, -1)).distance
    return np.where(np.isfinite(down), top - down, np.nan)


def beside(terrain: Surface | Cloud, places: Array) -> Mask:
    """(n,) whether places in plan (n, 2) are outside of the terrain; its very edge belongs to it."""
    outside: Mask = np.isnan(heights_at(terrain, places))
    for step in ((EDGE_M, 0.0), (-EDGE_M, 0.0), (0.0, EDGE_M), (0.0, -EDGE_M)):
        left = np.flatnonzero(outside)
        if left.size:
            outside[left] = np.isnan(heights_at(terrain, places[left] + step))
    return outside


def check_areas(terrain: Surface | Cloud, polygons: Sequence[Polygon], what: str, then: str) -> tuple[Remark, ...]:
    """Which areas are partly outside of the terrain, and how much of each.

    Parameters
    ----------
    what : they are ("release area"). then : what follows for the part outside.

    Raises
    ------
    InputError : one is wholly outside.
    """
    remarks = []
    for polygon in polygons:
        places = places_within(polygon)
        remarks += _said(terrain, places, named(what, polygon.name, polygon.number), "area", then)
    return tuple(remarks)


def check_lines(
    terrain: Surface | Cloud,
    lines: Sequence[Array],
    names: Sequence[str],
    what: str,
    then: str,
    *,
    refuse: bool = True,
) -> tuple[Remark, ...]:
    """The same of lines, each (k, 2 or more) local [m].

    Parameters
    ----------
    refuse : one that is wholly outside; else it is said as any other.

    Raises
    ------
    InputError : see `refuse`.
    """
    remarks = []
    for number, (line, name) in enumerate(zip(lines, names, strict=True), start=1):
        places = places_along(line[:, :2])
        remarks += _said(terrain, places, named(what, name, number if len(lines) > 1 else 0), "length", then, refuse)
    return tuple(remarks)


def named(what: str, name: str, number: int) -> str:
    """ "release area a (feature 2)", as far as it has a name and a number."""
    return what + (f" {name}" if name else "") + (f" (feature {number})" if number else "")


def places_within(polygon: Polygon, number: int = PLACES) -> Array:
    """(n, 2) places spread evenly over a polygon, always the same."""
    low, high, left0, left1, right0, right1 = polygon.pieces.T
    corners = np.stack(
        [np.stack([left0, low], 1), np.stack([right0, low], 1), np.stack([left1, high], 1), np.stack([right1, high], 1)]
    )
    triangles = np.concatenate([corners[[0, 1, 3]], corners[[0, 3, 2]]], axis=1).transpose(1, 0, 2)
    first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    cumulated = np.cumsum(0.5 * np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]))
    at = np.searchsorted(cumulated, (np.arange(number) + 0.5) / number * cumulated[-1])
    steps = np.arange(1, number + 1)
    u, v = np.sqrt(steps * GOLDEN % 1.0), steps * 2**0.5 % 1.0
    weights = np.column_stack([1 - u, u * (1 - v), u * v])
    return np.einsum("ij,ijk->ik", weights, triangles[np.minimum(at, len(triangles) - 1)])


def places_along(line: Array, number: int = PLACES) -> Array:
    """(n, 2) places in the middle of so many equal parts of a line (k, 2)."""
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    at = (np.arange(number) + 0.5) / number * length[-1]
    return np.column_stack([np.interp(at, length, line[:, axis]) for axis in (0, 1)])


def parts_on(terrain: Surface | Cloud, line: Array) -> list[Array]:
    """The parts of a line (k, 3) that have terrain below them, cut at `PLACES` equal steps of each side."""
    steps = max(8, PLACES // max(len(line) - 1, 1))
    found: list[Array] = []
    for a, b in pairwise(line):
        ends = a + np.linspace(0.0, 1.0, steps + 1)[:, None] * (b - a)
        there = ~beside(terrain, ends[:, :2])
        whole = there[1:] & there[:-1]
        edges = np.flatnonzero(np.diff(np.concatenate([[False], whole, [False]]).astype(np.int8)))
        found += [ends[[start, end]] for start, end in edges.reshape(-1, 2).tolist()]
    return found


def _said(terrain: Surface | Cloud, places: Array, what: str, of: str, then: str, refuse: bool = True) -> list[Remark]:
    outside = beside(terrain, places)
    if refuse and outside.all():
        raise InputError(f"The {what} is wholly outside of the terrain", advice=unit_hint(places, terrain) or ADVICE)
    share = float(outside.mean())
    if share == 0.0:
        return []
    text = f"{100 * share:.{2 if share < 0.99 else 3}g} % of the {of} of the {what} is outside of the terrain: {then}."
    return [Remark(text, "warning", "outside")]

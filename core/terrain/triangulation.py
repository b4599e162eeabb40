# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshing of grids and clouds in plan (2.5-D); `folds` meshes the overhangs of clouds."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..vectors import Array, Mask
from .ordering import along_curve

MAX_EDGE_SPACINGS = 10.0
"""Longest edge of a meshed cloud by default, in multiples of its mean point spacing: longer ones bridge holes."""
AT_ONCE = 100_000
"""Points that the library is given: it holds more memory for more of them."""
SNAPPED_M = 1e-9
"""Points of a cloud that are nearer in plan are one."""


@dataclass(frozen=True, eq=False)
class Meshed:
    """Faces over some of the points, counter-clockwise from above.

    Attributes
    ----------
    points : (n, 3) the points that were meshed.
    faces : (m, 3).
    notes : sentences for the summary.
    origin : (n,) number of each among the points that were given; empty when they are the same.
    """

    points: Array
    faces: NDArray[np.int32]
    notes: tuple[str, ...]
    origin: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))


def mesh_grid(points: Array, shape: tuple[int, int]) -> Meshed:
    """Two triangles per cell, along the shorter diagonal in space; one where a corner has no data; else a hole.

    Parameters
    ----------
    points : (rows * columns, 3) row by row, NaN height where there are no data.
    """
    valid = ~np.isnan(points[:, 2])
    number = np.arange(points.shape[0], dtype=np.int32).reshape(shape)
    a, b, c, d = (number[i, j].ravel() for i in (slice(-1), slice(1, None)) for j in (slice(-1), slice(1, None)))
    corners = sum(valid[corner].astype(np.int8) for corner in (a, b, c, d))

    def length2(i: NDArray[np.int32], j: NDArray[np.int32]) -> Array:
        return ((points[i] - points[j]) ** 2).sum(axis=1)

    along_ad = length2(a, d) <= length2(b, c)
    full, faces = corners == 4, []
    # a b
    # c d
    for keep, (i, j, k) in (
        (full & along_ad, (a, d, b)),
        (full & along_ad, (a, c, d)),
        (full & ~along_ad, (a, c, b)),
        (full & ~along_ad, (b, c, d)),
        ((corners == 3) & ~valid[a], (b, c, d)),
        ((corners == 3) & ~valid[b], (a, c, d)),
        ((corners == 3) & ~valid[c], (a, d, b)),
        ((corners == 3) & ~valid[d], (a, c, b)),
    ):
        faces.append(np.stack([i[keep], j[keep], k[keep]], axis=1))
    missing = int((~valid).sum())
    notes = ["Meshed with two triangles per cell."]
    if missing:
        notes.append(f"{missing:,} cells without data are holes.")
    kept = np.cumsum(valid, dtype=np.int32) - 1
    return Meshed(points[valid], upward(points, kept[np.concatenate(faces)], valid), tuple(notes))


def upward(points: Array, faces: NDArray[np.int32], valid: Mask) -> NDArray[np.int32]:
    """Faces of a grid turned if its rows and columns run the other way round (south row first)."""
    if len(faces):
        x, y = points[valid][faces[0], 0], points[valid][faces[0], 1]
        if (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]) < 0:
            return np.ascontiguousarray(faces[:, ::-1])
    return faces


def mesh_cloud(points: Array, max_edge_m: float | None) -> Meshed:
    """2.5-D Delaunay triangulation in plan, without triangles that have an edge over the maximum (in plan).

    Parameters
    ----------
    points : (n, 3) local coordinates [m]; of several at one place in plan the lowest is used.
    max_edge_m : longest edge [m]; `MAX_EDGE_SPACINGS` times the mean point spacing when None.

    Raises
    ------
    InputError : fewer than three points, or all on a line in plan.
    """
    from .triangle_kernels import wind

    total = len(points)
    origin = _in_plan(points)
    if total:
        origin = origin[np.r_[True, (np.diff(points[origin, :2], axis=0) != 0).any(axis=1)]]
    points = points[origin]
    notes = []
    if len(points) < total:
        notes.append(f"{total - len(points):,} points above another at the same place in plan were left out.")
    if len(points) < 3:
        raise InputError(f"{len(points)} points in plan, where a surface needs 3", advice="Check the file")
    plan = points[:, :2] - points[:, :2].mean(axis=0)
    spread = np.linalg.svd(plan.T @ plan, compute_uv=False)
    if spread[1] <= 1e-14 * spread[0]:
        raise _on_a_line()
    faces = _delaunay(plan)
    if not len(faces):
        raise _on_a_line()
    longest2 = np.empty(len(faces))
    spacing = float(np.sqrt(wind(plan, faces, longest2) / len(points)))
    limit = MAX_EDGE_SPACINGS * spacing if max_edge_m is None else float(max_edge_m)
    short = longest2 <= limit * limit
    if not short.any():
        raise InputError(
            f"No triangle has all edges below {limit:g} m",
            advice=f"Points are {spacing:.3g} m apart: raise the maximum edge",
        )
    notes += [
        f"Meshed {len(points):,} points in plan (2.5-D Delaunay); mean spacing {spacing:.3g} m.",
        f"Edges over {limit:.3g} m in plan were left out, with {int((~short).sum()):,} of {len(faces):,} triangles"
        + (f"; the maximum is {MAX_EDGE_SPACINGS:g} times the spacing." if max_edge_m is None else "."),
    ]
    return Meshed(points, faces[short], tuple(notes), origin)


def _in_plan(points: Array) -> NDArray[np.int64]:
    """(n,) the order of points (n, 3) along a curve in plan; of those at one place the lowest comes first."""
    if not len(points):
        return np.empty(0, np.int64)
    curve = along_curve(points[:, :2])
    order = np.argsort(curve, kind="stable")
    curve = curve[order]
    same = np.r_[False, curve[1:] == curve[:-1], False]
    rows = np.flatnonzero(same[1:] | same[:-1])
    among = order[rows]
    order[rows] = among[np.lexsort((*points[among, ::-1].T, curve[rows]))]
    return order


def _delaunay(plan: Array) -> NDArray[np.int32]:
    """(m, 3) Delaunay triangles of points in plan (n, 2), of which near ones follow each other: each is sought from the
    one before.
    """
    import startinpy

    made = startinpy.DT()
    made.snap_tolerance = SNAPPED_M
    for start in range(0, len(plan), AT_ONCE):
        part = plan[start : start + AT_ONCE]
        number = np.arange(start, start + len(part), dtype=np.float64)
        made.insert(np.column_stack([part, number]))  # heights carry the points' numbers
    number = made.points[:, 2]
    number[0] = 0.0  # the first point is at infinity
    return np.asarray(number.astype(np.int32)[made.triangles])


def _on_a_line() -> InputError:
    return InputError("All points lie on a line in plan", advice="A surface needs points to both sides")

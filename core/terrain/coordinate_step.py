# SPDX-License-Identifier: GPL-3.0-or-later
"""Coordinates that are stored more coarsely than the points are apart: single precision at survey coordinates, six
digits, a LAS scale of a metre, whole metres of height.

What a format says of its numbers is taken as it is. Where it says nothing, the numbers themselves are looked at, and
only what no exact surface looks like is called coarse: a regular grid has steps too.
"""

from collections.abc import Sequence

import numpy as np

from ..vectors import Array, Mask
from .cleaning import point_hashes

COARSE_SHARE = 0.1
"""A step above this part of the spacing: slopes between neighbours are wrong by up to six degrees."""
COARSE_M, COARSE_PLACE_M = 0.02, 0.05
"""Smaller steps [m] matter to no block; of single places, to no speed."""
LOOKED_AT, FEWEST_VALUES = 200_000, 5
SHARED_PLACES = 0.2
"""Of points in plan that are at the place of another, with another height: rounding throws them together."""
MUCH_COARSER = 4.0
"""In plan than in height: of walls built of blocks, whose points share places too, both are alike."""
ROUNDED = 1e-6
"""Numbers that were rounded to some digits come in steps of a power of ten; marks set out by the two metres do not."""
DECIMALS = 1e4
"""Numbers with more than four decimals were computed, not typed."""
NEIGHBOURS, NEIGHBOURHOODS, NEAR = 8, 200, 20_000
EXACT_PART = 0.05
"""Of a step: neighbours that are nearer to a plane were not rounded to it."""


def single_precision_step(points: Array, axes: Sequence[bool] = (True, True, True)) -> Array:
    """(3,) step of coordinates (n, 3) in single precision at the greatest of each axis; 0 where it is not in it."""
    if not len(points):
        return np.zeros(3)
    with np.errstate(all="ignore"):
        steps = np.spacing(np.abs(points).max(axis=0).astype(np.float32)).astype(np.float64)
    return np.where(axes, np.nan_to_num(steps, posinf=0.0), 0.0)


def stored_step(points: Array, stated: Array | None, kind: str) -> Array:
    """(3,) of which the coordinates (n, 3) of a terrain are multiples, 0 where they are fine enough or exact.

    Parameters
    ----------
    points : as in the file.
    stated : (3,) what the format says.
    kind : "mesh", "grid" or "cloud".
    """
    points = points[np.isfinite(points[:, 2])] if kind == "grid" else points
    steps = np.zeros(3) if stated is None else stated.copy()
    if len(points) < FEWEST_VALUES:
        return steps
    some = _some(points)
    if stated is None and _was_in_single_precision(some):
        steps = single_precision_step(points)
    if kind == "grid":
        steps[:2] = 0.0
    spacing = spacing_of(points)
    found = np.array([_lattice_step(some[:, axis], 2, COARSE_SHARE * spacing) for axis in range(3)])
    coarse = found > np.maximum(steps, COARSE_SHARE * spacing)
    in_plan = coarse[:2] & (found[:2] > MUCH_COARSER * found[2]) & (kind != "grid")
    coarse[:2] = in_plan if in_plan.any() and _thrown_together(points) else False
    if coarse[2] and (len(np.unique(points[:, 2])) < FEWEST_VALUES or _lies_exactly(points, float(found[2]))):
        coarse[2] = False
    return np.where(coarse, found, steps)


def spacing_of(points: Array) -> float:
    """How far points (n, 3) lie apart on the surface that they span, as if it were a rectangle."""
    if not len(points):
        return 0.0
    centred = _some(points)
    centred = centred - centred.mean(axis=0)
    spread = np.sqrt(np.maximum(np.linalg.eigvalsh(centred.T @ centred / len(centred)), 0.0))
    return float(np.sqrt(12.0 * spread[-1] * spread[-2] / len(points)))  # a rectangle's variance: its side² / 12


def spacing_in_box(corners: Array, count: int) -> float:
    """The same of so many points in a box, of which two corners (2, 3) are known."""
    sides = np.sort(np.ptp(corners, axis=0))
    return float(np.sqrt(sides[-1] * sides[-2] / max(count, 1)))


def coarse_sentence(steps: Array, spacing: float) -> str:
    """What coordinates in steps (3,) [m] do to points that are so far apart [m]; empty where they are fine enough."""
    coarse = (steps >= COARSE_M) & (steps > COARSE_SHARE * spacing)
    if not coarse.any():
        return ""
    greatest = float(steps[coarse].max())
    degrees = np.degrees(np.arctan2(greatest, spacing))
    return (
        f"Coordinates are stored in steps of {_steps(steps, coarse)}, where points are about {spacing:.2g} m apart: "
        f"slopes and normals between neighbours are wrong by up to {degrees:.0f}°. Export them with more digits, in "
        "double precision or with a finer scale, or take a whole offset off before."
    )


def coarse_places_sentence(places: Array) -> str:
    """What to say of single places (n, 3) [m], picked or released, that are stored coarsely; empty if they are not."""
    places = places[np.isfinite(places).all(axis=1)]
    if len(places) < FEWEST_VALUES:
        return ""
    steps = single_precision_step(places) if _was_in_single_precision(places) else np.zeros(3)
    lattice = np.array([_lattice_step(places[:, axis], FEWEST_VALUES, COARSE_PLACE_M / 2) for axis in range(3)])
    digits = np.log10(np.where(lattice > 0, lattice, np.e))
    steps = np.maximum(steps, np.where(np.abs(digits - np.rint(digits)) < ROUNDED, lattice, 0.0))
    coarse = steps >= COARSE_PLACE_M
    if not coarse.any():
        return ""
    return (
        f"Places are stored in steps of {_steps(steps, coarse)}: what follows from the way between two of them is as "
        "coarse. Write them with more digits, or in double precision."
    )


def _steps(steps: Array, coarse: Mask) -> str:
    named = [f"{steps[axis]:.3g} m ({'xyz'[axis]})" for axis in range(3) if coarse[axis]]
    return " and ".join([", ".join(named[:-1]), named[-1]] if len(named) > 1 else named)


def _was_in_single_precision(points: Array) -> bool:
    """Whether double numbers are all single ones, and not because they are short."""
    with np.errstate(all="ignore"):
        if not (points.astype(np.float32) == points).all():
            return False
        return bool((points * DECIMALS % 1 != 0).mean(axis=0).max() > 0.5)


def _some(points: Array) -> Array:
    return points[:: max(1, len(points) // LOOKED_AT)]


def _lattice_step(values: Array, fewest: int, least: float) -> float:
    """The number of which all differences are multiples; 0 where it is small, and for fewer different values."""
    distinct = np.unique(values)
    if len(distinct) < fewest:
        return 0.0
    noise = 8 * float(np.spacing(np.abs(distinct[[0, -1]]).max()))
    gaps = np.unique(np.diff(distinct))
    gaps = gaps[gaps > noise]
    least = max(least, 100 * noise)
    step = 0.0
    for gap in gaps.tolist():
        step = _common(gap, step, max(noise, 1e-6 * step))
        if step < least:
            return 0.0
    return step


def _common(a: float, b: float, noise: float) -> float:
    """The greatest common measure of two lengths."""
    while b > noise:
        a, b = b, abs(a - b * round(a / b))
    return a


def _thrown_together(points: Array) -> bool:
    """Whether many points share their place in plan with another one of another height."""
    flat = points.copy()
    flat[:, 2] = 0.0
    all_places, in_plan = (len(np.unique(point_hashes(each))) for each in (points, flat))
    return all_places - in_plan > SHARED_PLACES * all_places


def _lies_exactly(points: Array, step: float) -> bool:
    """Whether points and their neighbours lie on planes that are not level, more exactly than rounding leaves them."""
    from scipy.spatial import cKDTree

    away = ((points[:, :2] - points[len(points) // 2, :2]) ** 2).sum(axis=1)
    near = points[np.argsort(away, kind="stable")[:NEAR]]
    some = near[:: max(1, len(near) // NEIGHBOURHOODS)]
    about = near[cKDTree(near).query(some, k=min(NEIGHBOURS + 1, len(near)))[1]]
    centred = about - about.mean(axis=1, keepdims=True)
    off = np.linalg.svd(centred, compute_uv=False)[:, -1] / np.sqrt(about.shape[1])
    relief = np.ptp(about[..., 2], axis=1)
    return bool(np.median(off) < EXACT_PART * step and np.median(relief) > 0)

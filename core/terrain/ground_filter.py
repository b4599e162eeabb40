# SPDX-License-Identifier: GPL-3.0-or-later
"""The ground under vegetation in a cloud that nobody has classified: a cloth laid on the cloud from below.

The cloud is turned upside down and a stiff cloth falls on it; what lies on the cloth is ground (cloth simulation
filter, Zhang et al. 2016, doi 10.3390/rs8060501). Two things differ for steep slopes: the cloth falls on what is left
after the slope's own plane is taken away, and a point's distance to it is measured at right angles to the cloth.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..progress import Progress, silent
from ..vectors import Array, Mask

CELL_M = 1.0
DISTANCE_M = 0.2
STIFFNESS = 3
"""Times per step that a particle moves by `YIELD` of the way to its neighbour, as in the paper."""
YIELD = 0.3
MOST_STEPS, AT_ONCE = 500, 10
MARGIN = 2
"""Cells around the cloud, so that its border does not hold the cloth up."""
LOW_M = 5.0
"""A cell that lies deeper under all its neighbours holds a false return (multipath)."""
MOST_CELLS = 50_000_000
REWEIGHTED = 20


@dataclass(frozen=True, eq=False)
class GroundFilter:
    """What the filter found.

    Attributes
    ----------
    ground : (n,) the points that lie on the cloth.
    notes : sentences for the summary.
    """

    ground: Mask
    notes: tuple[str, ...]


def filter_ground(
    points: Array, cell_m: float = CELL_M, distance_m: float = DISTANCE_M, progress: Progress = silent
) -> GroundFilter:
    """Tell the ground from what stands on it.

    Parameters
    ----------
    points : (n, 3) metres, z up.
    cell_m : spacing of the cloth's particles [m]: more than the gaps that the scanner saw through the leaves; a boulder
        or a step of the ground that is smaller than this may be left out.
    distance_m : a point that is nearer to the cloth is ground [m].

    Raises
    ------
    InputError : a cell or distance that is no length, a cell too small or too large for the cloud.
    """
    for name, value in (("cell", cell_m), ("distance", distance_m)):
        if not (np.isfinite(value) and value > 0):
            raise InputError(f"The ground filter's {name} of {value} m is no length", advice="Give metres, like 1.0")
    plan = points[:, :2] - points[:, :2].min(axis=0)
    extent = plan.max(axis=0)
    if extent.min() < 3 * cell_m:
        raise InputError(
            f"The cloud is {extent.min():.3g} m wide, too small for a ground filter of {cell_m:g} m cells",
            advice="Give a smaller cell",
        )
    if np.prod(extent / cell_m + 1) > MOST_CELLS:
        raise InputError(
            f"Cells of {cell_m:g} m on {extent[0]:.0f} by {extent[1]:.0f} m are more than {MOST_CELLS:,}",
            advice="Give a larger cell",
        )
    progress("Filtering the ground", 0, 0)
    slope = _plane(plan, points[:, 2])
    height = points[:, 2] - plan @ slope
    lowest, false = _lowest(height, (plan / cell_m).astype(np.int64) + MARGIN)
    cloth = _settled(lowest, cell_m, progress)
    ground = _distance(cloth, plan / cell_m + (MARGIN - 0.5), height, slope, cell_m) <= distance_m
    kept = int(ground.sum())
    notes = [
        f"Ground filter (cloth of {cell_m:g} m): kept the {kept:,} of {len(points):,} points within {distance_m:g} m "
        f"of it, left out {len(points) - kept:,}.",
        "Look at what it left out: tops of boulders and steps of walls may be among it.",
    ]
    if false:
        cells = "1 cell" if false == 1 else f"{false:,} cells"
        notes.append(f"Passed over {cells} with returns more than {LOW_M:g} m under all around.")
    return GroundFilter(ground, tuple(notes))


def _plane(plan: Array, height: Array) -> Array:
    """(2,) mean slope of the lowest points of coarse cells; those far above it count little."""
    cells = (plan / max(plan.max() / 20, 1e-9)).astype(np.int64)
    key = cells[:, 0] * (cells[:, 1].max() + 1) + cells[:, 1]
    order = np.lexsort((height, key))
    lowest = order[np.r_[True, np.diff(key[order]) != 0]]
    columns = np.column_stack([plan[lowest], np.ones(len(lowest))])
    weights = np.ones(len(lowest))
    for _ in range(REWEIGHTED):
        plane = np.linalg.lstsq(columns * weights[:, None], height[lowest] * weights, rcond=None)[0]
        weights = 1 / np.sqrt(1 + np.abs(height[lowest] - columns @ plane))
    return np.asarray(plane[:2])


def _lowest(height: Array, cells: NDArray[np.int64]) -> tuple[Array, int]:
    """(rows, columns) lowest height in each cell, of the nearest one where there is none; and how many were false."""
    from scipy.ndimage import distance_transform_edt, minimum_filter

    rows, columns = cells.max(axis=0) + 1 + MARGIN
    lowest = np.full(rows * columns, np.inf)
    np.minimum.at(lowest, cells[:, 0] * columns + cells[:, 1], height)
    lowest = lowest.reshape(rows, columns)
    around = np.ones((3, 3), bool)
    around[1, 1] = False
    beside = minimum_filter(lowest, footprint=around, mode="constant", cval=np.inf)
    false = np.isfinite(beside) & (lowest < beside - LOW_M)
    without = false | ~np.isfinite(lowest)
    nearest = distance_transform_edt(without, return_distances=False, return_indices=True)
    return lowest[tuple(nearest)], int(false.sum())


def _settled(lowest: Array, cell_m: float, progress: Progress) -> Array:
    """Heights of the cloth, of the form of `lowest`, the right way up."""
    from .cloth_kernels import settle

    floor = np.ascontiguousarray(-lowest)
    cloth = np.full(floor.shape, floor.max() + cell_m)
    before, held = cloth.copy(), np.zeros(floor.shape, bool)
    for step in range(0, MOST_STEPS, AT_ONCE):
        progress("Laying a cloth on the ground", step, MOST_STEPS)
        if settle(cloth, before, held, floor, 1 - (1 - YIELD) ** STIFFNESS, AT_ONCE):
            break
    return -cloth


def _distance(cloth: Array, at: Array, height: Array, slope: Array, cell_m: float) -> Array:
    """(n,) distance of each point to the cloth, at right angles to the ground [m].

    Parameters
    ----------
    at : (n, 2) places in rows and columns of the cloth.
    slope : (2,) of the plane that was taken away from the heights.
    """
    from scipy.ndimage import map_coordinates

    along = np.gradient(cloth, cell_m)
    here, dx, dy = (map_coordinates(values, at.T, order=1, mode="nearest") for values in (cloth, *along))
    return np.asarray(np.abs(height - here) / np.sqrt(1 + (dx + slope[0]) ** 2 + (dy + slope[1]) ** 2))

# SPDX-License-Identifier: GPL-3.0-or-later
"""Places that would be at the terrain if they, or it, were in another unit: what a wrong unit looks like."""

import numpy as np

from ..constants import UNITS_M
from ..vectors import Array
from .cloud import Cloud
from .surface import Surface

FOOT_M = UNITS_M["ft"]
NEAR_M = 100.0
"""Places belong to a terrain that are within its box, or beside it by no more than this and half of its size."""


def unit_hint(places: Array, terrain: Surface | Cloud, near_m: float = NEAR_M) -> str:
    """What to do about places that are far from a terrain and at it in feet, or in metres if it is in feet.

    Parameters
    ----------
    places : (n, 3) in the terrain's frame [m], NaN for heights that are not known; (n, 2) without heights.
    near_m : by which they may be beside it, see `NEAR_M`: cameras are farther away than picks.

    Returns
    -------
    advice, a sentence without a final full stop; empty when no other unit explains where they are. At heights near
    zero none does.
    """
    places = np.column_stack([places, np.full((len(places), 3 - places.shape[1]), np.nan)])
    known = terrain.shift.to_survey(places[np.isfinite(places[:, :2]).all(axis=1)])
    if not len(known):
        return ""
    low, high = terrain.shift.to_survey(terrain.bounds)
    margin = near_m + (high - low) / 2
    low, high = low - margin, high + margin
    middle = np.array([np.median(known[:, 0]), np.median(known[:, 1]), _median(known[:, 2])])
    with np.errstate(invalid="ignore"):
        here, in_feet, as_feet = (
            (middle * factor >= low) & (middle * factor <= high) for factor in (1.0, FOOT_M, 1 / FOOT_M)
        )
    unknown = np.isnan(middle[2])
    if here[:2].all():
        if unknown or here[2]:
            return ""
        if in_feet[2]:
            return "The heights look like feet: multiply them by 0.3048, or end the column's name in _ft"
        if as_feet[2]:
            return "The terrain's heights look like feet: read it with the unit of its heights (--height-unit ft)"
        return ""
    if in_feet[:2].all() and (unknown or in_feet[2] or here[2]):
        return "The coordinates look like feet: multiply them by 0.3048, or end the columns' names in _ft"
    if as_feet[:2].all() and (unknown or as_feet[2] or here[2]):
        return "The terrain's coordinates look like feet: read it with its unit (--unit ft)"
    return ""


def _median(values: Array) -> float:
    values = values[np.isfinite(values)]
    return float(np.median(values)) if values.size else np.nan

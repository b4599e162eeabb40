# SPDX-License-Identifier: GPL-3.0-or-later
"""The classes and colours in which maps are shown: in GIS, in figures and in Blender."""

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import isfinite

import numpy as np

from ..colours import scale_colours
from ..vectors import Array
from .maps import LAYERS

MOST_LIMITS = 6
"""So many colours more than one are still told apart."""
POWERS = tuple(10.0**power for power in range(-3, 9))
SERIES: Mapping[str, tuple[float, ...]] = {
    "kJ": tuple(step * power for power in POWERS for step in (1.0, 3.0)),
    "m": tuple(step * power for power in POWERS for step in (1.0, 2.0, 5.0)),
    "m/s": (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 40.0, 50.0, 75.0, 100.0),
    "%": (0.1, 1.0, 5.0, 10.0, 25.0, 50.0, 75.0),
    "": tuple(step * power for power in POWERS if power >= 1 for step in (1.0, 3.0)),
}
"""Unit → limits to choose from; those of energies have the Swiss ones, 30 and 300 kJ, in them."""


@dataclass(frozen=True, eq=False)
class Classes:
    """Values between limits have one colour.

    Attributes
    ----------
    limits : ascending; a value that is one of them belongs to the class above.
    colours : (limits + 1, 3) sRGB in 0…1, from the lowest class on; told apart with any colour vision.
    labels : of each class, without the unit.
    """

    limits: tuple[float, ...]
    colours: Array
    labels: tuple[str, ...]

    def colours_of(self, values: Array) -> Array:
        """(..., 4) sRGB and opacity: nothing where there is no value, and where nothing passes."""
        values = np.asarray(values, dtype=np.float64)
        found = np.zeros((*values.shape, 4))
        shown = values > 0
        found[shown, :3] = self.colours[np.searchsorted(self.limits, values[shown], side="right")]
        found[shown, 3] = 1.0
        return found


def classes_of(name: str, greatest: float) -> Classes:
    """The classes of a map.

    Parameters
    ----------
    name : of the map, see `LAYERS`.
    greatest : its greatest value; limits above it would be empty classes.

    Raises
    ------
    KeyError : there is no such map.
    """
    series = SERIES[LAYERS[name].unit]
    top = bisect_right(series, greatest) if isfinite(greatest) else 1
    limits = series[max(top - MOST_LIMITS, 0) : top] or series[:1]
    colours = scale_colours(np.linspace(0.0, 1.0, len(limits) + 1), 0.0, 1.0)
    words = [f"{limit:,.10g}".replace(",", "\u202f") for limit in limits]
    between = [f"{low} – {high}" for low, high in pairwise(words)]
    return Classes(tuple(limits), colours, (f"below {words[0]}", *between, f"{words[-1]} and more"))

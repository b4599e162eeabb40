# SPDX-License-Identifier: GPL-3.0-or-later
"""The classes and colours in which maps are shown: in GIS, in figures and in Blender."""

from bisect import bisect_left, bisect_right
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..colours import scale_colours
from ..vectors import Array
from .maps import LAYERS

MOST_LIMITS = 6
"""So many colours more than one are still told apart."""
LOW = 0.05
"""Share of the cells that may all be in the lowest class."""
POWERS = tuple(10.0**power for power in range(-3, 9))


def _steps(*steps: float, least: float = 0.0) -> tuple[float, ...]:
    return tuple(step * power for power in POWERS for step in steps if step * power >= least)


SERIES: Mapping[str, tuple[tuple[float, ...], tuple[float, ...]]] = {
    "kJ": (_steps(1, 2, 3, 5), _steps(1, 3)),
    "m": (_steps(1, 1.5, 2, 3, 5, 7), _steps(1, 2, 5)),
    "m/s": (
        (0.1, 0.2, 0.5, 1, 2, 4, 6, 8, *range(10, 100, 5)),
        (0.1, 0.5, 1, 2, 5, 10, 15, 20, 25, 30, 40, 50, 75, 100),
    ),
    "%": ((0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 50, 70, 90), (0.1, 1, 5, 10, 25, 50, 75)),
    "": (_steps(1, 2, 3, 5, least=2), _steps(1, 3, least=3)),
}
"""Unit → limits to choose from, fine and coarse; those of energies have the Swiss ones, 30 and 300 kJ, in both."""


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


def classes_of(name: str, values: Array) -> Classes:
    """The classes of a map: fine where its values are near to each other, and no empty ones above them.

    Parameters
    ----------
    name : of the map, see `LAYERS`.
    values : in any shape; NaN, or 0, where nothing passes.

    Raises
    ------
    KeyError : there is no such map.
    """
    return classes_in(LAYERS[name].unit, values)


def classes_in(unit: str, values: Array) -> Classes:
    """The same of values in a unit, which is one of `SERIES`."""
    shown = values[np.isfinite(values) & (values > 0)]
    least, greatest = np.quantile(shown, [LOW, 1.0]).tolist() if shown.size else (0.0, 0.0)
    series = [one[bisect_left(one, least) : bisect_right(one, greatest)] for one in SERIES[unit]]
    fine, coarse = series
    limits = (fine if len(fine) <= MOST_LIMITS else coarse)[-MOST_LIMITS:]
    if not limits:
        limits = SERIES[unit][0][:1]
    colours = scale_colours(np.linspace(0.0, 1.0, len(limits) + 1), 0.0, 1.0)
    words = [f"{limit:,.10g}" for limit in limits]
    between = [f"{low} – {high}" for low, high in pairwise(words)]
    return Classes(tuple(limits), colours, (f"below {words[0]}", *between, f"{words[-1]} and more"))

# SPDX-License-Identifier: GPL-3.0-or-later
"""Standard deviations and intervals of the measured variables, from those of the picks."""

import numpy as np

from ..reconstruction.impact import Impacts
from ..vectors import Array, Indices, norm
from .variables import measured_values

NORMAL_95 = 1.96
"""Half the interval of a normal law, in standard deviations."""


def measured_sigma(impacts: Impacts, row: Indices, name: str) -> Array:
    """(m,) standard deviation of a variable of some rows, in its unit; NaN where none is known."""
    if name in ("v1_mps", "v2_mps"):
        return _speed_sigma(impacts, name.removesuffix("_mps"))[row]
    attribute = name.removesuffix("_mps").removesuffix("_deg")
    if attribute not in impacts.sigma:
        return np.full(row.size, np.nan)
    sigma = impacts.sigma[attribute][row]
    return np.degrees(sigma) if name.endswith("_deg") else sigma


def measured_interval(impacts: Impacts, row: Indices, name: str) -> Array:
    """(m, 2) ends of the 95 % interval of a variable of some rows, in its unit; NaN where none is known.

    Without an interval of its own it is as wide as the standard deviation says of a normal law.
    """
    attribute = name.removesuffix("_deg")
    if attribute in impacts.intervals:
        ends = impacts.intervals[attribute][row]
        ends = np.degrees(ends) if name.endswith("_deg") else ends
        known = np.isfinite(ends[:, :1])
        if known.all():
            return ends
    else:
        ends, known = np.full((row.size, 2), np.nan), np.zeros((row.size, 1), np.bool_)
    reach = NORMAL_95 * measured_sigma(impacts, row, name)
    return np.where(known, ends, measured_values(impacts, row, name)[:, None] + reach[:, None] * [-1.0, 1.0])


def _speed_sigma(impacts: Impacts, velocity: str) -> Array:
    """(n,) of |v|: from that of the energy where a table has it, else from the components as if independent."""
    vectors: Array = getattr(impacts, velocity)
    energy = f"kinetic{velocity[-1]}_j"
    speed = norm(vectors)
    with np.errstate(divide="ignore", invalid="ignore"):
        if energy in impacts.sigma:
            return np.asarray(impacts.sigma[energy] / (impacts.mass_kg * speed))
        if velocity in impacts.sigma:
            return np.asarray(norm(impacts.sigma[velocity] * vectors) / speed)
    return np.full(len(impacts), np.nan)

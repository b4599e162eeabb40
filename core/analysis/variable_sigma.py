# SPDX-License-Identifier: GPL-3.0-or-later
"""Standard deviations of the measured variables, from those of the picks."""

import numpy as np

from ..reconstruction.impact import Impacts
from ..vectors import Array, Indices, norm


def measured_sigma(impacts: Impacts, row: Indices, name: str) -> Array:
    """(m,) standard deviation of a variable of some rows, in its unit; NaN where none is known."""
    if name in ("v1_mps", "v2_mps"):
        return _speed_sigma(impacts, name.removesuffix("_mps"))[row]
    attribute = name.removesuffix("_mps").removesuffix("_deg")
    if attribute not in impacts.sigma:
        return np.full(row.size, np.nan)
    sigma = impacts.sigma[attribute][row]
    return np.degrees(sigma) if name.endswith("_deg") else sigma


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

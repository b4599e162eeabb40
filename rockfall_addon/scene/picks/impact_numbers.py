# SPDX-License-Identifier: GPL-3.0-or-later
"""The numbers of an impact at its pick's object.

They are one list there: ten thousand groups of thirty lists, each of which Blender keeps twice, took 130 MB more.
"""

from collections.abc import Mapping, Sequence

import bpy
import numpy as np

from ....core.reconstruction.impact import Impacts
from ....core.reconstruction.intervals import JUDGED
from ....core.vectors import Array, norm
from ..storage import store

type Numbers = dict[str, float | tuple[float, ...]]
"""Name → number, or numbers of a vector or an interval; NaN where not known."""


def _sigma_name(name: str) -> str:
    return f"sigma_{name}_deg" if name.startswith("theta") else f"sigma_{name}"


SHAPE = {
    "number": 1,
    "incident_mps": 3,
    "restituted_mps": 3,
    **dict.fromkeys(("rn", "rt", "r", "theta1_deg", "theta_dev_deg", "normal_spread_deg"), 1),
    **dict.fromkeys(("kinetic1_j", "kinetic2_j", "bounce_height_m", "chord_height_m"), 1),
    **dict.fromkeys(map(_sigma_name, JUDGED), 1),
    **dict.fromkeys(("sigma_speed1", "sigma_speed2", "sigma_kinetic1_j", "sigma_kinetic2_j"), 1),
    **{f"interval_{name}": 2 for name in JUDGED},
}
"""What is in the list, in this order, and how many numbers it has. Files hold it: another order is another schema."""
_ENDS = np.cumsum(list(SHAPE.values())).tolist()
WIDTH = _ENDS[-1]
"""Length of the list."""
_PLACES = {name: (end - many, end) for (name, many), end in zip(SHAPE.items(), _ENDS, strict=True)}


def of(obj: bpy.types.Object) -> Numbers | None:
    """What a pick's object keeps; None when it has no numbers, as all that are no impacts."""
    kept = obj.get(store.RESULT)
    if kept is None:
        return None
    values = kept.to_list()
    return {name: values[a] if b == a + 1 else tuple(values[a:b]) for name, (a, b) in _PLACES.items()}


def one(obj: bpy.types.Object, name: str) -> float:
    """A single number of those; NaN when it has none."""
    kept = obj.get(store.RESULT)
    return np.nan if kept is None else kept[_PLACES[name][0]]


def flags(obj: bpy.types.Object) -> list[str]:
    """The flags of an impact, some of `FLAGS` of the core."""
    return [flag for flag in obj.get(store.FLAGS, "").split(";") if flag]


def keep(obj: bpy.types.Object, numbers: Mapping[str, float | Sequence[float]]) -> None:
    """Write numbers into a pick's object; those that are not given are not known."""
    row = np.full(WIDTH, np.nan)
    for name, (start, end) in _PLACES.items():
        if name in numbers:
            row[start:end] = numbers[name]
    obj[store.RESULT] = row


def table(impacts: Impacts) -> Array:
    """(n, WIDTH) the numbers of impacts, NaN where not known."""
    columns = {
        "number": impacts.impact,
        "incident_mps": impacts.v1,
        "restituted_mps": impacts.v2,
        "rn": impacts.rn,
        "rt": impacts.rt,
        "r": impacts.r,
        "theta1_deg": np.degrees(impacts.theta1),
        "theta_dev_deg": np.degrees(impacts.theta_dev),
        "normal_spread_deg": np.degrees(impacts.normal_spread),
        "kinetic1_j": impacts.kinetic1_j,
        "kinetic2_j": impacts.kinetic2_j,
        "bounce_height_m": impacts.bounce_height_m,
        "chord_height_m": impacts.chord_height_m,
    }
    if impacts.sigma:
        sigma = impacts.sigma
        for name in JUDGED:
            columns[_sigma_name(name)] = np.degrees(sigma[name]) if name.startswith("theta") else sigma[name]
        for side, velocity in ((1, impacts.v1), (2, impacts.v2)):
            columns[f"sigma_speed{side}"] = speed_sigma(velocity, sigma[f"v{side}"])
            columns[f"sigma_kinetic{side}_j"] = impacts.mass_kg * norm(velocity) * columns[f"sigma_speed{side}"]
    columns |= {f"interval_{name}": ends for name, ends in impacts.intervals.items()}
    rows = np.full((len(impacts), WIDTH), np.nan)
    for name, (start, end) in _PLACES.items():
        if name in columns:
            rows[:, start:end] = columns[name].reshape(-1, end - start)
    return rows


def speed_sigma(velocity: Array, sigma: Array) -> Array:
    """(n,) standard deviation of the speed, the errors of the components (n, 3) taken as independent [m/s]."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return norm(velocity * sigma) / norm(velocity)

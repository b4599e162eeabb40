# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of others: are angles in degrees, velocities in m/s, lengths in metres, times in seconds?

Columns are compared with what follows from the others (an angle from the velocity and the normal, a velocity from
the places and times of two impacts), so that a wrong unit shows as its own factor; what follows from nothing is
compared with what is plausible.
"""

from pathlib import Path

import numpy as np

from ..errors import InputError
from ..reconstruction.impact import Impacts, apparent
from ..vectors import Array, Mask, norm

ANGLE_FACTORS = {np.pi / 180: ("in radians", "multiply it by 57.29578")}
SPEED_FACTORS = {
    3.6: ("in km/h", "divide it by 3.6"),
    1000.0: ("in mm/s", "divide it by 1000"),
    1 / 0.3048: ("in feet per second", "multiply it by 0.3048"),
}
FLIGHT_FACTORS = {
    1 / 3.6: ("velocities are in km/h", "divide them by 3.6"),
    1000.0: ("positions are in mm, not m", "divide them by 1000"),
    100.0: ("positions are in cm, not m", "divide them by 100"),
    1 / 0.3048: ("positions are in feet, not m", "multiply them by 0.3048"),
    0.001: ("times are in ms, not s", "divide them by 1000"),
}
DENSITY_KGPM3 = (300.0, 10_000.0)
"""Plausible mass by the volume of a sphere: a plate of light rock to a block of ore."""
DIAMETER_M, SPEED_MPS, LENGTH_TOLERANCE = (0.005, 30.0), 150.0, 1e-3
NEAR, FEWEST = 0.04, 5
"""A ratio is a factor when it is this near to it, over this many impacts or more."""


def check_units(impacts: Impacts, file: str | Path) -> list[str]:
    """Refuse a table whose numbers are surely in another unit; sentences about what is only implausible.

    Raises
    ------
    InputError : with the column, the unit and what to do.
    """
    lengths = norm(impacts.normal)
    wrong = np.flatnonzero(np.abs(lengths - 1.0) > LENGTH_TOLERANCE)
    if wrong.size:
        i = wrong[0]
        raise InputError(
            f"The normal of impact {impacts.impact[i]} has the length {lengths[i]:.4g}, not 1",
            file=file,
            trajectory=str(impacts.trajectory[i]),
            advice="Divide nx, ny, nz by their length",
        )
    seen = apparent(impacts.v1, impacts.v2, impacts.normal)
    for name, suffix, factors in (
        *((name, "deg", ANGLE_FACTORS) for name in ("theta1", "theta_dev")),
        *((name, "mps", SPEED_FACTORS) for name in ("vn1", "vt1", "vn2", "vt2")),
    ):
        _refuse(_ratio(getattr(impacts, name), getattr(seen, name)), factors, f"The column {name}_{suffix} is", file)
    _refuse(_flight_ratio(impacts), FLIGHT_FACTORS, "Between impacts the blocks fly as if the", file)
    known = np.isfinite(impacts.diameter_m)
    if known.any() and np.median(impacts.diameter_m[known]) > DIAMETER_M[1]:
        raise InputError(
            f"diameter_m has the median {np.median(impacts.diameter_m[known]):g}: these are no metres",
            file=file,
            advice="Divide it by 1000 if these are millimetres",
        )
    return [*_block_doubts(impacts), *_speed_doubts(impacts)]


def _refuse(ratio: float, factors: dict[float, tuple[str, str]], subject: str, file: str | Path) -> None:
    for factor, (unit, advice) in factors.items():
        if abs(ratio / factor - 1) < NEAR:
            raise InputError(f"{subject} {unit}", file=file, advice=advice[:1].upper() + advice[1:])


def _ratio(values: Array, expected: Array) -> float:
    known = np.isfinite(values) & np.isfinite(expected) & (expected > 1e-9)
    return float(np.median(values[known] / expected[known])) if known.sum() >= FEWEST else np.nan


def _flight_ratio(impacts: Impacts) -> float:
    """Median of the horizontal distance to the next impact, by what v2 and the times give."""
    order = np.lexsort((impacts.time_s, impacts.impact, _runs(impacts)))
    run, number = _runs(impacts)[order], impacts.impact[order]
    follows: Mask = (np.diff(run) == 0) & (np.diff(number) == 1)
    far = np.hypot(*np.diff(impacts.position[order, :2], axis=0).T)
    expected = np.hypot(*impacts.v2[order][:-1, :2].T) * np.diff(impacts.time_s[order])
    return _ratio(np.where(follows, far, np.nan), expected)


def _runs(impacts: Impacts) -> Array:
    """(n,) number of the stretch of rows with one site and trajectory."""
    same = (impacts.trajectory[1:] == impacts.trajectory[:-1]) & (impacts.site[1:] == impacts.site[:-1])
    return np.cumsum(np.r_[False, ~same])


def _block_doubts(impacts: Impacts) -> list[str]:
    diameter, mass = impacts.diameter_m, impacts.mass_kg
    doubts = []
    known = np.isfinite(diameter)
    if known.any() and np.median(diameter[known]) < DIAMETER_M[0]:
        doubts.append(f"diameter_m has the median {np.median(diameter[known]):g}: are these metres?")
    both = known & np.isfinite(mass) & (diameter > 0)
    if both.any():
        density = float(np.median(mass[both] / (np.pi / 6 * diameter[both] ** 3)))
        if not DENSITY_KGPM3[0] <= density <= DENSITY_KGPM3[1]:
            doubts.append(f"mass_kg and diameter_m give a density of {density:.3g} kg/m³: is one in another unit?")
    return doubts


def _speed_doubts(impacts: Impacts) -> list[str]:
    speed = norm(impacts.v1)
    known = np.isfinite(speed)
    if not known.any() or float(np.median(speed[known])) <= SPEED_MPS:
        return []
    return [f"The incident speed has the median {np.median(speed[known]):.0f} m/s: are these km/h or mm/s?"]

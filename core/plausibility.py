# SPDX-License-Identifier: GPL-3.0-or-later
"""What a number can be, by its name: what is far beyond is a mistake of a file, and would end in infinities or never.

The limits are far outside of everything that is filmed or simulated; they are no advice.
"""

from collections.abc import Mapping
from math import inf

from .errors import InputError

GREATEST_M = 1e9
"""Coordinates: survey systems have less than 1e8 m."""
OF_UNIT: Mapping[str, float] = {
    "m": GREATEST_M, "s": 1e10, "px": 1e7, "mps": 1e5, "radps": 1e6, "kg": 1e15, "J": 1e25, "deg": 1e5, "hz": 1e7,
}  # fmt: skip
"""Unit at the end of a name → the greatest amount, of either sign."""
BETWEEN: Mapping[str, tuple[float, float]] = {
    **dict.fromkeys(("d1_m", "d2_m", "d3_m", "diameter_m"), (1e-5, 1e4)),
    "density_kgpm3": (0.1, 1e5),
    "air_density_kgpm3": (0.0, 2e3),
    "drag_coefficient": (0.0, 100.0),
    "gravity_mps2": (0.0, 1e3),
    "unit_m": (1e-7, 1e7),
    **dict.fromkeys(("fx", "fy"), (1e-3, 1e7)),
    **dict.fromkeys(("cx", "cy"), (0.0, 1e7)),
    **dict.fromkeys(("k1", "k2", "k3", "p1", "p2"), (0.0, 1e6)),
    **dict.fromkeys(("width", "height"), (1, 1e5)),
    **dict.fromkeys(("nx", "ny", "nz"), (0.0, 1e3)),
    **dict.fromkeys(("rn", "rt", "r"), (0.0, 1e9)),
    **dict.fromkeys(("position", "target", "shift"), (0.0, GREATEST_M)),
}
"""Name → the least amount, of either sign, that can be if it is not zero, and the greatest."""
GREATEST_SEED = 2**63 - 1
"""Of random numbers: what fits into a whole number with a sign of 64 bits, also of a GeoPackage."""
SIGMA, GREATEST_SIGMA = "sigma_", 1e50
"""A standard deviation of 1e20 says that nothing is known; squares stay finite."""


def limits(name: str) -> tuple[float, float]:
    """The least and the greatest amount of a number of this name; signs and zeros are for its reader to judge."""
    if name in BETWEEN:
        return BETWEEN[name]
    return 0.0, GREATEST_SIGMA if name.startswith(SIGMA) else OF_UNIT.get(name.rpartition("_")[2], inf)


def implausible(name: str, value: float) -> str:
    """What is wrong with a finite number of this name; empty when nothing is."""
    least, greatest = limits(name)
    if value == 0.0 or least <= abs(value) <= greatest:
        return ""
    return f"is {value:g}, beyond what can be ({f'{least:g}' if least else '±'}{' to ' if least else ''}{greatest:g})"


def check_plausible(name: str, value: float, what: str) -> None:
    """Refuse a number that cannot be.

    Parameters
    ----------
    name : with its unit, as in files.
    what : it is, in words.

    Raises
    ------
    InputError : it cannot be.
    """
    if problem := implausible(name, value):
        raise InputError(f"The {what} {problem}", advice="Check it and its unit")

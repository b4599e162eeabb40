# SPDX-License-Identifier: GPL-3.0-or-later
"""The unit of a file's coordinates, by its name, and how large a scan is in it."""

from collections.abc import Sequence

import bpy

from ....core.constants import UNITS_M

UNITS = (  # identifier, name, what it is, its length [m]; the last one is any other
    ("METRE", "Metres", "As nearly all surveys are", UNITS_M["m"]),
    ("FOOT", "Feet", "International feet of 0.3048 m", UNITS_M["ft"]),
    ("US_FOOT", "US survey feet", "Of 1200/3937 m, as in plane coordinates of the United States", UNITS_M["us-ft"]),
    ("CENTIMETRE", "Centimetres", "Of 0.01 m", UNITS_M["cm"]),
    ("MILLIMETRE", "Millimetres", "Of 0.001 m, as in many programs for construction", UNITS_M["mm"]),
)
OTHER = ("OTHER", "Other", "Give its length in metres")
ITEMS = [(*words, "", number) for number, (*words, _) in enumerate(UNITS)] + [(*OTHER, "", len(UNITS))]
SAME = 1e-7
"""Relative difference that single precision leaves; the two feet are 2e-6 apart."""


def exact(unit_m: float) -> float:
    """A length that Blender has kept in single precision [m], with all its digits where it is a known unit."""
    number = numbered(unit_m)
    return UNITS[number][3] if number < len(UNITS) else float(f"{unit_m:.7g}")


def numbered(unit_m: float) -> int:
    """The place of a unit in the menu."""
    found = (i for i, unit in enumerate(UNITS) if abs(unit_m - unit[3]) <= SAME * unit[3])
    return next(found, len(UNITS))


def get(self: bpy.types.Operator) -> int:
    """How the menu reads the operator's `unit_m`, until another length is to be typed."""
    return len(UNITS) if self.types_unit else numbered(self.unit_m)


def set_by_name(self: bpy.types.Operator, value: int) -> None:
    """How the menu writes it."""
    self.types_unit = value == len(UNITS)
    if not self.types_unit:
        self.unit_m = UNITS[value][3]


def size(extent_m: Sequence[float], factor: float) -> str:
    """The sides of a box, to see whether a unit can be right; `factor` is what they are multiplied by."""
    sides = " × ".join(_metres(factor * side) for side in extent_m)
    return f"Read so, it measures {sides} m."


def _metres(length_m: float) -> str:
    return f"{length_m:,.0f}" if length_m >= 100 else f"{length_m:.3g}"

# SPDX-License-Identifier: GPL-3.0-or-later
"""The unit of a file's coordinates, by its name, and how large a scan is in it."""

from collections.abc import Sequence

import bpy

from ....core.constants import UNITS_M

UNITS = (  # identifier, name, what it is, its length [m]; 0 leaves it to the file; the last one is any other
    ("FILE", "As the file says", "That of its coordinate system; metres where it says nothing", 0.0),
    ("METRE", "Metres", "As nearly all surveys are", UNITS_M["m"]),
    ("FOOT", "Feet", "International feet of 0.3048 m", UNITS_M["ft"]),
    ("US_FOOT", "US survey feet", "Of 1200/3937 m, as in plane coordinates of the United States", UNITS_M["us-ft"]),
    ("CENTIMETRE", "Centimetres", "Of 0.01 m", UNITS_M["cm"]),
    ("MILLIMETRE", "Millimetres", "Of 0.001 m, as in many programs for construction", UNITS_M["mm"]),
)
OTHER = ("OTHER", "Other", "Give its length in metres")
ITEMS = [(*words, "", number) for number, (*words, _) in enumerate(UNITS)] + [(*OTHER, "", len(UNITS))]
HEIGHT_ITEMS = [
    ("SAME", "As the file unit", "That of its coordinates, or as the file says of its heights", "", 0),
    *((*words, "", number) for number, (*words, length) in enumerate(UNITS) if length),
]
"""Units of heights, which may differ from that of the coordinates in plan."""
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


def height_m(identifier: str) -> float | None:
    """The length of a unit of heights [m]; None when nothing is said of it."""
    return next((length for name, *_, length in UNITS if name == identifier), None)


def size(extent_m: Sequence[float], factors: Sequence[float]) -> str:
    """The sides of a box, to see whether a unit can be right; `factors` are what they are multiplied by."""
    sides = " × ".join(_metres(factor * side) for side, factor in zip(extent_m, factors, strict=True))
    return f"Read so, it measures {sides} m."


def _metres(length_m: float) -> str:
    return f"{length_m:,.0f}" if length_m >= 100 else f"{length_m:.3g}"

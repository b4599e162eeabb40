# SPDX-License-Identifier: GPL-3.0-or-later
"""Columns in other units: a column's name ends in its unit, and what is not in ours is converted or refused."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import pi
from pathlib import Path

from ..constants import UNITS_M
from ..errors import InputError

FACTORS: Mapping[str, Mapping[str, float]] = {
    "m": {
        "mm": 0.001,
        "cm": 0.01,
        "km": 1000.0,
        "ft": UNITS_M["ft"],
        **dict.fromkeys(("usft", "us-ft", "ftus"), UNITS_M["us-ft"]),
    },
    "cm": {"mm": 0.1, "m": 100.0, "in": 2.54},
    "s": {"us": 1e-6, "ms": 0.001, "min": 60.0},
    "kg": {"g": 0.001, "t": 1000.0, "lb": 0.45359237},
    "mps": {
        **dict.fromkeys(("m/s", "ms-1"), 1.0),
        **dict.fromkeys(("kmh", "km/h", "kmph", "kph"), 1 / 3.6),
        **dict.fromkeys(("fps", "ft/s"), 0.3048),
        **dict.fromkeys(("cmps", "cm/s"), 0.01),
        **dict.fromkeys(("mmps", "mm/s"), 0.001),
    },
    "deg": {"°": 1.0, "rad": 180 / pi},
    "radps": {"rad/s": 1.0, "degps": pi / 180, "deg/s": pi / 180, "rpm": pi / 30},
    "J": {"kj": 1000.0},
    "kgpm3": {"kg/m3": 1.0, "gpcm3": 1000.0, "g/cm3": 1000.0},
}
"""Unit at the end of our names → another, in lower case → what its numbers are multiplied by."""
WORDS = {"mps": "m/s", "deg": "degrees", "radps": "rad/s", "kgpm3": "kg/m³"}
"""Where the end of a name is not how the unit is written."""


@dataclass(frozen=True)
class OtherUnit:
    """A column in another unit: its name in the file, and what its numbers are multiplied by."""

    name: str
    factor: float


def other_units(path: Path, header: Sequence[str], known: Sequence[str], row: int) -> dict[str, OtherUnit]:
    """Our name → the column that is the same in another unit, where ours is not there.

    Raises
    ------
    InputError : two columns are the same one.
    """
    found: dict[str, OtherUnit] = {}
    for name in header:
        for ours in _meant(name, header, known):
            stem, unit = _parts(ours)
            factor = FACTORS[unit].get(_parts(name)[1].lower()) if not stem.endswith("_per") else None
            if factor is None:
                continue
            if ours in found:
                raise InputError(
                    f"The columns {found[ours].name} and {name} are both {ours} in another unit",
                    file=path,
                    row=row,
                    advice="Remove one of them",
                )
            found[ours] = OtherUnit(name, factor)
    return found


def unknown_units(header: Sequence[str], known: Sequence[str]) -> dict[str, str]:
    """Columns that have the name of one of ours but for a unit that is not known → ours, which is not there."""
    return {name: meant[0] for name in header if (meant := _meant(name, header, known))}


def unknown_unit(path: Path, name: str, ours: str, row: int) -> InputError:
    """The refusal of such a column."""
    unit = _parts(ours)[1]
    return InputError(
        f"The column {name} is {ours} in a unit that is not known",
        file=path,
        row=row,
        advice=f"Convert it to {WORDS.get(unit, unit)} and rename it to {ours}; known are {', '.join(FACTORS[unit])}. "
        f"If it is something else, give it a name that does not begin with {_parts(ours)[0]}_",
    )


def if_in_unit(name: str) -> str:
    """What to add to the advice to give a column one of our names."""
    unit = _parts(name)[1]
    return f" if it is in {WORDS.get(unit, unit)}" if unit in FACTORS else ""


def _meant(name: str, header: Sequence[str], known: Sequence[str]) -> list[str]:
    """Our columns with this stem and another unit; none when one of them is there, or the name is ours."""
    stem, suffix = _parts(name)
    ours = [one for one in known if _parts(one)[0] == stem and _parts(one)[1] in FACTORS] if suffix else []
    return [] if name in known or any(one in header for one in ours) else ours


def _parts(name: str) -> tuple[str, str]:
    stem, _, unit = name.rpartition("_")
    return stem, unit

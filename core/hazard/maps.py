# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps: one value in each cell, conditional on the release of the blocks."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from ..vectors import Array
from .cells import Cells

SHARES = (50, 90, 95, 99)
"""Percentiles of which there is a map."""
CLASSES_KJ = (30, 300)
"""Energies between the Swiss classes of intensity: low, medium, high."""


@dataclass(frozen=True)
class Layer:
    """What one map shows.

    Attributes
    ----------
    title : in a legend, without the unit.
    unit : "" for a number.
    meaning : a sentence for who reads the map.
    """

    title: str
    unit: str
    meaning: str


@dataclass(frozen=True, eq=False)
class Maps:
    """The maps of n blocks.

    Attributes
    ----------
    cells : what the rows and columns are.
    blocks : n.
    layers : name, see `LAYERS` → (rows, columns), the first row in the south; NaN where there is nothing to say.
    """

    cells: Cells
    blocks: int
    layers: Mapping[str, Array]


QUANTITIES: Mapping[str, tuple[str, str, str]] = MappingProxyType(
    {
        "V": ("speed", "m/s", "the greatest speed of the block's centre"),
        "E": ("kinetic energy", "kJ", "the greatest kinetic energy, of translation and rotation"),
        "Et": ("translational energy", "kJ", "the greatest kinetic energy of translation"),
        "Ph": ("passing height", "m", "the greatest height of the block's centre vertically above the terrain"),
    }
)
"""What each passage has: prefix of its maps → name, unit, what it is."""


def _layers() -> dict[str, Layer]:
    found = {
        "Reach_probability": Layer(
            "Reach probability", "%", "Share of the released blocks that enter the cell at least once"
        ),
        "Nr_passages": Layer("Passages", "", "How often blocks pass through the cell; a block that comes back counts"),
        "Nr_blocks": Layer("Blocks", "", "How many blocks enter the cell at least once"),
        "Nr_deposited": Layer("Deposited blocks", "", "How many blocks come to rest in the cell"),
    }
    for prefix, (name, unit, what) in QUANTITIES.items():
        each = f"of the passages through the cell, of each {what}"
        found[f"{prefix}_mean"] = Layer(f"Mean {name}", unit, f"Mean {each}")
        for share in SHARES:
            percentile = "Median" if share == 50 else f"{share} % value"
            found[f"{prefix}_{share}CI"] = Layer(
                f"{name.capitalize()}, {percentile.lower()}", unit, f"{percentile} {each}"
            )
        found[f"{prefix}_max"] = Layer(f"Greatest {name}", unit, f"Greatest {each}")
        found[f"{prefix}_95CI_error"] = Layer(
            f"{name.capitalize()}, standard error of the 95 % value", unit,
            "What the 95 % value would scatter by with as many other blocks; empty where they are too few to say",
        )  # fmt: skip
    for limit in CLASSES_KJ:
        found[f"E_over_{limit}kJ"] = Layer(
            f"Passages above {limit} kJ",
            "%",
            f"Share of the passages with more kinetic energy than {limit} kJ",
        )
    return found


LAYERS: Mapping[str, Layer] = MappingProxyType(_layers())
"""All maps. The names are those that programs for Rockyfor3D's maps know, where these have one."""

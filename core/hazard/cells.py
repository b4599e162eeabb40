# SPDX-License-Identifier: GPL-3.0-or-later
"""The square cells of maps."""

from dataclasses import dataclass
from math import ceil, floor, isfinite

from ..errors import InputError
from ..memory import available_bytes, in_words
from ..terrain.cloud import Cloud
from ..terrain.surface import Surface

LEAST_M = 0.05
"""Smaller cells say nothing about blocks."""
CELL_BYTES = 600
"""Of one cell in all maps together, while they are made."""


@dataclass(frozen=True)
class Cells:
    """Square cells in plan, rows from south to north.

    Attributes
    ----------
    x0_m, y0_m : the south-west corner, local.
    size_m : of a side.
    columns, rows : towards the east, towards the north.

    Raises
    ------
    InputError : a size that is not finite or below `LEAST_M`; no cells, or more than the memory has room for.
    """

    x0_m: float
    y0_m: float
    size_m: float
    columns: int
    rows: int

    def __post_init__(self) -> None:
        if not all(isfinite(value) for value in (self.x0_m, self.y0_m, self.size_m)):
            raise InputError("The cells of the maps have a place or size that is not finite", advice="Give metres")
        check_size(self.size_m)
        if self.columns < 1 or self.rows < 1:
            raise InputError(f"The maps have {self.columns} × {self.rows} cells", advice="Give at least one")
        needed, there = len(self) * CELL_BYTES, available_bytes()
        if needed > there:
            coarser = self.size_m * (needed / there) ** 0.5
            raise InputError(
                f"Maps of {self.columns} × {self.rows} cells of {self.size_m:g} m need {in_words(needed)} of memory, "
                f"and {in_words(there)} are there",
                advice=f"Give cells of {coarser:.2g} m or more",
            )

    def __len__(self) -> int:
        return self.columns * self.rows

    @property
    def shape(self) -> tuple[int, int]:
        """Rows, columns: of the arrays of maps."""
        return self.rows, self.columns


def check_size(size_m: float) -> None:
    """Raises `InputError` for cells of such a size."""
    if not (isfinite(size_m) and size_m >= LEAST_M):
        raise InputError(
            f"Cells of {size_m:g} m are no cells for maps", advice=f"Give {LEAST_M:g} m or more; 1 to 5 m are usual"
        )


def cells_over(terrain: Surface | Cloud, size_m: float) -> Cells:
    """The cells that cover a terrain; their corners are at whole multiples of the size in survey coordinates.

    Raises
    ------
    InputError : see `Cells`.
    """
    check_size(size_m)
    low, high = terrain.bounds
    corner, counts = [], []
    for least, most, moved in zip(low[:2].tolist(), high[:2].tolist(), terrain.shift.vector[:2].tolist(), strict=True):
        first = floor((least + moved) / size_m)
        corner.append(first * size_m - moved)
        counts.append(max(ceil((most + moved) / size_m) - first, 1))
    return Cells(corner[0], corner[1], size_m, counts[0], counts[1])

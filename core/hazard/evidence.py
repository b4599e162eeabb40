# SPDX-License-Identifier: GPL-3.0-or-later
"""On how many blocks the values of maps rest, and whether there is terrain where they stand."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..terrain.cloud import Cloud, heights_above_points
from ..terrain.raycast import heights_above
from ..terrain.surface import Surface
from ..vectors import Array
from .cells import Cells
from .face_tally import FaceMaps
from .maps import Maps

FEW = 20
"""Of so many blocks one is above the 95 % value on average; of fewer it is hardly more than the greatest seen."""
CELLS, FACES = "cells", "faces"


@dataclass(frozen=True, eq=False)
class Evidence:
    """Which parts of a map say little; they are hatched wherever maps are shown.

    Attributes
    ----------
    reached : as the map; entered by a block.
    few : entered, by fewer than `FEW` blocks.
    beyond : entered, and without terrain below the centre: the scan ends there.
    parts : "cells" or "faces".
    """

    reached: NDArray[np.bool_]
    few: NDArray[np.bool_]
    beyond: NDArray[np.bool_]
    parts: str = CELLS

    @property
    def weak(self) -> NDArray[np.bool_]:
        """What is hatched."""
        return self.few | self.beyond

    @property
    def in_words(self) -> tuple[str, ...]:
        """What the hatching says, for legends and metadata; nothing where there is none."""
        number = int(self.reached.sum())
        found = ((f"fewer than {FEW} blocks", self.few), ("beyond the terrain", self.beyond))
        return tuple(f"{words}: {int(of.sum()):,} of {number:,} {self.parts}" for words, of in found if of.any())


def cell_evidence(maps: Maps, terrain: Surface | Cloud) -> Evidence:
    """That of the cells of maps.

    Parameters
    ----------
    terrain : that the blocks fell on.
    """
    cells, reached, few = maps.cells, entered(maps), few_blocks(maps)
    row, column = np.nonzero(reached)
    centre = np.array([cells.x0_m, cells.y0_m]) + cells.size_m * (np.column_stack([column, row]) + 0.5)
    places = np.column_stack([centre, np.full(len(centre), float(terrain.bounds[1, 2]) + 1.0)])
    above = heights_above(terrain, places) if isinstance(terrain, Surface) else heights_above_points(terrain, places)
    beyond = np.zeros(reached.shape, np.bool_)
    beyond[row, column] = np.isnan(above)
    return Evidence(reached, few, beyond)


def entered(maps: Maps) -> NDArray[np.bool_]:
    """(rows, columns) which cells blocks enter."""
    found = np.zeros(maps.cells.shape, np.bool_)
    for values in maps.layers.values():
        found |= np.nan_to_num(values, nan=0.0) > 0
    return found


def few_blocks(maps: Maps) -> NDArray[np.bool_]:
    """(rows, columns) which cells fewer than `FEW` blocks enter; none where it was not counted."""
    blocks = np.nan_to_num(maps.layers.get("Nr_blocks", np.zeros(maps.cells.shape)), nan=0.0)
    return (blocks > 0) & (blocks < FEW)


def face_evidence(maps: FaceMaps) -> Evidence:
    """That of the faces of maps: they are the terrain, so none is beyond it."""
    blocks = np.nan_to_num(maps.layers["Nr_blocks"], nan=0.0)
    reached = blocks > 0
    return Evidence(reached, reached & (blocks < FEW), np.zeros(reached.shape, np.bool_), FACES)


def row_runs(mask: NDArray[np.bool_]) -> NDArray[np.intp]:
    """(k, 3) row, first column, and column behind the last, of all stretches of a mask (rows, columns) along rows."""
    padded = np.zeros((mask.shape[0], mask.shape[1] + 2), np.int8)
    padded[:, 1:-1] = mask
    change = np.diff(padded, axis=1)
    row, first = np.nonzero(change == 1)
    end = np.nonzero(change == -1)[1]
    return np.column_stack([row, first, end])


def outlines(cells: Cells, runs: NDArray[np.intp]) -> Array:
    """(k, 5, 2) closed rectangles around stretches of cells along rows (see `row_runs`), local [m]."""
    row, first, end = runs.T.astype(np.float64)
    corners = np.stack([[first, row], [end, row], [end, row + 1], [first, row + 1], [first, row]], axis=0)
    places: Array = np.array([cells.x0_m, cells.y0_m]) + cells.size_m * corners.transpose(2, 0, 1)
    return places

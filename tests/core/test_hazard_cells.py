# SPDX-License-Identifier: GPL-3.0-or-later
"""The cells of maps: where they lie, and which cannot be."""

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.georeference import GlobalShift
from rockfall.core.hazard import cells as cells_module
from rockfall.core.hazard.cells import Cells, cells_over
from rockfall.core.terrain.surface import Surface

SQUARE = np.array([[0, 1, 2], [0, 2, 3]], np.int32)


def terrain(low: tuple[float, float], high: tuple[float, float], shift: GlobalShift) -> Surface:
    corners = [(low[0], low[1], 0), (high[0], low[1], 0), (high[0], high[1], 0), (low[0], high[1], 0)]
    return Surface(np.array(corners, np.float64), SQUARE, shift, "plane")


def test_cells_lie_on_multiples_of_their_size_in_survey_coordinates() -> None:
    cells = cells_over(terrain((0.3, -2.5), (6.1, 3.0), GlobalShift(2_600_001, 1_200_000)), 2.0)
    assert (cells.x0_m, cells.y0_m) == (-1.0, -4.0)
    assert cells.shape == (4, 4)
    assert cells.x0_m + 4 * 2.0 >= 6.1


@pytest.mark.parametrize("size", [0.001, 0.0, -1.0, float("nan"), float("inf")])
def test_sizes_that_are_none(size: float) -> None:
    with pytest.raises(InputError, match="no cells for maps"):
        cells_over(terrain((0, 0), (10, 10), GlobalShift()), size)


def test_more_cells_than_the_memory_has_room_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cells_module, "available_bytes", lambda: 1_000_000)
    with pytest.raises(InputError, match=r"Give cells of 2\.4 m or more"):
        cells_over(terrain((0, 0), (100, 100), GlobalShift()), 1.0)


def test_a_corner_that_is_not_finite() -> None:
    with pytest.raises(InputError, match="not finite"):
        Cells(float("nan"), 0.0, 1.0, 2, 2)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The nodes of the index as flights look at them: the terrain is within them, in single precision too."""

import numpy as np
import pytest
from rockfall.core.simulation.pair_kernels import CODES, SECOND
from rockfall.core.simulation.pairs import make_pairs
from rockfall.core.terrain.index import build_index


@pytest.mark.parametrize("triangles", [1, 4, 5, 900])
@pytest.mark.parametrize("offset", [0.0, 123_456.7])
def test_every_triangle_is_in_each_of_its_nodes(triangles: int, offset: float) -> None:
    rng = np.random.default_rng(triangles)
    middles = rng.uniform(-50, 50, (triangles, 1, 3)) + offset
    soup = (middles + rng.normal(0, 1, (triangles, 3, 3)) * [1, 1, 1e-3]).reshape(-1, 3)
    soup[-3:] = soup[-1]  # one without area
    index = build_index(soup, np.arange(3 * triangles, dtype=np.int32).reshape(-1, 3))
    pairs, children = make_pairs(index)
    assert pairs.ctypes.data % 128 == 0
    seen = []

    def within(row: int, side: int) -> list[int]:
        """The triangles of a child, each looked for in its box and between its planes."""
        own = pairs[row, SECOND * side : SECOND * (side + 1)].astype(np.float64)
        code = int(children[row, CODES + side])
        if code >= 0:
            members = within(code, 0) + within(code, 1)
        else:
            first, count = divmod(-1 - code, 8)
            members = list(range(first, first + count))
            seen.extend(members)
        corners = index.corners[members].reshape(-1, 3)
        assert (own[:3] <= corners.min(axis=0)).all()
        assert (corners.max(axis=0) <= own[3:6]).all()
        heights = corners @ own[6:9]
        assert own[9] <= heights.min() + 1e-9
        assert heights.max() - 1e-9 <= own[10]
        tight = 1e-6 * max(1.0, np.abs(corners).max())
        assert (corners.min(axis=0) - own[:3] < tight).all()
        assert own[10] - heights.max() < tight
        return members

    within(0, 0)
    if len(index.count) > 1:
        within(0, 1)
    else:
        assert np.isnan(pairs[0, SECOND])
    assert sorted(seen) == list(range(triangles))

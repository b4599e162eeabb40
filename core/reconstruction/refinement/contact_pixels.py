# SPDX-License-Identifier: GPL-3.0-or-later
"""Pixels of a block between its landing and its take-off, where it does not move evenly: they say little of flights."""

from collections.abc import Sequence

import numpy as np

from ...vectors import Mask
from ..picks import Picks
from .views import PixelObservations, View


def while_landed(picks: Picks, views: Sequence[View], observations: PixelObservations) -> Mask:
    """(m,) whether a pixel was seen after an impact was marked and before its take-off was."""
    landed = np.zeros(len(observations), dtype=np.bool_)
    landing = np.flatnonzero(picks.leaves_at != np.arange(len(picks)))
    if not landing.size:
        return landed
    common = np.empty(len(observations))
    for i, view in enumerate(views):
        mine = observations.view == i
        common[mine] = view.clock.to_common(observations.time_s[mine])
    for pick in landing.tolist():
        begin, end = picks.time_s[[pick, pick + 1]]
        landed |= (observations.trajectory == picks.trajectory[pick]) & (common > begin) & (common < end)
    return landed

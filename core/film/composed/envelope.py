# SPDX-License-Identifier: GPL-3.0-or-later
"""The corridor that holds 95 % of the paths that a model with chance simulates."""

from collections.abc import Sequence

import numpy as np

from ...terrain.raycast import heights_above
from ...terrain.surface import Surface
from ...vectors import Array
from .falls import Fall

SHARE = 0.95
FEWEST = 20
"""Paths, below which no corridor is drawn."""
STATIONS = 80
ABOVE_M = 200.0


def envelope(falls: Sequence[Fall], surface: Surface, share: float = SHARE) -> Array | None:
    """Outline of the corridor of the blocks of one model, on the terrain.

    Returns
    -------
    (m, 3) closed, without the first point again; None where the paths are too few, or lead nowhere.

    Notes
    -----
    Across the way from the mean start to the mean end, at stations along it: the quantiles of where the paths first
    cross each. The corridor ends where fewer than 1 − `share` of the paths arrive.
    """
    if len(falls) < FEWEST:
        return None
    starts, ends = (np.array([fall.position[i, :2] for fall in falls]) for i in (0, -1))
    origin, way = starts.mean(axis=0), ends.mean(axis=0) - starts.mean(axis=0)
    length = float(np.hypot(*way))
    if length < 1e-6:
        return None
    along, across = way / length, np.array([-way[1], way[0]]) / length
    farthest = max(float(((fall.position[:, :2] - origin) @ along).max()) for fall in falls)
    stations = np.linspace(0.0, farthest, STATIONS)
    offset = np.full((len(falls), STATIONS), np.nan)
    for row, fall in enumerate(falls):
        away = fall.position[:, :2] - origin
        s, side = np.maximum.accumulate(away @ along), away @ across
        offset[row] = np.interp(stations, s, side, right=np.nan)
        offset[row, stations < s[0]] = np.nan
    arrived = np.isfinite(offset).sum(axis=0)
    kept = arrived >= max((1 - share) * len(falls), 2)
    if kept.sum() < 2:
        return None
    low, high = np.nanquantile(offset[:, kept], [(1 - share) / 2, (1 + share) / 2], axis=0)
    sides = [origin + stations[kept][:, None] * along + edge[:, None] * across for edge in (low, high)]
    outline = np.concatenate([sides[0], sides[1][::-1]])
    top = float(surface.vertices[:, 2].max()) + ABOVE_M
    above = np.column_stack([outline, np.full(len(outline), top)])
    ground = top - heights_above(surface, above)
    placed = np.column_stack([outline, ground])
    placed = placed[np.isfinite(ground)]
    return placed if len(placed) > 2 else None

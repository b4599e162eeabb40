# SPDX-License-Identifier: GPL-3.0-or-later
"""How well a track's places are known: from their scatter about smooth motion, flight by flight."""

import numpy as np

from ..vectors import Array
from .kinks import find_kinks

NEIGHBOURS = 8
SHAPE = 0.005
"""Standard deviation of the centre of a block that is no sphere, in diameters."""


def scatter_sigma(time_s: Array, stable: Array, fitted_px: Array, diameter_px: Array, score: Array) -> Array:
    """(m,) standard deviations of a track that agree with how far its places scatter about smooth motion [px].

    Parameters
    ----------
    time_s : (m,) [s].
    stable : (m, 2) places in the reference frame of the background [px].
    fitted_px, diameter_px : (m,) standard deviation and size that the fit of each frame says.
    score : (m,) likeness to the block.

    Notes
    -----
    What the fit of one frame says is scaled by one factor, from the residuals of the places against parabolas through
    their neighbours in the same flight. A share of the size stands for the shape, whose turning shows only slowly;
    where the block looks less like itself than usual, because a part of it is hidden, more is added.
    """
    if time_s.size < 3:
        return 2 * fitted_px + 0.05 * diameter_px
    unlike = np.maximum(np.median(score) - 0.03 - score, 0)
    fitted, shape = np.maximum(fitted_px, 0.01), SHAPE * diameter_px + 0.35 * diameter_px * unlike
    scale, breaks = 1.5, np.zeros(0)
    for again in (False, True, True):
        if again:
            breaks = find_kinks(time_s, stable, np.hypot(fitted * scale, shape)).time_s
        ratio = _smooth_ratio(time_s, stable, np.hypot(fitted * scale, shape), breaks)
        if ratio.size < 8:
            break
        scale = float(np.clip(scale * np.sqrt(np.mean(np.minimum(ratio, 12.0)) / 2), 0.3, 8.0))
    return np.hypot(fitted * scale, shape)


def _smooth_ratio(time_s: Array, place: Array, sigma: Array, breaks: Array) -> Array:
    """(k,) squared residuals, both coordinates, over their expected variance; chi-squared with 2 degrees of freedom.

    Each is that of a sighting against the parabola through its neighbours on both sides, none beyond a break.
    """
    flight = np.searchsorted(breaks, time_s)
    ratio = []
    for i in range(time_s.size):
        window = np.arange(max(i - NEIGHBOURS, 0), min(i + NEIGHBOURS + 1, time_s.size))
        window = window[(flight[window] == flight[i]) & (window != i)]
        if min((window < i).sum(), (window > i).sum()) < 3:
            continue
        when = (time_s[window] - time_s[i]) / np.ptp(time_s[window])
        design = when[:, None] ** np.arange(3) / sigma[window, None]
        spread = np.linalg.inv(design.T @ design)
        value = spread @ design.T @ (place[window] / sigma[window, None])
        ratio.append(np.sum((place[i] - value[0]) ** 2) / (sigma[i] ** 2 + spread[0, 0]))
    return np.array(ratio)

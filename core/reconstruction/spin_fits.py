# SPDX-License-Identifier: GPL-3.0-or-later
"""Which steady rates of turning fit the phases of one point of a block: whole turns between two marks are not seen."""

from dataclasses import dataclass

import numpy as np

from ..vectors import Array

STEPS = 16
"""Rates that are tried, for each turn over the time between the first and the last mark."""
MOST_TRIED = 200_000
SAME_FIT = 9.0
"""A rate fits as well as the best one up to this much more of χ²: three standard deviations."""


@dataclass(frozen=True, eq=False)
class RateFits:
    """The c steady rates that fit n phases alike, from the slowest on.

    Attributes
    ----------
    rate : (c,) turns per second, signed.
    turns : (c, n) the phases with the whole turns that this rate has made between them.
    chi_square : (c,) weighted squares of what is left.
    """

    rate: Array
    turns: Array
    chi_square: Array

    def __len__(self) -> int:
        return self.rate.size


def fit_rates(time_s: Array, phase: Array, sigma_turns: Array, limit: float) -> RateFits:
    """All steady rates up to a limit that fit as well as the best of them.

    Parameters
    ----------
    time_s : (n,) of two marks or more, all different [s].
    phase : (n,) turns, known but for whole ones.
    sigma_turns : (n,) standard deviations, above zero.
    limit : of the rate in either direction [turns/s].
    """
    span = float(np.ptp(time_s))
    count = int(np.clip(np.ceil(2 * limit * span * STEPS), 3, MOST_TRIED))
    tried = np.linspace(-limit, limit, count | 1)
    since = time_s - time_s[0]
    whole = np.unique(np.round(tried[:, None] * since - (phase - phase[0])), axis=0)
    turns = phase + whole
    weight = sigma_turns**-2 / (sigma_turns**-2).sum()
    lever = since - weight @ since
    rate = (turns @ (weight * lever)) / (weight @ lever**2)
    left = turns - (turns @ weight)[:, None] - rate[:, None] * lever
    chi_square = ((left / sigma_turns) ** 2).sum(axis=1)
    good = np.flatnonzero(np.abs(rate) <= limit)
    if not good.size:  # even the slowest is beyond it
        good = np.argmin(np.abs(rate), keepdims=True)
    good = good[chi_square[good] <= chi_square[good].min() + SAME_FIT]
    order = good[np.argsort(np.abs(rate[good]), kind="stable")]
    return RateFits(rate[order], turns[order], chi_square[order])

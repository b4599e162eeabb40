# SPDX-License-Identifier: GPL-3.0-or-later
"""How well n runs know a mean and a quantile."""

from dataclasses import dataclass

import numpy as np

from ..vectors import Array

LEVEL = 0.95
"""Of the intervals."""


@dataclass(frozen=True)
class Convergence:
    """The mean and the 95 % quantile of n values, and how far they may be off because n is finite.

    Attributes
    ----------
    mean, standard_error : s/√n; the latter is NaN for one value.
    q95 : the value that 95 % do not exceed (Hyndman and Fan 1996, type 7).
    q95_low, q95_high : its interval, see `Quantile`.
    """

    mean: float
    standard_error: float
    q95: float
    q95_low: float
    q95_high: float


@dataclass(frozen=True)
class Quantile:
    """A quantile of n values, and its interval.

    Attributes
    ----------
    share : of the values, that do not exceed it.
    value : Hyndman and Fan 1996, type 7.
    low, high : interval at the level `LEVEL`, free of any distribution: from the order statistics whose ranks are
        binomial (Conover 1999, § 3.2). NaN where there are too few values for a bound.
    """

    share: float
    value: float
    low: float
    high: float

    @property
    def known_to(self) -> float:
        """Half the width of the interval, as a part of the value; infinite where there is no interval."""
        half = (self.high - self.low) / 2
        if np.isnan(half):
            return np.inf
        return half / self.value if half else 0.0


def quantile(values: Array, share: float) -> Quantile:
    """A quantile of (n,) values, n ≥ 1, with its interval."""
    from scipy import stats

    n, ordered = values.size, np.sort(values)
    below, above = stats.binom.ppf([(1 - LEVEL) / 2, (1 + LEVEL) / 2], n, share).astype(int)
    return Quantile(
        share,
        float(np.quantile(ordered, share)),
        float(ordered[below - 1]) if below >= 1 else np.nan,
        float(ordered[above]) if above < n else np.nan,
    )


def convergence(values: Array) -> Convergence:
    """What (n,) values say of the distribution that they were drawn from, n ≥ 1."""
    n, q95 = values.size, quantile(values, 0.95)
    error = float(values.std(ddof=1) / np.sqrt(n)) if n > 1 else np.nan
    return Convergence(float(values.mean()), error, q95.value, q95.low, q95.high)

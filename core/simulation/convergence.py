# SPDX-License-Identifier: GPL-3.0-or-later
"""How well n runs know a mean and a quantile."""

from dataclasses import dataclass

import numpy as np
from scipy import stats

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
    q95_low, q95_high : interval of the 95 % quantile at the level `LEVEL`, free of any distribution: from the order
        statistics whose ranks are binomial (Conover 1999, § 3.2). NaN where there are too few values for a bound.
    """

    mean: float
    standard_error: float
    q95: float
    q95_low: float
    q95_high: float


def convergence(values: Array) -> Convergence:
    """What (n,) values say of the distribution that they were drawn from, n ≥ 1."""
    n, ordered = values.size, np.sort(values)
    below, above = stats.binom.ppf([(1 - LEVEL) / 2, (1 + LEVEL) / 2], n, 0.95).astype(int)
    return Convergence(
        float(values.mean()),
        float(values.std(ddof=1) / np.sqrt(n)) if n > 1 else np.nan,
        float(np.quantile(ordered, 0.95)),
        float(ordered[below - 1]) if below >= 1 else np.nan,
        float(ordered[above]) if above < n else np.nan,
    )

# SPDX-License-Identifier: GPL-3.0-or-later
"""How well n runs know a mean and a quantile."""

from dataclasses import dataclass
from math import ceil, inf, isfinite, log

import numpy as np

from ..vectors import Array, Indices, Mask

LEVEL = 0.95
"""Of the intervals."""


@dataclass(frozen=True)
class Convergence:
    """The mean and the 95 % quantile of n values, and how far they may be off because n is finite.

    Attributes
    ----------
    mean, standard_error : s/√n, or over clusters; the latter is NaN for one value.
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
    count : n.
    effective : so many independent values would know as much as these; n where each is independent of the others.
    most_effective : what more values from the same clusters would bring it to at most; infinite where there are none.
    """

    share: float
    value: float
    low: float
    high: float
    count: int = 0
    effective: float = 0.0
    most_effective: float = inf

    @property
    def known_to(self) -> float:
        """Half the width of the interval, as a part of the value; infinite where there is no interval."""
        half = (self.high - self.low) / 2
        if np.isnan(half):
            return np.inf
        return half / self.value if half else 0.0


def fewest(share: float) -> int:
    """Independent values from which on the interval of a quantile has an upper bound.

    The greatest of n values is below the quantile with the probability shareⁿ, which must not be above the half of
    1 − `LEVEL`.

    >>> fewest(0.95), fewest(0.99)
    (72, 368)
    """
    return ceil(log((1 - LEVEL) / 2) / log(share))


def quantile(values: Array, share: float, cluster: Indices | None = None) -> Quantile:
    """A quantile of (n,) values, n ≥ 1, with its interval.

    Parameters
    ----------
    cluster : (n,) values of one cluster depend on one another, as those of blocks from one release; None where all
        are independent. Values of a single cluster are taken as independent: what another would give they cannot tell.

    Notes
    -----
    With clusters the ranks are those of as many independent values as know the share of values below the quantile
    equally well: Woodruff (1952), with the effective number of Korn and Graubard (1998, Survey Methodology 24:193),
    which pays for the few clusters that it is found from with Student's t.
    """
    from scipy import stats

    n, ordered = values.size, np.sort(values)
    value = float(np.quantile(ordered, share))
    effective, most = (float(n), inf) if cluster is None else _effective(values <= value, cluster)
    size = int(effective)
    below, above = stats.binom.ppf([(1 - LEVEL) / 2, (1 + LEVEL) / 2], size, share).astype(int) if size else (0, 0)
    first, last = int((below - 1) * n // size) if size else -1, -int(-(above + 1) * n // size) - 1 if size else n
    return Quantile(
        share,
        value,
        float(ordered[first]) if below >= 1 else np.nan,
        float(ordered[last]) if above < size else np.nan,
        n,
        effective,
        most,
    )


def _effective(under: Mask, cluster: Indices) -> tuple[float, float]:
    """So many independent values know the share of values under a limit as well; and at most, with ever more values."""
    from scipy import stats

    n = under.size
    _, own, sizes = np.unique(cluster, return_inverse=True, return_counts=True)
    k = sizes.size
    if k in (1, n):
        return float(n), inf
    share = float(under.mean())
    apart = np.bincount(own, under - share, minlength=k)
    variance = k / (k - 1) * float((apart**2).sum()) / n**2
    if not variance > 0:
        return float(k), float(k)
    plain = share * (1 - share) / variance
    paid = float(stats.t.ppf((1 + LEVEL) / 2, n - 1) / stats.t.ppf((1 + LEVEL) / 2, k - 1)) ** 2
    size = float((sizes**2).sum()) / n  # of the cluster of a value
    together = (n / plain - 1) / (size - 1) if size > 1 else 0.0
    most = n / size / together * paid if together > 0 else inf
    return min(plain * paid, float(n)), most


def values_needed(known: Quantile, times: float) -> float:
    """How many times as many values make the effective number so many times as large; infinite where none do.

    Clusters stay the same, and each has so many times as many values.

    >>> values_needed(Quantile(0.95, 1.0, 0.9, 1.1, 100, 100.0), 2.0)
    2.0
    """
    if times <= 1 or not known.effective > 0:
        return 1.0 if times <= 1 else inf
    if not isfinite(known.most_effective):
        return times
    most = known.most_effective / known.effective
    return times * (most - 1) / (most - times) if most > times else inf


def convergence(values: Array, cluster: Indices | None = None) -> Convergence:
    """What (n,) values say of the distribution that they were drawn from, n ≥ 1.

    cluster : see `quantile`.
    """
    n, q95, mean = values.size, quantile(values, 0.95, cluster), float(values.mean())
    own = np.arange(n) if cluster is None else np.unique(cluster, return_inverse=True)[1].ravel()
    k = int(own.max()) + 1
    if k == 1:
        own, k = np.arange(n), n
    apart = np.bincount(own, values - mean, minlength=k)
    error = float(np.sqrt(k / (k - 1) * (apart**2).sum()) / n) if k > 1 else np.nan
    return Convergence(mean, error, q95.value, q95.low, q95.high)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Statistics of a whole data set of runs, observed or simulated: what back-analysis compares.

Each value of a run is held against those of all simulations of its own release: less their median, in units of their
robust standard deviation, cut off at `MOST`. So a run that is known on ten metres counts beside one that is known to
its stop, and no single value can pull the rest away. Of each quantity there are then three numbers: mean and spread
over the runs, and the share of the runs that have one, as that which reaches a section. Runs of which it is not known
whether they have one, as where the footage ends, count on neither side.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..constants import IQR_PER_SD
from ..vectors import Array, Indices, Mask, Names
from .run_measures import QUANTITIES, Quantity

MOST = 4.0
"""Robust standard deviations."""
OF_TAILS, NINETY_PER_SD = 0.25, 3.29
"""Where half of the simulations agree, the spread is this part of that of nine tenths of them."""
ROUNDING = 1e-6
LEAST_ERROR = 0.05
"""Of the spread of the simulations."""
FEWEST_SPREAD = 4
"""With fewer runs no spread is looked at."""

Key = tuple[str, str]
"""(section, quantity); the section is empty for a quantity of whole runs."""


@dataclass(frozen=True, eq=False)
class ObservedValues:
    """What was read off n observed runs.

    Attributes
    ----------
    names : (n,) of the runs.
    keys : Q quantities.
    value, sigma : (n, Q), NaN where there is none, or where the standard deviation is not known.
    seen : (n, Q) whether it is known if the run has a value.
    """

    names: Names
    keys: tuple[Key, ...]
    value: Array
    sigma: Array
    seen: Mask

    def __len__(self) -> int:
        return len(self.names)

    def take(self, runs: Indices) -> "ObservedValues":
        """Some of the runs."""
        return ObservedValues(self.names[runs], self.keys, self.value[runs], self.sigma[runs], self.seen[runs])

    def quantity(self, column: int) -> Quantity:
        """What a column is about."""
        return QUANTITIES[self.keys[column][1]]

    def title(self, column: int) -> str:
        """For people."""
        section = self.keys[column][0]
        return self.quantity(column).title + (f", {section}" if section else "")


@dataclass(frozen=True, eq=False)
class Scales:
    """(n, Q) centre and robust standard deviation of the values of each run over many simulations."""

    centre: Array
    spread: Array

    def __call__(self, values: Array) -> Array:
        """(..., n, Q) in units of the spread, cut off."""
        return np.clip((values - self.centre) / self.spread, -MOST, MOST)


def with_errors(
    observed: ObservedValues, scales: Scales, values: Array, rng: np.random.Generator, least: float = LEAST_ERROR
) -> Array:
    """Simulated values (S, n, Q) with random errors as of the observed ones, NaN where a run cannot count.

    No value is taken to be known better than the part `least` of how far all simulations spread: a model is never
    exact.
    """
    sigma = np.maximum(np.nan_to_num(observed.sigma), least * scales.spread)
    return np.where(observed.seen, values + sigma * rng.standard_normal(values.shape), np.nan)


def find_scales(values: Array) -> Scales:
    """From simulated values (S, n, Q); where all are the same but for rounding, or none is finite, the spread is 1."""
    lowest, low, centre, high, highest = _quantiles(values, (0.05, 0.25, 0.5, 0.75, 0.95))
    spread = np.maximum((high - low) / IQR_PER_SD, OF_TAILS * (highest - lowest) / NINETY_PER_SD)
    alike = ~(spread > ROUNDING * np.maximum(np.abs(centre), 1.0))
    return Scales(np.nan_to_num(centre), np.where(alike, 1.0, spread))


def _quantiles(values: Array, parts: tuple[float, ...]) -> Array:
    """(len(parts), n, Q) quantiles of what is finite, NaN where nothing is."""
    ordered = np.sort(values, axis=0)  # NaN come last
    count = np.isfinite(values).sum(axis=0)
    result = np.full((len(parts), *values.shape[1:]), np.nan)
    for row, part in enumerate(parts):
        place = np.maximum(np.round(part * (count - 1)).astype(np.intp), 0)
        result[row] = np.take_along_axis(ordered, place[None], axis=0)[0]
    return result


def statistics_of(values: Array, scales: Scales, seen: Mask) -> Array:
    """(..., D) statistics of data sets (..., n, Q): mean, share and spread of each quantity over the runs.

    Parameters
    ----------
    seen : (n, Q) what may count.
    """
    scaled = scales(values)
    has = np.isfinite(scaled) & seen
    count = has.sum(axis=-2)
    some = np.maximum(count, 1)
    filled = np.where(has, scaled, 0.0)
    mean = filled.sum(axis=-2) / some
    share = count / np.maximum(seen.sum(axis=0), 1)
    if seen.shape[0] < FEWEST_SPREAD:
        return np.concatenate([mean, share], axis=-1)
    spread = np.where(has, np.abs(scaled - mean[..., None, :]), 0.0).sum(axis=-2) / some
    return np.concatenate([mean, share, spread], axis=-1)


def plain_means(values: Array, seen: Mask) -> Array:
    """(..., Q) means over the runs that have a value, in its own unit; NaN where none has."""
    has = np.isfinite(values) & seen
    total = np.where(has, values, 0.0).sum(axis=-2)
    count = has.sum(axis=-2)
    return np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0)


def crps(values: Array, weight: Array, observed: float) -> float:
    """Continuous ranked probability score of weighted values (m,) for what was observed; 0 is perfect, in its unit."""
    order = np.argsort(values, kind="stable")
    x, w = values[order], weight[order] / weight.sum()
    up_to = np.cumsum(w)
    apart = float(w @ np.abs(x - observed))
    scatter = float((2 * w * x) @ (up_to - w / 2) - w @ x)
    return apart - scatter


def tails(simulated: Array, observed: Array) -> Array:
    """(Q,) two-sided probabilities of observed values (Q,) among simulated ones (S, Q); NaN where there are too few."""
    known = np.isfinite(simulated)
    count = known.sum(axis=0)
    below = (simulated < observed).sum(axis=0) + 0.5 * (simulated == observed).sum(axis=0)
    part = np.divide(below + 0.5, count + 1, out=np.full(observed.size, np.nan), where=count > 0)
    p = 2 * np.minimum(part, 1 - part)
    return np.where(np.isfinite(observed) & (count >= 19), np.minimum(p, 1.0), np.nan)


def columns_of(keys: Sequence[Key], values: dict[Key, Array]) -> Array:
    """(n, Q) from (section, quantity) → (n,)."""
    return np.stack([values[key] for key in keys], axis=-1)

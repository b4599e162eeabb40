# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether groups of impacts differ: Kruskal & Wallis 1952 by ranks, with probabilities from exchanges that keep the
dependence within trajectories.

The impacts of a trajectory depend on each other: one block, one path. So impacts are not exchanged freely. Where each
trajectory is of one group, as with the site or the block, whole trajectories exchange their groups; where the group
changes along a trajectory, as with the ground, impacts exchange theirs within their trajectory. Only where each group
is one trajectory are impacts exchanged freely, and the test says whether trajectories differ. The probability is the
part of the exchanges in which the groups differ at least as much (Phipson & Smyth 2010).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from math import lgamma, log
from typing import Literal

import numpy as np

from ..compiled import in_chunks
from ..progress import Progress, silent
from ..vectors import Array, Indices
from .line_fits import FEWEST
from .ranks import holm, shared_ranks

Exchanged = Literal["trajectories", "within", "impacts"]
"""Whole trajectories, impacts within their trajectory, or impacts freely."""

EXCHANGES, FEWER_EXCHANGES = 9999, 999
WORK = 300_000_000
"""From so many values in all exchanges on, which take a second or two, there are fewer of them."""
FEWEST_ARRANGEMENTS = 20
"""With fewer different arrangements no probability can be below 5 %."""
MOST_PAIRED = 12
"""With more groups, no pairs are compared."""
LEVEL = 0.05


@dataclass(frozen=True)
class GroupTest:
    """Whether the groups differ in one quantity.

    Attributes
    ----------
    quantity : its name.
    n, groups : values, and groups that they are of.
    statistic : Kruskal & Wallis' H, corrected for ties.
    effect : ε² = H/(n − 1), the part of the ranks' variance that lies between the groups: 0 … 1.
    p : probability to differ as much by chance, from exchanges; NaN where there are too few arrangements.
    p_holm : that, corrected for the number of quantities (Holm 1979).
    p_independent : the probability if all impacts were independent (χ² distribution).
    """

    quantity: str
    n: int
    groups: int
    statistic: float
    effect: float
    p: float
    p_holm: float
    p_independent: float

    @property
    def differs(self) -> bool:
        """Whether the groups differ, at 5 % over all quantities."""
        return self.p_holm < LEVEL


@dataclass(frozen=True)
class PairTest:
    """Whether two groups differ in one quantity.

    Attributes
    ----------
    quantity, first, second : names.
    median_first, median_second : of their values.
    effect : Cliff's δ, the probability that a value of the second is the greater one, less that it is the smaller one.
    p, p_holm : as in `GroupTest`; corrected for the number of pairs of this quantity, and never below that of the test
        of all groups, so that no pair differs where the groups do not.
    """

    quantity: str
    first: str
    second: str
    median_first: float
    median_second: float
    effect: float
    p: float
    p_holm: float

    @property
    def differs(self) -> bool:
        """Whether the two differ, at 5 % over all pairs."""
        return self.p_holm < LEVEL


@dataclass(frozen=True)
class GroupTests:
    """Tests of all quantities.

    Attributes
    ----------
    exchanged : what changes its group.
    exchanges : how often.
    tested, left_out : names of the groups that were tested, and of those with too few impacts.
    tests : one for each quantity.
    pairs : for each quantity and pair of groups; empty for two groups and for very many.
    """

    exchanged: Exchanged
    exchanges: int
    tested: tuple[str, ...]
    left_out: tuple[str, ...]
    tests: tuple[GroupTest, ...]
    pairs: tuple[PairTest, ...]


def group_tests(
    values: dict[str, Array],
    number: Indices,
    names: Sequence[str],
    trajectory: Indices,
    seed: int = 0,
    progress: Progress = silent,
) -> GroupTests:
    """Test whether groups differ.

    Parameters
    ----------
    values : quantity → (n,) finite values.
    number : (n,) of each value's group, from 0.
    names : of the groups.
    trajectory : (n,) number of each value's trajectory.
    seed : of the exchanges.
    """
    counts = np.bincount(number, minlength=len(names))
    enough = counts >= FEWEST
    tested = tuple(name for name, there in zip(names, enough.tolist(), strict=True) if there)
    left_out = tuple(name for name, there in zip(names, enough.tolist(), strict=True) if not there)
    keep = enough[number]
    number, trajectory = (np.cumsum(enough) - 1)[number[keep]], trajectory[keep]
    columns = np.stack([column[keep] for column in values.values()]) if values else np.empty((0, 0))
    exchanged = what_to_exchange(number, trajectory)
    if len(tested) < 2 or not values:
        return GroupTests(exchanged, 0, tested, left_out, (), ())
    items = np.unique(trajectory).size if exchanged == "trajectories" else number.size
    exchanges = EXCHANGES if items * len(values) * EXCHANGES <= WORK else FEWER_EXCHANGES
    progress("Testing whether groups differ", 0, 1)
    ranked = np.stack([shared_ranks(column) for column in columns])
    found, p = _exchange_test(ranked, number, len(tested), trajectory, exchanged, exchanges, seed)
    tests = []
    for i, (name, corrected) in enumerate(zip(values, holm(p).tolist(), strict=True)):
        n, h = number.size, float(found[i])
        independent = _chi2_above(h, len(tested) - 1)
        tests.append(GroupTest(name, n, len(tested), h, h / (n - 1), float(p[i]), corrected, independent))
    paired = range(len(tested)) if 2 < len(tested) <= MOST_PAIRED else ()
    pairs = list(combinations(paired, 2))
    results = []
    for done, pair in enumerate(pairs):
        progress("Comparing pairs of groups", done, len(pairs))
        results.append(_pair(columns, number, pair, trajectory, exchanges, seed + 1 + done))
    made = []
    for i, name in enumerate(values):
        corrected_all = holm(np.array([result[i][3] for result in results]))
        corrected_all = np.maximum(corrected_all, tests[i].p_holm)
        for (a, b), result, corrected in zip(pairs, results, corrected_all.tolist(), strict=True):
            made.append(PairTest(name, tested[a], tested[b], *result[i], corrected))
    return GroupTests(exchanged, exchanges, tested, left_out, tuple(tests), tuple(made))


def what_to_exchange(number: Indices, trajectory: Indices) -> Exchanged:
    """What may change its group and keep the dependence; (n,) numbers of groups and of trajectories."""
    together = np.unique(np.stack([trajectory, number]), axis=1)
    trajectories, groups = np.unique(trajectory).size, np.unique(number).size
    if together.shape[1] > trajectories:
        return "within"
    return "impacts" if trajectories == groups else "trajectories"


def _pair(
    columns: Array, number: Indices, pair: tuple[int, int], trajectory: Indices, exchanges: int, seed: int
) -> list[tuple[float, float, float, float]]:
    """For each quantity: the two medians, Cliff's δ and the probability."""
    here = np.isin(number, pair)
    second = (number[here] == pair[1]).astype(np.intp)
    ranked = np.stack([shared_ranks(column) for column in columns[:, here]])
    exchanged = what_to_exchange(second, trajectory[here])
    _, p = _exchange_test(ranked, second, 2, trajectory[here], exchanged, exchanges, seed)
    results = []
    for column, ranks, chance in zip(columns[:, here], ranked, p.tolist(), strict=True):
        after = int(second.sum())
        before = second.size - after
        above = float(ranks[second == 1].sum()) - after * (after + 1) / 2
        median, other = (float(np.median(column[second == side])) for side in (0, 1))
        results.append((median, other, 2 * above / (before * after) - 1, chance))
    return results


def _exchange_test(
    ranked: Array,
    number: Indices,
    groups: int,
    trajectory: Indices,
    exchanged: Exchanged,
    exchanges: int,
    seed: int,
) -> tuple[Array, Array]:
    """(V,) H and the probabilities of ranks (V, n); NaN where all values are equal."""
    from .exchange_kernels import fill_exchanged

    n = number.size
    if exchanged == "trajectories":
        _, first, item = np.unique(trajectory, return_index=True, return_inverse=True)
        counts = np.bincount(item).astype(np.float64)
        sums = np.stack([np.bincount(item, ranks) for ranks in ranked], axis=1)
        group, start = number[first], np.array([0, counts.size])
    else:
        order = np.argsort(trajectory, kind="stable") if exchanged == "within" else np.arange(n)
        counts, sums, group = np.ones(n), np.ascontiguousarray(ranked[:, order].T), number[order]
        start = np.array([0, n])
        if exchanged == "within":
            start = np.r_[0, np.flatnonzero(np.diff(trajectory[order])) + 1, n]
    squares = np.zeros(ranked.shape[0])
    in_group = np.bincount(number, minlength=groups)
    for i, ranks in enumerate(ranked):
        squares[i] = np.sum(np.bincount(number, ranks, minlength=groups) ** 2 / in_group)
    ties = np.array([1.0 - _ties(ranks) / (n**3 - n) for ranks in ranked])
    with np.errstate(invalid="ignore", divide="ignore"):
        h = np.where(ties > 0, (12.0 / (n * (n + 1)) * squares - 3 * (n + 1)) / ties, np.nan)
    if _arrangements(group, start, groups) < log(FEWEST_ARRANGEMENTS - 0.5):
        return h, np.full(h.size, np.nan)
    by_chance = np.empty((exchanges, h.size))
    group, start, counts = (np.ascontiguousarray(one) for one in (group, start, counts))
    in_chunks(
        lambda low, high: fill_exchanged(seed, low, group, start, counts, sums, groups, by_chance[low:high]), exchanges
    )
    as_large = (by_chance >= squares * (1 - 1e-12)).sum(axis=0)
    return h, np.where(ties > 0, (1 + as_large) / (1 + exchanges), np.nan)


def _arrangements(group: Indices, start: Indices, groups: int) -> float:
    """Logarithm of how many different ways there are to give the items their groups, groups of one size being alike."""
    total = 0.0
    for low, high in zip(start[:-1].tolist(), start[1:].tolist(), strict=True):
        here = np.bincount(group[low:high], minlength=1)
        if here.max() < high - low:
            total += lgamma(high - low + 1) - sum(lgamma(k + 1) for k in here[here > 1].tolist())
    if start.size == 2:
        sizes = np.bincount(np.bincount(group, minlength=groups))
        total -= sum(lgamma(k + 1) for k in sizes.tolist())
    return total


def _ties(ranks: Array) -> float:
    _, counts = np.unique(ranks, return_counts=True)
    return float(np.sum(counts.astype(np.float64) ** 3 - counts))


def _chi2_above(value: float, freedom: int) -> float:
    from scipy.special import chdtrc

    return float(chdtrc(freedom, value))

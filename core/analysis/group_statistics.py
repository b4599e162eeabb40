# SPDX-License-Identifier: GPL-3.0-or-later
"""The statistics of groups of measured impacts, and whether the groups differ."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..progress import Progress, silent
from ..reconstruction.impact import Impacts, fall_numbers
from ..remarks import Remark
from ..vectors import Array, Indices, Names
from .group_tests import LEVEL, Exchanged, GroupTest, GroupTests, group_tests
from .line_fits import FEWEST, LineFit, power_law
from .statistics import ImpactStatistics, statistics_by_number, usable
from .variables import measured_values

QUANTITIES = {
    "rn": "R_N",
    "rn_over_law": "R_N at the same angle",
    "rt": "R_T",
    "r": "R",
    "theta_dev_deg": "deviation",
    "theta1_deg": "incident angle",
    "v1_mps": "incident speed",
}
"""What groups are tested for, and in words. rn_over_law is R_N/(a·θ1^b), with the law of all groups together."""
EXCHANGED: dict[Exchanged, str] = {
    "trajectories": "whole trajectories exchanged their groups",
    "within": "impacts exchanged their groups within their trajectory",
    "impacts": "impacts exchanged their groups, as each group is one trajectory",
}
MOST_NAMED = 6
"""So many pairs are named, the others counted."""


@dataclass(frozen=True, eq=False)
class Grouping:
    """Which group each of n impacts belongs to.

    Attributes
    ----------
    column : what they are grouped by, for people.
    names : of the groups, in their order.
    number : (n,) number of each impact's group, from 0; −1 for none.
    """

    column: str
    names: tuple[str, ...]
    number: Indices


@dataclass(frozen=True)
class GroupStatistics:
    """The statistics of groups.

    Attributes
    ----------
    column : what they are grouped by.
    groups : name → statistics, in their order.
    undefined : impacts without a group.
    tests : whether they differ.
    """

    column: str
    groups: dict[str, ImpactStatistics]
    undefined: int
    tests: GroupTests

    def remarks(self) -> list[Remark]:
        """What the tests say, in words; what could not be told first."""
        tests, made = self.tests, []
        if self.undefined:
            made.append(
                Remark(f"{self.undefined} impacts have no {self.column}: they are in no group.", "note", "groups")
            )
        if tests.left_out:
            text = f"Not tested, with fewer than {FEWEST} impacts: {_listed(tests.left_out)}."
            made.append(Remark(text, "warning", "groups"))
        if not tests.tests:
            text = f"Fewer than two groups have {FEWEST} impacts: whether groups differ cannot be told."
            return [Remark(text, "problem", "groups"), *made]
        what = "trajectories" if tests.exchanged == "trajectories" else "impacts"
        told = [test for test in tests.tests if test.p == test.p]
        if not told:
            text = f"Whether the groups differ cannot be told: there are too few {what} to exchange."
            return [Remark(text, "problem", "groups"), *made]
        different = [_said(test) for test in told if test.differs]
        alike = [_said(test) for test in told if not test.differs]
        if different:
            made.append(Remark(f"The groups differ in {', '.join(different)}.", "note", "groups"))
        if alike:
            made.append(Remark(f"No difference is seen in {', '.join(alike)}.", "note", "groups"))
        made += self._about_angle()
        made.append(
            Remark(
                f"Kruskal–Wallis; {EXCHANGED[tests.exchanged]}, {tests.exchanges} times; p after Holm for {len(told)} "
                "quantities; ε² is the part of the ranks' variance between the groups.",
                "note",
                "test",
            )
        )
        return [*made, *self._about_pairs()]

    def _about_angle(self) -> list[Remark]:
        by = {test.quantity: test for test in self.tests.tests}
        if "rn_over_law" in by and by["rn"].differs and not by["rn_over_law"].differs:
            text = "R_N differs as the incident angles do: at the same angle no difference is seen."
            return [Remark(text, "advice", "rn")]
        return []

    def _about_pairs(self) -> list[Remark]:
        different = [pair for pair in self.tests.pairs if pair.differs]
        made = []
        for pair in sorted(different, key=lambda pair: -abs(pair.effect))[:MOST_NAMED]:
            text = (
                f"{pair.first} and {pair.second} differ in {QUANTITIES[pair.quantity]}: "
                f"medians {pair.median_first:.2f} and {pair.median_second:.2f}, "
                f"Cliff's δ {pair.effect:+.2f}, p {_chance(pair.p_holm)}."
            )
            made.append(Remark(text.replace("-0", "−0"), "note", "pairs"))
        if len(different) > MOST_NAMED:
            made.append(Remark(f"And {len(different) - MOST_NAMED} more pairs differ.", "note", "pairs"))
        return made


def group_statistics(
    impacts: Impacts, grouping: Grouping, *, seed: int = 0, progress: Progress = silent
) -> GroupStatistics:
    """The statistics of each group of impacts.

    Parameters
    ----------
    seed : of the exchanges.
    """
    names, number = grouping.names, grouping.number
    found = statistics_by_number(impacts, number, len(names), progress)
    row = np.flatnonzero(usable(impacts) & (number >= 0))
    tests = group_tests(
        _tested(impacts, row), number[row], names, fall_numbers(impacts)[row], seed=seed, progress=progress
    )
    return GroupStatistics(grouping.column, dict(zip(names, found, strict=True)), int((number < 0).sum()), tests)


def group_by_text(column: str, texts: Names) -> Grouping:
    """A group of each text, in the order of first appearance; "" is none, but of flags a group, too."""
    if column == "flags":
        texts = np.where(texts == "", "no flag", texts)
    values, first, place = np.unique(texts, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    order = order[values[order] != ""]
    rank = np.full(values.size, -1, dtype=np.intp)
    rank[order] = np.arange(order.size)
    return Grouping(column, tuple(values[order].tolist()), rank[place])


def group_by_number(column: str, values: Array, classes: int = 0) -> Grouping:
    """A group of each number, or of each class of about equally many, in ascending order; NaN is none.

    Parameters
    ----------
    classes : how many, between quantiles; fewer where many values are equal. 0 for a group of each number.
    """
    known = np.isfinite(values)
    number = np.full(values.size, -1, dtype=np.intp)
    if not known.any():
        return Grouping(column, (), number)
    if not classes:
        each, place = np.unique(values[known], return_inverse=True)
        number[known] = place
        return Grouping(column, _named(each), number)
    edges = np.unique(np.quantile(values[known], np.linspace(0, 1, classes + 1)))
    edges = np.repeat(edges, 2) if edges.size == 1 else edges
    number[known] = np.clip(np.searchsorted(edges, values[known], side="right") - 1, 0, edges.size - 2)
    return Grouping(column, tuple(f"{low}–{high}" for low, high in pairwise(_named(edges))), number)


def _named(numbers: Array) -> tuple[str, ...]:
    """Numbers as texts, with as few digits as tell them apart."""
    different = np.unique(numbers).size
    for digits in range(3, 18):
        names = tuple(f"{number:.{digits}g}" for number in numbers.tolist())
        if len(set(names)) == different:
            break
    return names


def _tested(impacts: Impacts, row: Indices) -> dict[str, Array]:
    values = {name: measured_values(impacts, row, name) for name in QUANTITIES if name != "rn_over_law"}
    law = power_law(values["theta1_deg"], values["rn"], interval=False)
    if law.slope == law.slope and (values["theta1_deg"] > 0).all():
        values["rn_over_law"] = values["rn"] / _value(law, values["theta1_deg"])
    return {name: values[name] for name in QUANTITIES if name in values and np.isfinite(values[name]).all()}


def _value(law: LineFit, theta1_deg: Array) -> Array:
    return np.exp(law.intercept + law.slope * np.log(theta1_deg))


def _said(test: GroupTest) -> str:
    return f"{QUANTITIES[test.quantity]} (p {_chance(test.p_holm)}, ε² {test.effect:.2f})".replace("-0", "−0")


def _chance(p: float) -> str:
    return f"{p:.3f}" if p < 2 * LEVEL else f"{p:.2f}"


def _listed(names: tuple[str, ...]) -> str:
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return ", ".join(names[:MOST_NAMED]) + more

# SPDX-License-Identifier: GPL-3.0-or-later
"""Any column of a table of impacts: what graphs colour their points by, and filter them by."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..impact_models.machinery.parameters import suggestion
from ..reconstruction.impact import FLAGS, Impacts
from ..vectors import Array, Mask, Names
from .variables import VARIABLES, measured_values

TEXT_COLUMNS = {"site": "Site", "trajectory": "Trajectory", "flags": "Flags"}
FEWEST_NUMBERS = 6
"""A further column with fewer different numbers is taken for names of groups: 1 and 2 of a phase of a campaign."""


@dataclass(frozen=True, eq=False)
class Column:
    """One column of n impacts: numbers, or texts.

    Attributes
    ----------
    name, title : for files, and in words with the unit.
    numbers : (n,) NaN where empty; None for texts.
    texts : (n,); None for numbers.
    """

    name: str
    title: str
    numbers: Array | None = None
    texts: Names | None = None

    @property
    def labels(self) -> Names:
        """(n,) its texts, or its numbers as the shortest texts; empty where undefined."""
        if self.texts is not None:
            return self.texts
        numbers = np.empty(0) if self.numbers is None else self.numbers
        return np.array([f"{value:.15g}" if value == value else "" for value in numbers.tolist()], dtype=np.str_)

    @property
    def groups(self) -> tuple[str, ...]:
        """The different texts in the order of their first appearance; none for numbers."""
        return () if self.texts is None else tuple(dict.fromkeys(self.texts.tolist()))


@dataclass(frozen=True)
class Filter:
    """What a column must have: a number from `low` to `high`, or one of `texts`."""

    column: str
    low: float = -np.inf
    high: float = np.inf
    texts: frozenset[str] = frozenset()


def column_titles(tables: Sequence[Impacts]) -> dict[str, str]:
    """Name → title of each column that one of the tables has."""
    further = {name: name for table in tables for name in table.extra}
    return {**TEXT_COLUMNS, **{name: one.label for name, one in VARIABLES.items()}, **further}


def has_column(impacts: Impacts, name: str) -> bool:
    """Whether `find_column` finds a column."""
    return name in FLAGS or name in column_titles([impacts])


def find_column(impacts: Impacts, name: str) -> Column:
    """A column of a table: a variable, a text, a further column, or a flag ("yes" and "no").

    Raises
    ------
    InputError : there is none; the nearest is suggested.
    """
    titles = column_titles([impacts])
    if name in VARIABLES:
        return Column(name, titles[name], measured_values(impacts, np.arange(len(impacts)), name))
    if name in ("site", "trajectory"):
        return Column(name, titles[name], texts=getattr(impacts, name).astype(str))
    if name == "flags":
        return Column(name, titles[name], texts=np.array(impacts.flag_text(), dtype=np.str_))
    if name in FLAGS:
        return Column(name, name, texts=np.where(impacts.flags[name], "yes", "no"))
    if name in impacts.extra:
        return _further(name, impacts.extra[name])
    raise InputError(f"There is no column {name!r}", advice=suggestion(name, titles))


def passing(impacts: Impacts, filters: Sequence[Filter]) -> Mask:
    """(n,) the impacts that have what all filters ask for; one whose column is empty, or lacking, has it not."""
    found = np.ones(len(impacts), dtype=np.bool_)
    for one in filters:
        if not has_column(impacts, one.column):
            found[:] = False
            continue
        column = find_column(impacts, one.column)
        if column.numbers is not None:
            found &= (column.numbers >= one.low) & (column.numbers <= one.high)
        elif column.texts is not None and one.texts:
            found &= np.isin(column.texts, sorted(one.texts))
    return found


def _further(name: str, texts: Names) -> Column:
    """A column of a table that was read: numbers if all its texts are, and they are many."""
    texts = np.char.strip(texts.astype(str))
    filled = texts != ""
    try:
        values = np.full(texts.size, np.nan)
        values[filled] = texts[filled].astype(np.float64)
    except ValueError:
        return Column(name, name, texts=texts)
    if np.unique(values[filled]).size < FEWEST_NUMBERS:
        return Column(name, name, texts=texts)
    return Column(name, name, values)

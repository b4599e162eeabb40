# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows of a table of impacts: taken, filtered by conditions, grouped by a column, joined."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields, replace
from operator import eq, ge, gt, le, lt, ne
from typing import Any

import numpy as np

from ..analysis.columns import Column, find_column, has_column
from ..analysis.group_statistics import Grouping, group_by_number, group_by_text
from ..analysis.variables import known_variables, measured_values
from ..errors import InputError
from ..georeference import GlobalShift
from ..impact_models.machinery.parameters import suggestion
from ..reconstruction.impact import FLAGS, Impacts
from ..vectors import Array, Indices, Mask, Names, numbered
from .tables import impact_column, impact_columns

COMPARISONS: Mapping[str, Callable[[Any, Any], Any]] = {
    "<=": le,
    ">=": ge,
    "!=": ne,
    "==": eq,
    "=": eq,
    "<": lt,
    ">": gt,
}
CONDITION = re.compile(r"\s*(\w+)\s*(<=|>=|!=|==|=|<|>)\s*(.*?)\s*")
MEDIANS = ("theta1_deg", "rn", "rt", "r", "theta_dev_deg")


def rows_of(impacts: Impacts, rows: Indices | Mask | slice) -> Impacts:
    """Some rows, in the order given."""
    taken: dict[str, Any] = {}
    for one in fields(Impacts):
        value = getattr(impacts, one.name)
        if one.name in ("flags", "sigma", "intervals", "extra"):
            taken[one.name] = {name: column[rows] for name, column in value.items()}
        elif one.name != "shift":
            taken[one.name] = value[rows]
    return replace(impacts, **taken)


def joined(tables: Sequence[Impacts]) -> Impacts:
    """All rows of several tables, in one local frame: theirs, where they have the same one. What a table does not have
    is undefined there."""
    shift, position = _one_frame(tables)
    made: dict[str, Any] = {"shift": shift, "position": position}
    for one in fields(Impacts):
        if one.name == "flags":
            made["flags"] = {name: np.concatenate([table.flags[name] for table in tables]) for name in FLAGS}
        elif one.name == "sigma":
            names = dict.fromkeys(name for table in tables for name in table.sigma)
            made["sigma"] = {name: np.concatenate([_sigma(table, name) for table in tables]) for name in names}
        elif one.name == "intervals":
            names = dict.fromkeys(name for table in tables for name in table.intervals)
            made["intervals"] = {name: np.concatenate([_interval(table, name) for table in tables]) for name in names}
        elif one.name == "extra":
            names = dict.fromkeys(name for table in tables for name in table.extra)
            made["extra"] = {name: np.concatenate([_extra(table, name) for table in tables]) for name in names}
        elif one.name not in made:
            made[one.name] = np.concatenate([getattr(table, one.name) for table in tables])
    return Impacts(**made)


def _one_frame(tables: Sequence[Impacts]) -> tuple[GlobalShift, Array]:
    """The shift and the positions of all rows."""
    shift = tables[0].shift
    if all(table.shift == shift for table in tables):
        return shift, np.concatenate([table.position for table in tables])
    survey = [table.shift.to_survey(table.position) for table in tables]
    finite = np.concatenate([places[np.isfinite(places).all(axis=1)] for places in survey])
    shift = GlobalShift.proposed(finite.min(axis=0), finite.max(axis=0)) if len(finite) else GlobalShift()
    return shift, shift.to_local(np.concatenate(survey))


def matching(impacts: Impacts, conditions: Iterable[str]) -> Mask:
    """(n,) rows for which all conditions hold; an undefined number meets none.

    Parameters
    ----------
    conditions : texts such as ``theta1_deg<20``, ``site=Gully``, ``flags!=doubtful``, on columns as of `column_of`.

    Raises
    ------
    InputError : another form, an unknown column, a text compared by size, no number beside a column of numbers.
    """
    result = np.ones(len(impacts), dtype=np.bool_)
    for condition in conditions:
        parts = CONDITION.fullmatch(condition)
        if parts is None or not parts[3]:
            raise InputError(f"{condition!r} is no condition", advice="Write one like 'theta1_deg<20' or 'site=Gully'")
        name, sign, value = parts.groups()
        if name == "flags":
            result &= _flagged(impacts, sign, value, condition)
            continue
        column = column_of(impacts, name)
        if column.numbers is not None:
            result &= np.isfinite(column.numbers) & COMPARISONS[sign](column.numbers, _number(value, condition))
        elif sign in ("=", "==", "!="):
            result &= COMPARISONS[sign](column.labels, value)
        else:
            raise InputError(f"{condition!r} compares texts by size", advice="Use = or !=")
    return result


def column_of(impacts: Impacts, name: str) -> Column:
    """A column by its name: of the graphs (`find_column`), or else as in impacts.csv, with the unit of that name.

    Raises
    ------
    InputError : there is none; the nearest is suggested.
    """
    if has_column(impacts, name):
        return find_column(impacts, name)
    values = impact_column(impacts, name)
    if values is None:
        known = dict.fromkeys((*impact_columns(impacts), *known_variables(impacts), *FLAGS))
        raise InputError(f"There is no column {name!r}", advice=suggestion(name, known))
    return Column(name, name, np.asarray(values, dtype=np.float64))


def grouping_of(impacts: Impacts, name: str, classes: int = 0) -> Grouping:
    """The groups of impacts that a column makes; empty cells and undefined numbers are in none.

    Parameters
    ----------
    name : a column as in impacts.csv, a flag (the groups are "yes" and "no"), or a variable of the graphs.
    classes : cut numbers into so many classes of about equally many impacts; 0 makes a group of each number.

    Raises
    ------
    InputError : there is no such column; the nearest is suggested. Classes of a column of texts.
    """
    column = column_of(impacts, name)
    if column.numbers is not None:
        return group_by_number(name, column.numbers, classes)
    if not classes:
        return group_by_text(name, column.labels)
    try:
        numbers = [float(text) if text else np.nan for text in column.labels.tolist()]
    except ValueError:
        raise InputError(f"The column {name!r} holds texts, which have no classes", advice="Drop the classes") from None
    return group_by_number(name, np.array(numbers), classes)


def group_medians(impacts: Impacts, columns: Sequence[str]) -> list[dict[str, object]]:
    """One row for each group: its values, how many impacts, and the medians of `MEDIANS` of those that count."""
    keys, code = numbered(*(column_of(impacts, name).labels for name in columns))
    table: list[dict[str, object]] = [dict(zip(columns, key, strict=True)) for key in keys]
    for row, count in zip(table, np.bincount(code, minlength=len(keys)).tolist(), strict=True):
        row["impacts"] = count
    for name in MEDIANS:
        values = np.where(impacts.refused, np.nan, measured_values(impacts, np.arange(len(impacts)), name))
        medians = _medians(values, code, len(keys))
        for row, value in zip(table, medians.tolist(), strict=True):
            row[f"median_{name}"] = value if value == value else ""
    return table


def _medians(values: Array, code: Indices, groups: int) -> Array:
    """(groups,) of the defined values; NaN where there is none."""
    known = np.isfinite(values)
    values, code = values[known], code[known]
    counts = np.bincount(code, minlength=groups)
    medians, some = np.full(groups, np.nan), counts > 0
    if some.any():
        ordered, first = values[np.lexsort((values, code))], np.cumsum(counts) - counts
        lower, upper = (first + (counts - 1) // 2)[some], (first + counts // 2)[some]
        medians[some] = (ordered[lower] + ordered[upper]) / 2
    return medians


def _flagged(impacts: Impacts, sign: str, value: str, condition: str) -> Mask:
    if value not in FLAGS or sign not in ("=", "==", "!="):
        raise InputError(f"{condition!r} asks for no flag", advice=f"Use = or != and one of {', '.join(FLAGS)}")
    return impacts.flags[value] if sign != "!=" else ~impacts.flags[value]


def _number(value: str, condition: str) -> float:
    try:
        return float(value)
    except ValueError:
        raise InputError(f"{condition!r} compares numbers with {value!r}", advice="Give a number") from None


def _sigma(table: Impacts, name: str) -> Array:
    return table.sigma[name] if name in table.sigma else np.full_like(getattr(table, name), np.nan)


def _interval(table: Impacts, name: str) -> Array:
    return table.intervals[name] if name in table.intervals else np.full((len(table), 2), np.nan)


def _extra(table: Impacts, name: str) -> Names:
    return table.extra[name] if name in table.extra else np.zeros(len(table), dtype="U1")

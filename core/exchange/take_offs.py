# SPDX-License-Identifier: GPL-3.0-or-later
"""Impacts whose contact is no point, in one row of a table: columns of the take-off become a pick of its own."""

from typing import Any

import numpy as np

from ..georeference import GlobalShift
from ..reconstruction.impact import TAKE_OFF
from ..vectors import Array, Names
from .csv_text import TextTable

*PLACE, TIME = TAKE_OFF
SIGMA_TIME, SIGMA_PLACE = "sigma_time2_s", "sigma_position2_m"
COLUMNS = (*PLACE, TIME, SIGMA_TIME, SIGMA_PLACE)
ADVICE = "Give time2_s, and x2_m, y2_m, z2_m where the block leaves the ground elsewhere"


def with_take_offs(columns: dict[str, Any], table: TextTable, shift: GlobalShift) -> dict[str, Any]:
    """The columns of `make_picks`, with a row for each take-off that the table names beside its impact.

    Parameters
    ----------
    columns : name → (n, …) of the rows of the table, with `extra` by name.
    shift : of the local frame.

    Raises
    ------
    InputError : with the row: a part of a place, a take-off without a time or before its impact, or of another kind.
    """
    if not any(name in table.columns for name in COLUMNS):
        return columns
    survey, time = table.vectors(PLACE), table.numbers(TIME)
    placed, timed = np.isfinite(survey), np.isfinite(time)
    doubted = np.isfinite(table.numbers(SIGMA_TIME)) | np.isfinite(table.numbers(SIGMA_PLACE))
    kind = np.asarray(columns["kind"])
    for wrong, problem, advice in (
        (placed.any(axis=1) & ~placed.all(axis=1), "Only a part of the take-off's place is given", ADVICE),
        (placed.any(axis=1) & ~timed, "The take-off has a place and no time", ADVICE),
        (doubted & ~timed, "The take-off has a standard deviation and no time", ADVICE),
        (timed & (time <= columns["time_s"]), "The block takes off before it lands, or at once", "Correct time2_s"),
        (timed & (kind != "impact"), "A take-off belongs to an impact", "Empty its columns in the rows of other kinds"),
    ):
        if wrong.any():
            raise table.error(int(np.argmax(wrong)), problem, advice)
    rows = np.flatnonzero(timed)
    at = rows + 1
    place = np.where(placed, shift.to_local(survey), columns["position"])[rows]
    nowhere = np.full((rows.size, 3), np.nan)
    own: dict[str, Array | Names] = {
        "trajectory": np.asarray(columns["trajectory"])[rows],
        "time_s": time[rows],
        "position": place,
        "kind": np.full(rows.size, "takeoff"),
        "status": np.full(rows.size, "ok"),
        "normal": nowhere,
        "sigma_time_s": table.numbers(SIGMA_TIME)[rows],
        "sigma_position_m": table.numbers(SIGMA_PLACE)[rows],
        "angular_velocity": nowhere,
        "row": np.asarray(columns["row"])[rows],
    }
    for name in ("sigma_time_s", "sigma_position_m"):
        own[name] = np.where(np.isfinite(own[name]), own[name], np.asarray(columns[name])[rows])
    more = {name: np.insert(np.asarray(values), at, "") for name, values in columns["extra"].items()}
    longer = {name: _inserted(np.asarray(columns[name]), at, values) for name, values in own.items()}
    return {**columns, **longer, "extra": more}


def _inserted(values: Any, at: Any, more: Any) -> Any:
    """Rows before these places; texts become as wide as is needed."""
    kind = np.result_type(values, more)
    return np.insert(values.astype(kind), at, more, axis=0)

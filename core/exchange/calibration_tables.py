# SPDX-License-Identifier: GPL-3.0-or-later
"""calibration.csv, equivalent.csv, and holdout.csv."""

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path

from ..analysis.calibration import Fold
from ..analysis.estimation import Estimate
from ..impact_models.machinery.parameters import Value
from .csv_text import read_table

ESTIMATES_COLUMNS = ("model", "parameter", "unit", "default", "fitted", "low", "high", "verdict")
"""The columns of calibration.csv and equivalent.csv; low and high are the 95 % interval, empty for a choice."""
HOLDOUT_COLUMNS = ("fold", "trajectories", "impacts", "score_default", "score_fitted")
"""The columns of holdout.csv; the names of trajectories are joined by ";"."""


def write_estimates(model: str, estimates: Sequence[Estimate], path: str | Path) -> None:
    """Write fitted parameters of a model, one a row."""
    rows = ((model, e.name, e.unit, e.default, e.value, _cell(e.low), _cell(e.high), e.verdict) for e in estimates)
    _write(path, ESTIMATES_COLUMNS, rows)


def read_estimates(path: str | Path) -> tuple[str, tuple[Estimate, ...]]:
    """Model and estimates of a table that `write_estimates` wrote.

    Raises
    ------
    InputError : anything that is wrong with the table, with the row.
    """
    table = read_table(path, ESTIMATES_COLUMNS, ESTIMATES_COLUMNS)
    low, high = table.numbers("low"), table.numbers("high")
    estimates = tuple(
        Estimate(name, unit, _value(default), _value(fitted), float(low[i]), float(high[i]), verdict)
        for i, (name, unit, default, fitted, verdict) in enumerate(
            zip(*(table.text(name) for name in ("parameter", "unit", "default", "fitted", "verdict")), strict=True)
        )
    )
    return table.text("model")[0], estimates


def write_folds(folds: Sequence[Fold], path: str | Path) -> None:
    """Write the hold-out scores, one fold a row."""
    rows = ((i, ";".join(f.trajectories), f.impacts, f.default, f.fitted) for i, f in enumerate(folds, 1))
    _write(path, HOLDOUT_COLUMNS, rows)


def _write(path: str | Path, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    with Path(path).open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(rows)


def _cell(value: float) -> float | str:
    return "" if value != value else value


def _value(cell: str) -> Value:
    try:
        return float(cell)
    except ValueError:
        return cell

# SPDX-License-Identifier: GPL-3.0-or-later
"""calibration.csv, equivalent.csv, and holdout.csv."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from ..analysis.calibration import Fold
from ..analysis.estimation import Estimate
from ..formats.csv_cells import CellWriter
from ..output import output_stream

ESTIMATES_COLUMNS = ("model", "parameter", "unit", "default", "fitted", "low", "high", "verdict")
"""The columns of calibration.csv and equivalent.csv; low and high are the 95 % interval, empty for a choice."""
HOLDOUT_COLUMNS = ("fold", "trajectories", "impacts", "score_default", "score_fitted")
"""The columns of holdout.csv; the names of trajectories are joined by ";"."""


def write_estimates(model: str, estimates: Sequence[Estimate], path: str | Path) -> None:
    """Write fitted parameters of a model, one a row."""
    rows = ((model, e.name, e.unit, e.default, e.value, _cell(e.low), _cell(e.high), e.verdict) for e in estimates)
    _write(path, ESTIMATES_COLUMNS, rows)


def write_folds(folds: Sequence[Fold], path: str | Path) -> None:
    """Write the hold-out scores, one fold a row."""
    rows = ((i, ";".join(f.trajectories), f.impacts, f.default, f.fitted) for i, f in enumerate(folds, 1))
    _write(path, HOLDOUT_COLUMNS, rows)


def _write(path: str | Path, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    with output_stream(path) as stream:
        writer = CellWriter(stream)
        writer.writerow(columns)
        writer.writerows(rows)


def _cell(value: float) -> float | str:
    return "" if value != value else value

# SPDX-License-Identifier: GPL-3.0-or-later
"""spin_marks.csv: one point of a block, marked in pictures of a video; spin.csv: what was measured from such marks."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..reading import reader
from ..reconstruction.flight_spins import FlightSpin
from ..reconstruction.spin_marks import AXES, AXIS_WORDS, SpinMarks
from ..vectors import Array, Indices, Names
from .csv_text import read_table
from .footage_tables import PIXEL, frames_of, positive_of, whole_numbers
from .tables import Columns, vector_columns, write_columns

MARKS_REQUIRED = ("trajectory", "time_s", *PIXEL)
COUNTED = "counted_turns_per_s"
MARKS_KNOWN = (*MARKS_REQUIRED, "frame", "sigma_px", "axis", COUNTED)
OMEGA = ("omegax_radps", "omegay_radps", "omegaz_radps")
SPIN_MARKS_ADVICE = 'Mark one point of the block in two pictures, and name the table: spin_marks = "spin_marks.csv"'


@dataclass(frozen=True, eq=False)
class SpinMarkTable(SpinMarks):
    """A table of marks, with the rows of its file.

    Attributes
    ----------
    row : (m,) in a text editor.
    extra : further columns as text.
    """

    row: Indices
    extra: Mapping[str, Names] = field(default_factory=dict)


@reader("table")
def read_spin_marks(path: str | Path) -> SpinMarkTable:
    """Read spin_marks.csv.

    Raises
    ------
    InputError : anything that is wrong with the table, with the row.
    """
    table = read_table(path, MARKS_REQUIRED, MARKS_KNOWN)
    names, axis = table.text("trajectory"), table.text("axis", AXES[0])
    for i, (name, one) in enumerate(zip(names, axis, strict=True)):
        if not name:
            raise table.error(i, "The mark names no trajectory", "Name the block's run in the column trajectory")
        if one not in AXES:
            raise table.error(i, f"Unknown axis '{one}'", f"Use one of {', '.join(AXES)}")
    return SpinMarkTable(
        trajectory=np.array(names, dtype=np.str_),
        frame=frames_of(table),
        time_s=table.numbers("time_s", required=True),
        pixel=table.vectors(PIXEL, required=True),
        sigma_px=positive_of(table, "sigma_px"),
        axis=np.array(axis, dtype=np.str_),
        about=table.numbers(COUNTED),
        row=np.asarray(table.row, dtype=np.intp),
        extra=table.rest(MARKS_KNOWN),
    )


def write_spin_marks(marks: SpinMarks, path: str | Path) -> None:
    """Write spin_marks.csv; counted rates only where one is given."""
    columns: Columns = {
        "trajectory": marks.trajectory.tolist(),
        "frame": whole_numbers(marks.frame),
        "time_s": marks.time_s,
        **vector_columns(PIXEL, marks.pixel),
        "sigma_px": marks.sigma_px,
        "axis": marks.axis.tolist(),
    }
    if np.isfinite(marks.about).any():
        columns[COUNTED] = marks.about
    write_columns(path, columns)


def write_spins(flights: Sequence[FlightSpin], path: str | Path) -> None:
    """Write spin.csv: a row for each flight with marks, with empty cells where its spin is not known."""
    omega = np.array([np.full(3, np.nan) if f.spin is None else f.spin.angular_velocity for f in flights])
    columns: Columns = {
        "trajectory": [f.trajectory for f in flights],
        "flight": [str(f.flight) for f in flights],
        "impact": [str(f.impact or "") for f in flights],
        "start_time_s": _numbers([f.start_time_s for f in flights]),
        "end_time_s": _numbers([f.end_time_s for f in flights]),
        "marks": [str(f.mark_time_s.size) for f in flights],
        "verdict": [f.verdict for f in flights],
        "turns_per_s": _numbers([f.turns_per_s for f in flights]),
        "sigma_turns_per_s": _numbers([f.sigma_turns_per_s for f in flights]),
        "omega_radps": _numbers([_rate(f)[0] for f in flights]),
        "sigma_omega_radps": _numbers([_rate(f)[1] for f in flights]),
        **vector_columns(OMEGA, omega.reshape(-1, 3)),
        "axis": [f.axis for f in flights],
        "axis_in_words": [AXIS_WORDS[f.axis] for f in flights],
        "rotational_J": _numbers([f.energy_j for f in flights]),
        "sigma_rotational_J": _numbers([f.sigma_energy_j for f in flights]),
        "others_turns_per_s": [";".join(f"{rate:.4g}" for rate in f.others) for f in flights],
        "remarks": [" ".join(map(str, f.remarks)) for f in flights],
    }
    write_columns(path, columns)


def _rate(flight: FlightSpin) -> tuple[float, float]:
    return (np.nan, np.nan) if flight.spin is None else (flight.spin.rate, flight.spin.sigma_rate)


def _numbers(values: list[float]) -> Array:
    return np.array(values, dtype=np.float64)

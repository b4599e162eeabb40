# SPDX-License-Identifier: GPL-3.0-or-later
"""picks.csv, impacts.csv and trajectories.csv. Positions in files are survey coordinates."""

import csv
import io
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..formats.csv_cells import guarded
from ..georeference import GlobalShift
from ..output import output_stream
from ..reading import reader
from ..reconstruction.impact import FLAGS, Impacts, apparent
from ..reconstruction.intervals import JUDGED
from ..reconstruction.picks import Picks, make_picks
from ..reconstruction.sampling import TrajectorySamples
from ..vectors import Array, Indices, Mask, Names, dot
from . import take_offs
from .csv_text import read_table
from .number_text import COMPILED, shortest_texts
from .parquet_cells import SUFFIX, write_parquet

POSITION = ("x_m", "y_m", "z_m")
VELOCITY = ("vx_mps", "vy_mps", "vz_mps")
NORMAL = ("nx", "ny", "nz")
SPIN = ("omega1x_radps", "omega1y_radps", "omega1z_radps")
PICKS_REQUIRED = ("trajectory", "time_s", *POSITION)
PICKS_KNOWN = (
    *PICKS_REQUIRED,
    "kind",
    "status",
    *NORMAL,
    "sigma_time_s",
    "sigma_position_m",
    *SPIN,
    *take_offs.COLUMNS,
)

Cells = Array | Names | Indices | Sequence[str]
Columns = dict[str, Cells]
"""Name → (n,) cells: numbers, or text as it is written."""
WRITTEN_ROWS = 20_000
QUOTED = re.compile('[",\r\n]')
"""What a cell must be quoted for."""

Column = tuple[str, str, int | None, bool]
"""Name in the file, attribute of `Impacts`, component of a vector, whether it is an angle in degrees."""

V1 = ("v1x_mps", "v1y_mps", "v1z_mps")
V2 = ("v2x_mps", "v2y_mps", "v2z_mps")
_DERIVED: tuple[Column, ...] = (
    *((name, "v1", i, False) for i, name in enumerate(V1)),
    *((name, "v2", i, False) for i, name in enumerate(V2)),
    ("vn1_mps", "vn1", None, False),
    ("vt1_mps", "vt1", None, False),
    ("vn2_mps", "vn2", None, False),
    ("vt2_mps", "vt2", None, False),
    ("rn", "rn", None, False),
    ("rt", "rt", None, False),
    ("r", "r", None, False),
    ("theta1_deg", "theta1", None, True),
    ("theta_dev_deg", "theta_dev", None, True),
)
_BEFORE: tuple[Column, ...] = (
    ("time_s", "time_s", None, False),
    *((name, "position", i, False) for i, name in enumerate(POSITION)),
    *((name, "normal", i, False) for i, name in enumerate(NORMAL)),
    ("normal_radius_m", "normal_radius_m", None, False),
)
_BLOCK: tuple[Column, ...] = (("diameter_m", "diameter_m", None, False), ("mass_kg", "mass_kg", None, False))
_SPIN: tuple[Column, ...] = tuple((name, "angular_velocity", i, False) for i, name in enumerate(SPIN))
_MORE: tuple[Column, ...] = (
    ("normal_spread_deg", "normal_spread", None, True),
    *(
        (f"{name[:-2]}_{name[-1].upper()}" if name.endswith("_j") else name, name, None, False)
        for name in ("kinetic1_j", "kinetic2_j", "rotational1_j", "rotational2_j", "bounce_height_m", "chord_height_m")
    ),
)
_SIMULATED = ("angular_velocity", "kinetic1_j", "kinetic2_j", "rotational1_j", "rotational2_j")
_NUMBERS = (*_BEFORE, *_DERIVED, *_BLOCK)
_UNCERTAIN = (*_DERIVED, *(column for column in _MORE if column[1] in ("kinetic1_j", "kinetic2_j")))
"""What can have a standard deviation, in a column of its own."""
_ENDS: tuple[tuple[str, str, int, bool], ...] = tuple(
    (f"{name}_{end}", attribute, i, degrees)
    for name, attribute, _, degrees in _DERIVED
    if attribute in JUDGED
    for i, end in enumerate(("low", "high"))
)
"""Ends of intervals: name in the file, name of the interval, which end, whether it is an angle in degrees."""
IMPACTS_COLUMNS = ("site", "trajectory", "impact", *(column[0] for column in _NUMBERS), "flags")
"""The columns of impacts.csv that are always there, in order."""


@reader("table of picks")
def read_picks(path: str | Path, shift: GlobalShift | None = None) -> Picks:
    """Read picks.csv.

    Parameters
    ----------
    shift : of the local frame (the terrain's); None takes the shift proposed for the picks.

    Raises
    ------
    InputError : anything that is wrong with the table, with the row.
    """
    table = read_table(path, PICKS_REQUIRED, PICKS_KNOWN)
    survey = table.vectors(POSITION, required=True)
    shift = shift if shift is not None else GlobalShift.proposed(survey.min(axis=0), survey.max(axis=0))
    columns = {
        "trajectory": table.text("trajectory"),
        "time_s": table.numbers("time_s", required=True),
        "position": shift.to_local(survey),
        "kind": table.text("kind", "impact"),
        "status": table.text("status", "ok"),
        "normal": table.vectors(NORMAL),
        "sigma_time_s": table.numbers("sigma_time_s"),
        "sigma_position_m": table.numbers("sigma_position_m"),
        "angular_velocity": table.vectors(SPIN),
        "row": table.row,
        "extra": table.rest(PICKS_KNOWN),
    }
    return make_picks(**take_offs.with_take_offs(columns, table, shift), source=str(path), shift=shift)


def write_picks(picks: Picks, path: str | Path) -> None:
    """Write picks.csv: optional columns only where one has a value, unknown columns at the end. A take-off is a row."""
    columns: Columns = {
        "trajectory": picks.trajectory.tolist(),
        "time_s": picks.time_s,
        **vector_columns(POSITION, picks.shift.to_survey(picks.position)),
        "kind": picks.kind.tolist(),
        "status": picks.status.tolist(),
    }
    if np.isfinite(picks.normal).any():
        columns |= vector_columns(NORMAL, picks.normal)
    for name, values in (("sigma_time_s", picks.sigma_time_s), ("sigma_position_m", picks.sigma_position_m)):
        if np.isfinite(values).any():
            columns[name] = values
    if np.isfinite(picks.angular_velocity).any():
        columns |= vector_columns(SPIN, picks.angular_velocity)
    columns |= picks.extra
    write_columns(path, columns)


def write_impacts(impacts: Impacts | Sequence[Impacts], path: str | Path) -> None:
    """Write impacts.csv: the fixed columns, then what else is known: deviations, intervals, spin, energies, heights.

    Several tables stand one below the other; they have the same columns, but for those without a row.
    """
    tables = [impacts] if isinstance(impacts, Impacts) else impacts
    write_tables(path, map(_impact_cells, [table for table in tables if len(table)] or tables[:1]))


def _impact_cells(impacts: Impacts) -> Columns:
    columns: Columns = {"site": impacts.site, "trajectory": impacts.trajectory, "impact": impacts.impact}
    columns |= impact_numbers(impacts)
    columns["flags"] = impacts.flag_text()
    for name, attribute, component, degrees in _UNCERTAIN:
        if attribute in impacts.sigma:
            sigma = impacts.sigma[attribute]
            values = sigma if component is None else sigma[:, component]
            columns[f"sigma_{name}"] = np.degrees(values) if degrees else values
    for name, interval, end, degrees in _ENDS:
        if interval in impacts.intervals:
            values = np.where(
                np.isinf(impacts.intervals[interval][:, end]), np.nan, impacts.intervals[interval][:, end]
            )
            columns[name] = np.degrees(values) if degrees else values
    for column in (*_SPIN, *_MORE):
        values = _of(impacts, column)
        if np.isfinite(values).any():
            columns[column[0]] = values
    return {**columns, **impacts.extra}


def impact_numbers(impacts: Impacts) -> dict[str, Array]:
    """The columns of numbers that are always there, by name."""
    return {column[0]: _of(impacts, column) for column in _NUMBERS}


def spin_and_energies(impacts: Impacts) -> dict[str, Array]:
    """The columns of spin and energies by name, those that are always known of a simulated impact."""
    return {column[0]: _of(impacts, column) for column in (*_SPIN, *_MORE) if column[1] in _SIMULATED}


@reader("table of impacts")
def read_impacts(path: str | Path, shift: GlobalShift | None = None) -> Impacts:
    """Read impacts.csv.

    The trajectory, the velocities and the normal must be there; norms, coefficients and angles that have no column are
    computed (eq. 7–10), other missing columns are undefined.

    Raises
    ------
    InputError : anything that is wrong with the table, with the row.
    """
    sigma_names = [f"sigma_{column[0]}" for column in _UNCERTAIN]
    ends = tuple(column[0] for column in _ENDS)
    known = (*IMPACTS_COLUMNS, *sigma_names, *ends, *SPIN, *(column[0] for column in _MORE))
    table = read_table(path, ("trajectory", *NORMAL, *V1, *V2), known)
    n = len(table)
    arrays: dict[str, Any] = {}
    for columns, of in ((_NUMBERS, arrays), ((*_SPIN, *_MORE), arrays)):
        for name, attribute, component, degrees in columns:
            values = np.radians(table.numbers(name)) if degrees else table.numbers(name)
            if component is None:
                of[attribute] = values
            else:
                of.setdefault(attribute, np.empty((n, 3)))[:, component] = values
    sigma: dict[str, Array] = {}
    for name, attribute, component, degrees in _UNCERTAIN:
        if f"sigma_{name}" in table.columns:
            values = table.numbers(f"sigma_{name}")
            values = np.radians(values) if degrees else values
            if component is None:
                sigma[attribute] = values
            else:
                sigma.setdefault(attribute, np.full((n, 3), np.nan))[:, component] = values
    intervals: dict[str, Array] = {}
    for name, interval, end, degrees in _ENDS:
        if name in table.columns:
            values = np.radians(table.numbers(name)) if degrees else table.numbers(name)
            intervals.setdefault(interval, np.full((n, 2), np.nan))[:, end] = values
    for values in intervals.values():
        values[np.isfinite(values[:, 0]) & np.isnan(values[:, 1]), 1] = np.inf

    survey = arrays["position"]
    finite = survey[np.isfinite(survey).all(axis=1)]
    if shift is None:
        shift = GlobalShift.proposed(finite.min(axis=0), finite.max(axis=0)) if len(finite) else GlobalShift()
    arrays["position"] = shift.to_local(survey)
    marks = _marks(table.text("flags"))

    derived = [column for column in _DERIVED if column[2] is None and column[0] not in table.columns]
    if derived or "flags" not in table.columns:
        computed = apparent(arrays["v1"], arrays["v2"], arrays["normal"])
        for _, attribute, _, _ in derived:
            value = getattr(computed, attribute)
            judged = attribute in ("rn", "rt", "r", "theta1", "theta_dev")
            arrays[attribute] = np.where(computed.approach >= 0, np.nan, value) if judged else value
        if "flags" not in table.columns:
            marks["departing"], marks["into_ground"] = computed.approach >= 0, computed.escape < 0
    if "kinetic1_J" not in table.columns:
        for name, velocity in (("kinetic1_j", arrays["v1"]), ("kinetic2_j", arrays["v2"])):
            arrays[name] = 0.5 * arrays["mass_kg"] * dot(velocity, velocity)

    names = np.array(table.text("trajectory"), dtype=np.str_)
    numbers = table.numbers("impact")
    return Impacts(
        site=np.array(table.text("site"), dtype=np.str_),
        trajectory=names,
        impact=np.where(np.isfinite(numbers), numbers, 0).astype(np.intp),
        flags=marks,
        sigma=sigma,
        intervals=intervals,
        extra=table.rest(known),
        shift=shift,
        **arrays,
    )


def write_trajectories(samples: TrajectorySamples | Sequence[TrajectorySamples], path: str | Path) -> None:
    """Write trajectories.csv, to the micrometre and microsecond; several tables one below the other."""
    tables = [samples] if isinstance(samples, TrajectorySamples) else samples
    write_tables(path, map(_trajectory_cells, tables))


def _trajectory_cells(samples: TrajectorySamples) -> Columns:
    survey = samples.shift.to_survey(samples.position)
    columns: Columns = {
        "source": samples.source.tolist(),
        "trajectory": samples.trajectory.tolist(),
        "run": [str(run) for run in samples.run.tolist()],
        "time_s": _rounded(samples.time_s),
    }
    columns |= {name: _rounded(survey[:, i]) for i, name in enumerate(POSITION)}
    columns |= {name: _rounded(samples.velocity[:, i]) for i, name in enumerate(VELOCITY)}
    columns |= {"height_m": _rounded(samples.height_m), "kinetic_J": _rounded(samples.kinetic_j)}
    return columns


def impact_columns(impacts: Impacts) -> tuple[str, ...]:
    """The names of all columns that a table of impacts can be asked for."""
    return (*IMPACTS_COLUMNS, *(column[0] for column in (*_SPIN, *_MORE)), *impacts.extra)


def impact_column(impacts: Impacts, name: str) -> Array | Names | Indices | None:
    """(n,) a column by its name in impacts.csv, with the unit of that name; None when there is none."""
    if name in ("site", "trajectory", "impact"):
        values: Array | Names | Indices = getattr(impacts, name)
        return values
    if name == "flags":
        return np.array(impacts.flag_text(), dtype=np.str_)
    for column in (*_NUMBERS, *_SPIN, *_MORE):
        if column[0] == name:
            return _of(impacts, column)
    return impacts.extra.get(name)


def _marks(cells: Sequence[str]) -> dict[str, Mask]:
    """Flag → (n,) whether the cell has it; there are few different cells."""
    code: dict[str, int] = {}
    which = np.array([code.setdefault(cell, len(code)) for cell in cells], dtype=np.intp)
    flags = [{flag.strip() for flag in cell.split(";")} for cell in code]
    return {name: np.array([name in here for here in flags], dtype=np.bool_)[which] for name in FLAGS}


def _of(impacts: Impacts, column: Column) -> Array:
    _, attribute, component, degrees = column
    values: Array = getattr(impacts, attribute)
    if attribute == "position":
        values = impacts.shift.to_survey(values)
    values = values if component is None else values[:, component]
    return np.degrees(values) if degrees else values


def _texts(cells: Cells) -> list[str]:
    """As they are written: the shortest text that reads back as the same number; empty when undefined."""
    if isinstance(cells, np.ndarray) and cells.dtype.kind == "f":
        return shortest_texts(cells)
    if isinstance(cells, np.ndarray) and cells.dtype.kind != "U":
        return list(map(str, cells.tolist()))
    return [guarded(cell) for cell in (cells.tolist() if isinstance(cells, np.ndarray) else cells)]


def _rounded(values: Array) -> list[str]:
    return ["" if value != value else f"{value:.6f}" for value in values.tolist()]


def vector_columns(names: Iterable[str], values: Array) -> dict[str, Array]:
    return {name: values[:, i] for i, name in enumerate(names)}


def write_columns(path: str | Path, columns: Columns) -> None:
    """Write a table: a header, and undefined numbers as empty cells."""
    write_tables(path, [columns])


def write_tables(path: str | Path, tables: Iterable[Columns]) -> None:
    """Write tables of the same columns, one below the other.

    Some rows at a time: their text takes many times the memory of the numbers. As Parquet where the name ends in that.
    """
    if Path(path).suffix == SUFFIX:
        write_parquet(path, tables)
        return
    with output_stream(path, binary=True) as stream:
        for i, columns in enumerate(tables):
            if i == 0:
                stream.write(_quoted_rows([map(guarded, columns)]))
            for start in range(0, min(map(len, columns.values())), WRITTEN_ROWS):
                cells = [values[start : start + WRITTEN_ROWS] for values in columns.values()]
                if any(map(_must_be_quoted, cells)):
                    stream.write(_quoted_rows(zip(*map(_texts, cells), strict=True)))
                elif sum(map(len, cells)) < COMPILED:
                    lines = map(",".join, zip(*map(_texts, cells), strict=True))
                    stream.write("".join(f"{line}\n" for line in lines).encode())
                else:
                    stream.write(_plain_rows(cells))


def _quoted_rows(rows: Iterable[Iterable[str]]) -> bytes:
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerows(rows)
    return stream.getvalue().encode()


def _plain_rows(cells: Sequence[Cells]) -> memoryview:
    """Rows without anything to quote, by compiled code."""
    from .row_kernels import write_full_rows
    from .shortest_kernels import LONGEST

    rows = min(map(len, cells))
    numbers: list[Array] = []
    texts: list[bytes] = []
    places, size = [], 0
    for values in cells:
        if isinstance(values, np.ndarray) and values.dtype.kind == "f":
            places.append(len(numbers))
            numbers.append(values[:rows].astype(np.float64))
        else:
            places.append(-1 - size)
            texts.append("\n".join([*_texts(values)[:rows], ""]).encode())
            size += len(texts[-1])
    bits = (np.stack(numbers) if numbers else np.empty((0, rows))).view(np.uint64)
    out = np.empty(bits.size * LONGEST + size + rows * len(cells), np.uint8)
    written = write_full_rows(bits, np.frombuffer(b"".join(texts) or b" ", np.uint8), np.array(places, np.int64), out)
    return memoryview(out)[:written]


def _must_be_quoted(cells: Cells) -> bool:
    """Whether one of them must be."""
    if isinstance(cells, np.ndarray) and cells.dtype.kind != "U":
        return False
    return QUOTED.search("".join(cells)) is not None

# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of pixels (clicks.csv, track.csv, events.csv) and of a refinement (residuals.csv, what_if.csv,
reliability.csv)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..reading import reader
from ..reconstruction.picks import KINDS
from ..reconstruction.refinement.reliability import Statement
from ..reconstruction.refinement.what_if import WhatIf
from ..reconstruction.sightings import Events, Sightings
from ..vectors import Array, Indices, Mask, Names
from .csv_text import TextTable, read_table
from .tables import Columns, vector_columns, write_columns

PIXEL = ("u_px", "v_px")
CLICKS_KNOWN = ("trajectory", "frame", *PIXEL)
TRACK_REQUIRED = ("time_s", *PIXEL)
TRACK_KNOWN = ("trajectory", "frame", *TRACK_REQUIRED, "sigma_px", "score")
EVENTS_REQUIRED = TRACK_REQUIRED
EVENTS_KNOWN = ("trajectory", "frame", *EVENTS_REQUIRED, "sigma_time_s", "kind")

Extra = Mapping[str, Names]


@dataclass(frozen=True, eq=False)
class Clicks:
    """Where a person clicked the block, n times.

    Attributes
    ----------
    trajectory : (n,) empty where not given.
    frame : (n,)
    pixel : (n, 2) [px].
    row : (n,) in a text editor.
    extra : further columns as text.
    """

    trajectory: Names
    frame: Indices
    pixel: Array
    row: Indices
    extra: Extra = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.pixel)


@dataclass(frozen=True, eq=False)
class Track(Sightings):
    """A table of sightings, with the rows of its file.

    Attributes
    ----------
    score : (m,) how well the block was recognised, 0…1; NaN where not given.
    row : (m,) in a text editor.
    extra : further columns as text.
    source : the file, may be empty.
    """

    score: Array
    row: Indices
    extra: Extra = field(default_factory=dict)
    source: str = ""

    def error(self, index: int, problem: str, advice: str) -> InputError:
        """An `InputError` that points at one row."""
        return _error(self.source, self.row, self.trajectory, index, problem, advice)


@dataclass(frozen=True, eq=False)
class EventTable(Events):
    """A table of events, with the rows of its file; row, extra, source : as in `Track`."""

    row: Indices
    extra: Extra = field(default_factory=dict)
    source: str = ""

    def error(self, index: int, problem: str, advice: str) -> InputError:
        """An `InputError` that points at one row."""
        return _error(self.source, self.row, self.trajectory, index, problem, advice)


@reader("table")
def read_clicks(path: str | Path) -> Clicks:
    """Read clicks.csv: frames and pixels where a person saw the block.

    Raises
    ------
    InputError : anything that is wrong with the table, with the row.
    """
    table = read_table(path, ("frame", *PIXEL), CLICKS_KNOWN)
    return Clicks(
        trajectory=_names(table, "trajectory"),
        frame=frames_of(table, required=True),
        pixel=table.vectors(PIXEL, required=True),
        row=np.asarray(table.row, dtype=np.intp),
        extra=table.rest(CLICKS_KNOWN),
    )


@reader("table")
def read_track(path: str | Path) -> Track:
    """Read track.csv: the block's centre, frame by frame.

    Raises
    ------
    InputError : anything that is wrong with the table, with the row; times of a trajectory that do not ascend.
    """
    table = read_table(path, TRACK_REQUIRED, TRACK_KNOWN)
    track = Track(
        trajectory=_names(table, "trajectory"),
        frame=frames_of(table),
        time_s=table.numbers("time_s", required=True),
        pixel=table.vectors(PIXEL, required=True),
        sigma_px=positive_of(table, "sigma_px"),
        score=table.numbers("score"),
        row=np.asarray(table.row, dtype=np.intp),
        extra=table.rest(TRACK_KNOWN),
        source=str(path),
    )
    for name in dict.fromkeys(track.trajectory.tolist()):
        rows = np.flatnonzero(track.trajectory == name)
        late = np.flatnonzero(np.diff(track.time_s[rows]) <= 0)
        if late.size:
            before, after = rows[late[0]], rows[late[0] + 1]
            problem = f"The time {track.time_s[after]:g} s does not come after {track.time_s[before]:g} s"
            raise table.error(int(after), problem, "Put the frames in the order of their times, each frame once")
    return track


def write_track(track: Track, path: str | Path) -> None:
    """Write track.csv, unknown columns at the end."""
    columns: Columns = {"trajectory": track.trajectory, "frame": whole_numbers(track.frame), "time_s": track.time_s}
    columns |= vector_columns(PIXEL, track.pixel) | {"sigma_px": track.sigma_px}
    if np.isfinite(track.score).any():
        columns["score"] = track.score
    write_columns(path, columns | dict(track.extra))


@reader("table")
def read_events(path: str | Path) -> EventTable:
    """Read events.csv: impacts and other events as seen in one video.

    Raises
    ------
    InputError : anything that is wrong with the table, with the row.
    """
    table = read_table(path, EVENTS_REQUIRED, EVENTS_KNOWN)
    kinds = table.text("kind", "impact")
    for i, kind in enumerate(kinds):
        if kind not in KINDS:
            raise table.error(i, f"Unknown kind '{kind}'", f"Use one of {', '.join(KINDS)}")
    return EventTable(
        trajectory=_names(table, "trajectory"),
        frame=frames_of(table),
        time_s=table.numbers("time_s", required=True),
        pixel=table.vectors(PIXEL, required=True),
        sigma_time_s=positive_of(table, "sigma_time_s", zero_allowed=True),
        kind=np.array(kinds, dtype=np.str_),
        row=np.asarray(table.row, dtype=np.intp),
        extra=table.rest(EVENTS_KNOWN),
        source=str(path),
    )


def write_events(events: EventTable, path: str | Path) -> None:
    """Write events.csv, unknown columns at the end."""
    columns: Columns = {"trajectory": events.trajectory, "frame": whole_numbers(events.frame), "time_s": events.time_s}
    columns |= vector_columns(PIXEL, events.pixel) | {"sigma_time_s": events.sigma_time_s, "kind": events.kind}
    write_columns(path, columns | dict(events.extra))


def write_refinement_residuals(
    path: str | Path,
    *,
    trajectory: Names,
    video: Names,
    frame: Indices,
    time_s: Array,
    pixel: Array,
    residual_px: Array,
    outlier: Mask,
) -> None:
    """Write residuals.csv, a row for each observed pixel.

    Parameters
    ----------
    time_s : (m,) video time [s].
    pixel, residual_px : (m, 2) observed, and observed minus fitted [px].
    outlier : (m,) whether it was all but ignored.
    """
    columns: Columns = {"trajectory": trajectory, "video": video}
    if (frame >= 0).any():
        columns["frame"] = whole_numbers(frame)
    columns |= {"time_s": time_s} | vector_columns(PIXEL, pixel)
    columns |= vector_columns(("residual_u_px", "residual_v_px"), residual_px)
    write_columns(path, columns | {"outlier": ["1" if one else "0" for one in outlier.tolist()]})


def write_what_if(rows: Sequence[WhatIf], path: str | Path) -> None:
    """Write what_if.csv: a row for each change of an input and each trajectory."""
    names = [one.name for one in fields(WhatIf)]
    text, numbers = names[:3], names[3:]
    columns: Columns = {name: [getattr(row, name) for row in rows] for name in text}
    write_columns(path, columns | {name: np.array([getattr(row, name) for row in rows]) for name in numbers})


def write_reliability(rows: Sequence[Statement], path: str | Path) -> None:
    """Write reliability.csv: a row for each error of a statement and each trajectory."""
    text = ("about", "error", "trajectory", "unit")
    columns: Columns = {name: [getattr(row, name) for row in rows] for name in text}
    for name in ("found", "sigma", "w", "critical", "noticed"):
        columns[name] = np.array([getattr(row, name) for row in rows])
    columns["beyond"] = ["1" if row.beyond else "0" for row in rows]
    for name in ("speed_percent", "most_speed_percent", "intervals"):
        columns[name] = np.array([getattr(row, name) for row in rows])
    write_columns(path, columns)


def _names(table: TextTable, name: str) -> Names:
    return np.array(table.text(name), dtype=np.str_)


def whole_numbers(values: Indices) -> list[str]:
    """(n,) as they are written, empty where they are not given."""
    return [str(value) if value >= 0 else "" for value in values.tolist()]


def frames_of(table: TextTable, *, required: bool = False) -> Indices:
    """(n,) the column frame, −1 where it is not given.

    Raises
    ------
    InputError : no whole number of zero or more, with the row.
    """
    frames = table.numbers("frame", required=required)
    for i in np.flatnonzero(~np.isnan(frames) & ((frames < 0) | (frames % 1 != 0))):
        raise table.error(int(i), f"The frame {frames[i]:g} is no whole number of zero or more", "Frames count from 0")
    return np.where(np.isnan(frames), -1, frames).astype(np.intp)


def positive_of(table: TextTable, name: str, *, zero_allowed: bool = False) -> Array:
    """(n,) a column of numbers above zero, NaN where they are not given.

    Raises
    ------
    InputError : another number, with the row.
    """
    values = table.numbers(name)
    for i in np.flatnonzero((values < 0) if zero_allowed else (values <= 0)):
        limit = "of zero or more" if zero_allowed else "above zero"
        raise table.error(int(i), f"{name} is {values[i]:g}", f"Give a number {limit}, or nothing")
    return values


def _error(source: str, row: Indices, trajectory: Names, index: int, problem: str, advice: str) -> InputError:
    return InputError(
        problem,
        file=source or None,
        row=int(row[index]) or None,
        trajectory=str(trajectory[index]) or None,
        advice=advice,
    )

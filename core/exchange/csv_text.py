# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading comma-separated text into columns, with every mistake located."""

import codecs
import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..vectors import Array, Names
from .cells import Cells, split_cells

LARGE_BYTES = 2_000_000
"""Tables above this are split by compiled code, which takes a moment to load."""
EXPORT_ADVICE = "Export it as comma-separated text in UTF-8, with . decimals"


@dataclass(frozen=True, eq=False)
class TextTable:
    """A table of text cells.

    Attributes
    ----------
    source : the file.
    columns : name → (n,) cells, without surrounding blanks.
    row : (n,) row in a text editor, the header being row 1.
    """

    source: Path
    columns: Mapping[str, Sequence[str]]
    row: Sequence[int]

    def __len__(self) -> int:
        return len(self.row)

    def text(self, name: str, default: str = "") -> list[str]:
        """(n,) cells; `default` where the column is missing or the cell is empty."""
        cells = self.columns.get(name)
        if cells is None:
            return [default] * len(self)
        return [cell or default for cell in (cells.texts() if isinstance(cells, Cells) else cells)]

    def numbers(self, name: str, *, required: bool = False) -> Array:
        """(n,) a column of numbers; NaN where it is missing or empty.

        Raises
        ------
        InputError : a cell is no finite number, or is empty although required.
        """
        cells = self.columns.get(name)
        if cells is None:
            return np.full(len(self), np.nan)
        values = np.empty(len(cells))
        rows: Iterable[int] = range(len(cells))
        if isinstance(cells, Cells):
            values, found = cells.numbers(empty=required)
            rows = found.tolist()
        for i in rows:
            if cells[i]:
                values[i] = self._number(name, i, required)
            elif required:
                raise self.error(i, f"The cell of {name} is empty", "Give a number")
            else:
                values[i] = np.nan
        return values

    def _number(self, name: str, i: int, required: bool) -> float:
        or_empty = "" if required else ", or leave it empty if it is not defined"
        cell = self.columns[name][i]
        try:
            value = float(cell)
        except ValueError:
            value = None
        if value is None or "_" in cell:
            advice = "Write decimals with a point" if "," in cell else f"Correct the cell{or_empty}"
            raise self.error(i, f"'{cell}' in column {name} is not a number", advice)
        if not np.isfinite(value):
            raise self.error(i, f"'{cell}' in column {name} is not finite", f"Correct the cell{or_empty}")
        return value

    def vectors(self, names: Sequence[str], *, required: bool = False) -> Array:
        """(n, 3) from three columns."""
        return np.stack([self.numbers(name, required=required) for name in names], axis=1)

    def rest(self, known: Sequence[str]) -> dict[str, Names]:
        """The columns that are not among `known`."""
        left = [name for name in self.columns if name not in known]
        return {name: np.array(self.text(name), dtype=np.str_) for name in left}

    def error(self, i: int, problem: str, advice: str) -> InputError:
        """An `InputError` that points at one row."""
        name = self.columns.get("trajectory", [""] * len(self))[i]
        return InputError(problem, file=self.source, row=self.row[i], trajectory=name or None, advice=advice)


def read_table(path: str | Path, required: Sequence[str], known: Sequence[str]) -> TextTable:
    """Read a comma-separated table.

    Parameters
    ----------
    required : columns that must be there.
    known : all columns that mean something, to suggest a near one when a required one is missing.

    Raises
    ------
    InputError : no such file, no text, an empty file, another separator, a required column missing, a column twice, a
        row with too many or too few cells, no rows.
    """
    path = Path(path)
    data = _read_bytes(path)
    text = _decoded(path, data)
    if len(data) >= LARGE_BYTES and (large := _large_table(path, data, required, known)) is not None:
        return large
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    header: list[str] | None = None
    rows: list[list[str]] = []
    numbers: list[int] = []
    start = 1
    try:
        for cells in reader:
            stripped = [cell.strip() for cell in cells]
            if any(stripped):
                if header is None:
                    header = stripped
                    _check_header(path, header, required, known, start)
                elif len(stripped) != len(header):
                    raise InputError(
                        f"The row has {len(stripped)} cells, the header has {len(header)}",
                        file=path,
                        row=start,
                        advice="Give every row as many cells as the header; put text that contains a comma in quotes",
                    )
                else:
                    rows.append(stripped)
                    numbers.append(start)
            start = reader.line_num + 1
    except csv.Error as error:
        raise InputError(
            f"The row cannot be read as comma-separated text ({error})",
            file=path,
            row=max(start, 1),
            advice="Look for a quote that is not closed",
        ) from error
    if header is None:
        raise InputError("The file is empty", file=path, advice=f"Its first row must name {', '.join(required)}")
    if not rows:
        raise InputError("The table has a header but no rows", file=path, advice="Add a row for each pick")
    columns = {name: [row[i] for row in rows] for i, name in enumerate(header) if name}
    unnamed = [i for i, name in enumerate(header) if not name]
    for i in unnamed:
        filled = [number for number, row in zip(numbers, rows, strict=True) if row[i]]
        if filled:
            raise InputError(
                f"Column {i + 1} has no name, but a cell in it", file=path, row=filled[0], advice="Name it in row 1"
            )
    return TextTable(path, columns, numbers)


def _large_table(path: Path, data: bytes, required: Sequence[str], known: Sequence[str]) -> TextTable | None:
    """The same table, quickly; None when there is anything unusual about it."""
    begin = len(codecs.BOM_UTF8) if data.startswith(codecs.BOM_UTF8) else 0
    end = data.find(b"\n")
    header = [cell.strip() for cell in data[begin:end].decode().split(",")]
    if end < 0 or not all(header) or (columns := split_cells(data, end + 1, len(header))) is None:
        return None
    _check_header(path, header, required, known, 1)
    return TextTable(path, dict(zip(header, columns, strict=True)), range(2, len(columns[0]) + 2))


def _read_bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError as error:
        raise InputError("There is no such file", file=path, advice="Check the name and the folder") from error
    except OSError as error:
        raise InputError(f"The file cannot be read ({error.strerror})", file=path, advice="Check the path") from error


def _decoded(path: Path, data: bytes) -> str:
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError("The file is in UTF-16, not UTF-8", file=path, advice=EXPORT_ADVICE)
    if b"\0" in data:
        raise InputError("This is a binary file, not a table", file=path, advice=EXPORT_ADVICE)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        row = data.count(b"\n", 0, error.start) + 1
        raise InputError("The text is not in UTF-8", file=path, row=row, advice=EXPORT_ADVICE) from error


def _check_header(path: Path, header: list[str], required: Sequence[str], known: Sequence[str], row: int) -> None:
    for separator, name in ((";", "semicolons"), ("\t", "tabs")):
        if len(header) == 1 and separator in header[0]:
            raise InputError(f"The cells are separated by {name}", file=path, row=row, advice=EXPORT_ADVICE)
    named = [name for name in header if name]
    double = [name for name in dict.fromkeys(named) if named.count(name) > 1]
    if double:
        raise InputError(
            f"The column {double[0]} is there {named.count(double[0])} times",
            file=path,
            row=row,
            advice="Rename or remove one of them",
        )
    missing = [name for name in required if name not in named]
    if not missing:
        return
    spare = [name for name in named if name not in known]
    hints = []
    for name in missing:
        lower = {other.lower(): other for other in spare}
        near = get_close_matches(name, lower, n=1, cutoff=0.5) or [low for low in lower if low == name.split("_")[0]]
        if near:
            hints.append(f"rename {lower[near[0]]} to {name}")
    found = ", ".join(named) if len(named) <= 30 else ", ".join([*named[:30], "…"])
    plural = "s" if len(missing) > 1 else ""
    raise InputError(
        f"The required column{plural} {', '.join(missing)} {'are' if plural else 'is'} missing; found: {found[:1000]}",
        file=path,
        row=row,
        advice=(", ".join(hints).capitalize() if hints else f"Add {', '.join(missing)}"),
    )

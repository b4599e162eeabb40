# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading comma-separated text into columns, with every mistake located.

Semicolons or tabs between cells, and decimal commas with them, are read too, as spreadsheets in Europe write them.
"""

import csv
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from itertools import pairwise
from pathlib import Path

import numpy as np

from ..errors import InputError, readable
from ..formats.csv_cells import unguarded
from ..formats.number_words import (
    GROUP_SIGNS,
    as_utf8,
    has_thousands_marks,
    stated_separator,
    why_no_number,
    without_groups,
)
from ..plausibility import implausible, limits
from ..reading import reader
from ..vectors import Array, Names
from .parquet_cells import SUFFIX, read_cells, renamed
from .plain_cells import Cells, PlainCells, PlainRows, plain_rows
from .units import OtherUnit, if_in_unit, other_units, unknown_unit, unknown_units

BLOCK_ROWS, BETWEEN = 20_000, "\0"
"""So many rows of a column are kept as one text, cells between zero bytes: a fifth of the memory of single cells."""
MOST_OF_CELL = 60
"""Letters of a cell that a message shows."""
GROUP_SIGN = re.compile(f"[{GROUP_SIGNS}]")
MARKS = re.compile(r"\d[.,]\d{3}[.,]")
NUMBER_PARTS = re.compile(r"[-+]?\d+,\d+(\.\d*)?")
LINE_END = re.compile(rb"[\r\n]")
EXPORT_ADVICE = "Export it as comma-separated text in UTF-8, with . decimals"


@dataclass(frozen=True, eq=False)
class TextTable:
    """A table of text cells.

    Attributes
    ----------
    source : the file.
    columns : name → texts of some rows each, see `BLOCK_ROWS`.
    row : (n,) row in a text editor, the header being row 1; in a Parquet file from 1, for it has no header.
    converted : the columns whose numbers are in another unit in the file.
    decimal : mark of its numbers, a comma where other programs wrote semicolons or tabs between cells.
    """

    source: Path
    columns: Mapping[str, Sequence[str]]
    row: Sequence[int]
    converted: Mapping[str, OtherUnit] = field(default_factory=dict)
    decimal: str = "."

    def __len__(self) -> int:
        return len(self.row)

    def cells(self, name: str) -> list[str]:
        """(n,) of a column that is there, without surrounding blanks."""
        if isinstance(self.columns, Cells):
            cells = self.columns.texts(name)
        else:
            cells = [cell for block in self.columns[name] for cell in block.split(BETWEEN)]
        return cells if self.source.suffix.lower() == SUFFIX else [unguarded(cell) for cell in cells]

    def text(self, name: str, default: str = "") -> list[str]:
        """(n,) cells; `default` where the column is missing or the cell is empty."""
        if name not in self.columns:
            return [default] * len(self)
        return [cell or default for cell in self.cells(name)]

    def numbers(self, name: str, *, required: bool = False) -> Array:
        """(n,) a column of numbers in the unit of its name; NaN where it is missing or empty.

        Raises
        ------
        InputError : a cell is no finite number, or is empty although required.
        """
        if name not in self.columns:
            return np.full(len(self), np.nan)
        plain = self.columns.numbers(name, required) if isinstance(self.columns, Cells) else None
        texts = self.columns[name] if plain is None else ()
        blocks = [self._block_numbers(block, required) for block in texts]
        good = [block for block in blocks if block is not None]
        if len(good) < len(blocks):
            cells = self.cells(name)
            there = self.converted[name].name if name in self.converted else name
            raise next(error for i in range(len(self)) if (error := self._mistake(there, i, cells[i], required)))
        values = np.concatenate(good) if plain is None else plain
        values = values * self.converted[name].factor if name in self.converted else values
        least, greatest = limits(name)
        amount = np.abs(values)
        for i in np.flatnonzero((amount > greatest) | ((amount < least) & (amount > 0)))[:1].tolist():
            raise self.error(i, f"{name} {implausible(name, values[i])}", "Correct the cell, or the unit of the column")
        return values

    def has_numbers(self, name: str) -> bool:
        """Whether there are numbers in a column that is there, and nothing else."""
        blocks = [self._block_numbers(block, False) for block in self.columns[name]]
        good = [block for block in blocks if block is not None]
        return len(good) == len(blocks) and bool(np.isfinite(np.concatenate(good)).any())

    def _block_numbers(self, block: str, required: bool) -> Array | None:
        found = _numbers(self._with_points(block).split(BETWEEN), required)
        if found is None and GROUP_SIGN.search(block):
            found = _numbers([self._plain(cell) for cell in block.split(BETWEEN)], required)
        return found

    def _plain(self, cell: str) -> str:
        """A cell as Python writes numbers, if it is one."""
        return self._with_points(without_groups(cell))

    def _with_points(self, text: str) -> str:
        return text.replace(self.decimal, ".") if self.decimal != "." else text

    def _mistake(self, name: str, i: int, cell: str, required: bool) -> InputError | None:
        """What is wrong with a cell that must be a number."""
        or_empty = "" if required else ", or leave it empty if it is not defined"
        if not cell:
            return self.error(i, f"The cell of {name} is empty", "Give a number") if required else None
        try:
            value = float(self._plain(cell))
        except ValueError:
            value = None
        if value is None or "_" in cell:
            why, advice = why_no_number(cell)
            if self.decimal != "." and cell.count(".") == 1 and not why:
                why, advice = "has a decimal point, where others have commas", "Write all decimals in the same way"
            problem = f"'{readable(cell, MOST_OF_CELL)}' in column {name} is not a number"
            if why:
                problem = f"'{readable(cell, MOST_OF_CELL)}' in column {name} {why}"
            return self.error(i, problem, advice or f"Correct the cell{or_empty}")
        if not np.isfinite(value):
            return self.error(
                i, f"'{readable(cell, MOST_OF_CELL)}' in column {name} is not finite", f"Correct the cell{or_empty}"
            )
        return None

    def vectors(self, names: Sequence[str], *, required: bool = False) -> Array:
        """(n, 3) from three columns."""
        return np.stack([self.numbers(name, required=required) for name in names], axis=1)

    def rest(self, known: Sequence[str]) -> dict[str, Names]:
        """The columns that are not among `known`."""
        left = [name for name in self.columns if name not in known]
        cells = {name: self.text(name) for name in left}
        if self.decimal != ".":
            cells |= {name: list(map(self._plain, cells[name])) for name in left if self.has_numbers(name)}
        return {name: np.array(text, dtype=np.str_) for name, text in cells.items()}

    def error(self, i: int, problem: str, advice: str) -> InputError:
        """An `InputError` that points at one row."""
        name = self.text("trajectory")[i] or None
        return InputError(problem, file=self.source, row=self.row[i], trajectory=name, advice=advice)


@reader("table", EXPORT_ADVICE)
def read_table(path: str | Path, required: Sequence[str], known: Sequence[str]) -> TextTable:
    """Read a table separated by commas, semicolons or tabs, or a Parquet file; its columns in the units of `known`.

    Parameters
    ----------
    required : columns that must be there.
    known : all columns that mean something: what has the name of one but for its unit is converted (`units`), and a
        near one is suggested when a required one is missing.

    Raises
    ------
    InputError : no such file, no text, an empty file, a required column missing, a column twice, a
        row with too many or too few cells, no rows, numbers in a unit that is not known.
    DependencyError : a Parquet file, and pyarrow is not installed.
    """
    path = Path(path)
    if path.suffix.lower() == ".toml" and path.is_file():
        raise InputError(
            "This is a TOML file, and a table is needed",
            file=path,
            advice="Give the table itself; `rockfall reconstruct` makes impacts.csv and trajectories.csv of a project",
        )
    if path.suffix.lower() == SUFFIX:
        return _parquet_table(path, required, known)
    stated, data = stated_separator(_checked(path, as_utf8(path.read_bytes(), path, EXPORT_ADVICE)))
    separator = stated.decode() or _separator(data)
    plain = plain_rows(data) if separator == "," else None
    if plain is not None:
        return _plain_table(path, plain, required, known)
    reader = csv.reader(io.TextIOWrapper(io.BytesIO(data), "utf-8-sig", newline=""), strict=True, delimiter=separator)
    header: list[str] = []
    blocks: list[list[str]] = []
    rows: list[list[str]] = []
    numbers: list[int] = []
    converted: dict[str, OtherUnit] = {}
    start, top = 1, 1
    try:
        for cells in reader:
            stripped = [cell.strip() for cell in cells]
            if not any(stripped):
                pass
            elif not header:
                stripped = [unguarded(name) for name in stripped]
                top, blocks = start, [[] for _ in stripped]
                header, converted = _in_our_units(path, stripped, known, start)
                _check_header(path, header, required, known, start)
            else:
                _check_row(path, header, stripped, start)
                rows.append(stripped)
                numbers.append(start)
                if len(rows) == BLOCK_ROWS:
                    _add_block(blocks, rows)
            start = reader.line_num + 1
    except csv.Error as error:
        raise InputError(
            f"The row cannot be read as separated text ({error})",
            file=path,
            row=max(start, 1),
            advice="Look for a quote that is not closed",
        ) from error
    if not header:
        raise InputError("The file is empty", file=path, advice=f"Its first row must name {', '.join(required)}")
    if not numbers:
        raise InputError("The table has a header but no rows", file=path, advice="Add rows below it")
    _add_block(blocks, rows)
    columns = {name: texts for name, texts in zip(header, blocks, strict=True) if name}
    table = TextTable(path, columns, numbers, converted, _decimal(data, separator))
    if separator != ",":
        _refuse_thousands_marks(table)
    return _in_known_units(table, header, known, top)


def _plain_table(path: Path, rows: PlainRows, required: Sequence[str], known: Sequence[str]) -> TextTable:
    header, converted = _in_our_units(path, [unguarded(name) for name in rows.header], known, 1)
    _check_header(path, header, required, known, 1)
    cells = PlainCells(rows, header, BLOCK_ROWS, BETWEEN)
    return _in_known_units(TextTable(path, cells, range(2, len(rows.begins) + 1), converted), header, known, 1)


def _parquet_table(path: Path, required: Sequence[str], known: Sequence[str]) -> TextTable:
    cells = read_cells(path, BLOCK_ROWS, BETWEEN)
    header, converted = _in_our_units(path, list(cells), known, 1)
    _check_header(path, header, required, known, 1)
    rows = range(1, cells.table.num_rows + 1)
    return _in_known_units(TextTable(path, renamed(cells, header), rows, converted), header, known, 1)


def _in_known_units(table: TextTable, header: list[str], known: Sequence[str], row: int) -> TextTable:
    for name, ours in unknown_units(header, known).items():
        if table.has_numbers(name):
            raise unknown_unit(table.source, name, ours, row)
    return table


def _separator(data: bytes) -> str:
    """What stands between the cells, by the header: a comma, else semicolons or tabs."""
    blank = len(data) - len(data.lstrip())
    start = max(data.rfind(b"\n", 0, blank), data.rfind(b"\r", 0, blank)) + 1
    end = LINE_END.search(data, blank)
    header = data[start : end.start() if end else len(data)] if blank < len(data) else b""
    return next((sign for sign in (",", ";", "\t") if sign.encode() in header), ",")


def _decimal(data: bytes, separator: str) -> str:
    """A comma where cells are numbers with a comma, and none with a point."""
    if separator == ",":
        return "."
    sign = separator.encode()
    whole = rb"(?:\d{1,3}(?:(?:[ ']|\xc2\xa0|\xe2\x80[\xaf\x99])\d{3})+|\d*)"
    cell = rb"(?:^|[%s])[ \"]*[-+]?%s\%%s\d+(?:[eE][-+]?\d+)?[ \"]*(?=[%s]|\r|\n|$)" % (sign, whole, sign)
    commas, points = (re.search(cell % mark, data, re.MULTILINE) for mark in (b",", b"."))
    return "," if commas and not points else "."


def _refuse_thousands_marks(table: TextTable) -> None:
    """Where one number has marks between its thousands, no point or comma of the others is known to be decimal."""
    first: tuple[int, str, str] | None = None
    for name, blocks in table.columns.items():
        if not any(MARKS.search(block) for block in blocks):
            continue
        i = next((i for i, cell in enumerate(table.cells(name)) if has_thousands_marks(cell)), None)
        if i is not None and (first is None or i < first[0]):
            first = i, name, table.cells(name)[i]
    if first is not None:
        why, advice = why_no_number(first[2])
        raise table.error(first[0], f"'{readable(first[2], MOST_OF_CELL)}' in column {first[1]} {why}", advice)


def _in_our_units(
    path: Path, header: list[str], known: Sequence[str], row: int
) -> tuple[list[str], dict[str, OtherUnit]]:
    """The header with our names, and what is in another unit."""
    converted = other_units(path, header, known, row)
    ours = {one.name: name for name, one in converted.items()}
    return [ours.get(name, name) for name in header], converted


def _check_row(path: Path, header: list[str], cells: list[str], row: int) -> None:
    if len(cells) != len(header):
        advice = "Give every row as many cells as the header; put text that contains a comma in quotes"
        pairs = pairwise(cells)
        if len(cells) > len(header) and any(NUMBER_PARTS.fullmatch(f"{a},{b}") for a, b in pairs):
            advice = "Numbers seem to have commas, as decimal marks or between thousands: write them with a point alone"
        raise InputError(
            f"The row has {len(cells)} cells, the header has {len(header)}", file=path, row=row, advice=advice
        )
    if "" in header:
        for i, cell in enumerate(cells):
            if cell and not header[i]:
                raise InputError(
                    f"Column {i + 1} has no name, but a cell in it", file=path, row=row, advice="Name it in row 1"
                )


def _add_block(blocks: list[list[str]], rows: list[list[str]]) -> None:
    """Move rows to the columns."""
    for texts, cells in zip(blocks, zip(*rows, strict=True), strict=False):
        texts.append(BETWEEN.join(cells))
    rows.clear()


def _numbers(cells: list[str], required: bool) -> Array | None:
    """(n,) numbers, NaN where a cell is empty; None when one is no finite number, or empty although required."""
    try:
        values = np.array([float(cell) if cell else np.nan for cell in cells])
    except ValueError:
        return None
    allowed = 0 if required else cells.count("")
    return values if np.isfinite(values).sum() == len(cells) - allowed and "_" not in "".join(cells) else None


def _checked(path: Path, data: bytes) -> bytes:
    """The data, which are text in UTF-8."""
    if b"\0" in data:
        raise InputError("This is a binary file, not a table", file=path, advice=EXPORT_ADVICE)
    try:
        if not data.isascii():
            data.decode()
    except UnicodeDecodeError as error:
        row = data.count(b"\n", 0, error.start) + 1
        raise InputError("The text is not in UTF-8", file=path, row=row, advice=EXPORT_ADVICE) from error
    return data


def _check_header(path: Path, header: list[str], required: Sequence[str], known: Sequence[str], row: int) -> None:
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
    for name, ours in unknown_units(named, known).items():
        if ours in missing:
            raise unknown_unit(path, name, ours, row)
    spare = [name for name in named if name not in known]
    hints = []
    for name in missing:
        lower = {other.lower(): other for other in spare}
        near = get_close_matches(name, lower, n=1, cutoff=0.5) or [low for low in lower if low == name.split("_")[0]]
        if near:
            hints.append(f"rename {lower[near[0]]} to {name}{if_in_unit(name)}")
    found = ", ".join(named) if len(named) <= 30 else ", ".join([*named[:30], "…"])
    plural = "s" if len(missing) > 1 else ""
    raise InputError(
        f"The required column{plural} {', '.join(missing)} {'are' if plural else 'is'} missing; found: {found[:1000]}",
        file=path,
        row=row,
        advice=f"R{', '.join(hints)[1:]}" if hints else f"Add {', '.join(missing)}",
    )

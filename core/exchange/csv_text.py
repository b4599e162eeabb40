# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading comma-separated text into columns, with every mistake located."""

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..vectors import Array, Names

BLOCK_ROWS, BETWEEN = 20_000, "\0"
"""So many rows of a column are kept as one text, cells between zero bytes: a fifth of the memory of single cells."""
EXPORT_ADVICE = "Export it as comma-separated text in UTF-8, with . decimals"


@dataclass(frozen=True, eq=False)
class TextTable:
    """A table of text cells.

    Attributes
    ----------
    source : the file.
    columns : name → texts of some rows each, see `BLOCK_ROWS`.
    row : (n,) row in a text editor, the header being row 1.
    """

    source: Path
    columns: Mapping[str, Sequence[str]]
    row: Sequence[int]

    def __len__(self) -> int:
        return len(self.row)

    def cells(self, name: str) -> list[str]:
        """(n,) of a column that is there, without surrounding blanks."""
        return [cell for block in self.columns[name] for cell in block.split(BETWEEN)]

    def text(self, name: str, default: str = "") -> list[str]:
        """(n,) cells; `default` where the column is missing or the cell is empty."""
        if name not in self.columns:
            return [default] * len(self)
        return [cell or default for cell in self.cells(name)]

    def numbers(self, name: str, *, required: bool = False) -> Array:
        """(n,) a column of numbers; NaN where it is missing or empty.

        Raises
        ------
        InputError : a cell is no finite number, or is empty although required.
        """
        if name not in self.columns:
            return np.full(len(self), np.nan)
        blocks = [_numbers(block.split(BETWEEN), required) for block in self.columns[name]]
        good = [block for block in blocks if block is not None]
        if len(good) < len(blocks):
            cells = self.cells(name)
            raise next(error for i in range(len(self)) if (error := self._mistake(name, i, cells[i], required)))
        return np.concatenate(good)

    def _mistake(self, name: str, i: int, cell: str, required: bool) -> InputError | None:
        """What is wrong with a cell that must be a number."""
        or_empty = "" if required else ", or leave it empty if it is not defined"
        if not cell:
            return self.error(i, f"The cell of {name} is empty", "Give a number") if required else None
        try:
            value = float(cell)
        except ValueError:
            value = None
        if value is None or "_" in cell:
            advice = "Write decimals with a point" if "," in cell else f"Correct the cell{or_empty}"
            return self.error(i, f"'{cell}' in column {name} is not a number", advice)
        if not np.isfinite(value):
            return self.error(i, f"'{cell}' in column {name} is not finite", f"Correct the cell{or_empty}")
        return None

    def vectors(self, names: Sequence[str], *, required: bool = False) -> Array:
        """(n, 3) from three columns."""
        return np.stack([self.numbers(name, required=required) for name in names], axis=1)

    def rest(self, known: Sequence[str]) -> dict[str, Names]:
        """The columns that are not among `known`."""
        left = [name for name in self.columns if name not in known]
        return {name: np.array(self.text(name), dtype=np.str_) for name in left}

    def error(self, i: int, problem: str, advice: str) -> InputError:
        """An `InputError` that points at one row."""
        name = self.text("trajectory")[i] or None
        return InputError(problem, file=self.source, row=self.row[i], trajectory=name, advice=advice)


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
    data = _checked(path, _read_bytes(path))
    reader = csv.reader(io.TextIOWrapper(io.BytesIO(data), "utf-8-sig", newline=""), strict=True)
    header: list[str] = []
    blocks: list[list[str]] = []
    rows: list[list[str]] = []
    numbers: list[int] = []
    start = 1
    try:
        for cells in reader:
            stripped = [cell.strip() for cell in cells]
            if not any(stripped):
                pass
            elif not header:
                header, blocks = stripped, [[] for _ in stripped]
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
            f"The row cannot be read as comma-separated text ({error})",
            file=path,
            row=max(start, 1),
            advice="Look for a quote that is not closed",
        ) from error
    if not header:
        raise InputError("The file is empty", file=path, advice=f"Its first row must name {', '.join(required)}")
    if not numbers:
        raise InputError("The table has a header but no rows", file=path, advice="Add a row for each pick")
    _add_block(blocks, rows)
    return TextTable(path, {name: texts for name, texts in zip(header, blocks, strict=True) if name}, numbers)


def _check_row(path: Path, header: list[str], cells: list[str], row: int) -> None:
    if len(cells) != len(header):
        raise InputError(
            f"The row has {len(cells)} cells, the header has {len(header)}",
            file=path,
            row=row,
            advice="Give every row as many cells as the header; put text that contains a comma in quotes",
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


def _read_bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError as error:
        raise InputError("There is no such file", file=path, advice="Check the name and the folder") from error
    except OSError as error:
        raise InputError(f"The file cannot be read ({error.strerror})", file=path, advice="Check the path") from error


def _checked(path: Path, data: bytes) -> bytes:
    """The data, which are text in UTF-8."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError("The file is in UTF-16, not UTF-8", file=path, advice=EXPORT_ADVICE)
    if b"\0" in data:
        raise InputError("This is a binary file, not a table", file=path, advice=EXPORT_ADVICE)
    try:
        data.decode()
    except UnicodeDecodeError as error:
        row = data.count(b"\n", 0, error.start) + 1
        raise InputError("The text is not in UTF-8", file=path, row=row, advice=EXPORT_ADVICE) from error
    return data


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

# SPDX-License-Identifier: GPL-3.0-or-later
"""Large tables of plain text (commas, nothing in quotes): their cells stay where they are until they are asked for."""

import csv
from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from threading import Lock

import numpy as np

from ..compiled import in_chunks
from ..vectors import Array

FEWEST_BYTES = 1 << 20
"""Smaller tables are read before compiled code is loaded."""
ROWS, MOST_HARD = 16_384, 4096
"""Rows that are read at a time, and how many of their numbers may be left to Python."""


class Cells(Mapping[str, Sequence[str]]):
    """The columns of a table as texts of some rows each, which are also there as numbers."""

    @abstractmethod
    def numbers(self, name: str, required: bool) -> Array | None:
        """(n,) a column, NaN where a cell is empty; None when there is anything else, or an empty one if `required`."""


class PlainCells(Cells):
    """The columns of a table as texts of some rows each, made when they are asked for; and as numbers.

    Parameters
    ----------
    data : the rows below the header.
    begins : (n + 1,) where each begins.
    header : names of the columns.
    block, between : rows of a text, and what stands between its cells.
    """

    def __init__(self, data: np.ndarray, begins: np.ndarray, header: Sequence[str], block: int, between: str) -> None:
        self.data, self.begins, self.block, self.between = data, begins, block, between
        self.place = {name: j for j, name in enumerate(header)}
        self._read: tuple[Array, np.ndarray] | None = None

    def __contains__(self, name: object) -> bool:
        return name in self.place

    def __iter__(self) -> Iterator[str]:
        return iter(self.place)

    def __len__(self) -> int:
        return len(self.place)

    def __getitem__(self, name: str) -> list[str]:
        from .cell_kernels import cell_ends, joined

        ends = np.empty((len(self.begins) - 1, 2), np.int64)
        cell_ends(self.data, self.begins, self.place[name], len(self.place), ends)
        blocks = []
        for start in range(0, len(ends), self.block):
            part = ends[start : start + self.block]
            out = np.empty(int((part[:, 1] - part[:, 0] + 1).sum()), np.uint8)
            size = joined(self.data, part, ord(self.between), out)
            text = out[:size].tobytes().decode()
            blocks.append(self.between.join([cell.strip() for cell in text.split(self.between)]))
        return blocks

    def numbers(self, name: str, required: bool) -> Array | None:
        """(n,) a column, NaN where a cell is empty; None when there is anything else, or an empty one if `required`."""
        if self._read is None:
            self._read = self._numbers()
        values, kinds = self._read
        j = self.place[name]
        return None if kinds[j, 0] or (required and kinds[j, 1]) else values[j].copy()

    def _numbers(self) -> tuple[Array, np.ndarray]:
        from .cell_kernels import read_numbers

        n, columns, lock = len(self.begins) - 1, len(self.place), Lock()
        values, found = np.empty((columns, n)), np.zeros((columns, 2), np.int64)
        bits = values.view(np.uint64)

        def read(start: int, stop: int) -> None:
            kinds, hard = np.zeros((columns, 2), np.int64), np.empty((MOST_HARD, 2), np.int64)
            many = read_numbers(self.data, self.begins, start, stop, bits, kinds, hard)
            for i, j in hard[:many].tolist() if many >= 0 else ():
                value = float(self._cell(i, j))
                values[j, i] = value
                kinds[j, 0] |= not np.isfinite(value)
            if many < 0:
                kinds[:, 0] = 1
            with lock:
                found[:, 0] |= kinds[:, 0]
                found[:, 1] += kinds[:, 1]

        in_chunks(read, n, ROWS)
        return values, found

    def _cell(self, i: int, j: int) -> str:
        row = self.data[self.begins[i] : self.begins[i + 1] - 1].tobytes().decode()
        return row.split(",")[j].strip()


def plain_rows(data: bytes) -> tuple[list[str], bytes, np.ndarray] | None:
    """The header, the rows and where each begins; None where a table is small, or not plain.

    Plain is one with commas, without quotes, empty rows, or rows with other numbers of cells than the header.
    """
    if len(data) < FEWEST_BYTES or b'"' in data:
        return None
    if b"\r" in data and data.count(b"\r") != data.count(b"\r\n"):
        return None
    from .cell_kernels import count_rows

    first, _, rest = data.removeprefix(b"\xef\xbb\xbf").partition(b"\n")
    header = [name.strip() for name in first.decode().split(",")]
    if not all(header) or not rest or len(first) > csv.field_size_limit():
        return None
    rest = rest if rest.endswith(b"\n") else rest + b"\n"
    begins = np.empty(rest.count(b"\n") + 1, np.int64)
    rows = count_rows(np.frombuffer(rest, np.uint8), begins, len(header), csv.field_size_limit())
    return None if rows < 1 else (header, rest, begins[: rows + 1])

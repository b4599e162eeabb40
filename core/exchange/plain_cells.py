# SPDX-License-Identifier: GPL-3.0-or-later
"""Large tables of plain text (commas, nothing in quotes): their cells stay where they are until they are asked for."""

import csv
from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from threading import Lock

import numpy as np

from ..compiled import in_chunks
from ..vectors import Array

FEWEST_BYTES = 1 << 20
"""Smaller tables are read before compiled code is loaded."""
CHUNK_BYTES, MOST_HARD = 1 << 22, 4096
"""Of rows that are read at a time, and how many of their numbers may be left to Python."""
LINE = 10


class Cells(Mapping[str, Sequence[str]]):
    """The columns of a table as texts of some rows each, which are also there as single cells and as numbers.

    `block` rows are a text, with `between` between their cells.
    """

    block: int
    between: str

    def __getitem__(self, name: str) -> list[str]:
        cells = self.texts(name)
        return [self.between.join(cells[i : i + self.block]) for i in range(0, len(cells), self.block)]

    @abstractmethod
    def texts(self, name: str) -> list[str]:
        """(n,) cells of a column, without surrounding blanks."""

    @abstractmethod
    def numbers(self, name: str, required: bool) -> Array | None:
        """(n,) a column, NaN where a cell is empty; None when there is anything else, or an empty one if `required`."""


@dataclass(frozen=True, eq=False)
class PlainRows:
    """The rows of a plain table, and what of them is numbers.

    Attributes
    ----------
    header : names of the columns.
    data : the rows.
    begins : (n + 1,) where each begins.
    values : (columns, n) numbers, NaN for an empty cell; undefined in a column with anything else.
    kinds : (columns, 2) 1 where a column has anything else, and how many cells are empty.
    """

    header: Sequence[str]
    data: np.ndarray
    begins: np.ndarray
    values: Array
    kinds: np.ndarray


class PlainCells(Cells):
    """The columns of a table as texts of some rows each, made when they are asked for; and as numbers.

    Parameters
    ----------
    rows : the table.
    header : names of the columns, where they are others than in the file.
    block, between : rows of a text, and what stands between its cells.
    """

    def __init__(self, rows: PlainRows, header: Sequence[str], block: int, between: str) -> None:
        self.rows, self.block, self.between = rows, block, between
        self.place = {name: j for j, name in enumerate(header)}

    def __contains__(self, name: object) -> bool:
        return name in self.place

    def __iter__(self) -> Iterator[str]:
        return iter(self.place)

    def __len__(self) -> int:
        return len(self.place)

    def texts(self, name: str) -> list[str]:
        """(n,) cells of a column, without surrounding blanks."""
        from .cell_kernels import cell_ends, joined

        data, begins = self.rows.data, self.rows.begins
        ends = np.empty((len(begins) - 1, 2), np.int64)
        cell_ends(data, begins, self.place[name], len(self.place), ends)
        cells: list[str] = []
        for start in range(0, len(ends), self.block):
            part = ends[start : start + self.block]
            out = np.empty(int((part[:, 1] - part[:, 0] + 1).sum()), np.uint8)
            size = joined(data, part, ord(self.between), out)
            text = out[:size].tobytes().decode()
            found = text.split(self.between)
            cells += found if text.isascii() else [cell.strip() for cell in found]
        return cells

    def numbers(self, name: str, required: bool) -> Array | None:
        """(n,) a column, NaN where a cell is empty; None when there is anything else, or an empty one if `required`."""
        j, kinds = self.place[name], self.rows.kinds
        return None if kinds[j, 0] or (required and kinds[j, 1]) else self.rows.values[j].copy()


def plain_rows(data: bytes) -> PlainRows | None:
    """The rows of a table; None where it is small, or not plain.

    Plain is one with commas, without quotes, empty rows, or rows with other numbers of cells than the header.
    """
    if len(data) < FEWEST_BYTES or b'"' in data:
        return None
    if b"\r" in data and data.count(b"\r") != data.count(b"\r\n"):
        return None
    data = data if data.endswith(b"\n") else data + b"\n"
    below = data.find(b"\n") + 1
    header = [name.strip() for name in data[:below].removeprefix(b"\xef\xbb\xbf").decode().split(",")]
    if not all(header) or below == len(data) or below - 1 > csv.field_size_limit():
        return None
    signs, starts, many = np.frombuffer(data, np.uint8), [below], [0]
    while starts[-1] < len(data):
        starts.append(data.find(b"\n", min(starts[-1] + CHUNK_BYTES, len(data)) - 1) + 1)
        many.append(int(np.count_nonzero(signs[starts[-2] : starts[-1]] == LINE)))
    if sum(many) * len(header) > len(data) - below:  # a row has a byte for each cell
        return None
    return _read(header, signs, starts, np.cumsum(many))


def _read(header: list[str], data: np.ndarray, starts: list[int], firsts: np.ndarray) -> PlainRows | None:
    from .cell_kernels import read_rows

    columns, n, lock, longest = len(header), int(firsts[-1]), Lock(), csv.field_size_limit()
    values, found, begins = np.empty((columns, n)), np.zeros((columns, 2), np.int64), np.empty(n + 1, np.int64)
    refused: list[int] = []
    bits = values.view(np.uint64)

    def read(chunk: int, _: int) -> None:
        if refused:
            return
        kinds, hard = np.zeros((columns, 2), np.int64), np.empty((MOST_HARD, 2), np.int64)
        start, stop = starts[chunk : chunk + 2]
        many = read_rows(data, start, stop, firsts[chunk], longest, begins, bits, kinds, hard)
        if many == -2:
            refused.append(chunk)
        for i, j in hard[: max(many, 0)].tolist():
            end = begins[i + 1] if i + 1 < firsts[chunk + 1] else stop
            value = float(data[begins[i] : end - 1].tobytes().split(b",")[j])
            values[j, i] = value
            kinds[j, 0] |= not np.isfinite(value)
        if many < 0:
            kinds[:, 0] = 1
        with lock:
            found[:, 0] |= kinds[:, 0]
            found[:, 1] += kinds[:, 1]

    in_chunks(read, len(starts) - 1, 1)
    begins[n] = starts[-1]
    return None if refused else PlainRows(header, data, begins, values, found)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers out of text files, quickly, with the row of anything that is not one."""

import codecs
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..formats.number_words import UTF_16, as_utf8, why_no_number
from ..vectors import Array

BLOCK_BYTES = 1 << 20
"""Of a text that is read in parts: its lines take many times that."""


def read_text(path: Path) -> bytes:
    """The whole file; its lines end in a plain newline.

    Raises
    ------
    InputError : the file is empty, or is not text.
    """
    data = as_utf8(path.read_bytes(), path, "Export it in UTF-8").removeprefix(codecs.BOM_UTF8)
    if not data.strip():
        raise _empty(path)
    _check_beginning(data, path)
    return _plain(data)


def line_blocks(path: Path, size: int = BLOCK_BYTES) -> Iterator[list[bytes]]:
    """The lines of a file, some at a time.

    Raises
    ------
    InputError : the file is empty, or is not text.
    """
    rest, read, blank = b"", False, True
    with path.open("rb") as file:
        while data := file.read(size):
            if not read:
                data = data.removeprefix(codecs.BOM_UTF8)
                _check_beginning(data, path)
            read, blank = True, blank and not data.strip()
            data = rest + data
            end = data.rfind(b"\n") + 1 or data.rfind(b"\r", 0, -1) + 1  # a last \r may belong to a \n to come
            rest = data[end:]
            if end:
                yield _plain(data[:end]).split(b"\n")[:-1]
    if blank:
        raise _empty(path)
    if rest:
        yield _plain(rest).removesuffix(b"\n").split(b"\n")


def line_at(path: Path, row: int) -> bytes:
    """One line of a file that `line_blocks` has read, rows counted from 1."""
    before = 0
    for lines in line_blocks(path):
        if row <= before + len(lines):
            return lines[row - before - 1]
        before += len(lines)
    return b""


def _empty(path: Path) -> InputError:
    return InputError("The file is empty", file=path, advice="Export it again")


def _check_beginning(data: bytes, path: Path) -> None:
    if data.startswith(UTF_16):
        raise InputError("The text is in UTF-16", file=path, advice="Export it in UTF-8")
    if b"\0" in data[:4096]:
        raise InputError(
            "The file is not text", file=path, advice="Its extension promises a text format: check the export"
        )


def _plain(data: bytes) -> bytes:
    """Its lines end in a plain newline."""
    return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in data else data


class NumberRows:
    """Rows of numbers that come in blocks and become one table; every row has as many as the first one.

    Parameters
    ----------
    what : they are, for messages.
    """

    def __init__(self, path: Path, what: str = "numbers") -> None:
        self.path, self.what = path, what
        self.blocks: list[Array] = []
        self.first: tuple[bytes, int] | None = None

    def add(self, lines: Sequence[bytes], rows: Sequence[int]) -> None:
        """More lines, see `number_table`.

        Raises
        ------
        InputError : as `number_table`.
        """
        if not lines:
            return
        if self.first is None:
            self.first = lines[0], rows[0]
        if len(lines[0].split()) != len(self.first[0].split()):
            lines, rows = [self.first[0], *lines], [self.first[1], *rows]
        self.blocks.append(number_table(lines, rows, self.path, self.what))

    def table(self) -> Array:
        """(n, k) all of them; afterwards there are none."""
        blocks, self.blocks = self.blocks, []
        if not blocks:
            return np.empty((0, 0))
        found = np.empty((sum(map(len, blocks)), blocks[0].shape[1]))
        end = len(found)
        while blocks:  # the memory of each goes when it is in the table
            block = blocks.pop()
            found[end - len(block) : end] = block
            end -= len(block)
        return found


def number_table(lines: Sequence[bytes], rows: Sequence[int] | range, path: Path, what: str = "numbers") -> Array:
    """The numbers in lines that all have as many as the first, (n, k).

    Parameters
    ----------
    lines : without comments or empty lines; columns separated by blanks.
    rows : of the file, for each line, counted from 1.

    Raises
    ------
    InputError : a line with something that is not a number, or with another number of columns; its row.
    """
    if not lines:
        return np.empty((0, 0))
    columns = len(lines[0].split())
    table = even_table(lines, columns)
    if table is not None:
        return table
    for line, row in zip(lines, rows, strict=False):
        words = line.split()
        for word in words:
            if not _is_number(word):
                why, advice = why_no_number(word.decode("utf-8", "replace"))
                raise InputError(
                    f'"{shown(word)}" {why or "is not a number"}',
                    file=path,
                    row=row,
                    advice=advice or f"{what} are needed in this row",
                )
        if len(words) != columns:
            raise InputError(
                f"{len(words)} values, where the rows before have {columns}",
                file=path,
                row=row,
                advice="All rows need the same columns; a file that was cut off ends like this",
            )
    raise InputError("The numbers cannot be read", file=path, advice="Export the file again")


def all_numbers(text: bytes) -> Array | None:
    """All numbers of a text, separated by white space; None when something else is in it."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return np.fromstring(text, dtype=np.float64, sep=" ")
        except (DeprecationWarning, ValueError):
            return None


def even_table(lines: Sequence[bytes], columns: int) -> Array | None:
    """The numbers of lines that have so many each, (n, columns); None when any line differs."""
    if any(len(line.split()) != columns for line in lines):
        return None
    values = all_numbers(b"\n".join(lines))
    return values.reshape(len(lines), columns) if values is not None and values.size == columns * len(lines) else None


def _is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return b"_" not in word


def shown(text: bytes) -> str:
    """The beginning of a word or line, for a message."""
    return text[:60].decode("utf-8", "replace").strip()

# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers out of text files, quickly, with the row of anything that is not one."""

import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..vectors import Array


def read_text(path: Path) -> bytes:
    """The whole file; its lines end in a plain newline.

    Raises
    ------
    InputError : the file is empty, or is not text.
    """
    data = path.read_bytes()
    if not data.strip():
        raise InputError("The file is empty", file=path, advice="Export it again")
    if b"\0" in data[:4096]:
        raise InputError(
            "The file is not text", file=path, advice="Its extension promises a text format: check the export"
        )
    return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")


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
                raise InputError(
                    f'"{shown(word)}" is not a number', file=path, row=row, advice=f"{what} are needed in this row"
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

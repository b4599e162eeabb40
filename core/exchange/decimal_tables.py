# SPDX-License-Identifier: GPL-3.0-or-later
"""Large tables, written with fixed decimals: their parts become text on all cores, in the order of the rows."""

import io
import os
import re
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..formats.csv_cells import CellWriter, guarded
from ..output import output_stream
from ..progress import Progress, silent
from ..vectors import Array, Indices

DECIMALS = 6
"""Of metres, seconds, joules, degrees and ratios."""
QUOTED = re.compile(r'[",\r\n]')
"""Words with one of these are put in quotes."""
WAITING = 4
"""So many parts for each core may wait to be written: more would fill the memory where the disk is slow."""


@dataclass(frozen=True, eq=False)
class Words:
    """A column of words: (n,) which of the texts."""

    which: Indices
    texts: tuple[str, ...]


type DecimalColumns = Mapping[str, Array | Indices | Words]


def write_decimal_table(
    path: str | Path,
    parts: Sequence[Callable[[], DecimalColumns]],
    decimals: Mapping[str, int],
    progress: Progress = silent,
) -> None:
    """Write a table part by part.

    Parameters
    ----------
    parts : each makes some rows, or none, all with the same columns; they are called on several threads.
    decimals : of the columns that have not `DECIMALS`; whole numbers have none. A part with a number that has more than
        15 digits with its decimals is written with all digits.

    Raises
    ------
    InputError : the file cannot be written.
    """
    path, named = Path(path), False
    with output_stream(path, binary=True) as stream:
        for done, (names, text) in enumerate(_texts(parts, decimals)):
            progress(f"Writing {path.name}", done, len(parts))
            if not named:
                stream.write(_line(names).encode())
                named = True
            stream.write(text)


def _texts(
    parts: Sequence[Callable[[], DecimalColumns]], decimals: Mapping[str, int]
) -> Iterator[tuple[tuple[str, ...], bytes | memoryview]]:
    """The names of the columns and the text of each part, in order."""
    cores = os.process_cpu_count() or 1
    waiting: deque[Future[tuple[tuple[str, ...], bytes | memoryview]]] = deque()
    with ThreadPoolExecutor(cores) as pool:
        try:
            for make in parts:
                waiting.append(pool.submit(_text, make, decimals))
                if len(waiting) >= WAITING * cores:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            for one in waiting:
                one.cancel()


def _text(
    make: Callable[[], DecimalColumns], decimals: Mapping[str, int]
) -> tuple[tuple[str, ...], bytes | memoryview]:
    from .decimal_kernels import LONGEST, write_rows

    columns = make()
    rows = min(len(cells.which) if isinstance(cells, Words) else len(cells) for cells in columns.values())
    table, places = np.empty((len(columns), rows)), np.full(len(columns), -1)
    words: list[bytes] = []
    width = 0
    for j, (name, cells) in enumerate(columns.items()):
        if isinstance(cells, Words):
            table[j] = cells.which
            table[j] += len(words)
            texts = [(_line((text,))[:-1] if QUOTED.search(text) else guarded(text)).encode() for text in cells.texts]
            words += texts
            width += 1 + max(map(len, texts), default=0)
        else:
            table[j] = cells
            places[j] = decimals.get(name, DECIMALS)
            width += LONGEST
    starts = np.cumsum([0, *map(len, words)])
    out = np.empty(rows * width, np.uint8)
    size = write_rows(table, places, np.frombuffer(b"".join(words) or b" ", np.uint8), starts, out)
    if size >= 0:
        return tuple(columns), memoryview(out)[:size]
    return tuple(columns), _with_all_digits(columns, rows)


def _with_all_digits(columns: DecimalColumns, rows: int) -> bytes:
    stream = io.StringIO()
    writer = CellWriter(stream)
    for i in range(rows):
        row = []
        for cells in columns.values():
            value = cells.texts[cells.which[i]] if isinstance(cells, Words) else cells[i].item()
            row.append("" if value != value else value)
        writer.writerow(row)
    return stream.getvalue().encode()


def _line(texts: Iterable[str]) -> str:
    """A row, quoted where it must be."""
    stream = io.StringIO()
    CellWriter(stream).writerow(texts)
    return stream.getvalue()

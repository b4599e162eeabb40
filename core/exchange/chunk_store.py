# SPDX-License-Identifier: GPL-3.0-or-later
"""What is finished of many runs, on the disk: work that was ended, however, goes on where it was.

A folder for each scenario: ``000012.npz`` is a chunk, ``merged.npz`` what many of them add up to, ``000012.runs.csv``
rows of a table. Each file appears whole or not at all; a chunk counts when its .npz is there, which comes last.
"""

import io
import shutil
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np

from ..hazard.tally import Arrays
from ..output import write_bytes
from ..reading import reader
from ..workflow.ensembles import Chunk

MERGED = "merged.npz"
CHUNKS = "chunks"
"""Key of the numbers of the chunks that are merged."""


class ChunkStore:
    """What is kept in a folder, which is made when there is something to keep."""

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)

    def merged(self) -> tuple[Mapping[str, Arrays], frozenset[int]]:
        """See `workflow.ensembles.Store`."""
        file = self.folder / MERGED
        if not file.exists():
            return {}, frozenset()
        arrays, numbers = _read(file)
        return arrays, frozenset(numbers)

    def single(self) -> Iterator[tuple[int, Mapping[str, Arrays]]]:
        """See `workflow.ensembles.Store`."""
        _, merged = self.merged()
        for file in sorted(self.folder.glob("[0-9]*.npz")):
            number = int(file.stem)
            if number in merged:  # ended before it was removed
                file.unlink()
            else:
                yield number, _read(file)[0]

    def keep(self, number: int, chunk: Chunk) -> None:
        """See `workflow.ensembles.Store`.

        Raises
        ------
        InputError : the disk is full, or refuses; chunks that were kept stay.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        for name, rows in chunk.tables.items():
            write_bytes(self._table(number, name), rows)
        write_bytes(self._chunk(number), _packed(chunk.arrays, frozenset([number])))

    def keep_merged(self, arrays: Mapping[str, Arrays], numbers: frozenset[int]) -> None:
        """See `workflow.ensembles.Store`.

        Raises
        ------
        InputError : see `keep`.
        """
        write_bytes(self.folder / MERGED, _packed(arrays, numbers))
        for number in numbers:
            self._chunk(number).unlink(missing_ok=True)

    def tables(self) -> list[str]:
        """The names of the tables of the first chunk."""
        begin = f"{0:06d}."
        names = [file.name.removeprefix(begin) for file in self.folder.glob(f"{begin}*") if file.suffix != ".npz"]
        return sorted(names, key=lambda name: (name != "runs.csv", name))

    def write_table(self, name: str, chunks: int, path: Path) -> None:
        """Put the rows of all chunks together, in their order, under the header of the first."""
        with path.open("ab") as table:
            for number in range(chunks):
                with self._table(number, name).open("rb") as rows:
                    header = rows.readline()
                    if not table.tell():
                        table.write(header)
                    shutil.copyfileobj(rows, table)

    def remove(self) -> None:
        """Remove all: the result is written. The folder that it is in goes with the last one."""
        shutil.rmtree(self.folder, ignore_errors=True)
        with suppress(OSError):
            self.folder.parent.rmdir()

    def _chunk(self, number: int) -> Path:
        return self.folder / f"{number:06d}.npz"

    def _table(self, number: int, name: str) -> Path:
        return self.folder / f"{number:06d}.{name}"


def _packed(arrays: Mapping[str, Arrays], numbers: frozenset[int]) -> bytes:
    stream = io.BytesIO()
    content = {f"{tally}/{name}": values for tally, own in arrays.items() for name, values in own.items()}
    np.savez(stream, allow_pickle=False, **content, **{CHUNKS: np.array(sorted(numbers), np.int64)})
    return stream.getvalue()


@reader("kept chunk", "Remove its folder, and start again")
def _read(file: Path) -> tuple[dict[str, Arrays], list[int]]:
    found: dict[str, Arrays] = {}
    with np.load(file, allow_pickle=False) as content:
        for key in content.files:
            tally, slash, name = key.partition("/")
            if slash:
                found.setdefault(tally, {})[name] = content[key]
        return found, content[CHUNKS].tolist()

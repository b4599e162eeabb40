# SPDX-License-Identifier: GPL-3.0-or-later
"""What is finished of many runs, on the disk: work that was ended, however, goes on where it was.

A folder for each scenario: ``000012.npz`` is a chunk, ``merged.npz`` what many of them add up to, ``000012.runs.csv``
rows of a table, ``000012.json`` the chunk's record: its number, its scenario, and the rows and SHA-256 of each table.
Each file appears whole or not at all; a chunk counts when its .npz is there, which comes last. Nothing is taken that
differs from its record: such a chunk is computed again.
"""

import hashlib
import io
import json
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..exchange.content_digest import content_digest
from ..hazard.tally import Arrays
from ..open_folders import is_folder, is_own, may_be_planted, opened
from ..output import OTHER_FOLDER, write_bytes, write_text
from ..reading import reader
from ..remarks import Remark
from .ensembles import Chunk

MERGED = "merged.npz"
CHUNKS, SCENARIO, DIGEST = "chunks", "scenario", "digest"
"""Keys beside the arrays: the numbers of the chunks in them, of what they are, and SHA-256 of all of this."""
OWN_FILE = re.compile(r"[0-9]{6,}\..+|merged\.npz")
MOST_SAID = 3
READ_BYTES = 1 << 20


class ChunkStore:
    """What is kept in a folder, which is made when there is something to keep.

    Parameters
    ----------
    scenario : a digest of all that decides the runs.
    """

    def __init__(self, folder: str | Path, scenario: str = "") -> None:
        self.folder, self._scenario = Path(folder), scenario
        self._merged: frozenset[int] = frozenset()
        self._wrong: dict[int, str] = {}

    @property
    def remarks(self) -> list[Remark]:
        """Which chunks were not as they had been written."""
        if not self._wrong:
            return []
        some = "; ".join(f"{number}: {what}" for number, what in sorted(self._wrong.items())[:MOST_SAID])
        more = f"; and {len(self._wrong) - MOST_SAID} others" if len(self._wrong) > MOST_SAID else ""
        what = f"{len(self._wrong)} kept chunks were" if len(self._wrong) > 1 else "1 kept chunk was"
        text = f"{what} not as written, and computed again ({some}{more})."
        return [Remark(text, "warning", "kept chunks")]

    def merged(self) -> tuple[Mapping[str, Arrays], frozenset[int]]:
        """See `workflow.ensembles.Store`.

        Raises
        ------
        InputError : the folder is not of this user, or a link.
        """
        self._refuse_foreign()
        file = self.folder / MERGED
        arrays, numbers = self._checked(file) if file.exists() else ({}, [])
        self._merged = frozenset(numbers)
        return arrays, self._merged

    def lacking(self) -> frozenset[int]:
        """See `workflow.ensembles.Store`."""
        return frozenset(number for number in sorted(self._merged) if not self._has_tables(number))

    def single(self) -> Iterator[tuple[int, Mapping[str, Arrays]]]:
        """See `workflow.ensembles.Store`."""
        for file in sorted(self.folder.glob("[0-9]*.npz")):
            number = int(file.stem) if file.stem.isdecimal() else -1
            if number in self._merged:  # ended before it was removed
                file.unlink()
            elif number >= 0:
                arrays, numbers = self._checked(file)
                if numbers and numbers != [number]:
                    self._wrong[number] = f"it was chunk {numbers[0]}"
                elif numbers and self._has_tables(number):
                    yield number, arrays

    def keep(self, number: int, chunk: Chunk) -> None:
        """See `workflow.ensembles.Store`.

        Raises
        ------
        InputError : the disk is full, or refuses; chunks that were kept stay.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        for name, rows in chunk.tables.items():
            write_bytes(self._table(number, name), rows)
        tables = {
            name: {"rows": rows.count(b"\n") - 1, "sha256": hashlib.sha256(rows).hexdigest()}
            for name, rows in chunk.tables.items()
        }
        record = {"chunk": number, SCENARIO: self._scenario, "tables": tables}
        write_text(self._record_file(number), json.dumps(record, indent=2) + "\n")
        if number not in self._merged:
            write_bytes(self._chunk(number), _packed(chunk.arrays, frozenset([number]), self._scenario))

    def keep_merged(self, arrays: Mapping[str, Arrays], numbers: frozenset[int]) -> None:
        """See `workflow.ensembles.Store`.

        Raises
        ------
        InputError : see `keep`.
        """
        write_bytes(self.folder / MERGED, _packed(arrays, numbers, self._scenario))
        self._merged = numbers
        for number in numbers:
            self._chunk(number).unlink(missing_ok=True)

    def tables(self) -> list[str]:
        """The names of the tables of the first chunk."""
        names = list(self._record(0) or {})
        return sorted(names, key=lambda name: (name != "runs.csv", name))

    def write_table(self, name: str, chunks: int, path: Path) -> None:
        """Put the rows of all chunks together, in their order, under the header of the first.

        Raises
        ------
        InputError : the rows of a chunk are not those of its record.
        """
        with path.open("ab") as table:
            for number in range(chunks):
                file, stated = self._table(number, name), (self._record(number) or {}).get(name)
                digest = hashlib.sha256()
                try:
                    with file.open("rb") as rows:
                        header = rows.readline()
                        digest.update(header)
                        if not table.tell():
                            table.write(header)
                        while part := rows.read(READ_BYTES):
                            digest.update(part)
                            table.write(part)
                except FileNotFoundError:
                    stated = None
                if stated is None or digest.hexdigest() != stated["sha256"]:
                    raise InputError(
                        "A kept chunk has been changed while it was used",
                        file=file,
                        advice="Give the same command again: such a chunk is computed again",
                    )

    def remove(self) -> None:
        """Remove all that was kept here: the result is written. The folder that it is in goes with the last one."""
        with suppress(OSError), opened(self.folder.parent) as above:
            with above.opened(self.folder.name) as folder:
                for name in folder.names():
                    if OWN_FILE.fullmatch(name):
                        folder.remove_file(name)
            above.remove_folder(self.folder.name)
        with suppress(OSError):
            self.folder.parent.rmdir()

    def _refuse_foreign(self) -> None:
        """Another user could leave there what we would take for our own."""
        for folder in (self.folder.parent, self.folder):
            if may_be_planted(folder):
                raise InputError("This is a link of another user", file=folder, advice=OTHER_FOLDER)
        if self.folder.is_symlink() or self.folder.exists():
            state = self.folder.lstat()
            if not (is_folder(state) and is_own(state)):
                raise InputError(
                    "Kept chunks are to be in this folder, which is a link, a file, or of another user",
                    file=self.folder,
                    advice=f"Remove it. {OTHER_FOLDER}",
                )

    def _checked(self, file: Path) -> tuple[Mapping[str, Arrays], list[int]]:
        """The arrays of a file, and the numbers of their chunks; none where they are not what was written here."""
        try:
            content = _read(file)
            numbers, scenario, digest = content.pop(CHUNKS), content.pop(SCENARIO), str(content.pop(DIGEST))
            if content_digest(content, numbers, scenario) != digest:
                raise InputError("it is damaged")
        except (InputError, LookupError):
            self._say(file, "it is damaged")
            return {}, []
        if str(scenario) != self._scenario:
            self._say(file, "it is of another simulation")
            return {}, []
        found: dict[str, dict[str, Any]] = {}
        for key, values in content.items():
            tally, _, name = key.partition("/")
            found.setdefault(tally, {})[name] = values
        return found, numbers.tolist()

    def _say(self, file: Path, what: str) -> None:
        """What is wrong with a chunk; with all chunks that were merged, as far as their records tell them."""
        if file.name != MERGED:
            self._wrong[int(file.stem)] = what
            return
        known = sorted(int(one.stem) for one in self.folder.glob("[0-9]*.json") if one.stem.isdecimal())
        self._wrong |= dict.fromkeys(
            [number for number in known if not self._chunk(number).exists()] or [0], f"{MERGED}: {what}"
        )

    def _record(self, number: int) -> dict[str, dict[str, Any]] | None:
        """Name of each table of a chunk → its rows and SHA-256; None without a record of this chunk and scenario."""
        try:
            record = json.loads(self._record_file(number).read_text(encoding="utf-8"))
            tables = {str(name): {"rows": int(one["rows"]), "sha256": str(one["sha256"])}
                      for name, one in record["tables"].items()}  # fmt: skip
            return tables if (record["chunk"], record[SCENARIO]) == (number, self._scenario) else None
        except (OSError, ValueError, TypeError, LookupError, AttributeError, RecursionError):
            return None

    def _has_tables(self, number: int) -> bool:
        """Whether the tables of a chunk are those of its record."""
        record = self._record(number)
        if record is None:
            self._wrong[number] = "its record is missing, damaged, or of another one"
            return False
        for name, stated in record.items():
            try:
                rows, digest = _rows_and_digest(self._table(number, name))
            except OSError:
                self._wrong[number] = f"{name} is missing"
                return False
            if digest != stated["sha256"]:
                same = rows == stated["rows"]
                self._wrong[number] = (
                    f"{name} is another one" if same else f"{name} has {rows} of {stated['rows']} rows"
                )
                return False
        return True

    def _chunk(self, number: int) -> Path:
        return self.folder / f"{number:06d}.npz"

    def _record_file(self, number: int) -> Path:
        return self.folder / f"{number:06d}.json"

    def _table(self, number: int, name: str) -> Path:
        return self.folder / f"{number:06d}.{name}"


def _rows_and_digest(file: Path) -> tuple[int, str]:
    rows, digest = -1, hashlib.sha256()
    with file.open("rb") as stream:
        while part := stream.read(READ_BYTES):
            rows += part.count(b"\n")
            digest.update(part)
    return rows, digest.hexdigest()


def _packed(arrays: Mapping[str, Arrays], numbers: frozenset[int], scenario: str) -> bytes:
    content: dict[str, Any] = {
        f"{tally}/{name}": np.asarray(values) for tally, own in arrays.items() for name, values in own.items()
    }
    chunks, said = np.array(sorted(numbers), np.int64), np.array(scenario)
    digest = np.array(content_digest(content, chunks, said))
    stream = io.BytesIO()
    np.savez(stream, allow_pickle=False, **content, **{CHUNKS: chunks, SCENARIO: said, DIGEST: digest})
    return stream.getvalue()


@reader("kept chunk")
def _read(file: Path) -> dict[str, Any]:
    with np.load(file, allow_pickle=False) as content:
        return {key: content[key] for key in content.files}

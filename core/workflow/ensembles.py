# SPDX-License-Identifier: GPL-3.0-or-later
"""Many runs in chunks, wherever they are computed: what they add up to is the same bits for any number of workers.

A chunk is a fixed number of runs. Its worker simulates them, counts them in tallies, and gives up their records. What
comes back is added up as it comes, and kept in a store, so that work which was ended goes on where it was.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..hazard.tally import Arrays, Tally
from ..impact_models.registry import find_model
from ..progress import CancelledError, Progress, silent
from ..simulation.engine import AT_ONCE, Recorded, RecordSpace, Settings, Simulation, joined, simulate
from ..simulation.ground import Ground
from ..simulation.release import Releases
from ..terrain.ordering import along_curve

CHUNK = 4096
"""Runs of a chunk: about a second of work, and a lost one costs no more."""

type Tables = Mapping[str, bytes]
"""Name of a table → its rows, with the header."""


@dataclass(frozen=True, eq=False)
class Work:
    """What every worker needs once, whatever chunks it computes.

    Attributes
    ----------
    tallies : name → an empty one.
    record : what is recorded for the tallies and tables.
    tables : makes the rows of a chunk; None for none.
    kept : what is kept of the records until the tables are made.
    """

    ground: Ground
    settings: Settings
    tallies: Mapping[str, Tally]
    record: Recorded = "all"
    tables: Callable[[Simulation], Tables] | None = None
    kept: Recorded = "all"

    def chunk(self, releases: Releases, first_run: int) -> "Chunk":
        """Simulate some runs on one thread, and count them; several threads may do so at once."""
        tallies = {name: tally.empty() for name, tally in self.tallies.items()}
        order = np.argsort(along_curve(releases.position[:, :2]), kind="stable")
        parts, space = list[Simulation](), RecordSpace()
        for start in range(0, order.size, AT_ONCE):
            part = np.sort(order[start : start + AT_ONCE])
            simulation = simulate(
                self.ground, releases.take(part), self.settings, record=self.record, runs=first_run + part, space=space
            )
            for tally in tallies.values():
                tally.add(simulation)
            if self.tables is not None:
                parts.append(simulation.with_records(self.kept))
                if parts[-1] is simulation:
                    space = RecordSpace()
        arrays = {name: tally.arrays() for name, tally in tallies.items()}
        return Chunk(arrays, {} if self.tables is None else self.tables(joined(parts, releases)))


@dataclass(frozen=True, eq=False)
class Chunk:
    """What came of a chunk: name of each tally → its state; and tables."""

    arrays: Mapping[str, Arrays]
    tables: Tables = field(default_factory=dict)


class Store(Protocol):
    """Keeps what is finished; see `chunk_store`."""

    def merged(self) -> tuple[Mapping[str, Arrays], frozenset[int]]:
        """What is added up already, of which chunks."""
        ...

    def single(self) -> Iterator[tuple[int, Mapping[str, Arrays]]]:
        """The chunks that are kept one by one."""
        ...

    def lacking(self) -> frozenset[int]:
        """The chunks that are added up, but whose tables are not there as they were written."""
        ...

    def keep(self, number: int, chunk: Chunk) -> None:
        """Keep a chunk; of one that is added up already, its tables alone."""
        ...

    def keep_merged(self, arrays: Mapping[str, Arrays], numbers: frozenset[int]) -> None:
        """Keep what is added up of some chunks, in place of these."""
        ...


class Pool(Protocol):
    """Whoever computes chunks."""

    def compute(
        self, work: Work, chunks: Iterator[tuple[int, int, Releases]], beat: Callable[[], None]
    ) -> Iterator[tuple[int, Chunk]]:
        """Chunks as they are finished, in any order.

        Parameters
        ----------
        chunks : number, first run and releases; taken as they can be computed, so that few wait.
        beat : called now and then; what it raises ends the work.
        """
        ...


MERGED_EVERY = 64
"""Chunks that are kept one by one before they are kept as one."""


def run_ensemble(
    work: Work,
    releases: Releases,
    pool: Pool,
    *,
    first_run: int = 0,
    size: int = CHUNK,
    store: Store | None = None,
    progress: Progress = silent,
) -> dict[str, Tally]:
    """Compute all chunks that the store does not have as they were written, and add all up.

    Parameters
    ----------
    progress : counts the runs. A `CancelledError` raised in it ends the work; what is finished is in the store.

    Raises
    ------
    InputError : there are no runs, or the workers or the store fail; what is finished is in the store.
    CancelledError : see `progress`.
    """
    n = len(releases)
    if not n:
        raise InputError("There is nothing to simulate: no block is released", advice="Give at least one release")
    if size < 1:
        raise InputError(f"A chunk of {size} runs is none", advice="Give at least one")
    numbers = range(-(-n // size))
    tallies, added, ready = _kept(work.tallies, store)
    counted = sum(min(size, n - size * number) for number in ready)
    text = f"Simulating {find_model(work.settings.model).title}"
    progress(text, counted, n)
    parts = ((i, first_run + i * size, slice(i * size, (i + 1) * size)) for i in numbers if i not in ready)
    left = ((i, first, releases.take(part)) for i, first, part in parts)
    alone = 0

    def beat() -> None:
        progress(text, counted, n)

    for number, chunk in pool.compute(work, left, beat):
        if store is not None:
            store.keep(number, chunk)
        if number not in added:
            _add(tallies, chunk.arrays)
            added.add(number)
            alone += 1
        ready.add(number)
        counted += min(size, n - size * number)
        if store is not None and alone >= MERGED_EVERY:
            store.keep_merged(_state(tallies), frozenset(added))
            alone = 0
        progress(text, counted, n)
    if len(ready) < len(numbers):
        raise CancelledError
    return tallies


def _kept(empty: Mapping[str, Tally], store: Store | None) -> tuple[dict[str, Tally], set[int], set[int]]:
    """What the store has, of which chunks, and for which of them nothing is to be computed any more."""
    tallies = {name: tally.empty() for name, tally in empty.items()}
    if store is None:
        return tallies, set(), set()
    arrays, numbers = store.merged()
    added = set(numbers)
    if added:
        _add(tallies, arrays)
    lacking = store.lacking()
    for number, one in store.single():
        _add(tallies, one)
        added.add(number)
    return tallies, added, added - lacking


def _add(tallies: Mapping[str, Tally], arrays: Mapping[str, Arrays]) -> None:
    for name, tally in tallies.items():
        tally.merge(type(tally).from_arrays(arrays[name]))


def _state(tallies: Mapping[str, Tally]) -> dict[str, dict[str, NDArray[Any]]]:
    return {name: tally.arrays() for name, tally in tallies.items()}


class HereAlone:
    """Computes one chunk after the other, in this process."""

    def compute(
        self, work: Work, chunks: Iterator[tuple[int, int, Releases]], beat: Callable[[], None]
    ) -> Iterator[tuple[int, Chunk]]:
        """See `Pool`."""
        for number, first, part in chunks:
            beat()
            yield number, work.chunk(part, first)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Many runs, chunk by chunk: each is simulated, counted in tallies, and forgotten, so that memory lasts.

A run depends on its number and the seed, and tallies on the runs they have counted: the result is the same for any
number of threads.
"""

import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..hazard.tally import Tally
from ..progress import CancelledError, Progress, silent
from ..simulation.engine import AT_ONCE, Recorded, RecordSpace, Settings, Simulation, check_settings, simulate
from ..simulation.ground import Ground
from ..simulation.release import Releases
from ..simulation.turns import take_turns
from ..vectors import Indices

ROUND = 1024
"""Runs after which it is first asked whether they are enough."""

type Enough = Callable[[int], bool]
"""Whether so many blocks, which the tallies have counted, are enough."""


@dataclass(frozen=True, eq=False)
class Counted:
    """What became of many runs.

    Attributes
    ----------
    settings : of all of them.
    blocks, wanted : how many were counted; how many were asked for.
    ends : name → how many ended so.
    impacts : of all runs together.
    seconds : how long it took.
    """

    settings: Settings
    blocks: int
    wanted: int
    ends: dict[str, int]
    impacts: int
    seconds: float

    @property
    def rate(self) -> float:
        """Blocks per second."""
        return self.blocks / self.seconds if self.seconds > 0 else np.nan


class _Chunk(NamedTuple):
    """What is left of a chunk: its runs, all of them where that is asked for, and its tallies."""

    ends: tuple[str, ...]
    ended: NDArray[np.intp]
    impacts: int
    whole: Simulation | None
    tallies: list[Tally]


def run_chunks(
    ground: Ground,
    releases: Releases,
    settings: Settings,
    tallies: Sequence[Tally],
    *,
    first_run: int = 0,
    threads: int | None = None,
    enough: Enough | None = None,
    take: Callable[[Simulation], None] | None = None,
    record: Recorded = "all",
    progress: Progress = silent,
) -> Counted:
    """Simulate releases and add them to tallies.

    Parameters
    ----------
    tallies : what counts the runs.
    first_run : see `simulate`.
    threads : None takes all cores.
    enough : asked after `ROUND` runs, twice as many, four times …; the first yes ends it.
    take : gets each chunk, and of its records what `record` says; its runs are in their
        order, the chunks are not: see `joined`.
    progress : called with the number of finished blocks; a `CancelledError` raised in it ends it with the blocks that
        are finished, from the first on without a gap: see `take_turns`.

    Raises
    ------
    InputError : settings or blocks that cannot be.
    CancelledError : the work was ended before the first blocks were finished.
    """
    check_settings(ground, settings)
    ground.refuse_small(releases.radius_m)
    n, started = len(releases), time.perf_counter()
    ends, counted, impacts = np.zeros(0, np.int64), 0, 0
    names: tuple[str, ...] = ()
    progress("Compiling where needed, then simulating", 0, n)
    simulate(ground, releases.take(slice(0, 1)), settings, first_run=first_run, threads=1)

    spaces = list[RecordSpace]()

    def chunk(part: Indices) -> _Chunk:
        part = np.sort(part)
        space = spaces.pop() if spaces else RecordSpace()
        simulation = simulate(ground, releases.take(part), settings, record="all", runs=first_run + part, space=space)
        own = [each.empty() for each in tallies]
        for each in own:
            each.add(simulation)
        ended = np.bincount(simulation.end, minlength=len(simulation.ends))
        kept = None if take is None else simulation.with_records(record)
        if kept is not simulation:  # else its records are in the space
            spaces.append(space)
        return _Chunk(simulation.ends, ended, int(simulation.impacts.sum()), kept, own)

    def add(done: _Chunk, finished: int) -> None:
        nonlocal ends, impacts, names
        names = done.ends
        ends = _padded(ends, len(names)) + done.ended
        impacts += done.impacts
        if take is not None and done.whole is not None:
            take(done.whole)
        for whole, part in zip(tallies, done.tallies, strict=True):
            whole.merge(part)
        progress("Simulating", counted + finished, n)

    cores = threads or os.process_cpu_count() or 1
    with ThreadPoolExecutor(cores) as pool:
        for begin, end in _rounds(n) if enough is not None else [(0, n)]:

            def of_round(part: Indices, begin: int = begin) -> _Chunk:
                return chunk(begin + part)

            done = take_turns(pool, cores, of_round, releases.position[begin:end, :2], add, AT_ONCE)
            counted += done
            if done < end - begin or (enough is not None and enough(counted)):
                break
    if not counted:
        raise CancelledError
    told = dict(zip(names, ends.tolist(), strict=True))
    return Counted(settings, counted, n, told, impacts, time.perf_counter() - started)


def _rounds(n: int) -> list[tuple[int, int]]:
    """The first run of each round, and the one behind its last: see `ROUND`."""
    edges, size = [0], ROUND
    while size < n:
        edges.append(size)
        size *= 2
    edges.append(n)
    return list(pairwise(edges))


def _padded(counts: NDArray[np.int64], size: int) -> NDArray[np.int64]:
    return np.concatenate([counts, np.zeros(size - counts.size, np.int64)])

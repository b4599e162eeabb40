# SPDX-License-Identifier: GPL-3.0-or-later
"""Many runs, chunk by chunk: each is simulated, counted in tallies, and forgotten, so that memory lasts.

A run depends on its number and the seed, and tallies on the runs they have counted: the result is the same for any
number of threads.
"""

import os
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from itertools import pairwise
from threading import Event
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..hazard.barriers import with_barriers
from ..hazard.screens import Screen, check_screens, hits_at
from ..hazard.tally import Tally
from ..progress import CancelledError, Progress, silent
from ..simulation.engine import Recorded, RecordSpace, Settings, Simulation, check_settings, simulate
from ..simulation.ground import Ground
from ..simulation.release import Releases

CHUNK = 1024
"""Runs that are simulated and counted at once: of more, the records would take fresh memory each time."""
LOOK_S = 0.1
"""How often progress is told, and a cancel noticed."""

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

    blocks: int
    wanted: int
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
    behind: Sequence[Tally] = (),
    barriers: Sequence[Screen] = (),
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
    tallies : what counts the runs as they are.
    behind : what counts the same runs where `barriers` hold blocks.
    first_run : see `simulate`.
    threads : None takes all cores.
    enough : asked when 1, 2, 4, 8 … chunks are counted, whatever the number of threads; the first yes ends it.
    take : gets each chunk, without what `barriers` do, in the order of the runs; of its records what `record` says.
    progress : called with the number of finished blocks; a `CancelledError` raised in it ends it with the blocks that
        are finished, from the first on without a gap.

    Raises
    ------
    InputError : settings, barriers or blocks that cannot be.
    CancelledError : the work was ended before the first blocks were finished.
    """
    check_settings(ground, settings)
    check_screens(barriers, ground)
    ground.refuse_small(releases.radius_m)
    n, started = len(releases), time.perf_counter()
    ends, counted, impacts = np.zeros(0, np.int64), 0, 0
    names: tuple[str, ...] = ()
    progress("Compiling where needed, then simulating", 0, n)
    simulate(ground, releases.take(slice(0, 1)), settings, first_run=first_run, threads=1)

    stopping, spaces = Event(), list[RecordSpace]()

    def until_stopped(*_: object) -> None:
        if stopping.is_set():
            raise CancelledError

    def chunk(start: int) -> _Chunk:
        part = releases.take(slice(start, min(start + CHUNK, n)))
        space = spaces.pop() if spaces else RecordSpace()
        simulation = simulate(
            ground, part, settings, record="all", first_run=first_run + start, threads=1, space=space,
            progress=until_stopped,
        )  # fmt: skip
        own, later = [each.empty() for each in tallies], [each.empty() for each in behind]
        for each in own:
            each.add(simulation)
        if later:
            held = with_barriers(simulation, hits_at(simulation, barriers)) if barriers else simulation
            for each in later:
                each.add(held)
        ended = np.bincount(simulation.end, minlength=len(simulation.ends))
        kept = None if take is None else simulation.with_records(record)
        if kept is not simulation:  # else its records are in the space
            spaces.append(space)
        return _Chunk(
            len(simulation), len(part), simulation.ends, ended, int(simulation.impacts.sum()), kept, [*own, *later]
        )

    def add(done: _Chunk) -> None:
        nonlocal ends, counted, impacts, names
        names = done.ends
        ends = _padded(ends, len(names)) + done.ended
        counted, impacts = counted + done.blocks, impacts + done.impacts
        if take is not None and done.whole is not None:
            take(done.whole)
        for whole, part in zip((*tallies, *behind), done.tallies, strict=True):
            whole.merge(part)

    def tell() -> None:
        try:
            progress("Simulating", counted, n)
        except CancelledError:
            stopping.set()

    cores = threads or os.cpu_count() or 1
    with ThreadPoolExecutor(cores) as pool:
        for begin, end in _rounds(n) if enough is not None else [(0, n)]:
            goes_on = _do(pool, cores, range(begin, end, CHUNK), chunk, add, tell, stopping)
            if not goes_on or (enough is not None and enough(counted)):
                break
    if not counted:
        raise CancelledError
    told = dict(zip(names, ends.tolist(), strict=True))
    return Counted(settings, counted, n, told, impacts, time.perf_counter() - started)


def _do(
    pool: ThreadPoolExecutor,
    cores: int,
    starts: range,
    chunk: Callable[[int], _Chunk],
    add: Callable[[_Chunk], None],
    tell: Callable[[], None],
    stopping: Event,
) -> bool:
    """Do chunks, a few at a time, and add them in their order; False where it was stopped.

    Then those that are at work end early; what is finished behind a gap is left out.
    """
    waiting, left = deque[Future[_Chunk]](), iter(starts)
    try:
        while True:
            while not stopping.is_set() and len(waiting) < cores + 2 and (start := next(left, None)) is not None:
                waiting.append(pool.submit(chunk, start))
            if not waiting:
                return not stopping.is_set()
            wait((waiting[0],), LOOK_S)
            while waiting and waiting[0].done():
                done = waiting.popleft().result()
                add(done)
                if done.blocks < done.wanted:
                    return False
            if not stopping.is_set():
                tell()
    except CancelledError:
        return False
    finally:
        if waiting:
            stopping.set()
            for one in waiting:
                one.cancel()


def _rounds(n: int) -> list[tuple[int, int]]:
    """Rounds after which it is asked whether the blocks are enough: 1, 2, 4, 8 … chunks altogether."""
    edges, size = [0], CHUNK
    while size < n:
        edges.append(size)
        size *= 2
    edges.append(n)
    return list(pairwise(edges))


def _padded(counts: NDArray[np.int64], size: int) -> NDArray[np.int64]:
    return np.concatenate([counts, np.zeros(size - counts.size, np.int64)])

# SPDX-License-Identifier: GPL-3.0-or-later
"""Many runs, chunk by chunk: each is simulated, counted in tallies, and forgotten, so that memory lasts.

A run depends on its number and the seed, and tallies on the runs they have counted: the result is the same for any
number of threads.
"""

import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..hazard.barriers import with_barriers
from ..hazard.screens import Screen, check_screens, hits_at
from ..hazard.tally import Tally
from ..progress import CancelledError, Progress, silent
from ..simulation.engine import Settings, Simulation, check_settings, simulate
from ..simulation.ground import Ground
from ..simulation.release import Releases

CHUNK = 2048
"""Runs that are simulated and counted at once."""

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
    progress : called with the number of finished blocks; a `CancelledError` raised in it ends it with the chunks that
        are begun, which are the first without a gap.

    Raises
    ------
    InputError : settings, barriers or blocks that cannot be.
    """
    check_settings(ground, settings)
    check_screens(barriers, ground)
    ground.refuse_small(releases.radius_m)
    n, started = len(releases), time.perf_counter()
    ends, counted, impacts = np.zeros(0, np.int64), 0, 0
    names: tuple[str, ...] = ()
    progress("Compiling where needed, then simulating", 0, n)
    simulate(ground, releases.take(slice(0, 1)), settings, first_run=first_run, threads=1)

    def chunk(start: int) -> tuple[Simulation, list[Tally], list[Tally]]:
        part = releases.take(slice(start, min(start + CHUNK, n)))
        simulation = simulate(ground, part, settings, record="all", first_run=first_run + start, threads=1)
        own, later = [each.empty() for each in tallies], [each.empty() for each in behind]
        for each in own:
            each.add(simulation)
        if later:
            held = with_barriers(simulation, hits_at(simulation, barriers)) if barriers else simulation
            for each in later:
                each.add(held)
        return simulation, own, later

    def take(done: tuple[Simulation, list[Tally], list[Tally]]) -> None:
        nonlocal ends, counted, impacts, names
        simulation, own, later = done
        names = simulation.ends
        ends = _padded(ends, len(names)) + np.bincount(simulation.end, minlength=len(names))
        counted, impacts = counted + len(simulation), impacts + int(simulation.impacts.sum())
        for whole, part in zip((*tallies, *behind), (*own, *later), strict=True):
            whole.merge(part)

    cores = threads or os.cpu_count() or 1
    with ThreadPoolExecutor(cores) as pool:
        for begin, end in _rounds(n) if enough is not None else [(0, n)]:
            goes_on = _do(
                pool, cores, range(begin, end, CHUNK), chunk, take, lambda: progress("Simulating", counted, n)
            )
            if not goes_on or (enough is not None and enough(counted)):
                break
    told = dict(zip(names, ends.tolist(), strict=True))
    return Counted(settings, counted, n, told, impacts, time.perf_counter() - started)


def _do[T](
    pool: ThreadPoolExecutor,
    cores: int,
    starts: range,
    chunk: Callable[[int], T],
    take: Callable[[T], None],
    told: Callable[[], None],
) -> bool:
    """Do chunks, a few at a time; False where it was cancelled: those that had begun are done all the same."""
    waiting, left, goes_on = set[Future[T]](), iter(starts), True
    try:
        while True:
            while goes_on and len(waiting) < cores + 1 and (start := next(left, None)) is not None:
                waiting.add(pool.submit(chunk, start))
            if not waiting:
                return goes_on
            ready, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            for one in ready:
                take(one.result())
            if goes_on:
                try:
                    told()
                except CancelledError:
                    goes_on = False
    finally:
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

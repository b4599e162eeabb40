# SPDX-License-Identifier: GPL-3.0-or-later
"""Many runs, shared out among threads so that those released near one another follow each other."""

import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait

import numpy as np

from ..progress import CancelledError
from ..terrain.ordering import along_curve
from ..vectors import Array, Indices

BATCH = 64
"""Runs that one thread takes at a time; larger ones leave a thread without work at the end."""
WINDOW, WINDOW_S = 16384, 1.0
"""Of so many runs, and of no more than take so long, those that are released near one another are taken one after the
other: they find the terrain in the processor's cache. After a cancel a window that is begun is finished, so that no
finished run is lost."""


def take_turns[Result](
    pool: ThreadPoolExecutor,
    cores: int,
    batch: Callable[[Indices], Result],
    places: Array,
    done: Callable[[Result, int], None],
    most: int = BATCH,
) -> int:
    """Do all runs, window after window, in each along a curve through the places (n, 2) where they begin.

    Parameters
    ----------
    batch : does some runs, in one of the threads.
    done : gets what came of a batch, as they are finished, and how many runs are finished; a `CancelledError` raised
        in it lets no further window begin.
    most : runs of a batch.

    Returns
    -------
    How many, from the first on, are finished: all of them unless it was cancelled.
    """
    curve = along_curve(places)
    n = curve.size
    begun, finished, goes_on, started = 0, 0, True, time.perf_counter()
    batches, waiting = deque[Indices](), dict[Future[Result], int]()
    try:
        while True:
            while len(waiting) < 2 * cores and (batches or (goes_on and begun < n)):
                if not batches:
                    in_time = int(WINDOW_S * finished / (time.perf_counter() - started))
                    size = max(BATCH * cores, min(WINDOW, in_time, n // 4) // BATCH * BATCH)
                    window = begun + np.argsort(curve[begun : begun + size], kind="stable")
                    each = max(BATCH, min(most, window.size // cores))
                    batches.extend(window[start : start + each] for start in range(0, window.size, each))
                    begun += window.size
                part = batches.popleft()
                waiting[pool.submit(batch, part)] = part.size
            if not waiting:
                return begun
            for one in wait(waiting, return_when=FIRST_COMPLETED).done:
                finished += waiting.pop(one)
                try:
                    done(one.result(), finished)
                except CancelledError:
                    goes_on = False
    finally:
        for one in waiting:
            one.cancel()

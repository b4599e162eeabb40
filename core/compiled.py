# SPDX-License-Identifier: GPL-3.0-or-later
"""The one door to numba: plain Python functions, compiled when first needed.

A module of kernels decorates its functions with `kernel` and is imported *inside* the function that first needs it,
so that importing `rockfall` compiles nothing. Compiled code is kept on disk (`kept_code`). Kernels release the GIL;
`in_chunks` spreads rows over the cores.
"""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np

CHUNK_ROWS = 4096


def kernel(function: Callable[..., Any], *, inline: bool = False, allocates: bool = True) -> Any:
    """Compile a plain Python function with numba: no Python objects, the GIL released, kept on disk.

    Parameters
    ----------
    inline : whether it becomes a part of each compiled function that calls it.
    allocates : whether it makes arrays. If not, references to arrays are not counted in it: that is an atomic operation
        for each array of each call, on counters that all threads share.

    Raises
    ------
    DependencyError : another version of numba, which lacks what this needs of it.
    """
    from numba import njit

    from .kept_code import KeptCode
    from .numba_internals import check_numba

    check_numba()
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "forceinline": inline, "_nrt": allocates}
    dispatcher: Any = njit(**options)(function)
    dispatcher._cache = KeptCode(dispatcher)
    return dispatcher


borrowing = partial(kernel, allocates=False)
"""A kernel that makes no arrays."""


def in_chunks(function: Callable[[int, int], None], rows: int, chunk: int = CHUNK_ROWS) -> None:
    """Call ``function(start, stop)`` over ``range(rows)`` in chunks, on all cores."""
    starts = range(0, rows, chunk)
    if len(starts) <= 1:
        if rows:
            function(0, rows)
        return
    with ThreadPoolExecutor(max_workers=os.process_cpu_count()) as pool:
        list(pool.map(lambda start: function(start, min(start + chunk, rows)), starts))


def as_rows(points: Any) -> np.ndarray:
    """C-contiguous float64 (n, 3), which is what the kernels take."""
    return np.ascontiguousarray(np.atleast_2d(np.asarray(points, dtype=np.float64)))

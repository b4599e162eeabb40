# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether the memory is enough: what blocks and their records need, and what is there."""

import os
import sys
from pathlib import Path

from ..errors import InputError

BLOCK_BYTES = 1000
"""Of one block without its impacts, at the most at once: as it is released, simulated and kept (measured)."""
RECORD_BYTES = 370
"""Of one recorded moment, at the most at once (measured)."""
UNKNOWN_BYTES = 8_000_000_000
"""Where the system does not say."""


def available_bytes() -> int:
    """Memory that can be had now; all that is built in where the system does not say more."""
    try:
        for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    except OSError:
        pass
    if sys.platform == "win32":
        return _available_on_windows()
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (ValueError, OSError, AttributeError):
        return UNKNOWN_BYTES


def check_blocks(number: int) -> None:
    """Raises `InputError` when so many blocks do not fit into the memory, even without their impacts."""
    needed, there = number * BLOCK_BYTES, available_bytes()
    if needed > there:
        raise InputError(
            f"{number} blocks are too many for this memory: they need {_size(needed)} even without their impacts, and "
            f"{_size(there)} are there",
            advice=f"Release up to {there // BLOCK_BYTES}, in several simulations with seeds of their own",
        )


def check_records(number: int, finished: int, recorded: int, there: int) -> None:
    """Raises `InputError` when the records of all blocks will not fit, to judge by those that are finished.

    Parameters
    ----------
    number, finished : blocks; recorded : moments of the finished ones; there : memory at the beginning [bytes].
    """
    needed = int(recorded / finished * number * RECORD_BYTES)
    if needed > there:
        raise InputError(
            f"The motion of {number} blocks does not fit into the memory: it needs {_size(needed)}, and {_size(there)} "
            "are there",
            advice="Record less, release fewer blocks, or compute them in parts (rockfall simulate --runs)",
        )


def _size(count: int) -> str:
    return f"{count / 1e9:.1f} GB"


def _available_on_windows() -> int:
    import ctypes

    class Status(ctypes.Structure):
        _fields_ = (
            ("length", ctypes.c_ulong), ("load", ctypes.c_ulong), ("total", ctypes.c_ulonglong),
            ("available", ctypes.c_ulonglong), ("total_page", ctypes.c_ulonglong),
            ("available_page", ctypes.c_ulonglong), ("total_virtual", ctypes.c_ulonglong),
            ("available_virtual", ctypes.c_ulonglong), ("available_extended", ctypes.c_ulonglong),
        )  # fmt: skip

    status = Status(length=ctypes.sizeof(Status))
    windows = getattr(ctypes, "windll", None)
    if windows is None or not windows.kernel32.GlobalMemoryStatusEx(ctypes.byref(status)):
        return UNKNOWN_BYTES
    return int(status.available)

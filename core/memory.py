# SPDX-License-Identifier: GPL-3.0-or-later
"""How much memory there is."""

import os
import sys
from pathlib import Path

from .errors import InputError

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


def check_memory(what: str, needed: int, file: str | Path) -> None:
    """Raises `InputError` when what a file holds needs more memory than there is [bytes]."""
    there = available_bytes()
    if needed > there:
        raise InputError(
            f"{what} needs {in_words(needed)} of memory, and {in_words(there)} are there",
            file=file,
            advice="Cut out the slope, or make it coarser",
        )


def in_words(count: int) -> str:
    """A size of memory."""
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

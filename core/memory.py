# SPDX-License-Identifier: GPL-3.0-or-later
"""How much memory there is: of the machine, and of the container or job that this process runs in."""

import os
import re
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path, PurePosixPath

from .errors import InputError

UNKNOWN_BYTES = 8_000_000_000
"""Where the system does not say."""
NO_LIMIT_BYTES = 1 << 60
"""What version 1 of control groups says where there is no limit is somewhat below 2^63."""
FILES_OF_GROUP = {
    "cgroup2": (("memory.max", "memory.high"), "memory.current", "inactive_file"),
    "cgroup": (("memory.limit_in_bytes",), "memory.usage_in_bytes", "total_inactive_file"),
}
"""Of both versions of control groups: the files of the limits and of the use; what of the use is given up at need."""

MOUNT = re.compile(r"^\d+ \d+ \S+ (\S+) (\S+) .*- (\S+) \S+ (\S+)$", re.MULTILINE)
"""A line of ``mountinfo``: what is mounted, where, the kind of file system and its options."""


def available_bytes(root: Path = Path("/")) -> int:
    """Memory that can be had now; all that is built in where the system does not say more.

    On Linux also within the limits of the control groups of this process, by which containers and the queues of
    clusters share out a machine.

    Parameters
    ----------
    root : in which ``proc`` and the mounted control groups lie.
    """
    return min([_of_machine(root), *_left_in_groups(root)])


def _of_machine(root: Path) -> int:
    with suppress(OSError):
        for line in (root / "proc/meminfo").read_text(encoding="ascii").splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    if sys.platform == "win32":
        return _available_on_windows()
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (ValueError, OSError, AttributeError):
        return UNKNOWN_BYTES


def _left_in_groups(root: Path) -> Iterator[int]:
    """Of each control group with a limit, from that of this process up to the uppermost that can be seen [bytes].

    Notes
    -----
    Linux documentation, admin-guide/cgroup-v2 and cgroup-v1/memory; proc(5) for ``mountinfo``. A container sees its own
    group as the root of what is mounted, or as a part of a path that is not mounted: then the mounted root is its own.
    """
    try:
        groups = (root / "proc/self/cgroup").read_text(encoding="utf-8", errors="surrogateescape")
        mounts = (root / "proc/self/mountinfo").read_text(encoding="utf-8", errors="surrogateescape")
    except OSError:  # not Linux
        return
    paths = {}
    for number, controllers, path in re.findall(r"^(\d+):(.*?):(.*)$", groups, re.MULTILINE):
        if number == "0":
            paths["cgroup2"] = PurePosixPath(path)
        elif "memory" in controllers.split(","):
            paths["cgroup"] = PurePosixPath(path)
    for inside, at, version, options in MOUNT.findall(mounts):
        if version not in paths or (version == "cgroup" and "memory" not in options.split(",")):
            continue
        inside, top = _unescaped(inside), root / _unescaped(at).lstrip("/")
        path = paths[version]
        below = path.relative_to(inside).parts if path.is_relative_to(inside) else ()
        folder = top.joinpath(*(part for part in below if part != ".."))
        while True:
            left = _left(folder, version)
            if left is not None:
                yield left
            if folder == top:
                break
            folder = folder.parent


def _left(group: Path, version: str) -> int | None:
    """What is left of the limit of a control group [bytes]; None without one. Caches of files are given up at need."""
    limits, use, kept = FILES_OF_GROUP[version]
    most = min((value for name in limits if (value := _number(group / name)) is not None), default=NO_LIMIT_BYTES)
    if most >= NO_LIMIT_BYTES:
        return None
    cached = 0
    with suppress(OSError, ValueError):
        statistics = (line.split() for line in (group / "memory.stat").read_text(encoding="ascii").splitlines())
        cached = next((int(value) for name, value in statistics if name == kept), 0)
    return max(most - max((_number(group / use) or 0) - cached, 0), 0)


def _number(file: Path) -> int | None:
    """What a file of a control group says; None for "max", and where there is none."""
    try:
        return int(file.read_text(encoding="ascii"))
    except (OSError, ValueError):
        return None


def _unescaped(path: str) -> str:
    """A path of ``mountinfo``, in which spaces and their kind are octal numbers."""
    return re.sub(r"\\([0-7]{3})", lambda found: chr(int(found[1], 8)), path)


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

# SPDX-License-Identifier: GPL-3.0-or-later
"""Locks on open files, which the system takes back when a process ends, however it ends."""

import os
import sys
from errno import EACCES, EAGAIN
from pathlib import Path

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl


FAR = 1 << 30
"""The byte that is locked on Windows, where nobody else can read what is locked: behind all that a file says."""


def try_lock(descriptor: int) -> bool:
    """Lock an open file; False when somebody holds it, also this process through another descriptor.

    On a disk that knows no locks it succeeds always.
    """
    try:
        if sys.platform == "win32":
            at = os.lseek(descriptor, 0, os.SEEK_CUR)
            os.lseek(descriptor, FAR, os.SEEK_SET)
            try:
                msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
            finally:
                os.lseek(descriptor, at, os.SEEK_SET)
        else:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        return error.errno not in (EACCES, EAGAIN)
    return True


def holds(descriptor: int, path: Path) -> bool:
    """Whether an open file is still the one of a path: it may have been removed meanwhile."""
    try:
        return os.path.samestat(os.fstat(descriptor), path.stat())
    except OSError:
        return False

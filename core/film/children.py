# SPDX-License-Identifier: GPL-3.0-or-later
"""Processes that end when this one does, however it ends: they read from a pipe that only this one holds."""

import os
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from threading import Thread
from typing import IO


@contextmanager
def child(
    command: Sequence[str], *, stdout: int | IO[str] | None, stderr: int | IO[str] | None
) -> Iterator[subprocess.Popen[str]]:
    """A running process, which the end of the block ends.

    Raises
    ------
    OSError : there is no such program.
    """
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=stdout, stderr=stderr, encoding="utf-8", errors="replace"
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def end_with_parent() -> None:
    """In the child: end as soon as the parent has ended."""

    def watch() -> None:
        while os.read(0, 1):
            pass
        os._exit(1)

    Thread(target=watch, daemon=True).start()

# SPDX-License-Identifier: GPL-3.0-or-later
"""Processes that end when this one does, however it ends: they read from a pipe that only this one holds."""

import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from threading import Thread
from typing import IO

TIED = "ROCKFALL_ENDS_WITH_PARENT"
"""Variable of the environment that asks a command line to end with the process that has started it."""

rockfall_command: ContextVar[tuple[str, ...]] = ContextVar(
    "rockfall_command", default=(sys.executable, "-m", f"{(__package__ or '').rpartition('.')[0]}.core.start")
)
"""How another process runs the command line; inside Blender the add-on says it."""


@contextmanager
def child(
    command: Sequence[str],
    *,
    stdout: int | IO[str] | None,
    stderr: int | IO[str] | None,
    variables: Mapping[str, str] | None = None,
) -> Iterator[subprocess.Popen[str]]:
    """A running process, which the end of the block ends.

    Parameters
    ----------
    variables : of its environment, beside those of ours.

    Raises
    ------
    OSError : there is no such program.
    """
    environment = None if variables is None else {**os.environ, **variables}
    with subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=stdout,
        stderr=stderr,
        encoding="utf-8",
        errors="replace",
        env=environment,
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


def end_with_parent_if_asked() -> None:
    """`end_with_parent` where the parent has set `TIED`, which children of this process do not see."""
    if os.environ.pop(TIED, ""):
        end_with_parent()

# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender in another process: how it is started, what it is asked, and what it says."""

import importlib.util
import subprocess
import sys
from collections import deque
from collections.abc import Iterator, Sequence
from contextvars import ContextVar
from queue import Empty, SimpleQueue
from threading import Thread
from typing import IO

from .children import child
from .dependencies import require_blender_libraries
from .errors import DependencyError, RockfallError
from .progress import Progress

CRASHED = "Blender stopped while it made {name} (status {status}).{said} {advice}"
LINES_TOLD, MOST_KEPT = 5, 200
OURS = "rockfall "
"""Begins the lines that are ours: other add-ons print on the same standard output while Blender starts."""
BEAT_S = 0.2
"""So often progress is told again while a process says nothing: whoever wants it to end says so there."""

inside_blender: ContextVar[tuple[str, ...] | None] = ContextVar("blender_command", default=None)
"""The command that starts the other Blender; set by the add-on while Blender itself runs a command."""


def blender_command(purpose: str) -> tuple[str, ...]:
    """The command that starts Blender for one job, which follows it as JSON (see `steps/share/__main__.py`).

    Parameters
    ----------
    purpose : the beginning of the message where there is no Blender: "glTF, USD and Alembic are written".

    Raises
    ------
    DependencyError : this Python has no Blender.
    """
    inside = inside_blender.get()
    if inside is not None:
        return inside
    if importlib.util.find_spec("bpy") is None:
        raise DependencyError(
            f"{purpose} by Blender, which this Python does not have. Install it with: pip install rockfall[blender]"
        )
    require_blender_libraries()
    package = __name__.partition(".core.")[0]
    return sys.executable, "-m", f"{package}.rockfall_addon.steps.share"


def run_job(command: Sequence[str], name: str, progress: Progress, advice: str) -> tuple[str, ...]:
    """Run a process that makes the file `name`; its standard output tells how far it is (see `film/__main__.py`).

    advice : what to do when it crashes. Returns its remarks.

    Raises
    ------
    RockfallError : with what the process says is wrong, or the last lines that it printed when it crashed.
    """
    problem, remarks, said = "", [], deque[str](maxlen=MOST_KEPT)
    at = "Starting Blender", 0, 0
    with child(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        listener = Thread(target=said.extend, args=(process.stderr,))
        listener.start()
        try:
            progress(*at)
            for line in _lines(process.stdout):
                told = line.removeprefix(OURS) if line.startswith(OURS) else ""
                word, _, rest = told.strip().partition(" ")
                if word == "progress":
                    done, total, text = rest.split(maxsplit=2)
                    at = text, int(done), int(total)
                if word == "progress" or not line:
                    progress(*at)
                elif word == "remark":
                    remarks.append(rest)
                elif word == "error":
                    problem = rest
            status = process.wait()
        except BaseException:
            process.kill()
            raise
        finally:
            listener.join()
    if problem:
        raise RockfallError(problem)
    if status != 0:
        lines = [line.strip() for line in said if line.strip() and "EGL" not in line][-LINES_TOLD:]
        words = f" It said: {' / '.join(lines)}." if lines else ""
        raise RockfallError(CRASHED.format(name=name, status=status, said=words, advice=advice))
    return tuple(remarks)


def _lines(stream: IO[str]) -> Iterator[str]:
    """The lines of a stream as they come; now and then an empty one, without an end of line, while none comes."""
    come: SimpleQueue[str | None] = SimpleQueue()

    def listen() -> None:
        for line in stream:
            come.put(line)
        come.put(None)

    Thread(target=listen, daemon=True).start()
    while True:
        try:
            line = come.get(timeout=BEAT_S)
        except Empty:
            line = ""
        if line is None:
            return
        yield line

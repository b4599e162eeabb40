# SPDX-License-Identifier: GPL-3.0-or-later
"""Getting films made: by Blender in another process, or by the Blender we are in."""

import importlib.util
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextvars import ContextVar
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from threading import Thread
from typing import IO

from ..children import child
from ..dependencies import require_blender_libraries
from ..errors import DependencyError, RockfallError
from ..progress import Progress, silent
from .engines import choose_engine
from .job import AS_SET_UP, FilmJob
from .room import watched_room

CRASHED = "Blender stopped while it made {name} (status {status}).{said} {advice}"
OTHER_ENGINE = "Try the engine Cycles (--engine cycles)."
LINES_TOLD, MOST_KEPT = 5, 200
OURS = "rockfall "
"""Begins the lines that are ours: other add-ons print on the same standard output while Blender starts."""
BEAT_S = 0.2
"""So often progress is told again while a process says nothing: whoever wants it to end says so there."""


@dataclass(frozen=True)
class Film:
    """What was made: the engine that was used, and sentences on what a user should know of it."""

    engine: str
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class FilmMaker:
    """Who makes films.

    Attributes
    ----------
    make : does a job whose engine is chosen; returns the remarks.
    probe : command that runs a Python text, ``{probe}``, in another Blender.
    """

    make: Callable[[FilmJob, Progress], tuple[str, ...]]
    probe: tuple[str, ...]

    def film(self, job: FilmJob, progress: Progress = silent) -> Film:
        """Do a job.

        Raises
        ------
        DependencyError : Blender or the engine is not there.
        RockfallError : what the job says is wrong, or Blender crashed.
        """
        require_blender_libraries()
        chosen = job if job.engine == AS_SET_UP else job.with_engine(choose_engine(job.engine, self.probe))
        return Film(chosen.engine, self.make(chosen, progress))


def film_maker() -> FilmMaker:
    """Who makes films here.

    Raises
    ------
    DependencyError : this Python has no Blender.
    """
    inside = inside_blender.get()
    if inside is not None:
        return inside
    if importlib.util.find_spec("bpy") is None:
        raise DependencyError(
            "Films are made by Blender, which this Python does not have. Install it with: pip install rockfall[blender]"
        )
    return FilmMaker(_make, (sys.executable, "-c", "{probe}"))


inside_blender: ContextVar[FilmMaker | None] = ContextVar("inside_blender", default=None)
"""Set by the add-on while Blender itself runs a command."""


def run_job(command: Sequence[str], name: str, progress: Progress, advice: str = OTHER_ENGINE) -> tuple[str, ...]:
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


def make_file(command: Sequence[str], job: FilmJob, progress: Progress) -> tuple[str, ...]:
    """As `run_job`, for the file of a job; where its disk is full, that is said.

    Raises
    ------
    RockfallError : the file cannot be made.
    """
    with watched_room(job.out.absolute().parent, job.out.name, progress) as watched:
        return run_job([*command, job.to_json()], job.out.name, watched)


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


def _make(job: FilmJob, progress: Progress) -> tuple[str, ...]:
    package = __name__.partition(".core.")[0]
    command = [sys.executable, "-m", f"{package}.rockfall_addon.steps.film"]
    return make_file(command, job, progress)

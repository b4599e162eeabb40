# SPDX-License-Identifier: GPL-3.0-or-later
"""Getting films made: by Blender in another process, or by the Blender we are in."""

import importlib.util
import sys
from collections.abc import Callable, Sequence
from contextvars import ContextVar
from dataclasses import dataclass

from ..blender_process import run_job
from ..dependencies import require_blender_libraries
from ..errors import DependencyError
from ..progress import Progress, silent
from .engines import choose_engine
from .job import AS_SET_UP, FilmJob
from .room import watched_room

OTHER_ENGINE = "Try the engine Cycles (--engine cycles)."


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


def make_file(command: Sequence[str], job: FilmJob, progress: Progress) -> tuple[str, ...]:
    """As `run_job`, for the file of a job; where its disk is full, that is said.

    Raises
    ------
    RockfallError : the file cannot be made.
    """
    with watched_room(job.out.absolute().parent, job.out.name, progress) as watched:
        return run_job([*command, job.to_json()], job.out.name, watched, OTHER_ENGINE)


def _make(job: FilmJob, progress: Progress) -> tuple[str, ...]:
    package = __name__.partition(".core.")[0]
    command = [sys.executable, "-m", f"{package}.rockfall_addon.steps.film"]
    return make_file(command, job, progress)

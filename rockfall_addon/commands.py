# SPDX-License-Identifier: GPL-3.0-or-later
"""``blender --command rockfall …``: the same command line, films rendered by the Blender that runs it."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import bpy

from ..core import blender_process, cli
from ..core.children import rockfall_command
from ..core.film.job import FilmJob
from ..core.film.maker import FilmMaker, inside_blender
from ..core.progress import Progress

_handles: list[object] = []


def register() -> None:
    _handles.append(bpy.utils.register_cli_command("rockfall", run))


def unregister() -> None:
    while _handles:
        bpy.utils.unregister_cli_command(_handles.pop())


def run(arguments: list[str]) -> int:
    """Run one command; returns the exit status."""
    from .steps.share.beside import blender_command

    other = blender_process.inside_blender.set(blender_command())
    token = inside_blender.set(FilmMaker(_make, _probe_command()))
    blender = bpy.app.binary_path  # none where Blender is a module: there Python itself runs the command line
    again = (blender, "--background", "--command", "rockfall") if blender else rockfall_command.get()
    told = rockfall_command.set(again)
    try:
        return cli.main(arguments)
    finally:
        rockfall_command.reset(told)
        blender_process.inside_blender.reset(other)
        inside_blender.reset(token)


def _make(job: FilmJob, progress: Progress) -> tuple[str, ...]:
    from .steps.film.render import make

    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    with _quiet():
        return make(job, progress)


def _probe_command() -> tuple[str, ...]:
    blender = bpy.app.binary_path
    if not blender:  # Blender as a module
        return sys.executable, "-c", "{probe}"
    return blender, "--background", "--factory-startup", "--python-exit-code", "1", "--python-expr", "{probe}"


@contextmanager
def _quiet() -> Iterator[None]:
    """Blender reports each frame on its standard output; that is not ours."""
    sys.stdout.flush()
    kept = os.dup(1)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    try:
        yield
    finally:
        sys.stdout.flush()
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)

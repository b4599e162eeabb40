# SPDX-License-Identifier: GPL-3.0-or-later
"""The film of an open .blend, rendered by another Blender: one goes on working, and stops it at any time.

The other one gets a copy of the .blend. What it makes is checked, and then replaces the file of the old film.
"""

import shutil
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import mkdtemp

import bpy

from .... import __package__ as PACKAGE  # noqa: N812
from ....core.errors import RockfallError
from ....core.film.composed.request import FilmRequest
from ....core.film.job import AS_SET_UP, FilmJob
from ....core.film.maker import make_file
from ....core.output import output_file
from ....core.progress import Progress
from ...scene.project import save_project

type Remarks = tuple[str, ...]

written: dict[int, Path] = {}
"""session_uid of a scene → the film that was made of it."""

RUN = "import sys; from {package}.rockfall_addon.steps.film.__main__ import main; main(sys.argv[-1])"


def film_of(scene: bpy.types.Scene, path: Path) -> Callable[[Progress], None]:
    """What renders the film for which a scene is set up, as it is now; it needs no Blender, so that a thread can do it.

    Raises
    ------
    RockfallError : the copy of the .blend cannot be written. What is returned raises it when the film cannot be made:
        the old one is as it was.
    """
    folder = Path(mkdtemp(dir=bpy.app.tempdir))
    copy = folder / "film.blend"
    try:
        bpy.ops.wm.save_as_mainfile(filepath=str(copy), copy=True, compress=False)
    except RuntimeError as error:
        shutil.rmtree(folder, ignore_errors=True)
        raise RockfallError(
            f"The copy of the scene that is to be rendered cannot be written: {error}. "
            f"Make room on the disk of {folder.parent}."
        ) from error
    name, command = scene.name, _command()

    def render(progress: Progress) -> None:
        try:
            with output_file(path) as draft:
                make_file(command, FilmJob("film", copy, draft, AS_SET_UP, scene=name), progress)
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    return render


def composed_of(scene: bpy.types.Scene, request: FilmRequest, path: Path, codec: str) -> Callable[[Progress], Remarks]:
    """What composes a film, or a picture, of a scene as it is now: from a copy of its project, in another Blender.

    Parameters
    ----------
    request : its project is set here.

    Raises
    ------
    RockfallError : the project cannot be written. What is returned raises it when the film cannot be made: the old one
        is as it was, and finished frames are kept beside it.
    """
    folder = Path(mkdtemp(dir=bpy.app.tempdir))
    try:
        file, _ = save_project(scene, folder / "project")
    except RockfallError:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    asked, command = replace(request, project=file), _command()

    def make(progress: Progress) -> Remarks:
        try:
            job = FilmJob("composed", file, path, request=asked.to_json(), codec=codec)
            return make_file(command, job, progress)
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    return make


def _command() -> list[str]:
    """What runs `__main__` in another Blender of this kind."""
    if not bpy.app.binary_path:
        return [sys.executable, "-m", __package__]
    script = RUN.format(package=PACKAGE)
    options = ["--background", "--addons", PACKAGE, "--python-exit-code", "1", "--python-expr", script]
    return [bpy.app.binary_path, *options, "--"]

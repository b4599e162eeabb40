# SPDX-License-Identifier: GPL-3.0-or-later
"""Saved .blend files in the place of a project: Blender writes what a file holds as a project, which is then read."""

import json
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, cast

from ..blender_process import blender_command, run_job
from ..errors import InputError
from ..progress import silent

BLEND, TOML = ".blend", ".toml"
PROJECT = "project.toml"
ADVICE = "Open it in Blender and save it again, or export the project there (Share > Export Project)."


def is_project(file: str | Path) -> bool:
    """Whether a file is a project by its name: a TOML file or a saved .blend."""
    return Path(file).suffix.lower() in (TOML, BLEND)


@dataclass(frozen=True)
class _Exports:
    """The projects that were written of .blend files.

    Attributes
    ----------
    folder : has a folder for each, which is removed at the end.
    tell : is given what a user should know of one.
    made : (file, size, time of the last change) → project.toml.
    """

    folder: Path
    tell: Callable[[str], None]
    made: dict[tuple[str, int, int], Path]


_exports: ContextVar[_Exports | None] = ContextVar("exports", default=None)


@contextmanager
def saved_blends(tell: Callable[[str], None]) -> Iterator[None]:
    """Inside the block `read_project` also reads saved .blend files, through Blender, each once.

    Parameters
    ----------
    tell : is given what Blender says of a file, for example which trajectories are left out.
    """
    with TemporaryDirectory(prefix="rockfall_", ignore_cleanup_errors=True) as folder:
        token = _exports.set(_Exports(Path(folder), tell, {}))
        try:
            yield
        finally:
            _exports.reset(token)


def project_of(blend: Path) -> Path | None:
    """The project.toml that Blender writes of a saved .blend; None outside of `saved_blends`.

    Raises
    ------
    InputError : there is no such file, or Blender cannot open it, or it holds neither picks nor terrain.
    DependencyError : there is no Blender.
    """
    exports = _exports.get()
    if exports is None:
        return None
    state = blend.stat()
    key = str(blend.resolve()), state.st_size, state.st_mtime_ns
    if key not in exports.made:
        place = exports.folder / str(len(exports.made) + 1) / blend.name  # messages then name the file
        place.parent.mkdir()
        job = json.dumps({"blend": str(blend.absolute()), "folder": str(place)})
        command = blender_command("A .blend is read")
        for remark in run_job([*command, job], f"the project of {blend.name}", silent, ADVICE):
            exports.tell(f"{blend.name}: {remark}")
        if not (place / PROJECT).is_file():
            raise InputError("Blender has written no project of this file", file=blend, advice=ADVICE)
        exports.made[key] = place / PROJECT
    return exports.made[key]


def keep_files[T](content: T, source: Path, folder: Path) -> T:
    """What Blender wrote of a .blend, copied to where it stays; other projects as they are.

    Parameters
    ----------
    content : a project, whose paths are changed to the copies.
    source : the file that the project was read from.
    folder : of the output, which is staged; the copies get a folder in it with the name of the .blend.
    """
    exports = _exports.get()
    if exports is None or source.suffix.lower() != BLEND:
        return content
    written = cast(Path, project_of(source)).parent
    place = folder / source.name
    shutil.copytree(written, place, ignore=shutil.ignore_patterns(PROJECT))
    return cast(T, _moved(content, written, place))


def _moved(value: Any, old: Path, new: Path) -> Any:
    """The same with each path in one folder changed to another."""
    if isinstance(value, Path):
        file = Path(os.path.normpath(value))  # other files are named relative to the folder
        return new / file.relative_to(old) if file.is_relative_to(old) else value
    if isinstance(value, tuple):
        parts = [_moved(one, old, new) for one in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    if is_dataclass(value) and not isinstance(value, type):
        return replace(value, **{one.name: _moved(getattr(value, one.name), old, new) for one in fields(value)})
    return value

# SPDX-License-Identifier: GPL-3.0-or-later
"""Output that is whole or not there: files are staged, and moved into place only on success."""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from errno import EDQUOT, EFBIG, ENOSPC
from pathlib import Path

from ..errors import InputError

FULL = (ENOSPC, EDQUOT, EFBIG)
"""Errors of a file that is being written when there is no more room; they do not name it."""
OTHER_FOLDER = "Choose another folder for --out"


@contextmanager
def output_folder(path: str | Path) -> Iterator[Path]:
    """A staging folder whose files are moved into `path` when the block ends without an error.

    On an error nothing is left, not even folders that were made for it. Other files that are in `path` stay, files of
    the same names are replaced.

    Raises
    ------
    InputError : the folder cannot be made or written, or something of another kind is in the way.
    """
    path = Path(path).absolute()
    if path.exists() and not path.is_dir():
        raise InputError("This is a file, not a folder", file=path, advice="Give --out the name of a folder")
    parent = path.parent
    made = [folder for folder in (parent, *parent.parents) if not folder.exists()]
    try:
        parent.mkdir(parents=True, exist_ok=True)
        staging = Path(tempfile.mkdtemp(prefix=f".{path.name}.", suffix=".part", dir=parent))
    except OSError as error:
        _remove_empty(made)
        raise InputError(
            f"The output folder cannot be made ({error.strerror})", file=path, advice=OTHER_FOLDER
        ) from error
    complete = False
    try:
        yield staging
        _move(staging, path)
        complete = True
    except OSError as error:
        in_the_way = error.filename is not None and str(error.filename).startswith((str(staging), str(path)))
        if not in_the_way and error.errno not in FULL:
            raise
        raise InputError(
            f"The output cannot be written ({error.strerror})",
            file=path,
            advice="Make room, or choose a folder on another disk" if error.errno in FULL else OTHER_FOLDER,
        ) from error
    finally:
        shutil.rmtree(staging, ignore_errors=True)
        if not complete:
            _remove_empty(made)


def _move(staging: Path, path: Path) -> None:
    """Move all files; what could refuse is tried first."""
    files = [file for file in sorted(staging.rglob("*")) if not file.is_dir()]
    for file in files:
        target = path / file.relative_to(staging)
        if target.is_dir():
            raise InputError("A folder is where a file should be written", file=target, advice="Rename or move it")
    path.mkdir(exist_ok=True)
    for file in files:
        target = path / file.relative_to(staging)
        target.parent.mkdir(parents=True, exist_ok=True)
        file.replace(target)


def _remove_empty(folders: list[Path]) -> None:
    for folder in folders:
        try:
            folder.rmdir()
        except OSError:
            return

# SPDX-License-Identifier: GPL-3.0-or-later
"""Output that is whole or not there: files are staged, and moved into place only when all is written.

Every writer goes through here. A staging folder ``.NAME.part`` stands on the disk of what is written, and a lock in it
tells other processes that somebody is at work; without one its process has died, and whoever writes next beside it
removes it.
"""

import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from errno import EDQUOT, EFBIG, EIO, ENOSPC
from pathlib import Path
from typing import IO, Any

from .errors import InputError
from .file_locks import holds, try_lock
from .interrupts import uninterrupted

FULL = (ENOSPC, EDQUOT, EFBIG)
"""Errors of a file that is being written when there is no more room; they do not name it."""
MAKE_ROOM, OTHER_DISK = "Make room, or choose a folder on another disk", "Check the disk, or choose another one"
OTHER_FOLDER = "Choose another folder for the output"
PART, LOCK = ".part", "rockfall.lock"
TRIES, BETWEEN_S = 5, 0.05
"""Another process may be looking whether a staging folder is alive, which takes no time."""


@contextmanager
def output_folder(path: str | Path) -> Iterator[Path]:
    """A staging folder whose files are moved into `path` when the block ends without an error.

    On an error nothing is left, not even folders that were made for it. Other files that are in `path` stay, files of
    the same names are replaced. A new folder appears in one step.

    Raises
    ------
    InputError : the folder cannot be made or written, something of another kind is in the way, or another process is
        writing into it.
    KeyboardInterrupt : when it came while the files were moved, after that, with a message that says so.
    """
    path = Path(path).absolute()
    _refuse_file(path)
    with made_folder(path.parent, path), _staging(path) as staging:
        draft = staging if staging.parent == path else staging / path.name
        try:
            draft.mkdir(exist_ok=True)
            yield draft
            files = [file for file in sorted(draft.rglob("*")) if not file.is_dir() and file != staging / LOCK]
            for file in files:
                with _told(file, final_path(file)):
                    _sync(file)
            with uninterrupted(f"{path} is complete"):
                _move(draft, files, path)
        except OSError as error:
            in_the_way = error.filename is not None and str(error.filename).startswith((str(draft), str(path)))
            if not in_the_way and error.errno not in FULL:
                raise
            place = path if error.filename is None else final_path(Path(error.filename))
            raise _refusal("The output cannot be written", error, place) from error


@contextmanager
def made_folder(folder: Path, place: Path | None = None) -> Iterator[None]:
    """A folder that is there, with those above it; on an error, what was made and is empty is removed again.

    Parameters
    ----------
    place : what is named where it cannot be made; None for the folder.

    Raises
    ------
    InputError : it cannot be made, or a file is in the way.
    """
    if place is None:
        _refuse_file(folder)
    made = [one for one in (folder.absolute(), *folder.absolute().parents) if not one.exists()]
    try:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise _refusal("The output folder cannot be made", error, place or folder) from error
        yield
    except BaseException:
        _remove_empty(made)
        raise


def _refuse_file(path: Path) -> None:
    if path.exists() and not path.is_dir():
        raise InputError("This is a file, not a folder", file=path, advice="Give --out the name of a folder")


@contextmanager
def output_file(path: str | Path) -> Iterator[Path]:
    """A path to write to, whose file replaces `path` when the block ends without an error.

    In an `output_folder` it is the path itself: the folder is whole or not there.

    Raises
    ------
    InputError : the file cannot be written; the old one, if there is one, is as it was.
    """
    path = Path(path)
    place = final_path(path)
    if place != path or (path.exists() and not path.is_file() and not path.is_dir()):  # staged, or a device
        with _told(path, place):
            yield path
        return
    path = Path(os.path.realpath(path))
    if path.is_dir():
        raise InputError("A folder is where a file should be written", file=path, advice="Rename or move it")
    with _staging(path) as staging, _told(staging, place):
        draft = staging / path.name
        yield draft
        _sync(draft)
        with uninterrupted(f"{path} is complete"):
            draft.replace(path)


@contextmanager
def output_stream(path: str | Path, *, binary: bool = False) -> Iterator[IO[Any]]:
    """An `output_file` that is open: bytes, or UTF-8 with lines as they are given."""
    with output_file(path) as draft, draft.open("wb") if binary else draft.open("w", encoding="utf-8", newline="") as s:
        yield s


def write_text(path: str | Path, text: str) -> None:
    """Write an `output_file` in UTF-8."""
    with output_stream(path) as stream:
        stream.write(text)


def write_bytes(path: str | Path, data: bytes | memoryview) -> None:
    """Write an `output_file`."""
    with output_stream(path, binary=True) as stream:
        stream.write(data)


@contextmanager
def _staging(path: Path) -> Iterator[Path]:
    """A folder of this process alone on the disk of `path`, which is removed at the end."""
    place = path if path.is_dir() else path.parent
    folder = place / f".{path.name}{PART}"
    try:
        _remove_stale(place)
        lock = _claim(folder, path)
    except OSError as error:
        raise _refusal("The output cannot be written there", error, path) from error
    try:
        yield folder
    finally:
        with uninterrupted():
            _release(folder, lock)


def _claim(folder: Path, path: Path) -> int:
    """Make a staging folder, or take that of a dead process; returns the descriptor that holds its lock."""
    for left in reversed(range(TRIES)):
        folder.mkdir(exist_ok=True)
        try:
            lock = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT)
        except FileNotFoundError:  # whoever had it has just removed it
            continue
        if try_lock(lock) and holds(lock, folder / LOCK):
            _empty(folder)
            return lock
        os.close(lock)
        if left:
            time.sleep(BETWEEN_S)
    raise InputError(
        "Another run of Rockfall is writing here",
        file=path,
        advice="Wait until it has ended, or choose another folder for the output",
    )


def _release(folder: Path, lock: int) -> None:
    _empty(folder)
    if os.name == "nt":  # where an open file cannot be removed
        os.close(lock)
    with suppress(OSError):
        (folder / LOCK).unlink()
        folder.rmdir()
    if os.name != "nt":
        os.close(lock)


def _remove_stale(place: Path) -> None:
    """Remove what dead processes have left in a folder."""
    for folder in place.glob(f".*{PART}"):
        with suppress(OSError):
            folder.rmdir()  # a process that died before it had its lock
        with suppress(OSError):
            lock = os.open(folder / LOCK, os.O_RDWR)
            if try_lock(lock) and holds(lock, folder / LOCK):
                _release(folder, lock)
            else:
                os.close(lock)


def _empty(folder: Path) -> None:
    for one in folder.iterdir():
        if one.is_dir() and not one.is_symlink():
            shutil.rmtree(one, ignore_errors=True)
        elif one.name != LOCK:
            with suppress(OSError):
                one.unlink()


def _sync(file: Path) -> None:
    """Wait until a file is on the disk: some disks say only then that they are full or damaged."""
    with file.open("r+b") as stream:
        os.fsync(stream.fileno())


def _move(draft: Path, files: list[Path], path: Path) -> None:
    """Move all files; what could refuse is tried first."""
    if not path.exists():
        draft.rename(path)
        return
    targets = [path / file.relative_to(draft) for file in files]
    for target in targets:
        if target.is_dir():
            raise InputError("A folder is where a file should be written", file=target, advice="Rename or move it")
    for file, target in zip(files, targets, strict=True):
        target.parent.mkdir(parents=True, exist_ok=True)
        file.replace(target)


@contextmanager
def _told(draft: Path, place: Path) -> Iterator[None]:
    """What stands in the way of a file, as an error that names it; not what befalls another one meanwhile."""
    try:
        yield
    except OSError as error:
        if error.filename is not None and not str(error.filename).startswith((str(draft), str(place))):
            raise
        raise _refusal("The file cannot be written", error, place) from error


def _refusal(problem: str, error: OSError, place: Path) -> InputError:
    advice = MAKE_ROOM if error.errno in FULL else OTHER_DISK if error.errno == EIO else OTHER_FOLDER
    return InputError(f"{problem} ({error.strerror})", file=place, advice=advice)


def final_path(path: Path) -> Path:
    """Where a staged file will be; any other path as it is."""
    for folder in (path, *path.parents):
        if folder.name.startswith(".") and folder.name.endswith(PART) and (folder / LOCK).exists():
            return folder.parent / path.relative_to(folder)
    return path


def _remove_empty(folders: list[Path]) -> None:
    for folder in folders:
        try:
            folder.rmdir()
        except OSError:
            return

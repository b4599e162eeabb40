# SPDX-License-Identifier: GPL-3.0-or-later
"""Output that is whole or not there: files are staged, and moved into place only when all is written.

Every writer goes through here. A staging folder ``.NAME.part`` stands on the disk of what is written, and in it a file
says that it is ours, and is locked while somebody is at work; else its process has died, and whoever writes next beside
it removes it. A folder of that name without this file, of another user, or a link is never touched.

Links: the output, or a folder above it, may be one. Inside of the output none is followed and none replaced.
"""

import os
import stat
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from contextvars import ContextVar
from errno import EDQUOT, EFBIG, EIO, ELOOP, ENOSPC, ENOTDIR
from pathlib import Path
from typing import IO, Any

from .errors import InputError
from .file_locks import try_lock
from .interrupts import uninterrupted
from .open_folders import OpenFolder, is_folder, is_own, may_be_planted, opened

FULL = (ENOSPC, EDQUOT, EFBIG)
"""Errors of a file that is being written when there is no more room; they do not name it."""
MAKE_ROOM, OTHER_DISK = "Make room, or choose a folder on another disk", "Check the disk, or choose another one"
OTHER_FOLDER = "Choose another folder for the output"
PART, LOCK = ".part", "rockfall.lock"
OURS = b"Rockfall is writing here.\n"
"""What a lock says."""
WAIT_UNTIL_WRITTEN: int = getattr(os, "O_DSYNC", 0)
"""A lock is on the disk with its words, so that what a power cut leaves can still be told to be ours."""
PARTS = ("figures", "maps")
"""Folders in most outputs: links in their place are refused before any work."""
complete: ContextVar[list[Path] | None] = ContextVar("complete", default=None)
"""The folders that are written, where somebody wants to know them."""
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
    _refuse_links(path)
    _refuse_file(path)
    with made_folder(path.parent, path), _staging(path) as (place, staging):
        is_new = staging.path.parent != path
        draft = staging.path / path.name if is_new else staging.path
        try:
            if is_new:
                staging.make_folder(path.name)
            yield draft
            for file in sorted(draft.rglob("*")):
                if file.is_file() and file != staging.path / LOCK:
                    with _told(file, final_path(file)):
                        _sync(file)
            with uninterrupted(f"{path} is complete"):
                if is_new:
                    _move_folder(staging, place, path)
                else:
                    _move_files(staging, place)
                if (written := complete.get()) is not None:
                    written.append(path)
        except OSError as error:
            in_the_way = error.filename is not None and str(error.filename).startswith((str(draft), str(path)))
            if not in_the_way and error.errno not in FULL:
                raise
            where = path if error.filename is None else final_path(Path(error.filename))
            raise _refusal("The output cannot be written", error, where) from error


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


def _refuse_links(path: Path) -> None:
    """Links that lead nowhere, that another user may have put there, and those in the place of a usual part."""
    if path.is_symlink() and not path.exists():
        raise InputError("This is a link that leads nowhere", file=path, advice=f"Remove it. {OTHER_FOLDER}")
    for folder in (path, *path.parents):
        if may_be_planted(folder):
            raise InputError(
                "This is a link of another user, in a folder that others write to", file=folder, advice=OTHER_FOLDER
            )
    for name in PARTS:
        if path.is_dir() and (path / name).is_symlink():
            raise _link_refused(path / name)


def _link_refused(path: Path) -> InputError:
    return InputError(
        "A link is in the output, and what is written there would lie elsewhere",
        file=path,
        advice="Remove or rename the link, or give the folder that it leads to as --out",
    )


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
    if may_be_planted(path):
        raise InputError("This is a link of another user, in a folder that others write to", file=path)
    path = Path(os.path.realpath(path))
    if path.is_dir():
        raise InputError("A folder is where a file should be written", file=path, advice="Rename or move it")
    with _staging(path) as (folder, staging), _told(staging.path, place):
        draft = staging.path / path.name
        yield draft
        _sync(draft)
        with uninterrupted(f"{path} is complete"):
            staging.move(path.name, folder, path.name)


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
def _staging(path: Path) -> Iterator[tuple[OpenFolder, OpenFolder]]:
    """The folder beside or in which `path` is written, and in it one of this process alone, removed at the end."""
    name = f".{path.name}{PART}"
    with ExitStack() as held:
        try:
            place = held.enter_context(opened(path if path.is_dir() else path.parent))
            _remove_stale(place)
            staging = _claim(place, name, path, held)
        except OSError as error:
            raise _refusal("The output cannot be written there", error, path) from error
        yield place, staging


def _claim(place: OpenFolder, name: str, path: Path, held: ExitStack) -> OpenFolder:
    """Make a staging folder, or take that of a dead process; the end of `held` removes it.

    Raises
    ------
    InputError : another run is at work, or what is there is not ours.
    """
    is_ours = False
    for left in reversed(range(TRIES)):
        try:
            with uninterrupted(), ExitStack() as trying:
                is_new = _made(place, name)
                folder = trying.enter_context(place.opened(name))
                lock = _new_lock(place, name, folder) if is_new else _lock_of(folder)
                is_ours = lock is not None
                if lock is not None:
                    if is_new or _taken(place, name, folder, lock):
                        held.push(trying.pop_all())
                        held.callback(_release, place, name, folder, lock)
                        break
                    os.close(lock)
        except FileNotFoundError:  # whoever had it has just removed it
            is_ours = True
        except OSError as error:
            if error.errno not in (ENOTDIR, ELOOP):
                raise
        if left:
            time.sleep(BETWEEN_S)
    else:
        if is_ours:
            problem, advice = "Another run of Rockfall is writing here", "Wait until it has ended, or choose another"
            raise InputError(problem, file=path, advice=f"{advice} folder for the output")
        raise InputError(
            "Output is written under this name first, and what is there was not made by Rockfall, or by another user",
            file=place.path / name,
            advice="Rename it, remove it if nobody needs it, or choose another folder for the output",
        )
    if not is_new:
        folder.empty(LOCK)
    return folder


def _made(place: OpenFolder, name: str) -> bool:
    """Make a folder for this user alone; False where something has its name."""
    try:
        place.make_folder(name, 0o700)
    except FileExistsError:
        return False
    return True


def _new_lock(place: OpenFolder, name: str, folder: OpenFolder) -> int | None:
    """Lock a folder that this process has just made; None where it has been exchanged meanwhile."""
    if folder.names():
        return None
    lock = folder.open_file(LOCK, os.O_RDWR | os.O_CREAT | os.O_EXCL | WAIT_UNTIL_WRITTEN, 0o600)
    try:
        try_lock(lock)
        if os.write(lock, OURS) < len(OURS):
            raise OSError(ENOSPC, os.strerror(ENOSPC))
    except BaseException:
        os.close(lock)
        folder.remove_file(LOCK)
        place.remove_folder(name)
        raise
    return lock


def _lock_of(folder: OpenFolder) -> int | None:
    """The descriptor of the lock that says that a folder is ours; None for any other folder."""
    if not is_own(folder.own_state()):
        return None
    try:
        lock = folder.open_file(LOCK, os.O_RDWR | getattr(os, "O_NONBLOCK", 0))
    except OSError:
        return None
    state = os.fstat(lock)
    if stat.S_ISREG(state.st_mode) and state.st_nlink == 1 and is_own(state) and os.read(lock, 99) == OURS:
        return lock
    os.close(lock)
    return None


def _taken(place: OpenFolder, name: str, folder: OpenFolder, lock: int) -> bool:
    """Lock what a dead process has left: False while it is alive, or where it has been removed meanwhile."""
    return (
        try_lock(lock) and _is_in_place(folder, LOCK, os.fstat(lock)) and _is_in_place(place, name, folder.own_state())
    )


def _is_in_place(folder: OpenFolder, name: str, state: os.stat_result) -> bool:
    there = folder.state(name)
    return there is not None and os.path.samestat(there, state)


def _release(place: OpenFolder, name: str, folder: OpenFolder, lock: int) -> None:
    """Remove a staging folder; where the system does not let us, it stays with the lock that says that it is ours."""
    with uninterrupted(), suppress(OSError):
        folder.empty(LOCK)
        if folder.names() == [LOCK] and _is_in_place(place, name, folder.own_state()):
            if os.name == "nt":  # where an open file cannot be removed
                os.close(lock)
            folder.remove_file(LOCK)
            place.remove_folder(name)
    with suppress(OSError):
        os.close(lock)


def _remove_stale(place: OpenFolder) -> None:
    """Remove what dead processes of ours have left in a folder."""
    for name in place.names():
        if name.startswith(".") and name.endswith(PART):
            with suppress(OSError), place.opened(name) as folder:
                lock = _lock_of(folder)
                if lock is not None and _taken(place, name, folder, lock):
                    _release(place, name, folder, lock)
                elif lock is not None:
                    os.close(lock)


def _sync(file: Path) -> None:
    """Wait until a file is on the disk: some disks say only then that they are full or damaged."""
    with file.open("r+b") as stream:
        os.fsync(stream.fileno())


def _move_folder(staging: OpenFolder, place: OpenFolder, path: Path) -> None:
    """Move the folder of a new output, in one step; its files alone if somebody has made the output meanwhile."""
    state = place.state(path.name)
    if state is None:
        staging.move(path.name, place, path.name)
        return
    if not is_folder(state):
        raise InputError("Something else has been put where the output should be", file=path, advice=OTHER_FOLDER)
    with staging.opened(path.name) as draft, place.opened(path.name) as target:
        _move_files(draft, target)


def _move_files(draft: OpenFolder, target: OpenFolder) -> None:
    """Move all files; what could refuse is tried first."""
    for is_trial in (True, False):
        _move_each(draft, target, is_trial)


def _move_each(draft: OpenFolder, target: OpenFolder, is_trial: bool) -> None:
    for name in draft.names():
        state, there = draft.state(name), target.state(name)
        if name == LOCK or state is None:
            continue
        if there is None:
            if not is_trial:
                draft.move(name, target, name)
        elif stat.S_ISLNK(there.st_mode):
            raise _link_refused(target.path / name)
        elif is_folder(state) != is_folder(there):
            problem = "A file is where a folder" if is_folder(state) else "A folder is where a file"
            raise InputError(f"{problem} should be written", file=target.path / name, advice="Rename or move it")
        elif is_folder(state):
            with draft.opened(name) as inner, target.opened(name) as inside:
                _move_each(inner, inside, is_trial)
        elif not is_trial:
            draft.move(name, target, name)


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
        if folder.name.startswith(".") and folder.name.endswith(PART) and _says_ours(folder / LOCK):
            return folder.parent / path.relative_to(folder)
    return path


def _says_ours(lock: Path) -> bool:
    try:
        return not lock.is_symlink() and lock.is_file() and lock.read_bytes() == OURS
    except OSError:
        return False


def _remove_empty(folders: list[Path]) -> None:
    for folder in folders:
        try:
            folder.rmdir()
        except OSError:
            return

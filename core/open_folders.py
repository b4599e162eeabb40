# SPDX-License-Identifier: GPL-3.0-or-later
"""Folders that are held open: what is done in them follows no link, whatever others do with their path meanwhile.

Where the system has no such descriptors (Windows), the path is looked at before each step instead.
"""

import os
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from errno import ELOOP, ENOENT, ENOTDIR
from pathlib import Path

HELD = os.open in os.supports_dir_fd and os.scandir in os.supports_fd
"""Whether the system opens folders."""
NO_LINK: int = getattr(os, "O_NOFOLLOW", 0)
FOLDER: int = os.O_RDONLY | getattr(os, "O_DIRECTORY", 0)
BINARY: int = getattr(os, "O_BINARY", 0)
"""Of Windows, where a file is text otherwise."""


class OpenFolder:
    """A folder; made by `opened` and `OpenFolder.opened`.

    Attributes
    ----------
    path : as it was opened, for messages and for libraries that write by path.
    """

    def __init__(self, path: Path, descriptor: int | None) -> None:
        self.path, self._descriptor = path, descriptor

    @contextmanager
    def opened(self, name: str) -> Iterator["OpenFolder"]:
        """A folder in this one.

        Raises
        ------
        OSError : there is none; ENOTDIR or ELOOP where it is a link or a file.
        """
        if self._descriptor is None:
            state = self.state(name)
            if state is None:
                raise FileNotFoundError(ENOENT, os.strerror(ENOENT), str(self.path / name))
            if not is_folder(state):
                raise NotADirectoryError(ENOTDIR, os.strerror(ENOTDIR), str(self.path / name))
            yield OpenFolder(self.path / name, None)
            return
        descriptor = os.open(name, FOLDER | NO_LINK, dir_fd=self._descriptor)
        try:
            yield OpenFolder(self.path / name, descriptor)
        finally:
            os.close(descriptor)

    def state(self, name: str) -> os.stat_result | None:
        """Of what has a name here, of a link itself; None where there is nothing."""
        try:
            return os.stat(self._at(name), dir_fd=self._descriptor, follow_symlinks=False)
        except FileNotFoundError:
            return None

    def own_state(self) -> os.stat_result:
        """Of the folder itself."""
        return os.stat(self.path if self._descriptor is None else self._descriptor)

    def names(self) -> list[str]:
        """Of all that is in it, in order."""
        return sorted(os.listdir(self.path if self._descriptor is None else self._descriptor))

    def open_file(self, name: str, flags: int, mode: int = 0o666) -> int:
        """The descriptor of a file, never through a link."""
        if self._descriptor is None and (state := self.state(name)) is not None and not stat.S_ISREG(state.st_mode):
            raise OSError(ELOOP, os.strerror(ELOOP), str(self.path / name))
        return os.open(self._at(name), flags | NO_LINK | BINARY, mode, dir_fd=self._descriptor)

    def make_folder(self, name: str, mode: int = 0o777) -> None:
        """Make a folder; an error where there is anything of that name."""
        os.mkdir(self._at(name), mode, dir_fd=self._descriptor)

    def move(self, name: str, other: "OpenFolder", new_name: str) -> None:
        """Move a file or a folder into another folder, in one step, in place of a file of that name."""
        os.replace(self._at(name), other._at(new_name), src_dir_fd=self._descriptor, dst_dir_fd=other._descriptor)

    def remove_file(self, name: str) -> None:
        """Remove a file, or a link and not what it leads to."""
        os.unlink(self._at(name), dir_fd=self._descriptor)

    def remove_folder(self, name: str) -> None:
        """Remove a folder that is empty."""
        os.rmdir(self._at(name), dir_fd=self._descriptor)

    def empty(self, besides: str = "") -> None:
        """Remove all that is in it, as far as the system lets us, but for one name."""
        for name in self.names():
            state = self.state(name)
            if name == besides or state is None:
                continue
            if is_folder(state):
                shutil.rmtree(self._at(name), ignore_errors=True, dir_fd=self._descriptor)
            else:
                with suppress(OSError):
                    self.remove_file(name)

    def _at(self, name: str) -> str:
        return name if self._descriptor is not None else str(self.path / name)


@contextmanager
def opened(path: Path) -> Iterator[OpenFolder]:
    """A folder that somebody has named, which may be a link.

    Raises
    ------
    OSError : there is none.
    """
    if not HELD:
        yield OpenFolder(path, None)
        return
    descriptor = os.open(path, FOLDER)
    try:
        yield OpenFolder(path, descriptor)
    finally:
        os.close(descriptor)


def is_folder(state: os.stat_result) -> bool:
    """Whether what was looked at is a folder itself, no link or junction to one."""
    junction = getattr(state, "st_reparse_tag", 0) == getattr(stat, "IO_REPARSE_TAG_MOUNT_POINT", -1)
    return stat.S_ISDIR(state.st_mode) and not junction


def is_own(state: os.stat_result) -> bool:
    """Whether it belongs to the user of this process; on Windows, where nobody asks, it does."""
    return not hasattr(os, "geteuid") or state.st_uid == os.geteuid()


def may_be_planted(path: Path) -> bool:
    """Whether a link is where others may put one, and of somebody else than us, the system and the folder's owner."""
    if not hasattr(os, "geteuid"):
        return False
    with suppress(OSError):
        link, folder = path.lstat(), path.parent.stat()
        foreign = link.st_uid not in (os.geteuid(), 0, folder.st_uid)
        return stat.S_ISLNK(link.st_mode) and foreign and bool(folder.st_mode & (stat.S_IWGRP | stat.S_IWOTH))
    return False

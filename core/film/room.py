# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender says when a disk is full is often of something else, or nothing: the room there is seen to instead."""

from collections.abc import Iterator
from contextlib import contextmanager
from math import inf
from pathlib import Path
from shutil import disk_usage

from ..errors import InputError, RockfallError
from ..output import MAKE_ROOM, final_path
from ..progress import Progress

FULL_BYTES = 1_000_000
"""With less room than this a disk is full: Blender writes in larger pieces."""


@contextmanager
def watched_room(folder: Path, names: str, progress: Progress) -> Iterator[Progress]:
    """Progress to be told while Blender writes files into a folder: what fails while its disk is full, is said to.

    names : of the files, for the message.

    Raises
    ------
    InputError : in place of a `RockfallError` of the block, if there was no more room at any time.
    """
    least = _free_bytes(folder)

    def watched(text: str, done: int, total: int) -> None:
        nonlocal least
        least = min(least, _free_bytes(folder))
        progress(text, done, total)

    try:
        yield watched
    except RockfallError as error:
        if min(least, _free_bytes(folder)) >= FULL_BYTES:
            raise
        place = final_path(folder.absolute())
        raise InputError(f"The disk is full: {names} cannot be written", file=place, advice=MAKE_ROOM) from error


def _free_bytes(folder: Path) -> float:
    """On the disk of a folder that may not be there yet; infinite where a system does not say."""
    there = next(one for one in (folder.absolute(), *folder.absolute().parents) if one.exists())
    try:
        return disk_usage(there).free
    except OSError:
        return inf

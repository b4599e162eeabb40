# SPDX-License-Identifier: GPL-3.0-or-later
"""The frames of a film as pictures in a folder, which a render that was ended goes on with.

A frame is there as a whole or not at all. The folder says of what it is; frames of anything else are removed.
"""

import json
import os
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from signal import SIGINT

from ...errors import InputError
from ...file_locks import holds, try_lock
from ...interrupts import Interrupt
from ...opencv import opencv
from ...output import TRIES, made_folder, write_bytes, write_text
from ...progress import Progress
from .canvas import Picture

STATED = "film.json"
LOCK = ".lock"
FRAME = re.compile(r"[0-9]{6,}\.png")
LAST_BYTES = b"IEND\xaeB`\x82"
"""Of every PNG."""
COMPRESSION = 1
"""Of PNG: a film's frames are written once and read once."""


class FrameStore:
    """A folder of frames; made by `frame_store`.

    Attributes
    ----------
    folder : where they lie.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def file(self, frame: int) -> Path:
        """Of a frame."""
        return self.folder / f"{frame:06d}.png"

    def fill(self, frames: Sequence[int], draw: Callable[[int], Picture], progress: Progress) -> int:
        """Draw the frames that are missing, or of which a part is.

        Returns
        -------
        How many were there.

        Raises
        ------
        InputError : a frame cannot be written: the disk is full. Those that are finished stay.
        """
        missing = [frame for frame in frames if not _is_whole(self.file(frame))]
        there = len(frames) - len(missing)
        for done, frame in enumerate(missing, start=there + 1):
            _, data = opencv().imencode(".png", draw(frame), [opencv().IMWRITE_PNG_COMPRESSION, COMPRESSION])
            try:
                write_bytes(self.file(frame), data.tobytes())
            except InputError as error:
                kept = (
                    f"{done - 1} of {len(frames)} frames are finished and kept in {self.folder}: run it again to go on"
                )
                raise InputError(f"{error.problem}. {kept}", file=error.file, advice=error.advice) from error
            progress("Drawing frames", done, len(frames))
        return there

    def remove(self) -> None:
        """Remove the frames and the folder."""
        _remove_frames(self.folder)
        (self.folder / STATED).unlink(missing_ok=True)
        with suppress(OSError):
            (self.folder / LOCK).unlink()
            self.folder.rmdir()


def _is_whole(file: Path) -> bool:
    """Whether a picture is there up to its last bytes: after a power cut it may not be."""
    try:
        with file.open("rb") as picture:
            picture.seek(-len(LAST_BYTES), os.SEEK_END)
            return picture.read() == LAST_BYTES
    except OSError:  # not there, or shorter
        return False


@contextmanager
def frame_store(folder: Path, states: dict[str, object]) -> Iterator[FrameStore]:
    """The frames of a film in a folder, for this process alone.

    Parameters
    ----------
    states : all that decides the frames.

    Raises
    ------
    InputError : the folder cannot be made or holds other things, or another process is drawing into it.
    KeyboardInterrupt : with a message that says so where frames are finished.
    """
    with made_folder(folder):
        lock = _claim(folder)
        try:
            _prepare(folder, json.dumps(states, indent=2, sort_keys=True))
            yield FrameStore(folder)
        except KeyboardInterrupt as error:
            kept = sum(_is_whole(file) for file in folder.iterdir() if _is_frame(file))
            if error.args or not kept:
                raise
            said = f"{kept} frames are finished and kept in {folder}; the same command goes on with the others"
            raise Interrupt(error.number if isinstance(error, Interrupt) else SIGINT, said) from error
        finally:
            with suppress(OSError):
                if not (folder / STATED).exists():  # it is no folder of frames, and nothing could be written
                    (folder / LOCK).unlink()
            os.close(lock)


def _claim(folder: Path) -> int:
    """The descriptor that holds a folder's lock, which a run that ends meanwhile removes with the folder."""
    for _ in range(TRIES):
        try:
            folder.mkdir(parents=True, exist_ok=True)
            lock = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT)
        except FileNotFoundError:
            continue
        except OSError as error:
            raise InputError(
                f"The frames cannot be written ({error.strerror})",
                file=folder,
                advice="Choose another folder with --out",
            ) from error
        if not try_lock(lock):
            os.close(lock)
            break
        if holds(lock, folder / LOCK):
            return lock
        os.close(lock)
    raise InputError("Another run of Rockfall is drawing these frames", file=folder, advice="Wait until it has ended")


def _prepare(folder: Path, states: str) -> None:
    stated = folder / STATED
    strangers = [file.name for file in folder.iterdir() if not (file.name in (STATED, LOCK) or _is_frame(file))]
    if strangers and not stated.is_file():
        raise InputError(
            f"The folder for the frames holds other files ({strangers[0]})",
            file=folder,
            advice="Choose another folder with --out",
        )
    try:
        same = stated.read_text(encoding="utf-8") == states
    except (OSError, UnicodeDecodeError):
        same = False
    if not same:
        _remove_frames(folder)
        write_text(stated, states)


def _is_frame(file: Path) -> bool:
    """By its name, as `FrameStore.file` gives them: what somebody put beside them is none."""
    return FRAME.fullmatch(file.name) is not None


def _remove_frames(folder: Path) -> None:
    for file in folder.iterdir():
        if _is_frame(file):
            file.unlink()

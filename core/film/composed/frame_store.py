# SPDX-License-Identifier: GPL-3.0-or-later
"""The frames of a film as pictures in a folder, which a render that was ended goes on with.

A frame is there as a whole or not at all, and says of which film and of which number it is, with a digest of itself:
one that differs is drawn again. The folder says of what it is; our frames of anything else are removed, and nobody
else's.
"""

import hashlib
import json
import os
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from signal import SIGINT
from zlib import crc32

from ...errors import InputError, readable
from ...file_locks import holds, try_lock
from ...interrupts import Interrupt
from ...open_folders import NO_LINK
from ...opencv import opencv
from ...output import TRIES, made_folder, write_bytes, write_text
from ...progress import Progress
from .canvas import Picture

STATED = "film.json"
LOCK = ".lock"
FRAME = re.compile(r"[0-9]{6,}\.png")
ABOUT = "frames of a film, drawn by Rockfall"
"""Key of what `STATED` holds."""
HEAD_BYTES = 33
"""Of a PNG, before its first chunk that may be a text."""
MARK = b"tEXtRockfall frame\0"
MARK_BYTES = 8 + len(MARK) - 4 + 64 + 4
MOST_SAID = 3
COMPRESSION = 1
"""Of PNG: a film's frames are written once and read once."""


class FrameStore:
    """A folder of frames; made by `frame_store`.

    Attributes
    ----------
    folder : where they lie.
    differing : frames that were there and not as they had been drawn; they are drawn again.
    """

    def __init__(self, folder: Path, film: str) -> None:
        self.folder, self._film = folder, film
        self.differing: list[int] = []

    @property
    def remarks(self) -> list[str]:
        """What a user should know of the frames that were kept."""
        if not self.differing:
            return []
        some = ", ".join(self.file(frame).name for frame in self.differing[:MOST_SAID])
        more = " and others" if len(self.differing) > MOST_SAID else ""
        return [f"{len(self.differing)} kept frames were not as drawn, and drawn again: {some}{more}."]

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
        missing = [frame for frame in frames if not _is_whole(self.file(frame), self._film)]
        self.differing += [frame for frame in missing if self.file(frame).exists()]
        there = len(frames) - len(missing)
        for done, frame in enumerate(missing, start=there + 1):
            _, data = opencv().imencode(".png", draw(frame), [opencv().IMWRITE_PNG_COMPRESSION, COMPRESSION])
            try:
                write_bytes(self.file(frame), _marked(data.tobytes(), self._film, frame))
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


def _digest(data: bytes, film: str, frame: int) -> bytes:
    return hashlib.sha256(f"{film} {frame} ".encode() + data).hexdigest().encode()


def _marked(data: bytes, film: str, frame: int) -> bytes:
    """A picture (PNG) that says what it is."""
    body = MARK + _digest(data, film, frame)
    chunk = (len(body) - 4).to_bytes(4, "big") + body + crc32(body).to_bytes(4, "big")
    return data[:HEAD_BYTES] + chunk + data[HEAD_BYTES:]


def _is_whole(file: Path, film: str) -> bool:
    """Whether a picture is that frame of the film, to its last byte: after a power cut it may not be."""
    try:
        data = file.read_bytes()
    except OSError:
        return False
    return data == _marked(data[:HEAD_BYTES] + data[HEAD_BYTES + MARK_BYTES :], film, int(file.stem))


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
            stated = json.dumps({ABOUT: states}, indent=2, sort_keys=True)
            film = hashlib.sha256(stated.encode()).hexdigest()
            _prepare(folder, stated)
            yield FrameStore(folder, film)
        except KeyboardInterrupt as error:
            kept = sum(_is_whole(file, film) for file in folder.iterdir() if _is_frame(file))
            if error.args or not kept:
                raise
            said = f"{kept} frames are finished and kept in {folder}; the same command goes on with the others"
            raise Interrupt(error.number if isinstance(error, Interrupt) else SIGINT, said) from error
        finally:
            with suppress(OSError):
                if not _is_ours(folder / STATED):  # it is no folder of frames, and nothing could be written
                    (folder / LOCK).unlink()
            os.close(lock)


def _claim(folder: Path) -> int:
    """The descriptor that holds a folder's lock, which a run that ends meanwhile removes with the folder."""
    for _ in range(TRIES):
        try:
            folder.mkdir(parents=True, exist_ok=True)
            lock = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT | NO_LINK)
        except FileNotFoundError:
            continue
        except OSError as error:
            raise InputError(
                f"The frames cannot be written ({error.strerror})",
                file=folder,
                advice="Choose another folder with --out",
            ) from error
        if os.fstat(lock).st_size:
            os.close(lock)
            raise _strange(folder, LOCK)
        if not try_lock(lock):
            os.close(lock)
            break
        if holds(lock, folder / LOCK):
            return lock
        os.close(lock)
    raise InputError("Another run of Rockfall is drawing these frames", file=folder, advice="Wait until it has ended")


def _prepare(folder: Path, states: str) -> None:
    stated = folder / STATED
    is_ours = _is_ours(stated)
    for file in sorted(folder.iterdir()):
        is_known = file.name == LOCK or (is_ours and file.name == STATED) or (_is_frame(file) and _may_go(file))
        if not is_known and (not is_ours or FRAME.fullmatch(file.name)):
            raise _strange(folder, file.name)
    if not is_ours or stated.read_text(encoding="utf-8") != states:
        _remove_frames(folder)
        write_text(stated, states)


def _strange(folder: Path, name: str) -> InputError:
    return InputError(
        f"The folder for the frames holds other files ({readable(name, 60)})",
        file=folder,
        advice="Move them, or choose another folder with --out",
    )


def _is_ours(stated: Path) -> bool:
    """Whether a folder says that it is one of frames."""
    try:
        return not stated.is_symlink() and list(json.loads(stated.read_text(encoding="utf-8"))) == [ABOUT]
    except (OSError, ValueError, TypeError, RecursionError):
        return False


def _is_frame(file: Path) -> bool:
    """By its name, as `FrameStore.file` gives them: what somebody put beside them is none."""
    return FRAME.fullmatch(file.name) is not None


def _may_go(file: Path) -> bool:
    """Whether a picture is one that was drawn here, of whatever film, or begun and is empty."""
    if file.is_symlink() or not file.is_file():
        return False
    with file.open("rb") as picture:
        head = picture.read(HEAD_BYTES + 4 + len(MARK))
    return not head or head[HEAD_BYTES + 4 :] == MARK


def _remove_frames(folder: Path) -> None:
    for file in folder.iterdir():
        if _is_frame(file) and _may_go(file):
            file.unlink()

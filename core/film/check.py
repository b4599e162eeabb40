# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether what Blender has written is whole: on a full disk it writes half a film and says nothing."""

import shutil
from errno import ENOSPC
from os import strerror
from pathlib import Path

from ..errors import RockfallError
from ..opencv import quiet_opencv
from ..progress import Progress, silent

LITTLE_BYTES = 1 << 20
"""So little room on a disk is the likely reason."""
PNG_END = b"\0\0\0\0IEND\xaeB`\x82"


def check_film(path: Path, frames: int, size: tuple[int, int], progress: Progress = silent) -> None:
    """Decode a film to its last frame.

    Parameters
    ----------
    frames, size : how many it should have, and their width and height.

    Raises
    ------
    RockfallError : it is not there, cannot be decoded, or is another one.
    """
    _check_there(path)
    with quiet_opencv() as cv2:
        film = cv2.VideoCapture(str(path))
        try:
            count, found = 0, size
            while True:
                is_there, picture = film.read()
                if not is_there:
                    break
                count, found = count + 1, (picture.shape[1], picture.shape[0])
                if found != size:
                    break
                progress("Checking the film", min(count, frames), frames)
        finally:
            film.release()
    if found != size:
        raise _damaged(path, f"its frames have {found[0]} × {found[1]} pixels instead of {size[0]} × {size[1]}")
    if count != frames:
        raise _damaged(path, f"{count} of its {frames} frames can be read")


def check_index(path: Path, frames: int, size: tuple[int, int]) -> None:
    """Compare what a film says of itself, where only Blender can decode it (AV1).

    Raises
    ------
    RockfallError : it is not there, or says something else.
    """
    _check_there(path)
    with quiet_opencv() as cv2:
        film = cv2.VideoCapture(str(path))
        try:
            count = round(film.get(cv2.CAP_PROP_FRAME_COUNT))
            found = (round(film.get(cv2.CAP_PROP_FRAME_WIDTH)), round(film.get(cv2.CAP_PROP_FRAME_HEIGHT)))
        finally:
            film.release()
    if (count, found) != (frames, size):
        raise _damaged(path, f"it says that it has {count} frames of {found[0]} × {found[1]} pixels")


def check_picture(path: Path, size: tuple[int, int]) -> None:
    """Decode a PNG.

    Raises
    ------
    RockfallError : it is not there, ends early, cannot be decoded, or has another width and height.
    """
    import numpy as np

    _check_there(path)
    data = path.read_bytes()
    if not data.endswith(PNG_END):
        raise _damaged(path, "it ends too early")
    with quiet_opencv() as cv2:
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    if picture is None or (picture.shape[1], picture.shape[0]) != size:
        raise _damaged(path, "it cannot be read")


def _check_there(path: Path) -> None:
    if not path.is_file() or not path.stat().st_size:
        raise _damaged(path, "nothing was written")


def _damaged(path: Path, found: str) -> RockfallError:
    full = path.parent.is_dir() and shutil.disk_usage(path.parent).free < LITTLE_BYTES
    reason = f"{strerror(ENOSPC)}. Make room, or choose a folder on another disk" if full else "Render it again"
    return RockfallError(f"Blender has not made {path.name} as it should be: {found}. {reason}.")

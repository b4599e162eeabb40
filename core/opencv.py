# SPDX-License-Identifier: GPL-3.0-or-later
"""OpenCV, imported when it is first needed: it takes a moment, and half of Rockfall does without it."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from .errors import InputError
from .output import write_bytes

FFMPEG_QUIET = "-8"


@cache
def opencv() -> Any:
    """The module; what FFmpeg would print about a damaged file is told by our own messages."""
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", FFMPEG_QUIET)
    import cv2

    return cv2


@contextmanager
def quiet_opencv() -> Iterator[Any]:
    """The module, which prints nothing meanwhile: our own messages say what is wrong with a file."""
    cv2 = opencv()
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        yield cv2
    finally:
        cv2.utils.logging.setLogLevel(level)


def write_picture(path: Path, picture: np.ndarray) -> None:
    """Write a picture, (h, w, 3) BGR or (h, w) uint8, in the format of the file's name.

    Raises
    ------
    InputError : there is no such format, or the file cannot be written.
    """
    with quiet_opencv() as cv2:
        try:
            _, data = cv2.imencode(path.suffix, picture)
        except cv2.error as error:
            raise InputError("This is no name of a picture", file=path, advice="Write it as .png") from error
    write_bytes(path, data.tobytes())

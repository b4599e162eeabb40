# SPDX-License-Identifier: GPL-3.0-or-later
"""OpenCV, imported when it is first needed: it takes a moment, and half of Rockfall does without it."""

import os
from typing import Any

FFMPEG_QUIET = "-8"


def opencv() -> Any:
    """The module; what FFmpeg would print about a damaged file is told by our own messages."""
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", FFMPEG_QUIET)
    import cv2

    return cv2

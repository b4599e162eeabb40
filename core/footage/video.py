# SPDX-License-Identifier: GPL-3.0-or-later
"""What a video file really contains: its frames, each with its own timestamp, and the pictures themselves."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..vectors import Array


@dataclass(frozen=True, eq=False)
class Video:
    """A video of f frames.

    Attributes
    ----------
    path : the file.
    width, height : as displayed, after the rotation [px].
    rotation_deg : clockwise turn that the file asks for: 0, 90, 180, 270.
    codec, container : readable names.
    header_rate_hz, header_frames : what the file announces; not to be trusted.
    time_s : (f,) timestamps of the frames, ascending [s].
    keyframe_s : (k,) timestamps of the frames from which decoding can start [s].
    """

    path: Path
    width: int
    height: int
    rotation_deg: int
    codec: str
    container: str
    header_rate_hz: float
    header_frames: int
    time_s: Array
    keyframe_s: Array

    @property
    def step_s(self) -> Array:
        """(f − 1,) from each frame to the next [s]."""
        return np.diff(self.time_s)

    @property
    def duration_s(self) -> float:
        """From the first frame to the end of the last [s]."""
        return float(self.time_s[-1] - self.time_s[0] + (np.median(self.step_s) if self.time_s.size > 1 else 0.0))

    @property
    def mean_rate_hz(self) -> float:
        """Frames per second of video time, NaN for a single frame."""
        span = float(self.time_s[-1] - self.time_s[0])
        return (self.time_s.size - 1) / span if span > 0 else np.nan


SAME_TIME_S = 1e-5


def open_video(path: str | Path, progress: Callable[[str], None] | None = None) -> Video:
    """Look at every frame of a video file.

    Raises
    ------
    InputError : a file that is missing or has no video that can be decoded.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError("There is no such file", file=path)
    if progress:
        progress(f"Reading the timestamps of {path.name}")
    capture = _capture(path)
    times, keys, shape = [], [], None
    while capture.grab():
        shape = capture.retrieve()[1].shape if shape is None else shape
        times.append(capture.get(0) / 1000)
        if capture.get(_cv2().CAP_PROP_LRF_HAS_KEY_FRAME):
            keys.append(times[-1])
    if not times:
        raise InputError("No frame of this file can be decoded", file=path)
    cv2 = _cv2()
    code = int(capture.get(cv2.CAP_PROP_FOURCC))
    return Video(
        path=path,
        width=int(capture.get(cv2.CAP_PROP_FRAME_WIDTH)) if shape is None else shape[1],
        height=int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT)) if shape is None else shape[0],
        rotation_deg=int(capture.get(cv2.CAP_PROP_ORIENTATION_META)) % 360,
        codec=code.to_bytes(4, "little").decode("latin-1"),
        container=path.suffix[1:].upper(),
        header_rate_hz=float(capture.get(cv2.CAP_PROP_FPS)),
        header_frames=int(capture.get(cv2.CAP_PROP_FRAME_COUNT)),
        time_s=np.array(times),
        keyframe_s=np.array(keys),
    )


def frame_at(video: Video, time_s: float) -> int:
    """The frame on display at a video time: the last whose timestamp is not after it, 0 before the first."""
    return max(int(np.searchsorted(video.time_s, time_s + SAME_TIME_S, side="right")) - 1, 0)


def read_frames(
    video: Video, indices: Sequence[int] | None = None, *, grey: bool = False
) -> Iterator[tuple[int, np.ndarray]]:
    """Pictures of the frames `indices` (ascending; all when None): index, (h, w, 3) BGR or (h, w) uint8."""
    cv2 = _cv2()
    wanted = range(video.time_s.size) if indices is None else indices
    capture, position = _capture(video.path), -1
    for index in wanted:
        while position < index:
            if not capture.grab():
                raise InputError(f"Frame {index} cannot be decoded", file=video.path)
            position += 1
        picture = capture.retrieve()[1]
        yield int(index), cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY) if grey else picture


def read_frame(video: Video, index: int, *, grey: bool = False) -> np.ndarray:
    """The picture of one frame, (h, w, 3) BGR or (h, w) uint8."""
    return next(picture for _, picture in read_frames(video, [index], grey=grey))


def _cv2() -> Any:
    import os

    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    import cv2

    return cv2


def _capture(path: Path) -> Any:
    cv2 = _cv2()
    capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    if not capture.isOpened():
        raise InputError("This file has no video that can be decoded", file=path)
    return capture

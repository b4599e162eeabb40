# SPDX-License-Identifier: GPL-3.0-or-later
"""The footage in a composed film: the frame that was on display at a moment of the fall, and its camera."""

from collections.abc import Iterator

import numpy as np

from ...camera.model import Camera
from ...camera.path import CameraPath, camera_at
from ...footage.clock import Clock
from ...footage.video import Video, frame_at, read_frame, read_frames
from ...opencv import opencv
from .canvas import Picture

AHEAD = 12
"""So many frames are decoded one after the other rather than sought."""


class Footage:
    """A video with its camera and its clock, whose frames are asked for mostly in order.

    Attributes
    ----------
    name : of the video.
    video, path, clock : the frames, where the camera was at each, and how video time becomes that of the fall.
    """

    def __init__(self, name: str, video: Video, path: CameraPath, clock: Clock) -> None:
        self.name, self.video, self.path, self.clock = name, video, path, clock
        self._coming: Iterator[tuple[int, Picture]] = iter(())
        self._last = -1, np.empty((0, 0, 3), np.uint8)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [px]."""
        return self.video.width, self.video.height

    @property
    def span_s(self) -> tuple[float, float]:
        """Moments of its first and its last frame [s of the fall]."""
        ends = self.clock.to_common(self.video.time_s[[0, -1]])
        return float(ends[0]), float(ends[1])

    def frame(self, moment_s: float) -> int:
        """The frame on display at a moment of the fall."""
        return min(frame_at(self.video, float(self.clock.to_video(moment_s))), self.video.frames - 1)

    def moment(self, frame: int) -> float:
        """When a frame was taken [s of the fall]."""
        return float(self.clock.to_common(float(self.video.time_s[frame])))

    def picture(self, frame: int) -> Picture:
        """A frame; not to be drawn on."""
        if frame == self._last[0]:
            return self._last[1]
        if not self._last[0] < frame <= self._last[0] + AHEAD:
            self._coming = read_frames(self.video, np.arange(frame, self.video.frames))
        for index, picture in self._coming:
            if index == frame:
                self._last = index, picture
                return picture
        return read_frame(self.video, frame)

    def camera(self, moment_s: float) -> Camera:
        """Where the camera was, and how it sees."""
        return camera_at(self.path, float(self.clock.to_video(moment_s)))


def warped(picture: Picture, matrix: np.ndarray, size: tuple[int, int]) -> Picture:
    """A picture, or a part of it, as it fills one of another size."""
    cv2 = opencv()
    shrinks = float(np.hypot(*matrix[:, 0])) < 0.6
    if shrinks:  # without aliasing
        scale = float(np.hypot(*matrix[:, 0]))
        small = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        ratio = small.shape[1] / picture.shape[1], small.shape[0] / picture.shape[0]
        inner = np.array([[matrix[0, 0] / ratio[0], 0.0, 0.0], [0.0, matrix[1, 1] / ratio[1], 0.0]])
        for i in range(2):
            corner = matrix[i, 2] - (matrix[i, i] - 1) / 2
            inner[i, 2] = corner + (inner[i, i] - 1) / 2
        made: Picture = cv2.warpAffine(small, inner, size, flags=cv2.INTER_LINEAR)
        return made
    return cv2.warpAffine(picture, matrix, size, flags=cv2.INTER_CUBIC)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Clocks: from a video's own timestamps to the time that all videos and picks share."""

from dataclasses import dataclass

from ..errors import InputError
from ..vectors import Array


@dataclass(frozen=True)
class Clock:
    """Common time = offset_s + (1 + drift) · rate · (video time − origin_s).

    Attributes
    ----------
    offset_s : common time at `origin_s` [s].
    drift : how much more common time passes than the video's clock says, relative (1e-5 = 36 ms per hour).
    origin_s : video time about which the drift turns [s].
    rate : file rate / capture rate: 1/8 for 240 pictures a second stored at 30.
    """

    offset_s: float = 0.0
    drift: float = 0.0
    origin_s: float = 0.0
    rate: float = 1.0

    def __post_init__(self) -> None:
        if not (self.rate > 0 and self.drift > -1):
            raise InputError(f"A clock with the rate {self.rate:g} and the drift {self.drift:g} does not run forwards")

    def to_common(self, video_s: Array | float) -> Array:
        """Common time [s] of video times [s]."""
        return self.offset_s + (1 + self.drift) * self.rate * (video_s - self.origin_s)  # type: ignore[return-value]

    def to_video(self, common_s: Array | float) -> Array:
        """Video time [s] of common times [s]."""
        return self.origin_s + (common_s - self.offset_s) / ((1 + self.drift) * self.rate)  # type: ignore[return-value]

# SPDX-License-Identifier: GPL-3.0-or-later
"""A block followed through a video from clicks, before a background whose motion is followed first."""

from collections.abc import Sequence
from typing import NamedTuple

from ..footage.advice import layered_background
from ..footage.background import BackgroundMotion, background_motion, no_motion
from ..footage.repeats import repeats_sentence
from ..footage.sources import kept, repeated_in
from ..footage.tracking import BlockTrack, track_block
from ..footage.video import Video
from ..progress import Progress, silent

type Click = tuple[int, float, float]
"""Frame, u, v [px]."""


class FollowedBlock(NamedTuple):
    """The block's track, the motion of the background before which it was found, and what a user should know of it.

    said : sentences, empty where there is nothing to say.
    """

    track: BlockTrack
    background: BackgroundMotion
    said: str


def follow_block(
    video: Video,
    clicks: Sequence[Click],
    first: int,
    last: int,
    *,
    still: bool = False,
    diameter_px: float | None = None,
    progress: Progress = silent,
) -> FollowedBlock:
    """Follow the block through the frames from first to last; both passes share the frames that are kept in memory.

    Parameters
    ----------
    clicks : on the block, at least one, ascending.
    still : the camera stands on a tripod; found out where it is not said.
    diameter_px : of the block; measured at the click when it is not given.

    Raises
    ------
    InputError : see `track_block`.
    """
    frame, u, v = clicks[0]
    source = kept(video, first, last, frame, diameter_px)
    if still:
        background = no_motion(first, last)
    else:
        background, _ = background_motion(source, first=first, last=last, progress=progress)
    repeated = repeated_in(source, first, last, progress)
    track = track_block(
        source,
        frame,
        (u, v),
        clicks=clicks[1:],
        diameter_px=diameter_px,
        background=background,
        first=first,
        last=last,
        repeated=repeated,
        progress=progress,
    )
    said = [
        layered_background(background, video.width),
        repeats_sentence(repeated, last - first + 1, video.rate_hz),
    ]
    return FollowedBlock(track, background, " ".join(text for text in said if text))

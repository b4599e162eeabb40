# SPDX-License-Identifier: GPL-3.0-or-later
"""Assisted tracking: from one click the block is followed through the video, until it is lost."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from ..errors import InputError
from ..progress import Progress, silent
from ..vectors import Array, Indices
from .background import BackgroundMotion, background_motion, reduced_motion, stabilise
from .plates import Plates
from .silhouette import outline_offsets
from .sources import SMALLEST, Kept, Source, kept, repeated_in
from .track_scatter import scatter_sigma
from .tracking_start import Footage, Start, start_at
from .tracking_steps import Row, follow

type Mark = tuple[int, tuple[float, float]]
"""A click: frame, and pixel (u, v)."""


@dataclass(frozen=True, eq=False)
class BlockTrack:
    """The block's centre in m frames.

    Attributes
    ----------
    frame : (m,) ascending; frames in which it is not seen are left out.
    time_s : (m,) video time [s].
    pixel : (m, 2) centre of the block, of the streak when it is blurred [px].
    sigma_px : (m,) standard deviation of each coordinate.
    score : (m,) likeness to the block: 1 for a perfect disc of its colour.
    stable : (m, 2) `pixel` in the reference frame of the background.
    diameter_px : (m,) fitted size.
    stopped : sentences: why the track begins where it does, and why it ends.
    repeated : (r,) frames that were looked at and show the picture of the one before; they are no positions.
    """

    frame: Indices
    time_s: Array
    pixel: Array
    sigma_px: Array
    score: Array
    stable: Array
    diameter_px: Array
    stopped: tuple[str, str]
    repeated: Indices = field(default_factory=lambda: np.empty(0, np.intp))


def track_block(
    video: Source,
    frame: int,
    pixel: Array | Sequence[float],
    *,
    clicks: Sequence[tuple[int, float, float]] = (),
    diameter_px: float | None = None,
    background: BackgroundMotion | None = None,
    first: int | None = None,
    last: int | None = None,
    repeated: Indices | None = None,
    progress: Progress = silent,
) -> BlockTrack:
    """Follow the block forwards and backwards from a click.

    Parameters
    ----------
    frame, pixel : the click, somewhere on the block.
    clicks : further ones (frame, u, v), which bring the track back to the block.
    diameter_px : of the block; measured at the click when it is not given.
    background : its motion; found when it is not given.
    first, last : frames beyond which is not looked.
    repeated : frames that show the picture of the one before, see `repeated_in`; found when not given.

    Raises
    ------
    InputError : a click outside the video, nothing that moves at a click, a background that cannot be followed.

    Notes
    -----
    The block is looked for where a motion of constant acceleration over the last frames puts it; where it is not
    there, around its last place, as an impact may have turned it. A sighting must look like the block: a disc or
    streak of its colour and size in front of the background. It is not looked for beyond a gap of a few frames.

    Where one side of the block is in the shade and looks like the ground, the side that shows is followed; the centre
    is then that of the outline, told by what the block hides on its way (`silhouette`).

    `sigma_px` tells the scatter from frame to frame. Where the block hardly moves before its ground, as at rest, the
    centre may still be off by a tenth of the diameter, the same in all frames, which `sigma_px` does not hold; times of
    impacts hardly feel it.
    """
    first, last = 0 if first is None else first, video.time_s.size - 1 if last is None else last
    marks = sorted({int(f): (float(u), float(v)) for f, u, v in [*clicks, (frame, *pixel)]}.items())
    _check(video, marks, first, last)
    source = kept(video, first, last, marks[0][0], diameter_px)
    motion = (
        background_motion(source, first=first, last=last, progress=progress)[0] if background is None else background
    )
    repeated = repeated_in(source, first, last, progress) if repeated is None else repeated
    footage, starts, scale = _begun(source, motion, marks, diameter_px, frozenset(repeated.tolist()), progress)
    backwards, before = follow(footage, starts[0], first, progress)
    rows = list(backwards[::-1])
    for start, other in pairwise(starts):
        there, _ = follow(footage, start, other.frame, progress)
        back, _ = follow(footage, other, start.frame, progress)
        rows += _joined(there, back[::-1])[1:]
    forwards, after = follow(footage, starts[-1], last, progress)
    return _assembled(motion, [*rows, *forwards[1:]], (before, after), footage.plates.spacing, scale, repeated)


def _begun(
    source: Source,
    motion: BackgroundMotion,
    marks: Sequence[Mark],
    diameter_px: float | None,
    repeated: frozenset[int],
    progress: Progress,
) -> tuple[Footage, list[Start], int]:
    """The footage in which the block is followed, what it is where it was clicked, and by how much both are reduced.

    Large pictures are reduced unless the block is too small for it.
    """

    def begun(pictures: Source, scale: int) -> tuple[Footage, list[Start], int]:
        moved = reduced_motion(motion, scale)
        footage = Footage(pictures, moved, Plates(pictures, moved, progress), repeated)
        size = None if diameter_px is None else diameter_px / scale
        return footage, [start_at(footage, at, np.array(place) / scale, size) for at, place in marks], scale

    if not isinstance(source, Kept) or source.scale == 1:
        return begun(source, 1)
    if diameter_px is None or diameter_px >= SMALLEST * source.scale:
        try:
            found = begun(source, source.scale)
        except InputError:
            pass  # perhaps it is seen in the whole picture; what that raises is told
        else:
            if min(start.looks.diameter_px for start in found[1]) >= SMALLEST:
                return found
            del found
    source.forget()
    return begun(Kept(source.video, int(motion.frames[0]), int(motion.frames[-1]), marks[0][0], whole=True), 1)


def _check(source: Source, marks: Sequence[Mark], first: int, last: int) -> None:
    video = source.video if isinstance(source, Kept) else source
    count = video.time_s.size
    if not 0 <= first <= last < count:
        raise InputError(f"Frames {first} to {last} are not in the video, which has the frames 0 to {count - 1}")
    for frame, (u, v) in marks:
        if not first <= frame <= last:
            raise InputError(
                f"The click in frame {frame} is outside the frames {first} to {last}",
                advice="Click in a frame that is looked at",
            )
        if not (0 <= u <= video.width and 0 <= v <= video.height):
            raise InputError(
                f"The click at ({u:g}, {v:g}) is outside the picture of {video.width} × {video.height} pixels",
                advice="Pixels count from the top left corner, u to the right and v down",
            )


def _joined(there: Sequence[Row], back: Sequence[Row]) -> list[Row]:
    """Rows from one click to the next: forwards while this leads there, backwards from the next where it does not."""
    near = {row.frame: row for row in back}
    shared = [row for row in there if row.frame in near]
    apart = [float(np.hypot(*(row.stable - near[row.frame].stable))) for row in shared]
    turn = shared[len(apart) - 1 - int(np.argmin(apart[::-1]))].frame if shared else there[-1].frame
    return [row for row in there if row.frame <= turn] + [row for row in back if row.frame > turn]


def _assembled(
    motion: BackgroundMotion,
    rows: Sequence[Row],
    stopped: tuple[str, str],
    spacing: float,
    scale: int,
    repeated: Indices,
) -> BlockTrack:
    """The track in whole pictures, of rows in reduced ones."""
    time_s, frame = np.array([row.time_s for row in rows]), np.array([row.frame for row in rows], dtype=np.intp)
    pixel, sigma, diameter, score = (
        np.array([getattr(row.seen, name) for row in rows]) for name in ("pixel", "sigma_px", "diameter_px", "score")
    )
    score = np.minimum(score, 1.0)
    stable, size = np.array([row.stable for row in rows]), np.array([row.scale_px for row in rows])
    offset, larger = outline_offsets([row.patch for row in rows], stable, size, spacing)
    pixel, diameter = pixel + offset, diameter * larger
    stable = stabilise(reduced_motion(motion, scale), frame, pixel)
    return BlockTrack(
        frame=frame,
        time_s=time_s,
        pixel=scale * pixel,
        sigma_px=scale * scatter_sigma(time_s, stable, sigma, diameter, score),
        score=score,
        stable=scale * stable,
        diameter_px=scale * diameter,
        repeated=repeated,
        stopped=stopped,
    )

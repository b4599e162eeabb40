# SPDX-License-Identifier: GPL-3.0-or-later
"""Aligning a camera: its lens and pose from the pairs of one frame, and the poses of other frames with enough pairs."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..camera.model import SIGMA_PX, Camera
from ..camera.pairs import Pairs
from ..camera.resection.problem import POSE_PAIRS
from ..camera.resection.resect import POSE, Resection, resect
from ..errors import InputError, RockfallError
from ..remarks import Remark
from ..vectors import Array, Indices, Mask
from .misread_pairs import check_reading


@dataclass(frozen=True, eq=False)
class AlignmentOptions:
    """How a camera is aligned.

    Attributes
    ----------
    size : width and height of the image [px].
    free : what is to be found of the lens, as for `resect`.
    start : what is known of the camera, and where to begin; None when nothing is.
    moves : the camera moves, so that each frame has its own pose.
    frame : the reference frame, which gives the lens; None for that with most pairs.
    robust : leave out pairs that do not fit the others.
    sigma_px, sigma_m : standard deviations of the coordinates of pairs that have none of their own.
    """

    size: tuple[int, int]
    free: tuple[str, ...] = ("f",)
    start: Camera | None = None
    moves: bool = False
    frame: int | None = None
    robust: bool = True
    sigma_px: float = SIGMA_PX
    sigma_m: float = 0.0


@dataclass(frozen=True, eq=False)
class SolvedFrames:
    """The frames of a video whose camera is solved.

    Attributes
    ----------
    frame, camera : the reference frame, which gives the lens, and its camera.
    keys : other frames and their cameras.
    """

    frame: int
    camera: Camera
    keys: Mapping[int, Camera]


@dataclass(frozen=True, eq=False)
class Alignment:
    """A camera aligned with n pairs.

    Attributes
    ----------
    frame : the reference frame.
    found : its camera.
    keys : other frames that were solved, with its lens.
    used : (n,) the pairs that counted.
    wrong : (n,) the pairs that were left out because they do not fit the others.
    remarks : on the other frames; those on the reference frame are `found.remarks`.
    """

    frame: int
    found: Resection
    keys: Mapping[int, Resection]
    used: Mask
    wrong: Mask
    remarks: tuple[Remark, ...]

    @property
    def solved(self) -> SolvedFrames:
        """The cameras."""
        return SolvedFrames(self.frame, self.found.camera, {frame: key.camera for frame, key in self.keys.items()})

    @property
    def pose_covariance(self) -> Array:
        """(6, 6) of the reference frame's rotation [rad] and position [m] for the lens as found.

        It is for what moves the whole path and holds the lens, as refinement does.
        """
        return self.found.pose_covariance_given_lens

    @property
    def pose_covariance_with_lens(self) -> Array | None:
        """(6, 6) the same with what is not known of the lens in it; None where the lens was held."""
        return self.found.pose_covariance if len(self.found.parameters) > len(POSE) else None


def reference_frame(pairs: Pairs) -> int:
    """The frame in which most pairs were marked that are to be used, else of all; the first of equals."""
    marked = pairs.frame >= 0
    for frames in (pairs.frame[marked & pairs.used], pairs.frame[marked]):
        if frames.size:
            return int(np.bincount(frames).argmax())
    return 0


def counting_pairs(pairs: Pairs, frame: int, *, moves: bool) -> Mask:
    """(n,) the pairs from which the reference frame is solved: all that are used, where the camera stands still."""
    return pairs.used & ((pairs.frame < 0) | (pairs.frame == frame)) if moves else pairs.used


def align(pairs: Pairs, options: AlignmentOptions) -> Alignment:
    """Solve the reference frame and, where the camera moves, each other frame that has enough pairs.

    Raises
    ------
    InputError : no pair is to be used, or what the pairs cannot give, as for `resect`.
    RockfallError : no camera sees the points where they were picked.
    """
    frame = reference_frame(pairs) if options.frame is None else options.frame
    here = counting_pairs(pairs, frame, moves=options.moves)
    if not here.any():
        where = f" in frame {frame}" if options.moves else ""
        raise InputError(f"No pair is to be used{where}", file=pairs.source, advice="Use at least one")
    used, wrong = np.zeros(len(pairs), dtype=np.bool_), np.zeros(len(pairs), dtype=np.bool_)

    def solved(rows: Indices, free: tuple[str, ...], start: Camera | None) -> Resection:
        found = _resected(pairs, rows, options, free, start)
        used[rows], wrong[rows] = found.used, ~found.used
        return found

    found = _believed(pairs, np.flatnonzero(here), options)
    used[here], wrong[here] = found.used, ~found.used
    keys: dict[int, Resection] = {}
    remarks: list[Remark] = []
    for other in np.unique(pairs.frame[pairs.used & ~here]).tolist():
        rows = np.flatnonzero(pairs.used & (pairs.frame == other))
        if rows.size < POSE_PAIRS:
            text = f"Frame {other} has {rows.size} pairs, too few to be solved: they only check the path."
        else:
            keys[other] = solved(rows, (), found.camera)
            text = f"Frame {other}: {rows.size} pairs fit to {keys[other].rmse_px:.2f} px."
        remarks.append(Remark(text, "note", f"frame {other}"))
    return Alignment(frame, found, keys, used, wrong, tuple(remarks))


def _believed(pairs: Pairs, rows: Indices, options: AlignmentOptions) -> Resection:
    """The camera of the reference frame.

    Raises
    ------
    InputError : no camera fits the pairs, with how else they may have been written.
    """

    def solve(some: Pairs) -> Resection:
        return _resected(some, np.arange(len(some)), options, options.free, options.start)

    own = pairs.some(rows)
    try:
        found = solve(own)
    except InputError:
        raise
    except RockfallError:
        check_reading(own, None, options.size, options.sigma_px, solve)
        raise
    check_reading(own, found, options.size, options.sigma_px, solve)
    return found


def _resected(
    pairs: Pairs, rows: Indices, options: AlignmentOptions, free: tuple[str, ...], start: Camera | None
) -> Resection:
    return resect(
        pairs.pixel[rows],
        pairs.point[rows],
        *options.size,
        free=free,
        camera=start,
        sigma_px=np.where(np.isnan(pairs.sigma_px), options.sigma_px, pairs.sigma_px)[rows],
        sigma_m=np.where(np.isnan(pairs.sigma_m), options.sigma_m, pairs.sigma_m)[rows],
        names=pairs.name[rows].tolist(),
        robust=options.robust,
        shift=pairs.shift,
        rows=None if pairs.row is None else pairs.row[rows].tolist(),
        source=None if pairs.source is None else str(pairs.source),
    )

# SPDX-License-Identifier: GPL-3.0-or-later
"""Aligning a camera: its lens and pose from the pairs of one frame, and the poses of other frames with enough pairs."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..camera.model import GUESSED_FOCAL, SIGMA_PX, Camera, pinhole
from ..camera.pairs import Pairs
from ..camera.quality import POSE
from ..camera.resection.problem import POSE_PAIRS
from ..camera.resection.resect import Resection, resect
from ..errors import InputError, RockfallError
from ..footage.advice import uneven_pixels
from ..georeference import GlobalShift
from ..remarks import Remark
from ..vectors import Array, Indices, Mask
from .misread_pairs import check_reading

FREES = (("fx", "fy"), ("c",), ("k1",))
"""What of a lens is freed to see whether it explains pairs that do not fit."""
POOR, REDUNDANT = 2.0, 8
"""Residuals of so many times what was stated, with so many observations to spare: other lenses are tried."""
BOTH = ("fx", "fy", "c")
STILL_POOR = 1.5
ASPECTS = (0.4, 2.5)
"""Between which pixels are as wide as high, in any video: anamorphic ones twice."""
EXPLAINS = 0.6
"""One that leaves less than this part of the residuals explains them."""
ALIKE = 1.1
"""Lenses whose residuals differ by less than this factor explain the pairs as well."""
ASPECT_AGREES = 0.01


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
    pixel_aspect : width / height of a pixel as the video says.
    robust : leave out pairs that do not fit the others.
    sigma_px, sigma_m : standard deviations of the coordinates of pairs that have none of their own.
    """

    size: tuple[int, int]
    free: tuple[str, ...] = ("f",)
    start: Camera | None = None
    moves: bool = False
    frame: int | None = None
    pixel_aspect: float = 1.0
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
    remarks : on the shape of pixels, the lens, and the other frames; others on the reference frame are
        `found.remarks`.
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
    remarks = [*_aspect_remarks(options, found), *_lens_remarks(pairs, np.flatnonzero(here), options, found)]
    for other in np.unique(pairs.frame[pairs.used & ~here]).tolist():
        rows = np.flatnonzero(pairs.used & (pairs.frame == other))
        if rows.size < POSE_PAIRS:
            text = f"Frame {other} has {rows.size} pairs, too few to be solved: they only check the path."
        else:
            keys[other] = solved(rows, (), found.camera)
            text = f"Frame {other}: {rows.size} pairs fit to {keys[other].rmse_px:.2f} px."
        remarks.append(Remark(text, "note", f"frame {other}"))
    return Alignment(frame, found, keys, used, wrong, tuple(remarks))


def with_aspect(size: tuple[int, int], focal_px: float | None, aspect: float, shift: GlobalShift) -> Camera:
    """A lens without distortion whose pixels have an aspect, for `start`; of a guessed focal length for None."""
    focal = GUESSED_FOCAL * size[0] if focal_px is None else focal_px
    return replace(pinhole(*size, focal, shift), fy=focal * aspect)


def _aspect_remarks(options: AlignmentOptions, found: Resection) -> Iterator[Remark]:
    """How the shape of the pixels that the video names was used."""
    said, solved = options.pixel_aspect, found.camera.fy / found.camera.fx
    if not uneven_pixels(said) and not uneven_pixels(solved):
        return
    if {"fx", "fy"} & set(options.free):
        if abs(solved / said - 1) > ASPECT_AGREES:
            text = f"Pixels are {solved:.3f} times as wide as high by the pairs, and {said:.3f} times by the video."
            yield Remark(text, "note", "focal")
    elif abs(solved / said - 1) > ASPECT_AGREES:
        text = (
            f"The camera that was given has pixels {solved:.3f} times as wide as high, the video {said:.3f} times: "
            "free fx,fy, or correct fy."
        )
        yield Remark(text, "warning", "focal")
    else:
        text = f"The video says that pixels are {said:.3f} times as wide as high: fy is {said:.3f} times fx."
        yield Remark(text, "note", "focal")


def _lens_remarks(pairs: Pairs, rows: Indices, options: AlignmentOptions, found: Resection) -> Iterator[Remark]:
    """What of the lens, if it were free, would explain pairs that do not fit."""
    if not (found.redundancy >= REDUNDANT and found.scatter > POOR):
        return
    tried = _better(pairs, rows, options, found, found.scatter, FREES)
    least = min((one[0] for one in tried), default=found.scatter)
    if least > STILL_POOR and (both := _better(pairs, rows, options, found, least, (BOTH,))):
        tried, least = both, both[0][0]
    alike = [(more, other) for scatter, more, other in tried if scatter < ALIKE * least]
    for more, other in alike:
        yield Remark(_freed(more, other), "advice", "lens")
    if len(alike) > 1:
        text = "More than one of these explains the pairs: see what rockfall inspect says of the video, or add pairs."
        yield Remark(text, "advice", "lens")


def _better(
    pairs: Pairs,
    rows: Indices,
    options: AlignmentOptions,
    found: Resection,
    scatter: float,
    frees: Iterable[tuple[str, ...]],
) -> list[tuple[float, tuple[str, ...], Resection]]:
    """Scatter, what is freed, and camera of lenses whose residuals are far below those of a scatter."""
    tried: list[tuple[float, tuple[str, ...], Resection]] = []
    for more in frees:
        if set(more) & set(options.free) or ("c" in more and {"cx", "cy"} & set(options.free)):
            continue
        kept = tuple(name for name in options.free if not (name == "f" and "fx" in more))
        try:
            with np.errstate(all="ignore"):  # of pairs that no lens explains some numbers are none
                other = _resected(pairs, rows, options, (*kept, *more), options.start)
        except RockfallError:
            continue
        if not ASPECTS[0] < other.camera.fy / other.camera.fx < ASPECTS[1]:
            continue  # no pixels are so: something else is wrong, such as the unit of the heights
        if other.scatter < EXPLAINS * scatter and other.used.sum() >= found.used.sum():
            tried.append((other.scatter, more, other))
    return tried


def _freed(more: tuple[str, ...], other: Resection) -> str:
    """What freeing a part of the lens does."""
    camera, fit = other.camera, f"they fit to {other.rmse_px:.2g} px"
    if more == BOTH:
        return (
            f"With fx and fy apart and the centre of the lens free {fit}: pixels are {camera.fy / camera.fx:.3f} times "
            f"as wide as high, the centre is at ({camera.cx:.0f}, {camera.cy:.0f}). Free fx,fy,c."
        )
    if "fx" in more:
        return (
            f"With fx and fy apart {fit}: pixels are {camera.fy / camera.fx:.3f} times as wide as high, as in a video "
            "that was stored narrower than it is shown. Free fx,fy."
        )
    if "c" in more:
        across, down = camera.cx - camera.width / 2, camera.cy - camera.height / 2
        return (
            f"With the centre of the lens free {fit}: it lies {abs(across):.0f} px to the "
            f"{'right' if across > 0 else 'left'} of the image's middle and {abs(down):.0f} px "
            f"{'below' if down > 0 else 'above'} it, as in a video that was cropped or stabilised. Free c."
        )
    return f"With the distortion k1 free {fit}. Free k1."


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

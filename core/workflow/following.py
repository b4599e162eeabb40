# SPDX-License-Identifier: GPL-3.0-or-later
"""A camera that moves: the background is followed from the solved frame, which gives each frame its pose."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..camera.model import vector_from_rotation
from ..camera.motion import FeatureTracks, PointsOf, solve_motion
from ..camera.path import CameraPath, fixed
from ..errors import InputError
from ..footage.background import BackgroundMotion, TrackedFeatures, background_motion
from ..footage.video import Video
from ..progress import Progress, silent
from ..remarks import Remark
from ..terrain.raycast import cast_rays
from ..terrain.surface import Surface
from ..vectors import Array, norm
from .alignment import SolvedFrames

type Background = tuple[BackgroundMotion, TrackedFeatures]


@dataclass(frozen=True, eq=False)
class FollowedCamera:
    """The path of a camera through its video.

    Attributes
    ----------
    path : one pose for each frame that was followed, or a single one.
    is_still : the background does not move, and no frame says otherwise.
    features : of the background in a frame (median); 0 when the camera stands still.
    residual_px : how far off they are (median) [px]; NaN when the camera stands still.
    remarks : what a user should know.
    """

    path: CameraPath
    is_still: bool
    features: float
    residual_px: float
    remarks: tuple[Remark, ...]

    @property
    def turn_deg(self) -> float:
        """Largest angle from the reference frame [°]."""
        turns = self.path.rotation @ self.path.reference.rotation.T
        return float(np.degrees(norm(vector_from_rotation(turns))).max())

    @property
    def move_m(self) -> float:
        """Largest distance from the reference frame's place [m]."""
        return float(norm(self.path.position - self.path.reference.position).max())

    @property
    def sigma_px(self) -> float | None:
        """How well the worst known pose is known relative to the solved frame, in the image [px]."""
        sigma = self.path.sigma_rotation[np.isfinite(self.path.sigma_rotation)]
        return None if self.is_still or not sigma.size else float(self.path.reference.fx * sigma.max())


def follow_background(
    video: Video,
    solved: SolvedFrames,
    *,
    mode: Literal["rotation", "full"],
    surface: Surface | None = None,
    frames: tuple[int, int] | None = None,
    background: Background | None = None,
    progress: Progress = silent,
) -> FollowedCamera:
    """A pose for each frame from the first to the last of `frames`, all when None.

    Parameters
    ----------
    mode : "rotation" for a camera that is held from one place, "full" for one that also moves.
    surface : the terrain, needed for "full".
    background : what `background_motion` has found before; it is followed when None.

    Raises
    ------
    InputError : frames that are not in the video, a solved frame outside of them, no terrain for "full", a background
        that cannot be followed.
    """
    first, last = frames or (0, video.frames - 1)
    _check(video, solved, first, last, mode, surface)
    if background is None:
        background = background_motion(video, first=first, last=last, progress=progress)
    motion, seen = background
    if motion.still and not solved.keys:
        return FollowedCamera(fixed(solved.camera), True, 0.0, np.nan, ())
    made = solve_motion(
        solved.camera,
        FeatureTracks(seen.frame - first, seen.feature, seen.pixel),
        video.time_s[first : last + 1],
        solved.frame - first,
        mode=mode,
        points_of=None if surface is None else _points_on(surface),
        key_frames={frame - first: camera for frame, camera in solved.keys.items()},
        progress=progress,
    )
    return FollowedCamera(
        made.path, False, float(np.median(made.features)), float(np.nanmedian(made.residual_px)), made.remarks
    )


def _check(video: Video, solved: SolvedFrames, first: int, last: int, mode: str, surface: Surface | None) -> None:
    if mode == "full" and surface is None:
        raise InputError("A camera that walks needs the terrain, which separates moving from turning")
    if not 0 <= first <= last < video.frames:
        raise InputError(
            f"The frames {first} to {last} are no part of the video",
            file=video.path,
            advice=f"It has the frames 0 to {video.frames - 1}",
        )
    for frame in (solved.frame, *solved.keys):
        if not first <= frame <= last:
            raise InputError(
                f"Pairs were picked on frame {frame}, outside of the frames {first} to {last}",
                advice="Widen the range, or leave these pairs out",
            )


def _points_on(surface: Surface) -> PointsOf:
    """Where rays meet the terrain; NaN where they do not, or are none."""

    def meet(origins: Array, directions: Array) -> Array:
        points = np.full_like(origins, np.nan)
        good = np.isfinite(directions).all(axis=1)
        points[good] = cast_rays(surface, origins[good], directions[good]).point
        return points

    return meet

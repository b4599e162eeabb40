# SPDX-License-Identifier: GPL-3.0-or-later
"""What the cameras saw: views with their clocks, and the block's pixels in them."""

from dataclasses import dataclass, field, replace

import numpy as np

from ...camera.path import CameraPath
from ...errors import InputError
from ...footage.clock import Clock
from ...georeference import GlobalShift
from ...vectors import Array, Indices, Mask, Names

SIGMA_POSE_DEG, SIGMA_PLACE = 0.1, 0.002
"""Of a camera's angles, and of its place in parts of the distance, where its pose is given without a covariance."""


@dataclass(frozen=True, eq=False)
class View:
    """A camera with its clock.

    Attributes
    ----------
    name : for people.
    path : of the camera.
    clock : from video time to the time of the picks.
    row_time_s : readout time of one row of the image [s], on the common clock; zero for a global shutter, None where it
        is not known. The time of a frame is that of its middle row.
    pose_covariance : (6, 6) of the solved pose, rotation vector [rad] about the axes of the camera in the solved frame
        and position [m]; an error of the solved pose moves and turns the whole path. None when unknown.
    camera_covariance : (15, 15) of the solved pose and the lens together, as `CameraQuality` has it: for rays through
        pixels, of which the pose for a lens that is held tells too little. None when unknown.
    """

    name: str
    path: CameraPath
    clock: Clock = field(default_factory=Clock)
    row_time_s: float | None = 0.0
    pose_covariance: Array | None = None
    camera_covariance: Array | None = None

    def __post_init__(self) -> None:
        if self.pose_covariance is None:
            return
        matrix = np.asarray(self.pose_covariance, dtype=np.float64)
        if matrix.shape != (6, 6) or not np.isfinite(matrix).all() or np.linalg.eigvalsh(matrix + matrix.T)[0] <= 0:
            raise InputError(
                f"View {self.name}: the covariance of the pose is not a positive definite 6 × 6 matrix",
                advice="Give rotation [rad] and position [m], or leave it out",
            )

    def exposed_at(self, time_s: Array, pixel: Array) -> Array:
        """(m,) when the rows of pixels (m, 2) of pictures at video times (m,) were exposed, on the common clock [s]."""
        return self.clock.to_common(time_s) + (self.row_time_s or 0.0) * (pixel[:, 1] - self.path.reference.height / 2)

    def solved_covariance(self, distance_m: float) -> Array:
        """(6, 6) of the solved pose; where it is not known, what is usual at such a distance from what is seen [m]."""
        if self.pose_covariance is not None:
            return np.asarray(self.pose_covariance, dtype=np.float64)
        place = SIGMA_PLACE * max(distance_m, 1e-3)
        return np.diag(np.repeat([np.radians(SIGMA_POSE_DEG) ** 2, place**2], 3))

    def covariance_at(self, video_s: float, distance_m: float) -> Array:
        """(6, 6) of the pose in a picture: rotation vector [rad] about the axes of the camera there, and position [m].

        That of the solved pose, turned with the camera, and what the pose of this picture is off from that one;
        infinite where this is not known.

        Parameters
        ----------
        video_s : video time of the picture [s].
        distance_m : from the camera to what is seen.
        """
        return self._in_picture(self.solved_covariance(distance_m), video_s)

    def ray_covariance_at(self, video_s: float, distance_m: float) -> Array:
        """As `covariance_at`; (15, 15) with the lens where it is known together with the pose."""
        known = self.camera_covariance
        return self.covariance_at(video_s, distance_m) if known is None else self._in_picture(known, video_s)

    def _in_picture(self, solved: Array, video_s: float) -> Array:
        path, size = self.path, len(solved)
        turn = np.eye(size)
        turn[:3, :3] = path.poses_at([video_s])[1][0] @ path.reference.rotation.T
        own = [np.interp(video_s, path.time_s, each) for each in (path.sigma_rotation, path.sigma_position_m)]
        moved = np.zeros(size)
        moved[:6] = np.repeat(np.square(own), 3)
        return turn @ solved @ turn.T + np.diag(moved)

    def in_shift(self, shift: GlobalShift) -> "View":
        """The same view in the local frame of another shift."""
        old = self.path.reference.shift
        if np.array_equal(old.vector, shift.vector):
            return self
        position = shift.to_local(old.to_survey(self.path.position))
        path = replace(self.path, reference=self.path.reference.in_shift(shift), position=position)
        return replace(self, path=path)


@dataclass(frozen=True, eq=False)
class PixelObservations:
    """m pixels of blocks' centres.

    Attributes
    ----------
    view : (m,) index of the view.
    trajectory : (m,) name.
    time_s : (m,) video time [s].
    pixel : (m, 2) [px].
    sigma_px : (m,) standard deviation of u and of v [px].
    """

    view: Indices
    trajectory: Names
    time_s: Array
    pixel: Array
    sigma_px: Array

    def __len__(self) -> int:
        return self.time_s.size

    def take(self, rows: Indices | Mask) -> "PixelObservations":
        """Some of them."""
        return PixelObservations(
            self.view[rows], self.trajectory[rows], self.time_s[rows], self.pixel[rows], self.sigma_px[rows]
        )


def check_observations(observations: PixelObservations, views: tuple[View, ...], names: set[str]) -> None:
    """Refuse what cannot be used.

    Raises
    ------
    InputError : no observations or no views, columns of different lengths, numbers that are not finite, a view that
        does not exist, a trajectory without picks.
    """
    m = len(observations)
    if not views:
        raise InputError("There is no view", advice="Give a solved camera")
    if not m:
        raise InputError("There are no pixels of the block", advice="Track the block in at least one video")
    if not (observations.view.shape == observations.trajectory.shape == observations.sigma_px.shape == (m,)) or (
        observations.pixel.shape != (m, 2)
    ):
        raise InputError("The columns of the pixels have different lengths")
    if ((observations.view < 0) | (observations.view >= len(views))).any():
        raise InputError(f"A pixel belongs to view {int(observations.view.max())}, but there are {len(views)}")
    finite = np.isfinite(observations.time_s) & np.isfinite(observations.pixel).all(axis=1)
    good = finite & np.isfinite(observations.sigma_px) & (observations.sigma_px > 0)
    if not good.all():
        i = int(np.argmin(good))
        raise InputError(
            f"Pixel {i + 1} of view {views[observations.view[i]].name} has a time, place or standard deviation that is "
            "not a number",
            trajectory=str(observations.trajectory[i]),
            advice="Give time_s, u_px, v_px, and a sigma_px above zero",
        )
    unknown = sorted(set(observations.trajectory.tolist()) - names)
    if unknown:
        raise InputError(
            "The block was tracked, but there are no picks of this trajectory",
            trajectory=unknown[0],
            advice=f"Mark its impacts, or name it as one of {', '.join(sorted(names))}",
        )

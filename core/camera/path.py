# SPDX-License-Identifier: GPL-3.0-or-later
"""The path of a camera: one pose for each frame of a video."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from ..vectors import Array, Mask
from .model import Camera, project, rays, rotation_from_vector, vector_from_rotation


@dataclass(frozen=True, eq=False)
class CameraPath:
    """A camera with a pose for each of f frames; a fixed camera has one.

    Attributes
    ----------
    reference : inner parameters; its pose is that of the frame that was solved.
    time_s : (f,) video time, ascending [s].
    position : (f, 3) local [m].
    rotation : (f, 3, 3) from the world to the camera.
    sigma_position_m, sigma_rotation : (f,) standard deviations of a component of the position [m] and of the rotation
        [rad], relative to the solved frame; zeros when unknown.
    """

    reference: Camera
    time_s: Array
    position: Array
    rotation: Array
    sigma_position_m: Array
    sigma_rotation: Array

    def __post_init__(self) -> None:
        f = self.time_s.size
        shapes = (self.position.shape, self.rotation.shape, self.sigma_position_m.shape, self.sigma_rotation.shape)
        if f == 0 or shapes != ((f, 3), (f, 3, 3), (f,), (f,)):
            raise InputError(f"The path of a camera has {f} times, but its other columns have the shapes {shapes}")
        if not (np.diff(self.time_s) > 0).all():
            raise InputError("The times of a camera's path do not ascend")

    @property
    def is_fixed(self) -> bool:
        """One pose for all times."""
        return self.time_s.size == 1

    def poses_at(self, time_s: ArrayLike) -> tuple[Array, Array]:
        """Positions (n, 3) and rotations (n, 3, 3) at video times (n,) [s].

        Between frames the position is linear and the rotation turns evenly about one axis; beyond the ends the last
        pose is held.
        """
        times = np.clip(np.asarray(time_s, dtype=np.float64).reshape(-1), self.time_s[0], self.time_s[-1])
        if self.is_fixed:
            return np.repeat(self.position, times.size, axis=0), np.repeat(self.rotation, times.size, axis=0)
        before = np.clip(np.searchsorted(self.time_s, times, side="right") - 1, 0, self.time_s.size - 2)
        start = self.time_s[before]
        share = ((times - start) / (self.time_s[before + 1] - start))[:, None]
        position = (1 - share) * self.position[before] + share * self.position[before + 1]
        step = vector_from_rotation(self.rotation[1:] @ np.swapaxes(self.rotation[:-1], 1, 2))
        return position, rotation_from_vector(share * step[before]) @ self.rotation[before]

    def known_at(self, time_s: ArrayLike) -> Mask:
        """(n,) whether the pose was found in the frames nearest to video times (n,) [s]: its deviations are numbers."""
        times = np.asarray(time_s, dtype=np.float64).reshape(-1)
        after = np.clip(np.searchsorted(self.time_s, times), 0, self.time_s.size - 1)
        before = np.maximum(after - 1, 0)
        near = np.where(np.abs(self.time_s[before] - times) < np.abs(self.time_s[after] - times), before, after)
        return np.isfinite(self.sigma_position_m[near]) & np.isfinite(self.sigma_rotation[near])


def fixed(camera: Camera) -> CameraPath:
    """A camera that does not move."""
    return CameraPath(
        reference=camera,
        time_s=np.zeros(1),
        position=camera.position[None].copy(),
        rotation=camera.rotation[None].copy(),
        sigma_position_m=np.zeros(1),
        sigma_rotation=np.zeros(1),
    )


def camera_at(path: CameraPath, time_s: float) -> Camera:
    """The camera with its pose at a video time [s]."""
    position, rotation = path.poses_at(time_s)
    return replace(path.reference, position=position[0], rotation=rotation[0])


def project_at(path: CameraPath, points: ArrayLike, time_s: ArrayLike) -> Array:
    """Pixels (n, 2) of points (n, 3) at video times (n,) [s]; NaN where they are not seen."""
    position, rotation = path.poses_at(time_s)
    return project(path.reference, points, position=position, rotation=rotation)


def rays_at(path: CameraPath, pixels: ArrayLike, time_s: ArrayLike) -> tuple[Array, Array]:
    """Origins and unit directions (n, 3) of the rays through pixels (n, 2) at video times (n,) [s]."""
    position, rotation = path.poses_at(time_s)
    return rays(path.reference, pixels, position=position, rotation=rotation)


def bent_through(path: CameraPath, cameras: Mapping[float, Camera]) -> CameraPath:
    """The path bent so that it has the poses of cameras at video times [s]; between them the bend is linear in time."""
    times = np.array(sorted(cameras))
    there = [cameras[time] for time in times.tolist()]
    position, rotation = path.poses_at(times)
    bend = CameraPath(
        reference=there[0],
        time_s=times,
        position=np.array([camera.position for camera in there]) - position,
        rotation=np.array([camera.rotation for camera in there]) @ np.swapaxes(rotation, 1, 2),
        sigma_position_m=np.zeros(times.size),
        sigma_rotation=np.zeros(times.size),
    )
    shift, turn = bend.poses_at(path.time_s)
    turned = rotation_from_vector(vector_from_rotation(turn @ path.rotation))  # so that rounding does not add up
    return replace(path, position=path.position + shift, rotation=turned)

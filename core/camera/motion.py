# SPDX-License-Identifier: GPL-3.0-or-later
"""How the path of a camera is found from features of the background."""

import itertools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from ..progress import Progress, silent
from ..remarks import Remark
from ..vectors import Array, Indices, Mask, norm
from .model import Camera, project, rays, undistort
from .path import CameraPath, bent_through
from .turning import LEAST_FEATURES, Turns, solve_turns
from .walking import LEAST_POINTS, solve_poses

SOLVING = "Solving the camera of each frame"

type PointsOf = Callable[[Array, Array], Array]
"""Origins and directions of rays, (n, 3) each, to the points where they meet the terrain, (n, 3), NaN where nowhere."""


@dataclass(frozen=True, eq=False)
class FeatureTracks:
    """Where features of the background were seen, m observations.

    Attributes
    ----------
    frame : (m,) index of the frame, from 0.
    feature : (m,) number of the feature, the same through all frames.
    pixel : (m, 2) [px].
    """

    frame: Indices
    feature: Indices
    pixel: Array


@dataclass(frozen=True, eq=False)
class SolvedMotion:
    """The path of a camera and how well f frames fit.

    Attributes
    ----------
    path : with standard deviations relative to the reference frame and the key frames.
    residual_px : (f,) median length of the residuals of the features that were believed [px]; NaN without any.
    features : (f,) how many were believed.
    remarks : what a user should know.
    """

    path: CameraPath
    residual_px: Array
    features: Indices
    remarks: tuple[Remark, ...]


def solve_motion(
    camera: Camera,
    tracks: FeatureTracks,
    time_s: ArrayLike,
    reference_frame: int,
    *,
    mode: Literal["rotation", "full"] = "rotation",
    points_of: PointsOf | None = None,
    key_frames: Mapping[int, Camera] | None = None,
    sigma_px: float = 0.5,
    progress: Progress = silent,
) -> SolvedMotion:
    """A pose for each frame, from one solved frame and features of the background.

    Parameters
    ----------
    camera : of the reference frame.
    time_s : (f,) video time of the frames [s].
    mode : "rotation" for a camera that is held from one place, "full" for one that also moves.
    points_of : needed for "full": where rays meet the terrain.
    key_frames : other frames that were solved by themselves: the drift between them is distributed evenly over time.
    sigma_px : standard deviation of a feature's coordinate [px].

    Raises
    ------
    InputError : a frame or time that cannot be, too few features in the reference frame, or no terrain for "full".

    Notes
    -----
    Features that appear later get their ray, or their point of the terrain, from frames that are already solved.
    A frame without features gets a pose between its neighbours, with infinite standard deviations.
    """
    times = np.asarray(time_s, dtype=np.float64).reshape(-1)
    keys = {reference_frame: camera, **(key_frames or {})}
    tracks = _checked(camera, tracks, times, keys, reference_frame)
    if mode == "full" and points_of is None:
        raise InputError("A camera that moves needs the terrain, to tell moving from turning")

    plane = undistort(camera, tracks.pixel)
    rows = np.isfinite(plane[:, 0])
    tracks = FeatureTracks(tracks.frame[rows], tracks.feature[rows], tracks.pixel[rows])
    length = np.sqrt(1 + (plane[rows] ** 2).sum(axis=1))
    bearing = np.append(plane[rows], np.ones((len(length), 1)), axis=1) / length[:, None]
    sigma = sigma_px / (np.sqrt(camera.fx * camera.fy) * length**1.5)
    progress(SOLVING, 0, times.size)
    turns = solve_turns(bearing, tracks.frame, tracks.feature, sigma, times.size, reference_frame, camera.rotation)
    if mode == "full" and points_of is not None:
        position, rotation, covariance, points = _walk(
            camera, tracks, turns, reference_frame, points_of, sigma_px, progress
        )
    else:
        position = np.repeat(camera.position[None], times.size, axis=0)
        rotation, points = turns.rotation, camera.position + 100 * turns.direction
        covariance = np.zeros((times.size, 6, 6))
        covariance[:, :3, :3] = turns.covariance
    known = np.isfinite(rotation[:, 0, 0]) & np.isfinite(position[:, 0])
    residual, features = _fit(camera, tracks, points, position, rotation, sigma_px)
    position, rotation = _filled(times, known, position, rotation)
    spread = np.where(
        known[:, None], np.stack([_mean_sigma(covariance, 0), _mean_sigma(covariance, 3)], axis=1), np.inf
    )
    spread = _bridged(spread, sorted(keys)) if len(keys) > 1 else spread
    path = CameraPath(
        reference=camera,
        time_s=times,
        position=position,
        rotation=rotation,
        sigma_position_m=spread[:, 1],
        sigma_rotation=spread[:, 0],
    )
    path = bent_through(path, {float(times[number]): key for number, key in keys.items()})
    return SolvedMotion(path, residual, features, tuple(_remarks(known, features, residual, sigma_px)))


def _checked(
    camera: Camera, tracks: FeatureTracks, times: Array, keys: Mapping[int, Camera], reference: int
) -> FeatureTracks:
    """The tracks with features counted from 0."""
    f = times.size
    if f == 0 or not (np.diff(times) > 0).all():
        raise InputError("The times of the frames do not ascend, or there are none")
    for key, other in keys.items():
        if not 0 <= key < f:
            raise InputError(f"Frame {key} was solved, but the video has the frames 0 to {f - 1}")
        if other.shift != camera.shift or other.size != camera.size:
            raise InputError(f"The camera of frame {key} has another shift or image size than the reference frame's")
    frame = np.asarray(tracks.frame, dtype=np.intp).reshape(-1)
    pixel = np.asarray(tracks.pixel, dtype=np.float64).reshape(-1, 2)
    if frame.size != len(pixel) or frame.size != np.size(tracks.feature):
        raise InputError("The tracks have columns of different lengths")
    if frame.size and (frame.min() < 0 or frame.max() >= f):
        raise InputError(f"A feature is in frame {frame.max()}, but the video has the frames 0 to {f - 1}")
    _, feature = np.unique(np.asarray(tracks.feature).reshape(-1), return_inverse=True)
    pair = frame * (int(feature.max(initial=0)) + 1) + feature
    if np.unique(pair).size != pair.size:
        raise InputError("A feature is seen twice in one frame")
    if (count := int((frame == reference).sum())) < LEAST_FEATURES:
        raise InputError(
            f"The solved frame {reference} has {count} features, too few to lead to other frames",
            advice="Track more features, or solve another frame",
        )
    return FeatureTracks(frame, feature.astype(np.intp), pixel)


def _walk(
    camera: Camera,
    tracks: FeatureTracks,
    turns: Turns,
    reference: int,
    points_of: PointsOf,
    sigma_px: float,
    progress: Progress,
) -> tuple[Array, Array, Array, Array]:
    """Positions, rotations and covariances of the frames, and points of the features, in waves from the reference."""
    frame, feature, pixel = tracks.frame, tracks.feature, tracks.pixel
    frames, features = len(turns.rotation), len(turns.direction)
    solved = np.zeros(frames, dtype=bool)
    solved[reference] = True
    position, rotation = np.full((frames, 3), np.nan), turns.rotation.copy()
    position[reference], rotation[reference] = camera.position, camera.rotation
    covariance = np.zeros((frames, 6, 6))
    points = np.full((features, 3), np.nan)
    tried = np.zeros(features, dtype=bool)
    total = np.bincount(frame, minlength=frames)
    while True:
        progress(SOLVING, int(solved.sum()), frames)
        new = np.flatnonzero(solved[frame] & ~tried[feature])
        # Each feature from the solved frame nearest to the reference.
        new = new[np.argsort(np.abs(frame[new] - reference), kind="stable")]
        first = new[np.unique(feature[new], return_index=True)[1]]
        origins, directions = rays(
            camera, pixel[first], position=position[frame[first]], rotation=rotation[frame[first]]
        )
        if first.size:
            points[feature[first]], tried[feature[first]] = points_of(origins, directions), True
        known = np.isfinite(points[feature, 0]) & ~solved[frame]
        count = np.bincount(frame[known], minlength=frames)
        if count.max(initial=0) < LEAST_POINTS:
            position[~solved] = rotation[~solved] = np.nan
            return position, rotation, covariance, points
        asked = (count >= 0.5 * total) & (count >= 12)
        if not asked.any():
            asked = count >= max(LEAST_POINTS, 0.9 * count.max())
        near = _nearest(solved)
        position[asked] = position[near[asked]]
        lost = asked & np.isnan(rotation[:, 0, 0])
        rotation[lost] = rotation[near[lost]]
        found = solve_poses(
            camera, points[feature[known]], pixel[known], frame[known], sigma_px, position, rotation, asked
        )
        position, rotation = found.position, found.rotation
        covariance[asked] = found.covariance[asked]
        solved |= asked


def _nearest(solved: Mask) -> Indices:
    """(f,) for each frame the nearest one that is solved."""
    known = np.flatnonzero(solved)
    gap = np.abs(np.arange(solved.size)[:, None] - known[None])
    return known[np.argmin(gap, axis=1)]


def _fit(
    camera: Camera, tracks: FeatureTracks, points: Array, position: Array, rotation: Array, sigma_px: float
) -> tuple[Array, Indices]:
    """Median residual [px] and number of the features that are believed, by frame."""
    frames = len(position)
    seen = project(camera, points[tracks.feature], position=position[tracks.frame], rotation=rotation[tracks.frame])
    gap = norm(tracks.pixel - seen)
    scale = max(sigma_px, float(np.median(gap[np.isfinite(gap)])) / 1.18) if np.isfinite(gap).any() else sigma_px
    believed = np.flatnonzero(gap < 4 * scale)
    order = believed[np.lexsort((gap[believed], tracks.frame[believed]))]
    count = np.bincount(tracks.frame[believed], minlength=frames)
    middle = np.cumsum(count) - count + count // 2
    residual = np.full(frames, np.nan)
    residual[count > 0] = gap[order[middle[count > 0]]]
    return residual, count


def _mean_sigma(covariance: Array, first: int) -> Array:
    """(f,) root mean variance of three parameters."""
    return np.sqrt(np.trace(covariance[:, first : first + 3, first : first + 3], axis1=1, axis2=2) / 3)


def _filled(times: Array, known: Mask, position: Array, rotation: Array) -> tuple[Array, Array]:
    """Poses between those of the neighbours for frames without any."""
    if known.all():
        return position, rotation
    zeros = np.zeros(int(known.sum()))
    any_camera = Camera(1, 1, 1.0, 1.0, 0.5, 0.5)
    path = CameraPath(any_camera, times[known], position[known], rotation[known], zeros, zeros)
    return path.poses_at(times)


def _bridged(spread: Array, keys: list[int]) -> Array:
    """Standard deviations of a path that is tied at several frames: what grows from one, shrinks towards the next.

    The growth is that of a random walk; what a frame scatters by itself stays.
    """
    variance = spread**2
    frames = np.arange(len(spread))
    own = np.array([np.min(column[np.isfinite(column) & (frames != keys[0])], initial=np.inf) for column in variance.T])
    own = np.where(np.isfinite(own), own, 0.0)
    result = variance.copy()
    for first, last in itertools.pairwise(keys):
        inner = slice(first, last + 1)
        low, high = variance[first], variance[last]
        from_first, from_last = np.abs(variance[inner] - low), np.abs(high - variance[inner])
        total = from_first + from_last
        divides = np.isfinite(total) & (total > 0)
        bridge = np.divide(from_first * from_last, total, out=np.zeros_like(total), where=divides)
        result[inner] = np.where(np.isfinite(variance[inner]), bridge + own, np.inf)
    for outer, key in ((slice(None, keys[0]), keys[0]), (slice(keys[-1] + 1, None), keys[-1])):
        result[outer] = np.abs(variance[outer] - variance[key]) + own
    result[keys] = 0.0
    return np.sqrt(result)


def _remarks(known: Mask, features: Indices, residual: Array, sigma_px: float) -> Iterator[Remark]:
    if not known.all():
        text = (
            f"{int((~known).sum())} frames have no features that lead there, the first is frame "
            f"{int(np.argmin(known))}: their poses are guessed between the neighbours. Solve a frame there."
        )
        yield Remark(text, "warning", "frames")
    few = known & (features < 10)
    if few.any():
        text = (
            f"{int(few.sum())} frames rest on fewer than 10 features, the first is frame {int(np.argmax(few))}. "
            "Track more of the background."
        )
        yield Remark(text, "advice", "features")
    typical = float(np.median(residual[np.isfinite(residual)])) if np.isfinite(residual).any() else 0.0
    if typical > 4 * sigma_px:
        text = (
            f"The features fit to {typical:.2g} px only, where {sigma_px:g} px were expected. If the camera moved from "
            "its place, solve its full motion."
        )
        yield Remark(text, "warning", "fit")

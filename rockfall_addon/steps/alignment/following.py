# SPDX-License-Identifier: GPL-3.0-or-later
"""A hand-held camera: the background is followed from the solved frame, which gives a pose to every frame.

What is needed is taken from the scene first, then computed without Blender (in a thread), then put back.
"""

import json
import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field

import bpy
import numpy as np

from ....core.camera.model import Camera, vector_from_rotation
from ....core.camera.motion import FeatureTracks, SolvedMotion, solve_motion
from ....core.camera.path import CameraPath, fixed
from ....core.errors import RockfallError
from ....core.footage.background import BackgroundMotion, TrackedFeatures, background_motion
from ....core.footage.video import Video
from ....core.progress import CancelledError, Progress
from ....core.remarks import from_plain, to_plain
from ....core.terrain.raycast import cast_rays
from ....core.terrain.surface import Surface
from ....core.vectors import Array, norm
from ...scene import alignment, store, terrain, videos

KEPT = 2

_tracks: OrderedDict[tuple[str, float], tuple[BackgroundMotion, TrackedFeatures]] = OrderedDict()

running: list["Job"] = []
"""The job that a person waits for, if any."""


@dataclass(frozen=True, eq=False)
class Task:
    """What is followed: a video from its solved reference frame, through other frames that are solved."""

    video: Video
    camera: Camera
    reference: int
    keys: dict[int, Camera]
    mode: str
    surface: Surface | None


@dataclass
class Job:
    """A task on its way in a thread; `said` is where it is, `part` how much of it is done."""

    task: Task
    said: str = "Opening the video"
    part: float = 0.0
    found: SolvedMotion | None = None
    problem: str = ""
    stopped: bool = False
    thread: threading.Thread | None = field(default=None, repr=False)

    @property
    def is_done(self) -> bool:
        """Whether the thread has ended."""
        return self.thread is not None and not self.thread.is_alive()

    def start(self) -> None:
        """Begin."""
        self.thread = threading.Thread(target=self._run, name="rockfall following", daemon=True)
        self.thread.start()

    def stop(self) -> None:
        """End soon."""
        self.stopped = True

    def _run(self) -> None:
        try:
            self.found = compute(self.task, self._progress)
        except RockfallError as error:
            self.problem = str(error)
        except CancelledError:
            pass
        except Exception as error:  # noqa: BLE001 - a thread has nobody else to tell
            self.problem = f"Something went wrong in Rockfall (following): {type(error).__name__}: {error}"

    def _progress(self, text: str, done: int, total: int) -> None:
        if self.stopped:
            raise CancelledError
        self.said = text
        if total:
            self.part = 0.9 * done / total


def prepare(scene: bpy.types.Scene, camera: bpy.types.Object) -> Task:
    """What there is to follow.

    Raises
    ------
    RockfallError : the camera is not solved, does not move, or what is needed is missing.
    """
    settings = camera.rockfall_alignment
    if not videos.is_solved(camera):
        raise RockfallError("First solve the camera in one frame, from pairs.")
    if not alignment.moves(camera):
        raise RockfallError("This camera stands still. Choose Hand-held, if it does not.")
    surface = terrain.surface_of_scene(scene)
    if settings.motion == "FULL" and surface is None:
        raise RockfallError("A camera that walks needs the terrain, to tell moving from turning. Import it first.")
    solution, path = alignment.solution_of(camera), videos.camera_path(camera)
    times = videos.times_of(camera)
    position, rotation = path.poses_at(times[list(solution.keys)])
    keys = {frame: _posed(path.reference, position[i], rotation[i]) for i, frame in enumerate(solution.keys)}
    return Task(videos.video_of(camera), path.reference, solution.reference, keys, settings.motion.lower(), surface)


def compute(task: Task, progress: Progress) -> SolvedMotion | None:
    """Follow the background and solve each frame; None when the camera stands still. Without Blender.

    Raises
    ------
    RockfallError : the background cannot be followed.
    """
    video = task.video
    key = (str(video.path), video.path.stat().st_mtime)
    if key not in _tracks:
        _tracks[key] = background_motion(video, progress=progress)
        while len(_tracks) > KEPT:
            _tracks.popitem(last=False)
    background, seen = _tracks[key]
    if background.still and not task.keys:
        return None
    progress("Solving the camera of each frame", 0, 0)
    return solve_motion(
        task.camera,
        FeatureTracks(seen.frame, seen.feature, seen.pixel),
        video.time_s,
        task.reference,
        mode=task.mode,
        points_of=None if task.surface is None else _points_of(task.surface),
        key_frames=task.keys,
    )


def apply(scene: bpy.types.Scene, camera: bpy.types.Object, task: Task, found: SolvedMotion | None) -> str:
    """Give the camera the poses that were found; returns a sentence about them."""
    frames = len(camera[store.VIDEO_TIMES])
    path = fixed(task.camera) if found is None else found.path
    videos.set_camera_path(
        scene,
        camera,
        path,
        rmse_px=camera.get(store.RMSE),
        pose_covariance=videos.pose_covariance(camera),
    )
    camera[store.FOLLOWED] = json.dumps(
        {
            "reference": task.reference,
            "frames": frames,
            "focal": task.camera.fx,
            "turn_deg": 0.0 if found is None else _turn_deg(path),
            "features": 0.0 if found is None else float(np.median(found.features)),
            "residual_px": None if found is None else float(np.nanmedian(found.residual_px)),
            "sigma_px": None if found is None else _sigma_px(path),
            "remarks": [] if found is None else to_plain(found.remarks),
        }
    )
    alignment.solve(scene, camera)  # the pairs may have changed meanwhile
    if found is None:
        return "The camera stands still: one pose serves all frames."
    return f"Followed through {frames} frames; the camera turns by up to {_turn_deg(path):.1f}°."


def followed(camera: bpy.types.Object) -> dict | None:
    """What the last following said: reference, frames, focal, turn_deg, features, residual_px, sigma_px, remarks."""
    if store.FOLLOWED not in camera:
        return None
    known = json.loads(camera[store.FOLLOWED])
    return known | {"remarks": from_plain(known.get("remarks", known.get("advice", ())))}  # "advice" of version 0.1.0


def is_stale(camera: bpy.types.Object) -> bool:
    """Whether the focal length has changed so much that the frames should be followed again."""
    known = followed(camera)
    return known is not None and abs(alignment.focal_px(camera) / known["focal"] - 1) > 0.005


def _posed(camera: Camera, position: Array, rotation: Array) -> Camera:
    return Camera(
        camera.width, camera.height, *camera.intrinsics.tolist(), position=position, rotation=rotation,
        shift=camera.shift,
    )  # fmt: skip


def _points_of(surface: Surface) -> Callable[[Array, Array], Array]:
    """Where rays meet the terrain; NaN where they do not, or are none."""

    def meet(origins: Array, directions: Array) -> Array:
        points = np.full_like(origins, np.nan)
        good = np.isfinite(directions).all(axis=1)
        points[good] = cast_rays(surface, origins[good], directions[good]).point
        return points

    return meet


def _turn_deg(path: CameraPath) -> float:
    return float(np.degrees(norm(vector_from_rotation(path.rotation @ path.reference.rotation.T))).max())


def _sigma_px(path: CameraPath) -> float | None:
    sigma = path.sigma_rotation[np.isfinite(path.sigma_rotation)]
    return float(path.reference.fx * sigma.max()) if sigma.size else None

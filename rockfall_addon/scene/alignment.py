# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs of a picture's pixel and a point of the terrain, and the camera that is solved from them at every change.

The pairs are doubles on the camera's object, and so is what came out; the rows that the panel lists mirror them. A
pair may be open: half of it is missing, or was predicted and waits for a person to confirm it.
"""

import json
import math
import uuid
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.camera.blender_lens import pose_from_blender
from ...core.camera.model import (
    Camera,
    full_frame_mm,
    project,
    rays,
    rotation_from_vector,
    vector_from_rotation,
    with_intrinsics,
)
from ...core.camera.path import CameraPath, fixed
from ...core.camera.resection.problem import POSE_PAIRS, needed_pairs
from ...core.camera.resection.resect import Resection, resect
from ...core.errors import RockfallError
from ...core.remarks import Remark, from_plain, to_plain
from ...core.terrain.raycast import cast_rays
from ...core.vectors import Array, distance_to_ray
from . import georeference, store, terrain, videos

COLOURS = 7
GOOD_PAIRS = 8
"""From how many pairs a frame is solved by itself once the lens is known, as on the command line."""
PIXEL, POINT = "pixel", "point"
NEAR_PX = 11.0
"""A click this near to a mark takes hold of it, in pixels at interface scale 1."""

LENS_BOXES = {"f": "free_focal", "c": "free_centre"} | {name: f"free_{name}" for name in ("k1", "k2", "k3", "p1", "p2")}
"""What the core calls free → the box in the panel."""

BY_PAIRS, BY_EYE, FROM_FILE = "pairs", "eye", "file"


@dataclass(frozen=True)
class Pair:
    """A pixel and the point of the terrain that is seen there.

    Attributes
    ----------
    pixel : u, v [px]; None while it is missing.
    point : local [m]; None while it is missing.
    frame : the video's frame in which the pixel was marked.
    proposed : the side that was computed and that nobody has confirmed: "pixel", "point", or empty.
    colour : number of its colour.
    """

    id: str
    name: str
    pixel: tuple[float, float] | None
    point: tuple[float, float, float] | None
    frame: int
    enabled: bool = True
    proposed: str = ""
    colour: int = 0
    sigma_px: float = math.nan
    sigma_m: float = math.nan

    @property
    def is_complete(self) -> bool:
        """Both sides are there, and a person has seen them."""
        return self.pixel is not None and self.point is not None and not self.proposed

    @property
    def missing(self) -> str:
        """The side that waits for a person: "pixel", "point", or empty."""
        if self.proposed:
            return self.proposed
        return PIXEL if self.pixel is None else POINT if self.point is None else ""


@dataclass(frozen=True)
class Solution:
    """What the last solution said, for the panel and the overlay.

    Attributes
    ----------
    problem : why there is none; the camera is then as it was before.
    rmse_px : of the used pairs [px].
    residual : pair's id → marked minus projected pixel [px].
    residual_m : pair's id → distance from the point to the pixel's ray [m].
    wrong : ids of the pairs that were left out.
    sigma : standard deviations by name [rad, m, px, 1].
    remarks : the gravest first.
    reference : the frame whose pairs gave the lens.
    keys : other frames that were solved.
    """

    problem: str = ""
    rmse_px: float = math.nan
    residual: dict[str, tuple[float, float]] | None = None
    residual_m: dict[str, float] | None = None
    wrong: tuple[str, ...] = ()
    sigma: dict[str, float] | None = None
    remarks: tuple[Remark, ...] = ()
    reference: int = 0
    keys: tuple[int, ...] = ()


def pairs_of(camera: bpy.types.Object) -> list[Pair]:
    """The pairs of a camera, in the order in which they were made."""
    return [_pair(values.to_dict()) for values in camera.get(store.PAIRS, ())]


def keep_pairs(camera: bpy.types.Object, pairs: Sequence[Pair]) -> None:
    """Store the pairs; nothing is solved."""
    if pairs:
        camera[store.PAIRS] = [_values(pair) for pair in pairs]
    elif store.PAIRS in camera:
        del camera[store.PAIRS]
    if not any(pair.id == camera.get(store.OPEN_PAIR) and pair.missing for pair in pairs):
        camera[store.OPEN_PAIR] = ""


def _values(pair: Pair) -> dict:
    u, v = pair.pixel if pair.pixel is not None else (math.nan, math.nan)
    x, y, z = pair.point if pair.point is not None else (math.nan,) * 3
    plain = {f.name: getattr(pair, f.name) for f in fields(pair) if f.name not in (PIXEL, POINT)}
    return plain | {"u": float(u), "v": float(v), "x": float(x), "y": float(y), "z": float(z)}


def _pair(values: dict) -> Pair:
    pixel = (values.pop("u"), values.pop("v"))
    point = (values.pop("x"), values.pop("y"), values.pop("z"))
    known = {f.name for f in fields(Pair)}
    rest = {name: value for name, value in values.items() if name in known}
    rest["enabled"] = bool(rest.get("enabled", True))
    return Pair(pixel=None if math.isnan(pixel[0]) else pixel, point=None if math.isnan(point[0]) else point, **rest)


def with_id(pairs: Iterable[Pair], identifier: str) -> Pair | None:
    """The pair of an id."""
    return next((pair for pair in pairs if pair.id == identifier), None)


def open_pair(camera: bpy.types.Object) -> Pair | None:
    """The pair whose other side is clicked next."""
    pair = with_id(pairs_of(camera), str(camera.get(store.OPEN_PAIR, "")))
    return pair if pair is not None and pair.missing else None


def active_pair(camera: bpy.types.Object) -> Pair | None:
    """The pair of the active row."""
    pairs, index = pairs_of(camera), camera.rockfall_alignment.active
    return pairs[index] if 0 <= index < len(pairs) else None


def activate(camera: bpy.types.Object, identifier: str) -> None:
    """Make the row of a pair the active one."""
    for index, pair in enumerate(pairs_of(camera)):
        if pair.id == identifier and camera.rockfall_alignment.active != index:
            camera.rockfall_alignment.active = index


def mark(
    scene: bpy.types.Scene, camera: bpy.types.Object, side: str, place: Sequence[float], *, frame: int | None = None
) -> str:
    """A person has clicked: begin a pair, or give the open one its other side. Returns the pair's id.

    side : "pixel" with u, v [px], or "point" with x, y, z local [m].

    Raises
    ------
    RockfallError : the pixel is outside of the picture.
    """
    pairs, place = pairs_of(camera), tuple(float(value) for value in place)
    if side == PIXEL:
        _check_inside(camera, place)
    shown = videos.true_frame(scene, camera) if frame is None else frame
    pair = open_pair(camera)
    if pair is None:
        pair = _new(pairs, shown)
        pairs.append(pair)
        camera[store.OPEN_PAIR] = pair.id
    there = pair.pixel if side == POINT else pair.point
    pair = replace(pair, pixel=place, frame=shown) if side == PIXEL else replace(pair, point=place)
    if there is None or pair.proposed not in ("", side):
        pair = _with_prediction(scene, camera, pair, side)  # a second click on the same side moves it
    else:
        pair = replace(pair, proposed="")
    _store(scene, camera, pairs, pair)
    return pair.id


def move(
    scene: bpy.types.Scene,
    camera: bpy.types.Object,
    identifier: str,
    side: str,
    place: Sequence[float],
    *,
    settle: bool = True,
) -> None:
    """Move one side of a pair; a prediction that was moved is one no longer.

    settle : False while the mouse is held, so that a prediction stays one until it is let go.
    """
    pairs = pairs_of(camera)
    pair = with_id(pairs, identifier)
    if pair is None:
        return
    place = tuple(float(value) for value in place)
    if side == PIXEL:
        _check_inside(camera, place)
        pair = replace(pair, pixel=place)
    else:
        pair = replace(pair, point=place)
    if settle and pair.proposed == side:
        pair = replace(pair, proposed="")
    elif pair.proposed and pair.proposed != side:
        pair = _with_prediction(scene, camera, pair, side)
    _store(scene, camera, pairs, pair)


def settle(scene: bpy.types.Scene, camera: bpy.types.Object, identifier: str) -> None:
    """A person agrees with a prediction."""
    pairs = pairs_of(camera)
    pair = with_id(pairs, identifier)
    if pair is not None and pair.proposed:
        _store(scene, camera, pairs, replace(pair, proposed=""))


def edit(scene: bpy.types.Scene, camera: bpy.types.Object, identifier: str, **values: object) -> None:
    """Give a pair another name, or (not) count it."""
    pairs = pairs_of(camera)
    pair = with_id(pairs, identifier)
    if pair is None:
        return
    changed = replace(pair, **values)
    if changed != pair:
        _store(scene, camera, pairs, changed)


def delete(scene: bpy.types.Scene, camera: bpy.types.Object, identifiers: Iterable[str]) -> int:
    """Remove pairs; returns how many there were."""
    gone, pairs = set(identifiers), pairs_of(camera)
    left = [pair for pair in pairs if pair.id not in gone]
    keep_pairs(camera, left)
    solve(scene, camera)
    settings = camera.rockfall_alignment
    settings.active = max(0, min(settings.active, len(left) - 1))
    return len(pairs) - len(left)


def _store(scene: bpy.types.Scene, camera: bpy.types.Object, pairs: list[Pair], pair: Pair) -> None:
    keep_pairs(camera, [pair if other.id == pair.id else other for other in pairs])
    solve(scene, camera)
    activate(camera, pair.id)


def _new(pairs: Sequence[Pair], frame: int) -> Pair:
    number = 1 + max((int(pair.name) for pair in pairs if pair.name.isdecimal()), default=0)
    used = [sum(pair.colour == colour for pair in pairs) for colour in range(COLOURS)]
    return Pair(uuid.uuid4().hex, str(number), None, None, frame, colour=used.index(min(used)))


def _check_inside(camera: bpy.types.Object, pixel: Sequence[float]) -> None:
    width, height = videos.size_of(camera)
    if not (0 <= pixel[0] <= width and 0 <= pixel[1] <= height):
        raise RockfallError("That is outside of the picture. Mark a place inside of it.")


def _with_prediction(scene: bpy.types.Scene, camera: bpy.types.Object, pair: Pair, side: str) -> Pair:
    """The pair with its other side where the camera as it is now has it; nothing while nothing is known."""
    other = POINT if side == PIXEL else PIXEL
    found = None
    if is_placed(camera):
        found = point_at(scene, camera, pair.pixel, pair.frame) if side == PIXEL else pixel_of(camera, pair)
    if found is None:
        return replace(pair, proposed="", **{other: None})
    return replace(pair, proposed=other, **{other: found})


def point_at(
    scene: bpy.types.Scene, camera: bpy.types.Object, pixel: Sequence[float], frame: int
) -> tuple[float, float, float] | None:
    """Where the ray of a pixel meets the terrain; None where it does not."""
    path = videos.camera_path(camera)
    position, rotation = path.poses_at(_times(camera, [frame]))
    origin, direction = rays(path.reference, [pixel], position=position, rotation=rotation)
    return meet(scene, origin, direction)


def meet(scene: bpy.types.Scene, origin: Array, direction: Array) -> tuple[float, float, float] | None:
    """Where a ray meets the terrain, all its tiles in double precision; None where it does not, or without terrain."""
    surface = terrain.surface_of_scene(scene)
    if surface is None or not np.isfinite(direction).all():
        return None
    hits = cast_rays(surface, origin, direction)
    return tuple(hits.point[0].tolist()) if hits.face[0] >= 0 else None


def pixel_of(camera: bpy.types.Object, pair: Pair) -> tuple[float, float] | None:
    """Where the camera as it is now sees the point of a pair; None outside of the picture."""
    if pair.point is None:
        return None
    u, v = reprojections(camera, [pair])[0].tolist()
    width, height = videos.size_of(camera)
    return (u, v) if 0 <= u <= width and 0 <= v <= height else None


def reprojections(camera: bpy.types.Object, pairs: Sequence[Pair], frame: int | None = None) -> Array:
    """(n, 2) where the camera sees the points, each in its pair's frame or all in one; NaN where it does not."""
    path = videos.camera_path(camera)
    points = np.array([pair.point if pair.point is not None else (np.nan,) * 3 for pair in pairs]).reshape(-1, 3)
    frames = [pair.frame if frame is None else frame for pair in pairs]
    position, rotation = path.poses_at(_times(camera, frames))
    return project(path.reference, points, position=position, rotation=rotation)


def _times(camera: bpy.types.Object, frames: Sequence[int]) -> Array:
    """(n,) video times of frames [s]."""
    times = videos.times_of(camera)
    return times[np.clip(np.asarray(frames, dtype=np.intp), 0, times.size - 1)]


def is_placed(camera: bpy.types.Object) -> bool:
    """Whether the camera stands somewhere that means something: solved, placed by eye, or from a file."""
    return videos.is_solved(camera)


def placement(camera: bpy.types.Object) -> str:
    """How the camera came to its place: `BY_PAIRS`, `BY_EYE`, `FROM_FILE`, or empty."""
    return str(camera.get(store.PLACED, FROM_FILE)) if videos.is_solved(camera) else ""


def free_of(camera: bpy.types.Object) -> tuple[str, ...]:
    """The parameters of the lens that are to be found."""
    settings = camera.rockfall_alignment
    return tuple(name for name, box in LENS_BOXES.items() if getattr(settings, box))


def known_lens(camera: bpy.types.Object) -> Array:
    """(9,) what is taken of the lens where it is not free: as imported or typed, else as it is, without distortion."""
    if store.KNOWN_LENS in camera:
        return np.array(camera[store.KNOWN_LENS], dtype=np.float64)
    width, height = videos.size_of(camera)
    return np.array([*lens_of(camera)[:2], width / 2, height / 2, 0, 0, 0, 0, 0], dtype=np.float64)


def keep_lens(camera: bpy.types.Object, values: Array) -> None:
    """Remember what is known of the lens."""
    camera[store.KNOWN_LENS] = [float(value) for value in values]


def lens_of(camera: bpy.types.Object) -> Array:
    """(9,) the lens as it is now."""
    return videos.camera_path(camera).reference.intrinsics


def focal_px(camera: bpy.types.Object) -> float:
    """The focal length as it is now [px]."""
    return float(lens_of(camera)[0])


def focal_mm(camera: bpy.types.Object, focal: float) -> float:
    """What a focal length [px] is on a camera of full frame [mm]."""
    return full_frame_mm(focal, videos.size_of(camera))


def set_focal(scene: bpy.types.Scene, camera: bpy.types.Object, focal: float) -> None:
    """The focal length is known [px]: keep it, and solve with it."""
    lens, now = known_lens(camera), lens_of(camera)
    lens[:2] = now[:2] = focal, focal * now[1] / now[0]
    keep_lens(camera, lens)
    set_lens(scene, camera, now)


def set_lens(scene: bpy.types.Scene, camera: bpy.types.Object, values: Array) -> None:
    """Solve the camera with what is known of its lens; where it cannot be solved, show it with (9,) this lens."""
    if solve(scene, camera):
        return
    path = videos.camera_path(camera)
    changed = with_intrinsics(path.reference, values)
    if videos.is_solved(camera):
        videos.set_camera_path(scene, camera, replace(path, reference=changed))
    else:
        videos.write_lens(camera, changed)


def lock_focal(camera: bpy.types.Object) -> None:
    """Keep the focal length that was found."""
    lens = known_lens(camera)
    lens[:2] = lens_of(camera)[:2]
    keep_lens(camera, lens)


def lock_lens(camera: bpy.types.Object) -> None:
    """The whole lens is known; what is known must be kept after this."""
    for box in LENS_BOXES.values():
        setattr(camera.rockfall_alignment, box, False)


def moves(camera: bpy.types.Object) -> bool:
    """Whether the camera has a pose for each frame, or is to get one."""
    return camera.rockfall_alignment.motion != "FIXED"


def reference_frame(pairs: Sequence[Pair]) -> int:
    """The frame in which most pairs were marked, the first of equals."""
    frames = [pair.frame for pair in pairs if pair.is_complete and pair.enabled] or [pair.frame for pair in pairs]
    return min(set(frames), key=lambda frame: (-frames.count(frame), frame), default=0)


def solve(scene: bpy.types.Scene, camera: bpy.types.Object) -> bool:
    """Solve the camera from its pairs and put it in its place; without enough pairs it stays where it is.

    Whether there is a solution; why not is in `solution_of`.
    """
    pairs = pairs_of(camera)
    try:
        found, keys, reference = _solve(scene, camera, pairs)
    except RockfallError as error:
        enough = len(_used_at(pairs, camera, reference_frame(pairs))) >= needed_pairs(free_of(camera))
        keep_check(camera, Solution(problem=str(error) if enough else ""))  # too few is no problem, but the beginning
        return False
    path = _path(camera, found.camera, {frame: key.camera for frame, key in keys.items()}, reference)
    camera[store.PLACED] = BY_PAIRS
    videos.set_camera_path(scene, camera, path, rmse_px=found.rmse_px, pose_covariance=found.pose_covariance)
    used = _used_at(pairs, camera, reference)
    wrong = [pair.id for pair, good in zip(used, found.used.tolist(), strict=True) if not good]
    for frame, key in keys.items():
        there = [pair for pair in _ready(pairs) if pair.frame == frame]
        wrong += [pair.id for pair, good in zip(there, key.used.tolist(), strict=True) if not good]
    solution = Solution(
        rmse_px=found.rmse_px,
        wrong=tuple(wrong),
        sigma=found.sigma,
        remarks=found.remarks,
        reference=reference,
        keys=tuple(sorted(keys)),
    )
    keep_check(camera, solution)
    return True


def _ready(pairs: Iterable[Pair]) -> list[Pair]:
    return [pair for pair in pairs if pair.is_complete and pair.enabled]


def _used_at(pairs: Sequence[Pair], camera: bpy.types.Object, reference: int) -> list[Pair]:
    """The pairs from which the reference frame is solved: of a camera that stands still, all of them."""
    return [pair for pair in _ready(pairs) if pair.frame == reference or not moves(camera)]


def _solve(
    scene: bpy.types.Scene, camera: bpy.types.Object, pairs: Sequence[Pair]
) -> tuple[Resection, dict[int, Resection], int]:
    """The camera of the reference frame and of other frames that have enough pairs."""
    width, height = videos.size_of(camera)
    path = videos.camera_path(camera)
    start, free = replace(path.reference, shift=georeference.read_shift(scene)), free_of(camera)
    lens = known_lens(camera)
    if "f" in free:
        lens[:2] = lens_of(camera)[:2]
    start = with_intrinsics(start, lens)

    def resected(some: Sequence[Pair], free: Sequence[str], start: Camera) -> Resection:
        return resect(
            np.array([pair.pixel for pair in some]).reshape(-1, 2),
            np.array([pair.point for pair in some]).reshape(-1, 3),
            width,
            height,
            free=free,
            camera=start,
            sigma_px=_or([pair.sigma_px for pair in some], 1.0),
            sigma_m=_or([pair.sigma_m for pair in some], 0.0),
            names=[pair.name for pair in some],
        )

    reference = reference_frame(pairs)
    found = resected(_used_at(pairs, camera, reference), free, start)
    keys: dict[int, Resection] = {}
    if moves(camera):
        ready = _ready(pairs)
        for frame in sorted({pair.frame for pair in ready} - {reference}):
            there = [pair for pair in ready if pair.frame == frame]
            if len(there) >= POSE_PAIRS:
                keys[frame] = resected(there, (), found.camera)
    return found, keys, reference


def _or(values: Sequence[float], instead: float) -> Array:
    array = np.array(values, dtype=np.float64)
    return np.where(np.isnan(array), instead, array)


def _path(camera: bpy.types.Object, solved: Camera, keys: dict[int, Camera], reference: int) -> CameraPath:
    """The path that the camera had, bent so that it passes through the frames that are solved."""
    path = videos.camera_path(camera)
    if not moves(camera) or path.is_fixed:
        return fixed(solved)
    cameras = {reference: solved, **keys}
    frames = sorted(cameras)
    times = _times(camera, frames)
    position, rotation = path.poses_at(times)
    zeros = np.zeros(len(frames))
    bend = CameraPath(
        solved,
        times,
        np.array([cameras[frame].position for frame in frames]) - position,
        np.array([cameras[frame].rotation for frame in frames]) @ np.swapaxes(rotation, 1, 2),
        zeros,
        zeros,
    )
    shift, turn = bend.poses_at(path.time_s)
    straight = rotation_from_vector(vector_from_rotation(turn @ path.rotation))
    return replace(path, reference=solved, position=path.position + shift, rotation=straight)


def _checked_against(camera: bpy.types.Object, pairs: Sequence[Pair], solution: Solution) -> Solution:
    """With the residuals of all complete pairs against the camera as it is now, counted or not."""
    complete = [pair for pair in pairs if pair.is_complete]
    if not complete or not is_placed(camera):
        return solution
    path = videos.camera_path(camera)
    marked, points = np.array([pair.pixel for pair in complete]), np.array([pair.point for pair in complete])
    position, rotation = path.poses_at(_times(camera, [pair.frame for pair in complete]))
    seen = project(path.reference, points, position=position, rotation=rotation)
    away = distance_to_ray(points, *rays(path.reference, marked, position=position, rotation=rotation))
    names = [pair.id for pair in complete]
    return replace(
        solution,
        residual=dict(zip(names, [tuple(row) for row in (marked - seen).tolist()], strict=True)),
        residual_m=dict(zip(names, away.tolist(), strict=True)),
    )


def keep_check(camera: bpy.types.Object, solution: Solution) -> None:
    """Store a solution with the residuals of the pairs against the camera as it is now."""
    _keep_solution(camera, _checked_against(camera, pairs_of(camera), solution))
    fill_rows(camera)


def _keep_solution(camera: bpy.types.Object, solution: Solution) -> None:
    values = {f.name: getattr(solution, f.name) for f in fields(solution)}
    camera[store.SOLUTION] = json.dumps(values | {"remarks": to_plain(solution.remarks)})


def solution_of(camera: bpy.types.Object) -> Solution:
    """What the last solution said."""
    values = json.loads(camera.get(store.SOLUTION, "{}"))
    for name in ("wrong", "keys"):
        values[name] = tuple(values.get(name, ()))
    remarks = from_plain(values.pop("remarks", values.pop("advice", ())))  # "advice" in files of version 0.1.0
    return Solution(**values, remarks=remarks)


def fill_rows(camera: bpy.types.Object) -> None:
    """Bring the rows that the panel lists in line with the pairs and the solution."""
    settings, pairs, solution = camera.rockfall_alignment, pairs_of(camera), solution_of(camera)
    rows = settings.rows
    while len(rows) > len(pairs):
        rows.remove(len(rows) - 1)
    while len(rows) < len(pairs):
        rows.add()
    for row, pair in zip(rows, pairs, strict=True):
        row.pair = ""  # while it is empty the row does not answer
        row.name, row.enabled, row.colour = pair.name, pair.enabled, pair.colour
        row.frame, row.missing, row.is_wrong = pair.frame, pair.missing, pair.id in solution.wrong
        residual = (solution.residual or {}).get(pair.id)
        row.residual_px = math.hypot(*residual) if residual is not None else math.nan
        row.residual_m = (solution.residual_m or {}).get(pair.id, math.nan)
        row.pair = pair.id


def place_by_eye(scene: bpy.types.Scene, camera: bpy.types.Object, placed: Camera) -> None:
    """Put the camera where a person says that it stood."""
    videos.set_camera_path(scene, camera, fixed(placed))
    camera[store.PLACED] = BY_EYE
    camera.pop(store.FOLLOWED, None)
    keep_lens(camera, placed.intrinsics)
    keep_check(camera, Solution())


def propose_here(scene: bpy.types.Scene, camera: bpy.types.Object) -> int:
    """Offer the terrain points of the pairs in the frame that is shown, to be dragged to where they are seen.

    Returns how many are in the picture.
    """
    frame, pairs = videos.true_frame(scene, camera), pairs_of(camera)
    here = {pair.point for pair in pairs if pair.frame == frame}
    added: list[Pair] = []
    for pair in pairs:
        if pair.is_complete and pair.frame != frame and pair.point not in here:
            pixel = pixel_of(camera, replace(pair, frame=frame))
            if pixel is not None:
                here.add(pair.point)
                added.append(replace(pair, id=uuid.uuid4().hex, pixel=pixel, frame=frame, proposed=PIXEL))
    keep_pairs(camera, [*pairs, *added])
    fill_rows(camera)
    return len(added)


def marks(camera: bpy.types.Object, frame: int, *, through_camera: bool) -> tuple[list[Pair], str, NDArray[np.float64]]:
    """What can be taken hold of in a view: pairs, which side of them, and (n, 2) pixels or (n, 3) points."""
    side = PIXEL if through_camera else POINT
    shown = [
        pair
        for pair in pairs_of(camera)
        if getattr(pair, side) is not None and (not moves(camera) or not through_camera or pair.frame == frame)
    ]
    places = np.array([getattr(pair, side) for pair in shown], dtype=np.float64)
    return shown, side, places.reshape(-1, 2 if through_camera else 3)


def hint(scene: bpy.types.Scene, camera: bpy.types.Object | None) -> str:
    """What to do next, in a sentence."""
    if camera is None:
        return "Add a video first (step 2)."
    if not terrain.tiles(scene):
        return "Import the terrain first (step 1)."
    pairs, pair = pairs_of(camera), open_pair(camera)
    if pair is not None:
        if pair.proposed == POINT:
            return (
                f"Pair {pair.name}: drag the dashed mark on the terrain to the right place, or press Enter if it fits."
            )
        if pair.proposed == PIXEL:
            return (
                f"Pair {pair.name}: drag the dashed mark in the picture to the right place, or press Enter if it fits."
            )
        where = "on the terrain" if pair.missing == POINT else "in the picture"
        return f"Pair {pair.name}: now click the same place {where}."
    waiting = sum(bool(pair.proposed) for pair in pairs)
    if waiting:
        return f"Drag {waiting} dashed marks to where they are seen in this frame; Enter takes one that fits."
    ready = _used_at(pairs, camera, reference_frame(pairs))
    more = needed_pairs(free_of(camera)) - len(ready)
    if not pairs:
        return (
            "Click a place in the picture that you will find again on the terrain: a boulder's edge, a ledge, a crack."
        )
    if more > 0:
        return f"{len(ready)} {'pair' if len(ready) == 1 else 'pairs'}. {more} more and the camera is solved."
    if placement(camera) == BY_PAIRS and len(ready) < GOOD_PAIRS:
        return "Fade the footage to check it. More pairs, out to the edges, make it surer."
    return ""


def look_through(scene: bpy.types.Scene, camera: bpy.types.Object) -> None:
    """Make it the scene's camera, and the scene's pictures as large as the video's."""
    scene.camera = camera
    render = scene.render
    render.resolution_x, render.resolution_y = videos.size_of(camera)
    render.resolution_percentage = 100
    render.pixel_aspect_x, render.pixel_aspect_y = camera.get(store.ASPECT, (1.0, 1.0))


def free_ray(rv3d: bpy.types.RegionView3D, width: float, height: float, x: float, y: float) -> tuple[Array, Array]:
    """Origin and direction, (1, 3) each, of what is seen at a place of a region, in double precision.

    width, height, x, y : of the region and in it [px], y from below.
    """
    window, view = np.array(rv3d.window_matrix, dtype=np.float64), np.array(rv3d.view_matrix, dtype=np.float64)
    a, b = 2 * x / width - 1, 2 * y / height - 1
    if rv3d.is_perspective:
        origin = np.zeros(3)
        direction = np.array([(a + window[0, 2]) / window[0, 0], (b + window[1, 2]) / window[1, 1], -1.0])
    else:
        back = np.abs(view[:3, 3]).max() + 1e4  # in front of everything
        origin = np.array([(a - window[0, 3]) / window[0, 0], (b - window[1, 3]) / window[1, 1], back])
        direction = np.array([0.0, 0.0, -1.0])
    turn = view[:3, :3]
    return ((origin - view[:3, 3]) @ turn)[None], (direction @ turn)[None]


def seen_camera(
    scene: bpy.types.Scene, camera: bpy.types.Object, rv3d: bpy.types.RegionView3D, width: float, *, keep_focal: bool
) -> Camera:
    """A camera that stands where a 3-D view looks from, with the video's size.

    width : of the region [px]; unless the focal length is kept, the picture shows as much as the region's width.

    Raises
    ------
    RockfallError : the view has no perspective.
    """
    matrix = rv3d.view_matrix.inverted()
    if rv3d.view_perspective == "CAMERA" and scene.camera == camera:
        matrix, keep_focal = camera.matrix_world, True
    elif rv3d.view_perspective != "PERSP":
        raise RockfallError("This view has no perspective, so no camera sees it. Press Numpad 5 first.")
    position, rotation = pose_from_blender(np.array(matrix))
    lens, (w, h) = lens_of(camera), videos.size_of(camera)
    if not keep_focal:
        lens[:2] = float(rv3d.window_matrix[0][0]) * w / 2 * np.array([1.0, lens[1] / lens[0]])
    one = Camera(w, h, 1.0, 1.0, 0.0, 0.0, position=position, rotation=rotation, shift=georeference.read_shift(scene))
    return with_intrinsics(one, lens)

# SPDX-License-Identifier: GPL-3.0-or-later
"""A person marks, moves, accepts and deletes pairs; the camera is solved at every change."""

import uuid
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import bpy
import numpy as np

from ....core.camera.path import project_at
from ....core.errors import RockfallError
from ....core.vectors import Array
from ...scene.footage import alignment, camera_paths, clocks, pairs, videos
from ...scene.footage.pairs import PIXEL, POINT, Pair, keep_pairs, open_pair, pairs_of, with_id
from ...scene.storage import store
from . import looking
from .solving import fill_rows, solve

ALIGNED = (
    store.PAIRS, store.OPEN_PAIR, store.SOLUTION, store.KNOWN_LENS, store.PLACED, store.FOLLOWED, store.SOLVED,
    store.CAMERA, store.REFERENCE_POSE, store.POSE_TIMES, store.POSES, store.POSE_SIGMA, store.CAMERA_SHIFT,
    store.RMSE, store.POSE_COVARIANCE, store.ASPECT, store.CAMERA_QUALITY,
)  # fmt: skip
"""What is kept of an alignment."""
LENS = ("type", "sensor_fit", "lens_unit", "sensor_width", "sensor_height", "lens", "shift_x", "shift_y")
"""Of Blender's camera."""
PLACE = ("location", "rotation_mode", "rotation_euler", "rotation_quaternion", "scale")
"""Of its object."""


@dataclass(frozen=True)
class Before:
    """An alignment and Blender's camera, to go back to."""

    kept: dict[str, object]
    active: int
    place: dict[str, object]
    lens: dict[str, object]


def mark(
    scene: bpy.types.Scene, camera: bpy.types.Object, side: str, place: Sequence[float], *, frame: int | None = None
) -> str:
    """A person has clicked: begin a pair, or give the open one its other side. Returns the pair's id.

    side : "pixel" with u, v [px], or "point" with x, y, z local [m].

    Raises
    ------
    RockfallError : the pixel is outside of the picture.
    """
    marked, place = pairs_of(camera), tuple(float(value) for value in place)
    if side == PIXEL:
        _check_inside(camera, place)
    shown = clocks.true_frame(scene, camera) if frame is None else frame
    pair = open_pair(camera)
    if pair is None:
        pair = _new(marked, shown)
        marked.append(pair)
        camera[store.OPEN_PAIR] = pair.id
    there = pair.pixel if side == POINT else pair.point
    pair = replace(pair, pixel=place, frame=shown) if side == PIXEL else replace(pair, point=place)
    if there is None or pair.proposed not in ("", side):
        pair = _with_prediction(scene, camera, pair, side)  # a second click on the same side moves it
    else:
        pair = replace(pair, proposed="")
    _store(scene, camera, marked, pair)
    return pair.id


def move(
    scene: bpy.types.Scene,
    camera: bpy.types.Object,
    identifier: str,
    side: str,
    place: Sequence[float],
    *,
    is_held: bool = False,
) -> None:
    """Move one side of a pair; a prediction that was moved is measured, once the mouse is let go.

    is_held : while the mouse is.
    """
    marked = pairs_of(camera)
    pair = with_id(marked, identifier)
    if pair is None:
        return
    place = tuple(float(value) for value in place)
    if side == PIXEL:
        _check_inside(camera, place)
        pair = replace(pair, pixel=place)
    else:
        pair = replace(pair, point=place)
    if side in (pair.proposed, pair.agreed) and not is_held:
        pair = replace(pair, proposed="", agreed="")
    elif pair.proposed and pair.proposed != side:
        pair = _with_prediction(scene, camera, pair, side)
    _store(scene, camera, marked, pair)


def accept(scene: bpy.types.Scene, camera: bpy.types.Object, identifier: str) -> None:
    """A person agrees with a prediction: it is where the camera has it, so its residual is no measurement."""
    marked = pairs_of(camera)
    pair = with_id(marked, identifier)
    if pair is not None and pair.proposed:
        _store(scene, camera, marked, replace(pair, proposed="", agreed=pair.proposed))


def edit(scene: bpy.types.Scene, camera: bpy.types.Object, identifier: str, **values: object) -> None:
    """Give a pair another name, or (not) count it."""
    marked = pairs_of(camera)
    pair = with_id(marked, identifier)
    if pair is None:
        return
    changed = replace(pair, **values)
    if changed != pair:
        _store(scene, camera, marked, changed)


def delete(scene: bpy.types.Scene, camera: bpy.types.Object, identifiers: Iterable[str]) -> int:
    """Remove pairs; returns how many there were."""
    gone, marked = set(identifiers), pairs_of(camera)
    left = [pair for pair in marked if pair.id not in gone]
    keep_pairs(camera, left)
    solve(scene, camera)
    settings = camera.rockfall_alignment
    settings.active = max(0, min(settings.active, len(left) - 1))
    return len(marked) - len(left)


def propose_here(scene: bpy.types.Scene, camera: bpy.types.Object) -> int:
    """Offer the terrain points of the pairs in the frame that is shown, to be dragged to where they are seen.

    Returns how many are in the picture.
    """
    frame, marked = clocks.true_frame(scene, camera), pairs_of(camera)
    here = {pair.point for pair in marked if pair.frame == frame}
    added: list[Pair] = []
    for pair in marked:
        if pair.is_complete and pair.frame != frame and pair.point not in here:
            pixel = pixel_of(camera, replace(pair, frame=frame))
            if pixel is not None:
                here.add(pair.point)
                added.append(replace(pair, id=uuid.uuid4().hex, pixel=pixel, frame=frame, proposed=PIXEL))
    keep_pairs(camera, [*marked, *added])
    fill_rows(camera)
    return len(added)


def remember(camera: bpy.types.Object) -> Before:
    """The alignment as it is now."""
    return Before(
        kept={key: _plain(camera[key]) for key in ALIGNED if key in camera},
        active=camera.rockfall_alignment.active,
        place={name: _plain(getattr(camera, name)) for name in PLACE},
        lens={name: getattr(camera.data, name) for name in LENS},
    )


def restore(scene: bpy.types.Scene, camera: bpy.types.Object, before: Before) -> None:
    """Bring an alignment back, and show the camera as it was."""
    if camera_paths.is_solved(camera):
        camera_paths.unsolve(camera)
    for key in ALIGNED:
        if key in before.kept:
            camera[key] = before.kept[key]
        elif key in camera:
            del camera[key]
    if camera_paths.is_solved(camera):
        camera_paths.write_lens(camera, camera_paths.camera_path(camera).reference)
        camera_paths.write_keys(scene, camera)
    else:
        for obj, values in ((camera, before.place), (camera.data, before.lens)):
            for name, value in values.items():
                setattr(obj, name, value)
    fill_rows(camera)
    camera.rockfall_alignment.active = before.active


def _plain(value: object) -> object:
    """A stored value on its own, which edits of the camera do not reach."""
    if isinstance(value, list):
        return [each.to_dict() for each in value]
    if hasattr(value, "to_list"):
        return value.to_list()
    return value.copy() if hasattr(value, "copy") else value


def activate(camera: bpy.types.Object, identifier: str) -> None:
    """Make the row of a pair the active one."""
    for index, pair in enumerate(pairs_of(camera)):
        if pair.id == identifier and camera.rockfall_alignment.active != index:
            camera.rockfall_alignment.active = index


def marks(camera: bpy.types.Object, frame: int, *, through_camera: bool) -> tuple[list[Pair], str, Array]:
    """What can be taken hold of in a view: pairs, which side of them, and (n, 2) pixels or (n, 3) points."""
    side = PIXEL if through_camera else POINT
    anywhere = not through_camera or not alignment.moves(camera)
    shown = [pair for pair in pairs_of(camera) if getattr(pair, side) is not None and (anywhere or pair.frame == frame)]
    places = np.array([getattr(pair, side) for pair in shown], dtype=np.float64)
    return shown, side, places.reshape(-1, 2 if through_camera else 3)


def pixel_of(camera: bpy.types.Object, pair: Pair) -> tuple[float, float] | None:
    """Where the camera as it is now sees the point of a pair; None outside of the picture."""
    if pair.point is None:
        return None
    u, v = reprojections(camera, [pair])[0].tolist()
    width, height = videos.size_of(camera)
    return (u, v) if 0 <= u <= width and 0 <= v <= height else None


def reprojections(camera: bpy.types.Object, marked: Sequence[Pair], frame: int | None = None) -> Array:
    """(n, 2) where the camera sees the points, each in its pair's frame or all in one; NaN where it does not."""
    points = np.array([pair.point if pair.point is not None else (np.nan,) * 3 for pair in marked]).reshape(-1, 3)
    frames = [pair.frame if frame is None else frame for pair in marked]
    return project_at(camera_paths.camera_path(camera), points, pairs.times_of(camera, frames))


def _store(scene: bpy.types.Scene, camera: bpy.types.Object, marked: list[Pair], pair: Pair) -> None:
    keep_pairs(camera, [pair if other.id == pair.id else other for other in marked])
    solve(scene, camera)
    activate(camera, pair.id)


def _new(marked: Sequence[Pair], frame: int) -> Pair:
    number = 1 + max((int(pair.name) for pair in marked if pair.name.isdecimal()), default=0)
    used = [sum(pair.colour == colour for pair in marked) for colour in range(pairs.COLOURS)]
    return Pair(uuid.uuid4().hex, str(number), None, None, frame, colour=used.index(min(used)))


def _check_inside(camera: bpy.types.Object, pixel: Sequence[float]) -> None:
    width, height = videos.size_of(camera)
    if not (0 <= pixel[0] <= width and 0 <= pixel[1] <= height):
        raise RockfallError("That is outside of the picture. Mark a place inside of it.")


def _with_prediction(scene: bpy.types.Scene, camera: bpy.types.Object, pair: Pair, side: str) -> Pair:
    """The pair with its other side where the camera as it is now has it; nothing while nothing is known."""
    other = POINT if side == PIXEL else PIXEL
    found = None
    if camera_paths.is_solved(camera):
        at = looking.point_at
        found = at(scene, camera, pair.pixel, pair.frame) if side == PIXEL else pixel_of(camera, pair)
    if found is None:
        return replace(pair, proposed="", **{other: None})
    return replace(pair, proposed=other, **{other: found})

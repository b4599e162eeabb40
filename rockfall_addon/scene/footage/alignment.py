# SPDX-License-Identifier: GPL-3.0-or-later
"""How the alignment of a camera stands: what its pairs gave, how it was placed, and what is known of its lens."""

import json
import math
from dataclasses import dataclass, fields

import bpy
import numpy as np

from ....core.camera.model import full_frame_mm, pinhole
from ....core.camera.resection.problem import needed_pairs
from ....core.footage.background import BackgroundMotion
from ....core.remarks import Remark, from_plain, from_text, to_plain, to_text
from ....core.vectors import Array
from ....core.workflow.alignment import counting_pairs, reference_frame
from ....core.workflow.noticed import STILL_PX, moves_at_a_glance, no_tripod
from ..storage import store
from ..terrain import georeference, terrain
from . import camera_paths, videos
from .pairs import POINT, complete_of, open_pair, pairs_of, table

GOOD_PAIRS = 8
BY_PAIRS, BY_EYE, FROM_FILE = "pairs", "eye", "file"

LENS_BOXES = {"f": "free_focal", "c": "free_centre"} | {name: f"free_{name}" for name in ("k1", "k2", "k3", "p1", "p2")}
"""What the core calls free → the box in the panel."""


@dataclass(frozen=True)
class Solution:
    """What came out of the pairs, for the panel and the overlay.

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


def solution_of(camera: bpy.types.Object) -> Solution:
    """What came out last."""
    values = store.read_json(camera, store.SOLUTION, {})
    for name in ("wrong", "keys"):
        values[name] = tuple(values.get(name, ()))
    remarks = from_plain(values.pop("remarks", values.pop("advice", ())))  # "advice" in files of version 0.1.0
    return Solution(**values, remarks=remarks)


def keep_solution(camera: bpy.types.Object, solution: Solution) -> None:
    """Store a solution."""
    values = {f.name: getattr(solution, f.name) for f in fields(solution)}
    camera[store.SOLUTION] = json.dumps(values | {"remarks": to_plain(solution.remarks)})


def placement(camera: bpy.types.Object) -> str:
    """How the camera came to its place: `BY_PAIRS`, `BY_EYE`, `FROM_FILE`, or empty."""
    return str(camera.get(store.PLACED, FROM_FILE)) if camera_paths.is_solved(camera) else ""


def moves(camera: bpy.types.Object) -> bool:
    """Whether the camera has a pose for each frame, or is to get one."""
    return camera.rockfall_alignment.motion != "FIXED"


def is_to_be_followed(camera: bpy.types.Object) -> bool:
    """Whether it is solved and moves, and has one frame's pose for all while nobody has followed its background."""
    fixed = camera_paths.is_solved(camera) and camera_paths.camera_path(camera).is_fixed
    return fixed and moves(camera) and store.FOLLOWED not in camera


def keep_background(camera: bpy.types.Object, motion: BackgroundMotion) -> None:
    """Remember whether the background of a video says that its camera is no tripod."""
    camera[store.BACKGROUND] = to_text(no_tripod(motion, camera_paths.camera_path(camera).reference, camera.name))


def look_at_background(camera: bpy.types.Object, moved_px: float) -> None:
    """Remember whether the pictures of a video lie apart; what was found by following its background is not touched."""
    said = moves_at_a_glance(moved_px, camera.name)
    if store.BACKGROUND not in camera and (said or moved_px < STILL_PX):
        camera[store.BACKGROUND] = to_text(said)  # nothing said: nobody needs to ask


def background_remarks(camera: bpy.types.Object) -> tuple[Remark, ...]:
    """What the background says against the camera that was chosen, as far as the video was looked through."""
    said = () if moves(camera) else from_text(str(camera.get(store.BACKGROUND, "")), "warning")
    return said if said and camera_paths.camera_path(camera).is_fixed else ()


def is_taken_for_a_tripod(camera: bpy.types.Object) -> bool:
    """Whether it has one pose for all frames, and nobody has looked whether the background moves."""
    return not moves(camera) and store.BACKGROUND not in camera and camera_paths.camera_path(camera).is_fixed


def free_of(camera: bpy.types.Object) -> tuple[str, ...]:
    """The parameters of the lens that are to be found."""
    settings = camera.rockfall_alignment
    return tuple(name for name, box in LENS_BOXES.items() if getattr(settings, box))


def known_lens(camera: bpy.types.Object) -> Array:
    """(9,) what is taken of the lens where it is not free: as imported or typed, else as it is, without distortion."""
    if store.KNOWN_LENS in camera:
        return np.array(camera[store.KNOWN_LENS], dtype=np.float64)
    lens = pinhole(*videos.size_of(camera), 1.0).intrinsics
    lens[:2] = lens_of(camera)[:2]
    return lens


def keep_lens(camera: bpy.types.Object, values: Array) -> None:
    """Remember what is known of the lens."""
    camera[store.KNOWN_LENS] = [float(value) for value in values]


def lens_of(camera: bpy.types.Object) -> Array:
    """(9,) the lens as it is now."""
    return camera_paths.camera_path(camera).reference.intrinsics


def focal_px(camera: bpy.types.Object) -> float:
    """The focal length as it is now [px]."""
    return float(lens_of(camera)[0])


def focal_mm(camera: bpy.types.Object, focal: float) -> float:
    """What a focal length [px] is on a camera of full frame [mm]."""
    return full_frame_mm(focal, videos.size_of(camera))


def ready_pairs(scene: bpy.types.Scene, camera: bpy.types.Object) -> int:
    """How many pairs the reference frame is solved from."""
    pairs = table(complete_of(camera), georeference.read_shift(scene))
    return int(counting_pairs(pairs, reference_frame(pairs), moves=moves(camera)).sum())


def hint(scene: bpy.types.Scene, camera: bpy.types.Object | None) -> str:
    """What to do next, in a sentence."""
    if camera is None:
        return "Add a video first (step 2)."
    if not terrain.tiles(scene):
        return "Import the terrain first (step 1)."
    pairs, pair = pairs_of(camera), open_pair(camera)
    if pair is not None and pair.proposed:
        where = "on the terrain" if pair.proposed == POINT else "in the picture"
        return f"Pair {pair.name}: drag the dashed mark {where} to the right place; click it if it fits."
    if pair is not None:
        where = "on the terrain" if pair.missing == POINT else "in the picture"
        return f"Pair {pair.name}: now click the same place {where}."
    if waiting := sum(bool(each.proposed) for each in pairs):
        return f"Drag {waiting} dashed marks to where they are seen in this frame; click one that fits."
    if not pairs:
        for remark in background_remarks(camera):
            return remark.text
        return (
            "Click a place in the picture that you will find again on the terrain: a boulder's edge, a ledge, a crack."
        )
    ready = ready_pairs(scene, camera)
    lacking = needed_pairs(free_of(camera)) - ready
    if lacking > 0:
        return f"{ready} {'pair' if ready == 1 else 'pairs'}. {lacking} more and the camera is solved."
    if placement(camera) == BY_PAIRS and ready < GOOD_PAIRS:
        return "Fade the footage to check it. More pairs, out to the edges, make it surer."
    return ""

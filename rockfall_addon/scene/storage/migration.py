# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of other versions: older ones are brought up to date when they are opened, newer ones are left as they are."""

import json
import uuid

import bpy

from ....core.errors import RockfallError
from ..footage import timing
from ..picks import impact_numbers, keyframes, picks, trajectories
from ..terrain import georeference
from . import materials, set_aside, store

SCHEMA = 3


def version(scene: bpy.types.Scene) -> int | None:
    """The schema of what is in a scene: 0 before there were numbers, None when nothing of ours is there."""
    kept = scene.get(store.SCHEMA)
    if isinstance(kept, (int, float)) and kept >= 0:
        return int(kept)
    return 0 if kept is not None or any(store.ROLE in obj for obj in scene.objects) else None


def is_newer(scene: bpy.types.Scene) -> bool:
    """Whether the scene was saved by a Rockfall that this one does not understand."""
    return store.SCHEMA in scene and (version(scene) or 0) > SCHEMA


def is_left_alone(scene: bpy.types.Scene) -> bool:
    """Whether nothing is written into the scene: a newer Rockfall saved it, or it is linked from another file."""
    return not store.is_own(scene) or is_newer(scene)


def warning(scene: bpy.types.Scene) -> str:
    """What to say about such a scene."""
    if not store.is_own(scene):
        return (
            "This scene is linked from another file, so nothing is computed or changed here. Open that file, or make "
            "the scene local: Object > Relations > Make Local > All."
        )
    return (
        f"This scene was saved by a newer Rockfall (schema {version(scene)}, this one knows {SCHEMA}). "
        "Update the extension. Until then nothing is computed or changed here."
    )


def migrate(scene: bpy.types.Scene) -> bool:
    """Bring a scene to the present schema; True when something had to be done."""
    found = version(scene)
    if found is None or found >= SCHEMA or not store.is_own(scene):
        return False
    for step in STEPS[found:]:
        step(scene)
    scene[store.SCHEMA] = SCHEMA
    return True


def _from_0(scene: bpy.types.Scene) -> None:
    """Picks got ids, the frame of their key and their shift; blocks are text, which has no limit for names."""
    blocks = scene.get(store.BLOCKS)
    if hasattr(blocks, "to_dict"):
        scene[store.BLOCKS] = json.dumps(blocks.to_dict(), default=str)
    _from_1(scene)
    set_aside.look_at_scene(scene)
    objects = store.of_role(scene, store.PICK_ROLE)
    shift = georeference.read_shift(scene).vector.tolist()
    for obj in objects:
        for key, value in (
            (store.ID, uuid.uuid4().hex),
            (store.KIND, "impact"),
            (store.STATUS, "ok"),
            (store.ROW, 0),
            (store.EXTRA, {}),
            (store.PICK_SHIFT, shift),
        ):
            if key not in obj:
                obj[key] = value
        curves = keyframes.location_curves(obj)
        if store.KEY_FRAME not in obj and curves and len(curves[0].keyframe_points):
            obj[store.KEY_FRAME] = float(curves[0].keyframe_points[0].co[0])
    set_aside.look(scene)
    objects = picks.objects_of(scene)
    if objects and store.OFFSETS not in scene:
        try:
            timing.keep_offsets(scene, timing.offsets_of(scene, picks.picks_of(scene)))
        except RockfallError:  # two picks at one time: the panel will say so
            timing.keep_offsets(scene, {})
    if store.has_role(scene, store.BLOCK_ROLE):
        trajectories.block_mesh()
    if materials.TRAIL_GROUP in bpy.data.node_groups:
        materials.trail_group()


def _from_1(scene: bpy.types.Scene) -> None:
    """The numbers of an impact were a group of lists, the flags among them."""
    for obj in store.of_role(scene, store.PICK_ROLE):
        kept = obj.get(store.RESULT)
        if not hasattr(kept, "to_dict"):
            continue
        values = kept.to_dict()
        try:
            impact_numbers.keep(obj, values)
            obj[store.FLAGS] = str(values.get("flags", ""))
        except (TypeError, ValueError):  # somebody has changed it; it is computed anew
            del obj[store.RESULT]


def _from_2(scene: bpy.types.Scene) -> None:
    """The numbers of an impact ended with intervals of the ground that the block met."""
    for obj in store.of_role(scene, store.PICK_ROLE):
        kept = obj.get(store.RESULT)
        if kept is not None and hasattr(kept, "to_list") and len(kept) == impact_numbers.WIDTH + 6:
            obj[store.RESULT] = kept.to_list()[: impact_numbers.WIDTH]


STEPS = (_from_0, _from_1, _from_2)
"""The step from each schema to the next."""

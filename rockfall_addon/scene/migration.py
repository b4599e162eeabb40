# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of other versions: older ones are brought up to date when they are opened, newer ones are left as they are."""

import json
import uuid

import bpy

from ...core.errors import RockfallError
from . import keyframes, materials, picks, store, timing

SCHEMA_KEY = "rockfall_schema"
SCHEMA = 1


def version(scene: bpy.types.Scene) -> int | None:
    """The schema of what is in a scene: 0 before there were numbers, None when nothing of ours is there."""
    if SCHEMA_KEY in scene:
        return int(scene[SCHEMA_KEY])
    return 0 if any(store.ROLE_KEY in thing for thing in scene.objects) else None


def is_newer(scene: bpy.types.Scene) -> bool:
    """Whether the scene was saved by a Rockfall that this one does not understand."""
    return SCHEMA_KEY in scene and int(scene[SCHEMA_KEY]) > SCHEMA


def warning(scene: bpy.types.Scene) -> str:
    """What to say about a newer scene."""
    return (
        f"This scene was saved by a newer Rockfall (schema {int(scene[SCHEMA_KEY])}, this one knows {SCHEMA}). "
        "Update the extension. Until then nothing is computed or changed here."
    )


def refuse_newer(scene: bpy.types.Scene) -> None:
    """Raise a RockfallError when the scene is of a newer version."""
    if is_newer(scene):
        raise RockfallError(warning(scene))


def migrate(scene: bpy.types.Scene) -> bool:
    """Bring a scene to the present schema; True when something had to be done."""
    found = version(scene)
    if found is None or found >= SCHEMA:
        return False
    for step in STEPS[found:]:
        step(scene)
    scene[SCHEMA_KEY] = SCHEMA
    return True


def _from_0(scene: bpy.types.Scene) -> None:
    """Picks got ids, the frame of their key and their shift; blocks are text, which has no limit for names."""
    blocks = scene.get("rockfall_blocks")
    if blocks is not None and not isinstance(blocks, str):
        scene["rockfall_blocks"] = json.dumps({name: list(values) for name, values in blocks.items()})
    things = [thing for thing in picks.things_of(scene) if picks.TIME_KEY in thing and picks.POSITION_KEY in thing]
    shift = store.read_shift(scene).vector.tolist()
    for thing in things:
        for key, value in (
            (picks.ID_KEY, uuid.uuid4().hex),
            (picks.KIND_KEY, "impact"),
            (picks.STATUS_KEY, "ok"),
            (picks.ROW_KEY, 0),
            (picks.EXTRA_KEY, {}),
            (picks.PICK_SHIFT_KEY, shift),
        ):
            if key not in thing:
                thing[key] = value
        curves = keyframes.location_curves(thing)
        if picks.KEY_FRAME_KEY not in thing and curves and len(curves[0].keyframe_points):
            thing[picks.KEY_FRAME_KEY] = float(curves[0].keyframe_points[0].co[0])
    if things and timing.OFFSETS_KEY not in scene:
        try:
            timing.keep_offsets(scene, timing.offsets_of(scene, picks.picks_of(scene)))
        except RockfallError:  # two picks at one time: the panel will say so
            timing.keep_offsets(scene, {})
    if materials.TRAIL_GROUP in bpy.data.node_groups:
        materials.trail_group()


STEPS = (_from_0,)
"""The step from each schema to the next."""

# SPDX-License-Identifier: GPL-3.0-or-later
"""What the scene shows of each trajectory, as a fingerprint of its picks: it tells which trajectory has changed.

The fingerprints are in the scene, so that after an undo they belong to what is shown then.
"""

import hashlib
import json
from collections.abc import Iterable, Sequence

import bpy

from ..footage import timing
from ..picks import keyframes, picks
from ..terrain import terrain, terrain_mesh
from . import store

COMPLETE = "+"
"""Behind the fingerprint of a trajectory that has flights and a block."""
_KEPT = (
    store.ID,
    store.KIND,
    store.STATUS,
    store.NORMAL,
    store.SIGMA_TIME,
    store.SIGMA_POSITION,
    store.SPIN,
    store.EXTRA,
    store.POSITION,
)


def by_trajectory(objects: Iterable[bpy.types.Object]) -> dict[str, list[bpy.types.Object]]:
    """The picks of each trajectory, in the order in which they come."""
    found: dict[str, list[bpy.types.Object]] = {}
    for obj in objects:
        found.setdefault(obj[store.TRAJECTORY], []).append(obj)
    return found


def fingerprint(objects: Sequence[bpy.types.Object], rate: float, held: picks.Held = picks.NOTHING_HELD) -> str:
    """Of all that a trajectory is computed from, with what a person is just doing to it, or to its block's keys."""
    rows = []
    for obj in objects:
        row = [picks.time_of(obj, rate, held)]
        for key in _KEPT:
            value = obj.get(key)
            if key == store.EXTRA:
                row.append(str(value.get("confidence", "")) if value is not None else "")
            else:
                row.append(value if value is None or isinstance(value, str) else tuple(value))
        if picks.moved(obj, held):
            row.append((*obj.location, *picks.resting_place(obj, None, 0.0, held)))
        rows.append(repr(row))
    return hashlib.sha1("\n".join(sorted(rows)).encode(), usedforsecurity=False).hexdigest()


def remembered(scene: bpy.types.Scene) -> dict[str, str]:
    """Trajectory → fingerprint of what is shown of it."""
    return store.read_json(scene, store.SHOWN, {})


def remember(scene: bpy.types.Scene, prints: dict[str, str]) -> None:
    """Store the fingerprints."""
    text = json.dumps(prints)
    if scene.get(store.SHOWN) != text:
        scene[store.SHOWN] = text


def mark(trail: bpy.types.Object | None, block: bpy.types.Object | None, text: str) -> None:
    """Remember beside the flights' mesh and the block's keys which picks they show."""
    for holder in _holders(trail, block):
        if holder.get(store.PRINT) != text:
            holder[store.PRINT] = text


def is_marked(trail: bpy.types.Object | None, block: bpy.types.Object | None, text: str) -> bool:
    """Whether flights and block show these picks; after an undo the scene's own memory may be that of another step."""
    return all(holder.get(store.PRINT, text) == text for holder in _holders(trail, block))


def _holders(trail: bpy.types.Object | None, block: bpy.types.Object | None) -> list[bpy.types.ID]:
    found = [trail.data if trail is not None else None, keyframes.action_of(block) if block is not None else None]
    return [holder for holder in found if holder is not None]


def remember_all(scene: bpy.types.Scene) -> None:
    """All that is shown is up to date."""
    rate = timing.keyed_rate(scene)
    groups = by_trajectory(picks.objects_of(scene))
    trails, blocks = (
        {obj[store.TRAJECTORY]: obj for obj in store.with_role(scene, role)}
        for role in (store.FLIGHTS_ROLE, store.BLOCK_ROLE)
    )
    prints = {name: fingerprint(objects, rate) for name, objects in groups.items()}
    for name, text in prints.items():
        mark(trails.get(name), blocks.get(name), text)
    remember(scene, {name: text + (COMPLETE if name in trails else "") for name, text in prints.items()})
    scene[store.GROUND], scene[store.GROUND_CONTENTS] = ground(scene), ground_contents(scene)
    scene[store.TICK_RATE] = timing.frame_rate(scene)


def ground(scene: bpy.types.Scene) -> str:
    """What the terrain is: its tiles, their sizes and places; empty without."""
    rows = []
    for tile in terrain.tiles(scene):
        place = [round(value, 5) for row in tile.matrix_world for value in row]
        rows.append(f"{len(tile.data.vertices)} {len(tile.data.polygons)} {place}")
    return "\n".join(sorted(rows))


def ground_contents(scene: bpy.types.Scene) -> str:
    """Checksums of the tiles' meshes."""
    return "\n".join(sorted(str(terrain_mesh.contents_of(tile.data)) for tile in terrain.tiles(scene)))

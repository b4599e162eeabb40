# SPDX-License-Identifier: GPL-3.0-or-later
"""What the scene shows of each trajectory, as a fingerprint of its picks: it tells which trajectory has changed.

The fingerprints are in the scene, so that after an undo they belong to what is shown then.
"""

import hashlib
import json
from collections.abc import Iterable, Sequence

import bpy

from . import picks, store, terrain, terrain_mesh, timing

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


def by_trajectory(things: Iterable[bpy.types.Object]) -> dict[str, list[bpy.types.Object]]:
    """The picks of each trajectory, in the order in which they come."""
    found: dict[str, list[bpy.types.Object]] = {}
    for thing in things:
        found.setdefault(thing[store.TRAJECTORY], []).append(thing)
    return found


def fingerprint(things: Sequence[bpy.types.Object], rate: float) -> str:
    """Of all that a trajectory is computed from, with what a person is just doing to it."""
    rows = []
    for thing in things:
        row = [picks.time_of(thing, rate)]
        for key in _KEPT:
            value = thing.get(key)
            if key == store.EXTRA:
                row.append(str(value.get("confidence", "")) if value is not None else "")
            else:
                row.append(value if value is None or isinstance(value, str) else tuple(value))
        if picks.moved(thing):
            row.append(tuple(thing.location))
        rows.append(repr(row))
    return hashlib.sha1("\n".join(sorted(rows)).encode(), usedforsecurity=False).hexdigest()


def remembered(scene: bpy.types.Scene) -> dict[str, str]:
    """Trajectory → fingerprint of what is shown of it."""
    return json.loads(scene.get(store.SHOWN, "{}"))


def remember(scene: bpy.types.Scene, prints: dict[str, str]) -> None:
    """Store the fingerprints."""
    text = json.dumps(prints)
    if scene.get(store.SHOWN) != text:
        scene[store.SHOWN] = text


def remember_all(scene: bpy.types.Scene) -> None:
    """All that is shown is up to date."""
    rate = timing.keyed_rate(scene)
    groups = by_trajectory(picks.things_of(scene))
    flying = {o[store.TRAJECTORY] for o in scene.objects if o.get(store.ROLE) == store.FLIGHTS_ROLE}
    remember(scene, {n: fingerprint(things, rate) + (COMPLETE if n in flying else "") for n, things in groups.items()})
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

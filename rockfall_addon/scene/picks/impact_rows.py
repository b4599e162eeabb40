# SPDX-License-Identifier: GPL-3.0-or-later
"""The impact table: rows that the panel lists, mirrored from the results that the picks' objects keep."""

import math
import zlib

import bpy
import numpy as np

from ..storage import store
from . import impact_numbers, picks

COLUMNS = ("speed1_mps", "speed2_mps", "rn", "rt", "r", "theta1_deg", "theta_dev_deg")


def fill(scene: bpy.types.Scene, trajectory: str | None = None) -> None:
    """Write the rows of one trajectory, or of all, from the results that are stored."""
    rows = scene.rockfall_impacts
    names = None if trajectory is None else [trajectory]
    wanted = [obj for obj in picks.objects_of(scene, names) if store.RESULT in obj]
    wanted.sort(key=lambda obj: (obj[store.TRAJECTORY], obj[store.TIME]))
    there = list(range(len(rows))) if trajectory is None else _rows_of(rows, trajectory)
    for _ in range(len(wanted) - len(there)):
        rows.add()
        there.append(len(rows) - 1)
    for i in reversed(there[len(wanted) :]):
        rows.remove(i)
    found = rows if trajectory is not None else list(rows)  # Blender counts up to each number
    for i, obj in zip(there, wanted, strict=False):
        _write(found[i], obj)


def _rows_of(rows: bpy.types.bpy_prop_collection, trajectory: str) -> list[int]:
    """Where a trajectory is in the table; the number that stands for its name is read many times as quickly."""
    numbers = np.empty(len(rows), dtype=np.int32)
    rows.foreach_get("trajectory_number", numbers)
    wanted = _number_of(trajectory)
    return [int(i) for i in np.flatnonzero((numbers == wanted) | (numbers == 0)) if rows[i].trajectory == trajectory]


def _number_of(trajectory: str) -> int:
    return 1 + zlib.crc32(trajectory.encode()) % (2**31 - 1)


def highlight(scene: bpy.types.Scene, identifier: str) -> None:
    """Make the row of a pick the active one, if it has one."""
    rows, settings = scene.rockfall_impacts, scene.rockfall
    if 0 <= settings.impact_index < len(rows) and rows[settings.impact_index].pick == identifier:
        return
    for i, row in enumerate(rows):
        if row.pick == identifier:
            settings.impact_index = i
            return


def chosen(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """The pick of the active row."""
    rows, index = scene.rockfall_impacts, scene.rockfall.impact_index
    return picks.with_id(scene, rows[index].pick) if 0 <= index < len(rows) else None


def go_to(context: bpy.types.Context, scene: bpy.types.Scene, obj: bpy.types.Object) -> None:
    """Select a pick, and nothing else, and go to its moment."""
    layer = context.view_layer
    if layer is not None and obj.name in layer.objects:
        for other in layer.objects.selected:
            if other != obj:
                other.select_set(False)
        obj.select_set(True)
        layer.objects.active = obj
    frame = obj.get(store.KEY_FRAME)
    if frame is not None:
        scene.frame_set(math.floor(frame), subframe=frame % 1)


def selected(context: bpy.types.Context) -> bpy.types.Object | None:
    """The active pick."""
    obj = context.object
    return obj if obj is not None and obj.get(store.ROLE) == store.PICK_ROLE and store.is_own(obj) else None


def _write(row: bpy.types.PropertyGroup, obj: bpy.types.Object) -> None:
    result = impact_numbers.of(obj)
    row.pick, row.trajectory = obj[store.ID], obj[store.TRAJECTORY]
    row.trajectory_number = _number_of(obj[store.TRAJECTORY])
    row.number, row.flags = int(result["number"]), ";".join(impact_numbers.flags(obj))
    row.time_s = obj[store.TIME]
    row.speed1_mps, row.speed2_mps = math.hypot(*result["incident_mps"]), math.hypot(*result["restituted_mps"])
    for name in COLUMNS[2:]:
        setattr(row, name, result[name])

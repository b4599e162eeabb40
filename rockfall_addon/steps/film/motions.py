# SPDX-License-Identifier: GPL-3.0-or-later
"""How the blocks of a scene move, read from the flight curves that show it."""

from dataclasses import dataclass

import bpy
import numpy as np

from ....core.vectors import Array
from ...scene.storage import materials, store


@dataclass(frozen=True, eq=False)
class Motion:
    """One block: its samples by display time, (m,) [s], (m, 3) [m], (m,) [m/s]."""

    name: str
    time_s: Array
    position: Array
    speed_mps: Array


def motions_of(scene: bpy.types.Scene) -> list[Motion]:
    """The motions of all blocks in the scene, by the names of their trajectories."""
    return [_read(obj) for obj in store.with_role(scene, store.FLIGHTS_ROLE)]


def _read(obj: bpy.types.Object) -> Motion:
    mesh = obj.data
    count = len(mesh.vertices)
    places = np.empty(3 * count, dtype=np.float32)
    mesh.vertices.foreach_get("co", places)
    time, speed = (_values(mesh, name, count) for name in (materials.TIME_ATTRIBUTE, materials.SPEED_ATTRIBUTE))
    return Motion(str(obj[store.TRAJECTORY]), time, places.reshape(-1, 3).astype(np.float64), speed)


def _values(mesh: bpy.types.Mesh, name: str, count: int) -> Array:
    values = np.empty(count, dtype=np.float32)
    mesh.attributes[name].data.foreach_get("value", values)
    return values.astype(np.float64)

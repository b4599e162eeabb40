# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps of the faces in the 3-D view: each face that blocks touch in the colour of its class; and its numbers."""

from typing import NamedTuple

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ....core.georeference import GlobalShift
from ....core.hazard.classes import Classes, classes_in
from ....core.hazard.face_tally import AT_CONTACT, FACE_LAYERS, FaceMaps
from ....core.hazard.maps import CLASSES_KJ, QUANTITIES, SHARES
from ....core.terrain.raycast import cast_ray
from ....core.terrain.surface import Surface
from ...scene import hazard_maps

SHADE = 0.55
"""Part of a colour that the light decides: so faces are told apart."""
SUN = np.array([-0.4, -0.5, 0.77])
BEHIND_M = 0.02
"""A face that is so much further than the terrain is hidden by it."""
OPACITY = 0.9


class _Painted(NamedTuple):
    key: tuple
    classes: Classes
    batch: gpu.types.GPUBatch


_painted: list[_Painted] = []
_surfaces: list[tuple[FaceMaps, Surface]] = []


def unregister() -> None:
    _painted.clear()
    _surfaces.clear()


def shown_faces(scene: bpy.types.Scene) -> FaceMaps | None:
    """The maps of faces, if these are to be painted."""
    return hazard_maps.faces_of(scene) if scene.rockfall_simulation.map_on == "FACES" else None


def draw(scene: bpy.types.Scene, maps: FaceMaps) -> None:
    """Paint the shown map; the depth test is on."""
    painted = _of(scene, maps)
    if painted is None:
        return
    shader = gpu.shader.from_builtin("SMOOTH_COLOR")
    shader.bind()
    painted.batch.draw(shader)


def classes(scene: bpy.types.Scene, maps: FaceMaps) -> Classes | None:
    """Those of the shown map."""
    painted = _of(scene, maps)
    return None if painted is None else painted.classes


def colours_of(maps: FaceMaps, name: str, found: Classes) -> np.ndarray:
    """(t, 4) sRGB and opacity of the faces, lit so that they are told apart; transparent where there is no number."""
    colours = found.colours_of(maps.layers[name])
    normal = np.cross(maps.corners[:, 1] - maps.corners[:, 0], maps.corners[:, 2] - maps.corners[:, 0])
    length = np.maximum(np.linalg.norm(normal, axis=1), 1e-12)
    light = np.clip(normal @ (SUN / np.linalg.norm(SUN)) / length, 0, 1)
    colours[:, :3] *= (1 - SHADE + SHADE * light)[:, None]
    colours[:, 3] *= OPACITY
    return colours


def _of(scene: bpy.types.Scene, maps: FaceMaps) -> _Painted | None:
    name = scene.rockfall_simulation.face_layer
    values = maps.layers.get(name)
    if values is None:
        return None
    key = maps, name
    if not _painted or _painted[0].key != key:
        found = classes_in(FACE_LAYERS[name].unit, values)
        colours = colours_of(maps, name, found)
        there = colours[:, 3] > 0
        places = maps.corners[there].reshape(-1, 3).astype(np.float32)
        each = np.repeat(colours[there], 3, axis=0).astype(np.float32)
        batch = batch_for_shader(
            gpu.shader.from_builtin("SMOOTH_COLOR"), "TRIS",
            {"pos": np.ascontiguousarray(places), "color": np.ascontiguousarray(each)},
        )  # fmt: skip
        _painted[:] = [_Painted(key, found, batch)]
    return _painted[0]


def face_under(maps: FaceMaps, origin: np.ndarray, direction: np.ndarray, terrain_m: float) -> int:
    """The row of the touched face that a ray meets first; −1 where the terrain is before it, or there is none.

    Parameters
    ----------
    terrain_m : distance of the terrain along the ray [m].
    """
    if not _surfaces or _surfaces[0][0] is not maps:
        corners = np.arange(3 * len(maps.faces), dtype=np.int32).reshape(-1, 3)
        _surfaces[:] = [(maps, Surface(maps.corners.reshape(-1, 3).copy(), corners, GlobalShift(), "faces"))]
    hit = cast_ray(_surfaces[0][1], origin, direction)
    if hit is None or hit.distance > terrain_m + BEHIND_M:
        return -1
    return int(hit.face)


def card_of(maps: FaceMaps, row: int) -> tuple[list[str], list[list[str]]]:
    """What stands on the card of a face: sentences, and the rows of a table, the first of which are its headings."""
    if row < 0:
        return ["No block touches this face."], []

    def value(name: str) -> float:
        values = maps.layers.get(name)
        return float("nan") if values is None else float(values[row])

    of = "the terrain" if maps.of[row] == "terrain" else str(maps.of[row])
    normal = np.cross(*(maps.corners[row, i] - maps.corners[row, 0] for i in (1, 2)))
    dip = np.degrees(np.arccos(np.clip(normal[2] / max(float(np.linalg.norm(normal)), 1e-12), -1, 1)))
    said = [
        f"{value('Nr_blocks'):.0f} of {maps.blocks} blocks touch this face of {of}: {value('Reach_probability'):.3g} %",
        f"{value('Nr_contacts'):.0f} contact{'s' * (value('Nr_contacts') != 1)}; it dips {dip:.0f}°",
        "; ".join(f"{value(f'E_over_{limit}kJ'):.3g} % above {limit} kJ" for limit in CLASSES_KJ),
    ]
    columns = ["mean", *(f"{share}CI" for share in SHARES), "95CI_error", "max"]
    table = [["", "mean", "median", *(f"{share} %" for share in SHARES[1:]), "± (95 %)", "max"]]
    for prefix in AT_CONTACT:
        name, unit, _ = QUANTITIES[prefix]
        found = [value(f"{prefix}_{column}") for column in columns]
        table.append([f"{name} [{unit}]", *("–" if np.isnan(each) else f"{each:.3g}" for each in found)])
    return said, table

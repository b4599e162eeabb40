# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps of the faces in the 3-D view: each face that blocks touch in the colour of its class; and its numbers."""

import functools
from typing import NamedTuple

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ....core.georeference import GlobalShift
from ....core.hazard.classes import Classes, classes_in
from ....core.hazard.evidence import FEW, face_evidence
from ....core.hazard.face_tally import AT_CONTACT, FACE_LAYERS, FaceMaps
from ....core.hazard.maps import CLASSES_KJ, QUANTITIES, SHARES
from ....core.terrain.raycast import cast_ray
from ....core.terrain.surface import Surface
from ...scene.simulation import hazard_maps

SHADE = 0.55
"""Part of a colour that the light decides: so faces are told apart."""
SUN = np.array([-0.4, -0.5, 0.77])
BEHIND_M = 0.02
"""A face that is so much further than the terrain is hidden by it."""
OPACITY = 0.9


HATCH = 8.0
"""Pixels at interface scale 1 from line to line of the hatching, which is the same from near and far."""
VERTEX = """
void main() {
  shown = color;
  hatched = weak;
  gl_Position = ModelViewProjectionMatrix * vec4(pos, 1.0);
}
"""
LINEAR = """
vec3 linear(vec3 c) {
  return mix(c / 12.92, pow((max(c, vec3(0.0)) + 0.055) / 1.055, vec3(2.4)), step(vec3(0.04045), c));
}
"""
"""GLSL: an sRGB colour as the frame buffer takes it when it is linear."""
FRAGMENT = (
    LINEAR
    + """
void main() {
  vec3 seen = shown.rgb;
  if (hatched > 0.5 && mod(gl_FragCoord.x + gl_FragCoord.y, hatch) < 0.25 * hatch) { seen = vec3(0.05); }
  fragColor = vec4(srgbTarget ? linear(seen) : seen, shown.a);
}
"""
)


class _Painted(NamedTuple):
    key: tuple
    classes: Classes
    batch: gpu.types.GPUBatch


_painted: list[_Painted] = []
_surfaces: list[tuple[FaceMaps, Surface]] = []


def unregister() -> None:
    _painted.clear()
    _shader.cache_clear()
    _surfaces.clear()


def shown_faces(scene: bpy.types.Scene) -> FaceMaps | None:
    """The maps of faces, if these are to be painted."""
    return hazard_maps.faces_of(scene) if scene.rockfall_simulation.map_on == "FACES" else None


def draw(scene: bpy.types.Scene, maps: FaceMaps) -> None:
    """Paint the shown map; the depth test is on."""
    painted = _of(scene, maps)
    if painted is None:
        return
    shader = _shader()
    shader.bind()
    shader.uniform_float("hatch", HATCH * bpy.context.preferences.system.ui_scale)
    painted.batch.draw(shader)


@functools.cache
def _shader() -> gpu.types.GPUShader:
    between = gpu.types.GPUStageInterfaceInfo("faces_between")
    between.smooth("VEC4", "shown")
    between.smooth("FLOAT", "hatched")
    info = gpu.types.GPUShaderCreateInfo()
    info.push_constant("MAT4", "ModelViewProjectionMatrix")
    info.push_constant("FLOAT", "hatch")
    info.push_constant("BOOL", "srgbTarget")
    info.vertex_in(0, "VEC3", "pos")
    info.vertex_in(1, "VEC4", "color")
    info.vertex_in(2, "FLOAT", "weak")
    info.vertex_out(between)
    info.fragment_out(0, "VEC4", "fragColor")
    info.vertex_source(VERTEX)
    info.fragment_source(FRAGMENT)
    return gpu.shader.create_from_info(info)


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
        weak = np.repeat(face_evidence(maps).weak[there], 3).astype(np.float32)
        values = {"pos": np.ascontiguousarray(places), "color": np.ascontiguousarray(each), "weak": weak}
        batch = batch_for_shader(_shader(), "TRIS", values)
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
    said += [f"Fewer than {FEW} blocks: these values say little"] if value("Nr_blocks") < FEW else []
    columns = ["mean", *(f"{share}CI" for share in SHARES), "95CI_error", "max"]
    table = [["", "mean", "median", *(f"{share} %" for share in SHARES[1:]), "± (95 %)", "max"]]
    for prefix in AT_CONTACT:
        name, unit, _ = QUANTITIES[prefix]
        found = [value(f"{prefix}_{column}") for column in columns]
        table.append([f"{name} [{unit}]", *("–" if np.isnan(each) else f"{each:.3g}" for each in found)])
    return said, table

# SPDX-License-Identifier: GPL-3.0-or-later
"""Zones of the ground with parameters of their own: parts of the terrain's meshes, painted or chosen in Blender.

A zone is what a vertex group of its name has (painted weights, or vertices that were assigned), or an attribute of that
name of vertices or faces: values of a half and more.
"""

import zlib
from collections.abc import Sequence

import bpy
import numpy as np

from ...core.errors import RockfallError
from ...core.exchange.zones import zones_with
from ...core.simulation.ground import element_places
from ...core.simulation.zones import Zones, face_values, nearest_values, zones_of_parts
from ...core.terrain.cloud import Cloud
from ...core.terrain.surface import Surface
from . import terrain, terrain_mesh

HALF = 0.5
NUMBERS = ("FLOAT", "INT", "INT8", "BOOLEAN")
DOMAINS = ("POINT", "FACE")

_painted: dict[tuple[int, str], tuple[object, np.ndarray, bool]] = {}
"""By mesh and name: the mesh's contents then, the values, whether they are of faces."""


def zones_of(scene: bpy.types.Scene, met: Surface | Cloud, models: Sequence[str]) -> Zones | None:
    """The scene's zones on its terrain, or on the points of that; None without.

    Raises
    ------
    RockfallError : a zone that is nowhere on the terrain, parameters that are none or out of range.
    """
    rows = scene.rockfall_simulation.zones
    if not rows:
        return None
    parts = [(row.name, _elements_in(scene, met, row.name)) for row in rows]
    cover = zones_of_parts(met, parts, "Paint or assign the vertex groups of the zones")
    return zones_with(cover, {row.name: properties_of(row) for row in rows}, models)


def properties_of(row: bpy.types.PropertyGroup) -> dict[str, object]:
    """What a zone has of its own.

    Raises
    ------
    RockfallError : a parameter without a value.
    """
    found: dict[str, object] = {"friction": round(row.friction, 6)} if row.use_friction else {}
    for text in row.parameters.split(","):
        name, equals, value = (part.strip() for part in text.partition("="))
        if not text.strip():
            continue
        if not (name and equals and value):
            raise RockfallError(
                f"Zone {row.name}: {text.strip()!r} sets no parameter. Write PARAMETER = VALUE, for example rt = 0.4."
            )
        found[name] = value
    return found


def keep(scene: bpy.types.Scene, zones: Zones, tile: bpy.types.Object) -> None:
    """The zones of a project as attributes of the faces of its terrain, with their parameters."""
    rows = scene.rockfall_simulation.zones
    rows.clear()
    for number, name in enumerate(zones.names[1:], start=1):
        attribute = tile.data.attributes.new(name, "BOOLEAN", "FACE")
        attribute.data.foreach_set("value", zones.of_face == number)
        row = rows.add()
        row.name, row.use_friction = attribute.name, name in zones.friction
        row.friction = zones.friction.get(name, row.friction)
        values = zones.parameters.get(name, {})
        row.parameters = ", ".join(f"{model}.{key} = {values[model][key]}" for model in values for key in values[model])


def fingerprint(scene: bpy.types.Scene) -> list[object]:
    """Of the zones, their parameters and where they are."""
    found: list[object] = []
    for row in scene.rockfall_simulation.zones:
        found.append((row.name, row.use_friction, row.friction, row.parameters))
        for tile in terrain.tiles(scene):
            values = _values(tile, row.name)
            found.append(None if values is None else zlib.crc32(values[0] >= HALF))
    return found


def _elements_in(scene: bpy.types.Scene, met: Surface | Cloud, name: str) -> np.ndarray:
    """(m,) whether each face, or point, of the joined terrain is in a zone: of vertices, two of its corners decide."""
    vertices, of_vertices, middles, of_faces = [], [], [], []
    for tile in terrain.tiles(scene):
        values, own = _values(tile, name), terrain.surface_of(tile)
        if values is None:
            vertices.append(own.vertices)
            of_vertices.append(np.zeros(len(own.vertices)))
        elif values[1]:
            middles.append(element_places(own))
            of_faces.append(values[0])
        else:
            vertices.append(own.vertices)
            of_vertices.append(values[0])
    inside = np.zeros(len(element_places(met)), np.bool_)
    if vertices:
        places = met.points if isinstance(met, Cloud) else met.vertices
        near = nearest_values(places, np.concatenate(vertices), np.concatenate(of_vertices) >= HALF)
        inside |= near if isinstance(met, Cloud) else face_values(met, near.astype(np.float64)) > 0
    if middles:
        near = nearest_values(element_places(met), np.concatenate(middles), np.concatenate(of_faces) >= HALF)
        inside |= near
    return inside


def _values(tile: bpy.types.Object, name: str) -> tuple[np.ndarray, bool] | None:
    """A number at each vertex or face of a tile, and whether they are of faces; None where it has no such zone."""
    mesh = tile.data
    key, contents = (mesh.session_uid, name), terrain_mesh.contents_of(mesh)
    known = _painted.get(key)
    if known is not None and known[0] is contents:
        return None if not known[1].size else known[1:]
    found = _read(tile, name)
    values, of_faces = (np.empty(0), False) if found is None else found
    _painted[key] = contents, values, of_faces
    return found


def _read(tile: bpy.types.Object, name: str) -> tuple[np.ndarray, bool] | None:
    mesh, group = tile.data, tile.vertex_groups.get(name)
    if group is not None:
        values = np.zeros(len(mesh.vertices))
        for vertex in mesh.vertices:
            for one in vertex.groups:
                if one.group == group.index:
                    values[vertex.index] = one.weight
        return values, False
    attribute = mesh.attributes.get(name)
    if attribute is None or attribute.domain not in DOMAINS or attribute.data_type not in NUMBERS:
        return None
    of_faces = attribute.domain == "FACE"
    kind = {"FLOAT": np.float32, "BOOLEAN": np.bool_}.get(attribute.data_type, np.int32)
    values = np.empty(len(attribute.data), kind)
    attribute.data.foreach_get("value", values)
    if of_faces and len(mesh.loops) != 3 * len(mesh.polygons):
        mesh.calc_loop_triangles()
        polygon = np.empty(len(mesh.loop_triangles), np.int32)
        mesh.loop_triangles.foreach_get("polygon_index", polygon)
        values = values[polygon]
    return values.astype(np.float64), of_faces

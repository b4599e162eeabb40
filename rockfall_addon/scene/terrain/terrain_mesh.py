# SPDX-License-Identifier: GPL-3.0-or-later
"""The meshes of the terrain: arrays ↔ Blender meshes, and the mesh that stands in for a large one in the 3-D view."""

import zlib
from collections.abc import Mapping

import bpy
import numpy as np

from ....core.terrain.polygons import triangles_of
from ..storage import materials

SHADING = ("hillshade", "eye_dome", "thin")
"""Attributes of a terrain's vertices, 0 … 1."""
MODIFIER = "Coarse view"
STAND_IN = "Coarse mesh"

Contents = tuple[int, int, int, int]

_contents: dict[int, Contents] = {}  # by the mesh's session_uid
_polygons: dict[int, tuple[str, ...]] = {}  # likewise


def new_mesh(name: str, vertices: np.ndarray, faces: np.ndarray, values: Mapping[str, np.ndarray]) -> bpy.types.Mesh:
    """A smooth mesh with the terrain's material, the shading values (n,) as attributes, and a relief to be painted."""
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(vertices))
    mesh.attributes["position"].data.foreach_set("vector", vertices.astype(np.float32).ravel())
    mesh.loops.add(3 * len(faces))
    mesh.attributes[".corner_vert"].data.foreach_set("value", faces.astype(np.int32).ravel())
    mesh.polygons.add(len(faces))
    mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * len(faces), 3, dtype=np.int32))
    mesh.update(calc_edges=True)
    mesh.shade_smooth()
    for name_, value in values.items():
        attribute = mesh.attributes.new(name_, "FLOAT", "POINT")
        attribute.data.foreach_set("value", np.ascontiguousarray(value, dtype=np.float32))
    mesh.attributes.new(materials.RELIEF_COLOUR, "FLOAT_COLOR", "POINT")
    mesh.attributes.active_color_name = mesh.attributes.default_color_name = materials.RELIEF_COLOUR
    mesh.materials.append(materials.terrain_material())
    return mesh


def mesh_arrays(mesh: bpy.types.Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) in single precision and triangles (m, 3) of a mesh, in its own coordinates."""
    vertices = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    if mesh.is_editmode:  # without attributes
        mesh.vertices.foreach_get("co", vertices)
    else:
        mesh.attributes["position"].data.foreach_get("vector", vertices)  # many times as quick as mesh.vertices
    if not mesh.polygons:
        faces = np.empty(0, dtype=np.int32)
    elif len(mesh.loops) == 3 * len(mesh.polygons):
        faces = np.empty(len(mesh.loops), dtype=np.int32)
        if mesh.is_editmode:
            mesh.loops.foreach_get("vertex_index", faces)
        else:
            mesh.attributes[".corner_vert"].data.foreach_get("value", faces)
    else:
        mesh.calc_loop_triangles()
        faces = np.empty(3 * len(mesh.loop_triangles), dtype=np.int32)
        mesh.loop_triangles.foreach_get("vertices", faces)
    return vertices.reshape(-1, 3), faces.reshape(-1, 3)


def polygon_remarks(mesh: bpy.types.Mesh) -> tuple[str, ...]:
    """What to say of faces with more than three corners: those that are not flat, or cross themselves.

    Kept until the mesh is mistrusted.
    """
    if len(mesh.loops) == 3 * len(mesh.polygons):
        return ()
    known = _polygons.get(mesh.session_uid)
    if known is None:
        corners, counts = np.empty(len(mesh.loops), np.int32), np.empty(len(mesh.polygons), np.int32)
        mesh.loops.foreach_get("vertex_index", corners)
        mesh.polygons.foreach_get("loop_total", counts)
        vertices = mesh_arrays(mesh)[0].astype(np.float64)
        known = _polygons[mesh.session_uid] = triangles_of(vertices, corners, counts).notes
    return known


def placed_vertices(obj: bpy.types.Object) -> np.ndarray:
    """(n, 3) vertices of an object's mesh where it stands, in double precision."""
    world = np.array(obj.matrix_world)
    return mesh_arrays(obj.data)[0].astype(np.float64) @ world[:3, :3].T + world[:3, 3]


def contents_of(mesh: bpy.types.Mesh) -> Contents:
    """Numbers of vertices and triangles, checksums of both: they differ when a person has edited the mesh.

    Computed anew, some milliseconds for each million triangles, where the numbers differ or the mesh is mistrusted.
    """
    known, counts = _contents.get(mesh.session_uid), (len(mesh.vertices), len(mesh.polygons))
    if known is None or known[:2] != counts:
        vertices, faces = mesh_arrays(mesh)
        known = _contents[mesh.session_uid] = (*counts, zlib.crc32(vertices), zlib.crc32(faces))
    return known


def mistrust(mesh: bpy.types.Mesh | None = None) -> None:
    """A mesh may have been edited; any mesh, after undo or loading."""
    if mesh is None:
        _contents.clear()
        _polygons.clear()
    else:
        _polygons.pop(mesh.session_uid, None)
        _contents.pop(mesh.session_uid, None)


def stand_in(tile: bpy.types.Object) -> bpy.types.Object | None:
    """The object whose mesh the 3-D view shows in the place of a tile's own, if there is one."""
    modifier = tile.modifiers.get(MODIFIER)
    if modifier is None or modifier.type != "NODES" or modifier.node_group is None:
        return None
    return materials.get_input(modifier, STAND_IN)

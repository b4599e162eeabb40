# SPDX-License-Identifier: GPL-3.0-or-later
"""Walls, fences, ditches, roads and houses that blocks meet beside the terrain: mesh objects that are marked as such.

Their names are those of the objects. What counts is the object's own mesh where the object stands, in double precision;
one without faces is a cloud, whose vertices are the points that blocks meet.
"""

import uuid
from collections.abc import Sequence

import bpy
import numpy as np

from ....core.errors import RockfallError
from ....core.terrain.cloud import Cloud
from ....core.terrain.joining import moved
from ....core.terrain.surface import Surface
from ..storage import materials, store
from ..terrain import georeference, terrain, terrain_mesh

COLOUR, GREY = "colour", (0.72, 0.74, 0.80)


def objects_of(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """The marked objects, by name."""
    return store.with_role(scene, store.STRUCTURE_ROLE)


def can_be(obj: bpy.types.Object) -> bool:
    """Whether an object can be marked: a mesh that is nothing else to Rockfall, such as terrain."""
    return obj.type == "MESH" and store.ROLE not in obj and obj.library is None


def mark(objects: Sequence[bpy.types.Object]) -> None:
    """Blocks meet these objects.

    Raises
    ------
    RockfallError : one of them is empty; then none is marked.
    """
    for obj in objects:
        if not obj.data.vertices:
            raise RockfallError(f"{obj.name} has nothing that a block could meet. Choose a mesh with faces or points.")
    for obj in objects:
        obj[store.ROLE], obj[store.ID] = store.STRUCTURE_ROLE, uuid.uuid4().hex


def unmark(obj: bpy.types.Object) -> None:
    """Blocks do not meet this object any more; it stays in the scene."""
    for key in (store.ROLE, store.ID):
        obj.pop(key, None)


def problem(scene: bpy.types.Scene) -> str:
    """What is wrong with the structures, in a sentence; empty when nothing is."""
    for obj in objects_of(scene):
        if not obj.data.vertices:
            return f"The structure {obj.name} has nothing that a block could meet. Give it faces, or remove it below."
        if any(modifier.show_viewport or modifier.show_render for modifier in obj.modifiers):
            return f"Apply the modifiers of the structure {obj.name}: blocks meet its own mesh, which looks otherwise."
    return ""


def is_cloud(obj: bpy.types.Object) -> bool:
    """Whether blocks meet a structure's points, as it has no faces."""
    return not terrain.has_faces(obj)


def met_of(scene: bpy.types.Scene) -> dict[str, Surface | Cloud]:
    """Name → surface or cloud in local coordinates.

    Raises
    ------
    RockfallError : see `problem`.
    """
    wrong = problem(scene)
    if wrong:
        raise RockfallError(wrong)
    return {obj.name: _cloud(obj, scene) if is_cloud(obj) else terrain.surface_of(obj) for obj in objects_of(scene)}


def _cloud(obj: bpy.types.Object, scene: bpy.types.Scene) -> Cloud:
    return Cloud(terrain_mesh.placed_vertices(obj), georeference.read_shift(scene), obj.name)


def make(scene: bpy.types.Scene, name: str, structure: Surface | Cloud) -> bpy.types.Object:
    """A structure of a project as a marked object."""
    here = moved(structure, georeference.read_shift(scene))
    vertices, faces = (here.points, []) if isinstance(here, Cloud) else (here.vertices, here.faces.tolist())
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices.tolist(), [], faces)
    colours = np.tile(materials.linear_colour(GREY), len(vertices)).astype(np.float32)
    mesh.attributes.new(COLOUR, "FLOAT_COLOR", "POINT").data.foreach_set("color", colours)
    mesh.attributes.active_color_name = mesh.attributes.default_color_name = COLOUR
    mesh.materials.append(materials.shaded_material("Rockfall structure", COLOUR))
    obj = bpy.data.objects.new(name, mesh)
    store.link(store.collection(scene, "Structures"), obj)
    mark([obj])
    return obj


def fingerprint(scene: bpy.types.Scene) -> Sequence[object]:
    """Of the structures' names, places and meshes."""
    return [
        (obj.name, [round(value, 5) for row in obj.matrix_world for value in row], terrain_mesh.contents_of(obj.data))
        for obj in objects_of(scene)
    ]

# SPDX-License-Identifier: GPL-3.0-or-later
"""Terrain: core surface ↔ Blender mesh object."""

import bpy
import numpy as np
from mathutils import Vector

from ...core.errors import RockfallError
from ...core.terrain.shading import Shading
from ...core.terrain.surface import Surface
from . import materials, state

_surfaces: dict[tuple, Surface] = {}  # the index of a million triangles takes a while: built once per mesh


def add_terrain(scene: bpy.types.Scene, surface: Surface, shading: Shading) -> bpy.types.Object:
    """Make the mesh object of a terrain, shaded by its attributes, in the project's local coordinates."""
    mesh = bpy.data.meshes.new(surface.name)
    vertices, faces = len(surface.vertices), len(surface.faces)
    mesh.vertices.add(vertices)
    mesh.vertices.foreach_set("co", surface.vertices.astype(np.float32).ravel())
    mesh.loops.add(3 * faces)
    mesh.loops.foreach_set("vertex_index", surface.faces.astype(np.int32).ravel())
    mesh.polygons.add(faces)
    mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * faces, 3, dtype=np.int32))
    mesh.update(calc_edges=True)
    mesh.shade_smooth()
    for name, values in (("hillshade", shading.hillshade), ("eye_dome", shading.eye_dome), ("thin", shading.thin)):
        attribute = mesh.attributes.new(name, "FLOAT", "POINT")
        attribute.data.foreach_set("value", np.asarray(values, dtype=np.float32))
    relief = mesh.attributes.new(materials.RELIEF_COLOUR, "FLOAT_COLOR", "POINT")
    relief.data.foreach_set("color", relief_colours(shading).astype(np.float32).ravel())
    mesh.attributes.active_color_name = materials.RELIEF_COLOUR
    mesh.attributes.default_color_name = materials.RELIEF_COLOUR
    mesh.materials.append(materials.terrain_material())

    thing = bpy.data.objects.new(surface.name, mesh)
    thing[state.ROLE_KEY] = state.TERRAIN_ROLE
    thing["rockfall_summary"] = list(surface.summary)
    state.collection(scene, "Terrain").objects.link(thing)
    if not state.has_shift(scene):
        state.write_shift(scene, surface.shift)
    _surfaces[_key(thing)] = surface
    return thing


def relief_colours(shading: Shading) -> np.ndarray:
    """(n, 4) linear colours of the viewport's solid mode: rock × (hillshade and eye-dome), thin data bluish."""
    rock = np.array(materials.ROCK_COLOUR)
    thin = np.array(materials.THIN_COLOUR)
    floor = materials.RELIEF_FLOOR
    light = (floor + (1 - floor) * shading.hillshade) * (floor + (1 - floor) * shading.eye_dome)
    mixed = np.where(np.asarray(shading.thin, dtype=bool)[:, None], 0.5 * rock + 0.5 * thin, rock)
    linear = np.clip(mixed * light[:, None] * materials.RELIEF_BRIGHTNESS, 0.0, 1.0)
    return np.column_stack([linear, np.ones(len(linear))])


def surface_of(thing: bpy.types.Object) -> Surface:
    """The surface of a terrain object, with its spatial index, in local coordinates.

    The mesh is single precision: coordinates within 1 km of the origin are exact to 0.03 mm.

    Raises
    ------
    RockfallError : the object has no faces.
    """
    key = _key(thing)
    if key not in _surfaces:
        mesh = thing.data
        if not mesh.polygons:
            raise RockfallError(f"{thing.name} has no faces, so it cannot be the terrain. Choose a mesh with faces.")
        vertices = np.empty(3 * len(mesh.vertices), dtype=np.float32)
        mesh.vertices.foreach_get("co", vertices)
        mesh.calc_loop_triangles()
        faces = np.empty(3 * len(mesh.loop_triangles), dtype=np.int32)
        mesh.loop_triangles.foreach_get("vertices", faces)
        world = np.array(thing.matrix_world)
        local = vertices.reshape(-1, 3).astype(np.float64) @ world[:3, :3].T + world[:3, 3]
        scene = next(iter(thing.users_scene), bpy.context.scene)
        _surfaces.clear()
        _surfaces[key] = Surface(local, faces.reshape(-1, 3), state.read_shift(scene), thing.name, ())
    return _surfaces[key]


def active_terrain(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """The terrain object that the trajectories refer to: the first by name."""
    return next(iter(state.with_role(scene, state.TERRAIN_ROLE)), None)


def downhill(thing: bpy.types.Object) -> Vector:
    """Horizontal direction in which a terrain falls, from its mean normal; to the south when it is level."""
    mean = Vector(np.nansum(surface_of(thing).face_normals * surface_of(thing).face_areas[:, None], axis=0).tolist())
    fall = Vector((mean.x, mean.y, 0.0))
    return fall.normalized() if fall.length > 1e-3 * mean.length else Vector((0.0, -1.0, 0.0))


def forget_surfaces() -> None:
    """Drop cached surfaces: after loading a file the same keys may mean other meshes."""
    _surfaces.clear()


def _key(thing: bpy.types.Object) -> tuple:
    mesh = thing.data
    place = tuple(round(value, 9) for row in thing.matrix_world for value in row)
    return mesh.session_uid, len(mesh.vertices), len(mesh.polygons), place

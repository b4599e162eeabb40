# SPDX-License-Identifier: GPL-3.0-or-later
"""What the 3-D view draws of a large terrain: a coarse mesh in the place of the full one.

The terrain's object keeps its full mesh, for rays, normals, renders and the file. A geometry-nodes modifier that is
on in the viewport only puts the mesh of another object, which is in no scene, in its place: so the terrain is
selected, framed, hidden and moved as ever, and the graphics card never sees the full mesh.
"""

import bpy
import numpy as np

from ....core.terrain.decimation import decimate
from ..storage import materials, store
from . import terrain_colours, terrain_look, terrain_mesh

GROUP = "Rockfall coarse view"
SHARE = 3
"""A coarse view has this part of the triangles from which on views are coarse."""
LEAST = 300
"""Triangles of a coarse view: of fewer nothing might be left. Tiles of not many more are drawn as they are."""
TOO_FINE = 2.0
"""A coarse mesh is made anew when it has this many times the triangles that it should have."""


def follow(scene: bpy.types.Scene) -> None:
    """Give the scene's tiles coarse views, or take them away, as their number of triangles and the settings ask for.

    All tiles together are drawn with about a third of the limit, each with its share.
    """
    settings = scene.rockfall_terrain
    tiles = [obj for obj in store.with_role(scene, store.TERRAIN_ROLE) if obj.type == "MESH"]
    total = sum(len(tile.data.polygons) for tile in tiles)
    for tile in tiles:
        if total <= settings.view_limit or len(tile.data.polygons) <= SHARE * LEAST:
            _remove(tile)
            continue
        wanted = max(LEAST, settings.view_limit // SHARE * len(tile.data.polygons) // total)
        if not _fits(tile, wanted):
            _make(tile, wanted)
            terrain_look.paint([terrain_mesh.stand_in(tile).data], terrain_look.look_of(scene))
        modifier = tile.modifiers[terrain_mesh.MODIFIER]
        if modifier.show_viewport == settings.full_resolution:
            modifier.show_viewport = not settings.full_resolution


def follow_edits(scene: bpy.types.Scene) -> None:
    """Make the coarse views anew of tiles that a person has edited."""
    tiles = [obj for obj in store.with_role(scene, store.TERRAIN_ROLE) if terrain_mesh.stand_in(obj) is not None]
    if not all(map(_is_current, tiles)):
        follow(scene)


def is_coarse(scene: bpy.types.Scene) -> bool:
    """Whether a tile of the scene has a coarse view, be it switched on or off."""
    return any(terrain_mesh.MODIFIER in tile.modifiers for tile in store.with_role(scene, store.TERRAIN_ROLE))


def drawn_triangles(tile: bpy.types.Object) -> int:
    """How many triangles the 3-D view draws of a tile."""
    other = terrain_mesh.stand_in(tile)
    coarse = other is not None and tile.modifiers[terrain_mesh.MODIFIER].show_viewport
    return len((other if coarse else tile).data.polygons)


def _fits(tile: bpy.types.Object, wanted: int) -> bool:
    other = terrain_mesh.stand_in(tile)
    if other is None:
        return False
    return _is_current(tile) and 1 / TOO_FINE < other[store.COARSE_VIEW_OF][2] / wanted < TOO_FINE


def _is_current(tile: bpy.types.Object) -> bool:
    """Whether the coarse mesh of a tile was made from the mesh that the tile has."""
    vertices, faces, _, *checksums = terrain_mesh.stand_in(tile).get(store.COARSE_VIEW_OF, (0, 0, 0))
    now = terrain_mesh.contents_of(tile.data)
    return now == (vertices, faces, *(checksums or now[2:]))  # 0.1.0 kept no checksums


def _make(tile: bpy.types.Object, wanted: int) -> None:
    """Make a tile's coarse mesh; its modifier shows it from then on."""
    full = tile.data
    vertices, faces = terrain_mesh.mesh_arrays(full)
    names = [name for name in terrain_mesh.SHADING if name in full.attributes]
    values = np.empty((len(names), len(vertices)), dtype=np.float32)
    for row, name in zip(values, names, strict=True):
        full.attributes[name].data.foreach_get("value", row)
    own = {name: found for name in materials.OWN_COLOURS if (found := terrain_colours.read(full, name)) is not None}
    values = np.concatenate([values, *(found.T.astype(np.float32) for found in own.values())])
    coarse = decimate(vertices.astype(np.float64), faces, wanted, values.T)
    mesh = terrain_mesh.new_mesh(
        f"{full.name} coarse", coarse.vertices, coarse.faces, dict(zip(names, coarse.values.T, strict=False))
    )
    for i, name in enumerate(own):
        found = coarse.values[:, len(names) + 4 * i : len(names) + 4 * i + 4]
        terrain_colours.write(mesh, name, np.rint(np.clip(found, 0, 255)).astype(np.uint8))
    _remove(tile)
    other = bpy.data.objects.new(mesh.name, mesh)
    other[store.ROLE] = store.COARSE_VIEW_ROLE
    contents = terrain_mesh.contents_of(full)
    other[store.COARSE_VIEW_OF] = [float(value) for value in (*contents[:2], wanted, *contents[2:])]
    modifier = tile.modifiers.new(terrain_mesh.MODIFIER, "NODES")
    modifier.node_group = _group()
    modifier.show_render = modifier.show_expanded = False
    materials.set_input(modifier, terrain_mesh.STAND_IN, other)


def _remove(tile: bpy.types.Object) -> None:
    other, modifier = terrain_mesh.stand_in(tile), tile.modifiers.get(terrain_mesh.MODIFIER)
    if modifier is not None:
        tile.modifiers.remove(modifier)
    if other is not None:
        store.remove_objects([other])


def _group() -> bpy.types.GeometryNodeTree:
    """Geometry nodes: the mesh of another object, unless it has no faces."""
    existing = bpy.data.node_groups.get((GROUP, None))
    if existing is not None:
        return existing
    group = bpy.data.node_groups.new(GROUP, "GeometryNodeTree")
    group.is_modifier = True
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket(terrain_mesh.STAND_IN, in_out="INPUT", socket_type="NodeSocketObject")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    new, link = group.nodes.new, group.links.new
    source, result, other = new("NodeGroupInput"), new("NodeGroupOutput"), new("GeometryNodeObjectInfo")
    size, there, choice = (
        new("GeometryNodeAttributeDomainSize"),
        new("FunctionNodeCompare"),
        new("GeometryNodeSwitch"),
    )
    size.component = "MESH"
    there.data_type, there.operation = "INT", "GREATER_THAN"
    choice.input_type = "GEOMETRY"
    link(source.outputs[terrain_mesh.STAND_IN], other.inputs["Object"])
    link(other.outputs["Geometry"], size.inputs["Geometry"])
    link(size.outputs["Face Count"], next(s for s in there.inputs if s.enabled and s.name == "A"))
    link(there.outputs["Result"], choice.inputs["Switch"])
    link(source.outputs["Geometry"], choice.inputs["False"])
    link(other.outputs["Geometry"], choice.inputs["True"])
    link(choice.outputs[0], result.inputs[0])
    return group

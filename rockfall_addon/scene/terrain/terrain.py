# SPDX-License-Identifier: GPL-3.0-or-later
"""Terrain: core surfaces ↔ Blender mesh objects, one for each tile."""

import uuid
from collections.abc import Sequence

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ....core.errors import RockfallError
from ....core.georeference import LARGE_COORDINATE_M
from ....core.remarks import Remark
from ....core.terrain.joining import join, moved
from ....core.terrain.shading import Shading, thin_share
from ....core.terrain.surface import Surface
from ....core.workflow.noticed import impossible_scan, standing_out, vegetated
from ..storage import materials, store
from . import georeference, terrain_colours, terrain_look, terrain_mesh, terrain_view

LEAST_THIN = 0.005


_surfaces: dict[int, tuple[tuple, Surface]] = {}
"""By the tile's session_uid, what it was made of and the surface: the index of a million triangles takes a while."""
MOST_LEFT_OUT = 200_000
_joined: list[tuple[tuple[Surface, ...], Surface]] = []


def add_terrain(scene: bpy.types.Scene, surface: Surface, shading: Shading) -> bpy.types.Object:
    """Make the mesh object of a terrain, shaded by its attributes, in the project's local coordinates.

    The first terrain gives the project its shift; later ones are moved to it.
    """
    if georeference.has_shift(scene):
        surface = moved(surface, georeference.read_shift(scene))
    else:
        georeference.write_shift(scene, surface.shift)
    values = dict(zip(terrain_mesh.SHADING, (shading.hillshade, shading.eye_dome, shading.thin), strict=True))
    mesh = terrain_mesh.new_mesh(surface.name, surface.vertices, surface.faces, values)
    if surface.colours is not None:
        terrain_colours.write(mesh, materials.SCAN_COLOURS, surface.colours)
    obj = bpy.data.objects.new(surface.name, mesh)
    obj[store.ROLE], obj[store.ID] = store.TERRAIN_ROLE, uuid.uuid4().hex
    obj[store.TERRAIN_SUMMARY], obj[store.TERRAIN_FILE] = list(surface.summary), surface.name
    obj[store.TURNED] = surface.turned
    obj[store.THIN_SHARE] = thin_share(surface, shading)
    obj[store.STANDING_OUT] = standing_out(surface)
    obj[store.REACH] = float(np.abs(surface.bounds).max())
    set_locked(obj, True)
    store.link(store.collection(scene, "Terrain"), obj)
    _surfaces[obj.session_uid] = _key(obj), surface
    if len(surface.left_out):
        _show_left_out(scene, surface)
    terrain_view.follow(scene)
    terrain_look.apply(scene)
    return obj


def remove(scene: bpy.types.Scene, tiles: Sequence[bpy.types.Object]) -> None:
    """Remove tiles with their coarse views and what the ground filter left out of their files."""
    files = {str(tile.get(store.TERRAIN_FILE, "")) for tile in tiles}
    apart = [obj for obj in store.with_role(scene, store.LEFT_OUT_ROLE) if obj.get(store.TERRAIN_FILE) in files]
    views = [view for view in map(terrain_mesh.stand_in, tiles) if view is not None]
    store.remove_objects([*tiles, *apart, *views])
    terrain_view.follow(scene)


def has_part(tile: bpy.types.Object, name: str) -> bool:
    """Whether a tile has a vertex group or an attribute of a name."""
    return name in tile.vertex_groups or name in tile.data.attributes


def _show_left_out(scene: bpy.types.Scene, surface: Surface) -> None:
    """Some of the points that the ground filter left out, beside the terrain: what it took for vegetation is seen."""
    points = surface.left_out[:: max(1, -(-len(surface.left_out) // MOST_LEFT_OUT))]
    mesh = bpy.data.meshes.new(f"{surface.name}, left out")
    mesh.from_pydata(points.tolist(), [], [])
    obj = bpy.data.objects.new(mesh.name, mesh)
    obj[store.ROLE], obj[store.TERRAIN_FILE] = store.LEFT_OUT_ROLE, surface.name
    obj.hide_select = obj.hide_render = obj.hide_viewport = True  # a forest would hide the slope
    store.link(store.collection(scene, "Terrain"), obj)


def show_left_out(scene: bpy.types.Scene, shown: bool) -> None:
    """Show or hide the points that the ground filter left out."""
    for points in store.with_role(scene, store.LEFT_OUT_ROLE):
        points.hide_viewport = not shown
        if shown:
            points.hide_set(False)


def is_left_out_shown(scene: bpy.types.Scene) -> bool:
    """Whether some of the points that the ground filter left out are seen."""
    return any(points.visible_get() for points in store.with_role(scene, store.LEFT_OUT_ROLE))


def tiles(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """The terrain objects that have faces, by name."""
    return [obj for obj in store.with_role(scene, store.TERRAIN_ROLE) if has_faces(obj)]


def has_faces(obj: bpy.types.Object) -> bool:
    """Whether an object can be terrain."""
    return obj.type == "MESH" and len(obj.data.polygons) > 0


def surface_of_scene(scene: bpy.types.Scene) -> Surface | None:
    """All tiles of a scene as one surface in local coordinates; None when there is no terrain.

    Made once, until a tile comes, goes, moves or changes; so is its spatial index.

    Raises
    ------
    RockfallError : there is terrain, but none of it has faces.
    """
    parts = tiles(scene)
    if not parts:
        empty = next(iter(store.with_role(scene, store.TERRAIN_ROLE)), None)
        return None if empty is None else surface_of(empty)
    surfaces = tuple(surface_of(part) for part in parts)
    if len(surfaces) == 1:
        _joined.clear()
        return surfaces[0]
    if not _joined or len(_joined[0][0]) != len(surfaces) or any(map(_differ, _joined[0][0], surfaces)):
        _joined[:] = [(surfaces, join(surfaces))]
    return _joined[0][1]


def surface_of(obj: bpy.types.Object) -> Surface:
    """The surface of one terrain object, with its spatial index, in local coordinates.

    That of a terrain that was just imported is the file's, in double precision. From a loaded file it is made from the
    mesh, which is single precision: coordinates within 1 km of the origin are exact to 0.03 mm.

    Raises
    ------
    RockfallError : the object has no faces.
    """
    if not has_faces(obj):
        raise RockfallError(f"{obj.name} has no faces, so it cannot be the terrain. Choose a mesh with faces.")
    key = _key(obj)
    known = _surfaces.get(obj.session_uid)
    if known is None or known[0] != key:
        for identifier in _surfaces.keys() - {each.session_uid for each in bpy.data.objects}:
            del _surfaces[identifier]
        known = _surfaces[obj.session_uid] = key, _read(obj)
    return known[1]


def set_locked(tile: bpy.types.Object, locked: bool) -> None:
    """Keep a tile from being selected and transformed by hand, or allow it."""
    tile.hide_select = tile.lock_rotation_w = locked
    tile.lock_location = tile.lock_rotation = tile.lock_scale = (locked,) * 3


def is_locked(tile: bpy.types.Object) -> bool:
    """Whether a tile is kept from being selected."""
    return tile.hide_select


def displaced(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Locked tiles that are not where their survey is: something has moved them all the same."""
    return [tile for tile in tiles(scene) if is_locked(tile) and tile.matrix_world != Matrix.Identity(4)]


def put_back(tile: bpy.types.Object) -> None:
    """Return a tile to where its survey is."""
    tile.parent = None
    tile.matrix_world = Matrix.Identity(4)


def accuracy_m(scene: bpy.types.Scene) -> float | None:
    """Standard deviation of the terrain's height, as it was given [m]."""
    return store.double(scene.rockfall_terrain.accuracy_m) or None


def active_terrain(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """The first terrain object by name."""
    return next(iter(store.with_role(scene, store.TERRAIN_ROLE)), None)


def downhill(scene: bpy.types.Scene) -> Vector:
    """Horizontal direction in which the terrain falls, from its mean normal; to the south when it is level."""
    surface = surface_of_scene(scene) if tiles(scene) else None
    if surface is None:
        return Vector((0.0, -1.0, 0.0))
    mean = Vector(np.nansum(surface.face_normals * surface.face_areas[:, None], axis=0).tolist())
    fall = Vector((mean.x, mean.y, 0.0))
    return fall.normalized() if fall.length > 1e-3 * mean.length else Vector((0.0, -1.0, 0.0))


def with_trees(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Tiles that look as if vegetation were part of them."""
    return [tile for tile in tiles(scene) if _vegetated(tile)]


def _vegetated(tile: bpy.types.Object) -> tuple[Remark, ...]:
    return vegetated(float(tile.get(store.STANDING_OUT, 0.0)), tile.name)


def of_impossible_size(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Tiles that are too high or too coarse for a slope in metres."""
    return [tile for tile in tiles(scene) if _oversized(tile)]


def _oversized(tile: bpy.types.Object) -> tuple[Remark, ...]:
    if not has_faces(tile):
        return ()
    return impossible_scan(np.ptp(np.array(tile.bound_box), axis=0), len(tile.data.polygons), tile.name)


def warnings(scene: bpy.types.Scene) -> list[str]:
    """What needs a person's attention, in sentences."""
    said = [
        f"{tile.name} is locked, but was moved by {_way_m(tile):.2f} m: it is not where it was surveyed. "
        "Put it back, or unlock it if it is to stay there."
        for tile in displaced(scene)
    ]
    for tile in store.with_role(scene, store.TERRAIN_ROLE):
        if not has_faces(tile):
            said.append(f"{tile.name} has no faces: it is left out. Undo what emptied it, or delete it.")
        said += [remark.text for remark in (*_oversized(tile), *_vegetated(tile))]
        reach = float(tile.get(store.REACH, 0.0))
        if reach > LARGE_COORDINATE_M and not _oversized(tile):
            step = float(np.spacing(np.float32(reach))) * 1000
            said.append(
                f"{tile.name} reaches {reach / 1000:.0f} km from the project's origin. Blender is single precision and "
                f"shows and saves it in steps of {step:.{0 if step >= 10 else 1}f} mm there. Is it of this project?"
            )
    return said


def remarks(scene: bpy.types.Scene) -> list[str]:
    """What is good to know about the scene's terrain, in sentences."""
    said = []
    grounds = tiles(scene)
    faces = sum(len(tile.data.polygons) for tile in grounds)
    drawn = sum(terrain_view.drawn_triangles(tile) for tile in grounds)
    if drawn < faces:
        said.append(
            f"The 3-D view draws {grouped(drawn)} of {grouped(faces)} triangles. "
            "Rays, normals and renders use them all."
        )
    thin = [(tile.dimensions.x * tile.dimensions.y, float(tile.get(store.THIN_SHARE, 0.0))) for tile in grounds]
    share = sum(area * part for area, part in thin) / max(1e-9, sum(area for area, _ in thin))
    if share >= LEAST_THIN:
        said.append(f"{100 * share:.0f} % of the area has thin data (bluish): the surface is guessed there.")
    if store.has_role(scene, store.LEFT_OUT_ROLE):
        said.append("The ground filter took points for vegetation; tops of boulders may be among them. Look at them:")
    said += [f"{tile.name}: {sentence}" for tile in grounds for sentence in terrain_mesh.polygon_remarks(tile.data)]
    away = [tile for tile in grounds if tile.matrix_world != Matrix.Identity(4)]
    moved_by_hand = [tile.name for tile in away if not is_locked(tile)]
    if moved_by_hand:
        said.append(f"Moved, turned or scaled in Blender: {', '.join(moved_by_hand)}. Rockfall takes it where it is.")
    scale = scene.unit_settings.scale_length
    if scale != 1.0:
        said.append(f"Blender shows lengths × {scale:g} (the scene's unit scale); Rockfall computes in metres.")
    return said


def readings(scene: bpy.types.Scene) -> list[tuple[str, tuple[str, ...]]]:
    """What was read of each tile, and what was left out, in sentences."""
    kept = [(tile.name, tile.get(store.TERRAIN_SUMMARY)) for tile in tiles(scene)]
    return [(name, tuple(map(str, said))) for name, said in kept if isinstance(said, list) and said]


def grouped(count: int) -> str:
    """A count with its thousands set apart."""
    return f"{count:,}"


def _read(obj: bpy.types.Object) -> Surface:
    _, faces = terrain_mesh.mesh_arrays(obj.data)
    local = terrain_mesh.placed_vertices(obj)
    if np.linalg.det(np.array(obj.matrix_world)[:3, :3]) < 0:  # mirrored: the faces would look into the ground
        faces = np.ascontiguousarray(faces[:, ::-1])
    shift, turned = georeference.read_shift(_scene_of(obj)), bool(obj.get(store.TURNED))
    return Surface(local, faces, shift, obj.name, turned=turned, colours=terrain_colours.scanned(obj.data))


def _way_m(tile: bpy.types.Object) -> float:
    """How far the corner that has moved most has moved [m]."""
    return max((tile.matrix_world @ Vector(corner) - Vector(corner)).length for corner in tile.bound_box)


def _key(obj: bpy.types.Object) -> tuple:
    mesh = obj.data
    place = tuple(round(value, 9) for row in obj.matrix_world for value in row)
    shift = georeference.read_shift(_scene_of(obj))
    return mesh.session_uid, terrain_mesh.contents_of(mesh), place, shift


def _scene_of(obj: bpy.types.Object) -> bpy.types.Scene:
    if len(bpy.data.scenes) == 1:  # to ask an object, Blender goes through all
        return bpy.data.scenes[0]
    return next(iter(obj.users_scene), bpy.context.scene)


def _differ(one: Surface, other: Surface) -> bool:
    return one is not other

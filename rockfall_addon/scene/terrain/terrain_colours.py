# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours of the terrain: those that the scan brought, and those of the footage, as attributes of its meshes."""

import hashlib
import json

import bpy
import numpy as np

from ....core.footage.sequences import is_there
from ....core.outreach.photographs import Filmed
from ....core.terrain.surface import Surface
from ..footage import camera_paths, video_files, videos
from ..storage import materials, store
from . import terrain_mesh

Colours = np.ndarray
"""(n, 4) uint8 sRGB, and how much it counts."""


def write(mesh: bpy.types.Mesh, name: str, colours: Colours) -> None:
    """Give the vertices of a mesh their colours, (n, 3) or (n, 4)."""
    attribute = mesh.attributes.get(name) or mesh.attributes.new(name, "BYTE_COLOR", "POINT")
    four = np.full((len(colours), 4), 255, dtype=np.uint8)
    four[:, : colours.shape[1]] = colours
    attribute.data.foreach_set("color_srgb", (four.astype(np.float32) / 255).ravel())


def read(mesh: bpy.types.Mesh, name: str) -> Colours | None:
    """The colours of a mesh's vertices, None where it has none."""
    attribute = mesh.attributes.get(name)
    if attribute is None or attribute.data_type != "BYTE_COLOR" or len(attribute.data) != len(mesh.vertices):
        return None
    values = np.empty(4 * len(mesh.vertices), dtype=np.float32)
    attribute.data.foreach_get("color_srgb", values)
    return np.rint(255 * values).astype(np.uint8).reshape(-1, 4)


def scanned(mesh: bpy.types.Mesh) -> np.ndarray | None:
    """(n, 3) of the scan, None where it brought none."""
    found = read(mesh, materials.SCAN_COLOURS)
    return None if found is None else np.ascontiguousarray(found[:, :3])


def meshes_of(tile: bpy.types.Object) -> list[bpy.types.Mesh]:
    """A tile's mesh, and the one that stands in for it."""
    other = terrain_mesh.stand_in(tile)
    return [tile.data, *([other.data] if other is not None else [])]


def have(scene: bpy.types.Scene, name: str) -> bool:
    """Whether a tile of a scene has colours of a name."""
    tiles = store.with_role(scene, store.TERRAIN_ROLE)
    return any(tile.type == "MESH" and name in tile.data.attributes for tile in tiles)


def filmed(scene: bpy.types.Scene) -> tuple[Filmed, ...]:
    """The scene's videos whose cameras are solved and whose files are there."""
    return tuple(
        Filmed(
            camera.name,
            video_files.file_of(camera),
            camera_paths.camera_path(camera),
            video_files.sequence_rate_of(camera),
        )
        for camera in _solved(scene)
        if is_there(video_files.file_of(camera))
    )


def remember(scene: bpy.types.Scene, tile: bpy.types.Object) -> None:
    """The tile has the colours of the cameras as they are now."""
    tile[store.FOOTAGE_OF] = json.dumps(_cameras(scene))


def is_stale(scene: bpy.types.Scene) -> bool:
    """Whether a tile has footage colours from where a camera is not any more."""
    now = None
    for tile in store.with_role(scene, store.TERRAIN_ROLE):
        if tile.type != "MESH" or materials.FOOTAGE_COLOURS not in tile.data.attributes:
            continue
        now = _cameras(scene) if now is None else now
        then = store.read_json(tile, store.FOOTAGE_OF, {})
        if any(now.get(identifier) != digest for identifier, digest in then.items()):
            return True
    return False


def remove(scene: bpy.types.Scene) -> None:
    """Take the footage colours off all tiles."""
    for tile in store.with_role(scene, store.TERRAIN_ROLE):
        for mesh in meshes_of(tile) if tile.type == "MESH" else []:
            attribute = mesh.attributes.get(materials.FOOTAGE_COLOURS)
            if attribute is not None:
                mesh.attributes.remove(attribute)
        if store.FOOTAGE_OF in tile:
            del tile[store.FOOTAGE_OF]


def bare(mesh: bpy.types.Mesh, tile: bpy.types.Object, like: Surface) -> Surface:
    """A mesh of a tile as a surface where the tile stands, to be photographed."""
    world = np.array(tile.matrix_world)
    vertices, faces = terrain_mesh.mesh_arrays(mesh)
    places = vertices.astype(np.float64) @ world[:3, :3].T + world[:3, 3]
    return Surface(places, faces, like.shift, tile.name)


def _solved(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    return [camera for camera in videos.cameras(scene) if camera_paths.is_solved(camera)]


def _cameras(scene: bpy.types.Scene) -> dict[str, str]:
    """Id → digest of where each solved camera stands and of what its video shows."""
    found = {}
    for camera in _solved(scene):
        digest = hashlib.sha1(str(camera[store.VIDEO_FILE]).encode(), usedforsecurity=False)
        for key in (store.CAMERA, store.POSES, store.POSE_TIMES):
            digest.update(np.array(camera[key], dtype=np.float64).tobytes())
        found[str(camera[store.ID])] = digest.hexdigest()
    return found

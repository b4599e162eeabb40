# SPDX-License-Identifier: GPL-3.0-or-later
"""Drawn release sources: a line, a closed line, or points, of a mesh, a curve or a Grease Pencil object."""

from collections.abc import Sequence

import bpy
import numpy as np

from ....core.errors import RockfallError
from ....core.vectors import Array
from ..storage import store

TYPES = ("MESH", "CURVE", "CURVES", "GREASEPENCIL")
POINTS, LINE, POLYGON = "points", "line", "polygon"
LEAST = {POINTS: 1, LINE: 2, POLYGON: 3}
NAMES = {POINTS: "Release points", LINE: "Release line", POLYGON: "Release area"}


def make(scene: bpy.types.Scene, kind: str, points: Sequence[Array], name: str = "") -> bpy.types.Object:
    """An object of points (n, 3) of the terrain.

    Raises
    ------
    RockfallError : they are too few.
    """
    n = len(points)
    if n < LEAST[kind]:
        raise RockfallError(f"{NAMES[kind]}: {n} points are too few. Click at least {LEAST[kind]}, then press Enter.")
    mesh = bpy.data.meshes.new(NAMES[kind])
    edges = [(i, i + 1) for i in range(n - 1)] if kind != POINTS else []
    mesh.from_pydata([tuple(map(float, point)) for point in points], edges + [(n - 1, 0)] * (kind == POLYGON), [])
    obj = bpy.data.objects.new(name or NAMES[kind], mesh)
    obj[store.ROLE] = store.RELEASE_ROLE
    obj.hide_render = True
    store.link(store.collection(scene, "Releases"), obj)
    return obj


def read(obj: bpy.types.Object) -> tuple[str, Array]:
    """What an object is (points, line or polygon), and its points in order (n, 3), local [m].

    Raises
    ------
    RockfallError : it is none of them.
    """
    lines = _strokes(obj) if obj.type == "GREASEPENCIL" else _chains(obj)
    if len(lines) > 1:
        raise RockfallError(f"{obj.name} has {len(lines)} separate lines. Join them, or draw one alone.")
    kind, places = lines[0] if lines else (POINTS, np.zeros((0, 3)))
    if len(places) < LEAST[kind]:
        raise RockfallError(f"{obj.name} has {len(places)} points. A {kind} needs at least {LEAST[kind]}.")
    world = np.array(obj.matrix_world)
    return kind, places.astype(np.float64) @ world[:3, :3].T + world[:3, 3]


def _chains(obj: bpy.types.Object) -> list[tuple[str, Array]]:
    """The lines of an object's mesh, or of the mesh that a curve makes; its points when it has no lines."""
    evaluated = obj if obj.type == "MESH" else obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = obj.data if obj.type == "MESH" else evaluated.to_mesh()
    try:
        places = np.empty(3 * len(mesh.vertices), dtype=np.float32)
        mesh.vertices.foreach_get("co", places)
        edges = np.empty(2 * len(mesh.edges), dtype=np.int32)
        mesh.edges.foreach_get("vertices", edges)
        faces = [list(face.vertices) for face in mesh.polygons]
    finally:
        if obj.type != "MESH":
            evaluated.to_mesh_clear()
    places = places.reshape(-1, 3)
    if len(faces) == 1:
        return [(POLYGON, places[faces[0]])]
    if len(faces) > 1:
        raise RockfallError(f"{obj.name} has {len(faces)} faces. A drawn area has one face, or is a closed line.")
    if not len(edges):
        return [(POINTS, places)]
    return [_in_order(obj, places, chain) for chain in _connected(edges.reshape(-1, 2))]


def _connected(edges: Array) -> list[dict[int, list[int]]]:
    """The neighbours of each point, chain by chain."""
    near: dict[int, list[int]] = {}
    for a, b in edges.tolist():
        near.setdefault(a, []).append(b)
        near.setdefault(b, []).append(a)
    chains, left = [], dict(near)
    while left:
        reached, waiting = {}, [next(iter(left))]
        while waiting:
            point = waiting.pop()
            if point in left:
                reached[point] = left.pop(point)
                waiting += reached[point]
        chains.append(reached)
    return chains


def _in_order(obj: bpy.types.Object, places: Array, near: dict[int, list[int]]) -> tuple[str, Array]:
    if any(len(others) > 2 for others in near.values()):
        raise RockfallError(f"The line of {obj.name} branches. Draw one that does not.")
    ends = [point for point, others in near.items() if len(others) == 1]
    here = min(ends, default=min(near))
    order = [here]
    while True:
        onward = [other for other in near[here] if other not in order[-2:] and other != order[0]]
        if not onward:
            break
        here = onward[0]
        order.append(here)
    return (LINE if ends else POLYGON), places[order]


def _strokes(obj: bpy.types.Object) -> list[tuple[str, Array]]:
    """The strokes of all visible layers at the present frame."""
    found = []
    for layer in obj.data.layers:
        frame = None if layer.hide else layer.current_frame()
        for stroke in frame.drawing.strokes if frame is not None else ():
            places = np.array([point.position[:] for point in stroke.points], dtype=np.float64).reshape(-1, 3)
            found.append((POLYGON if stroke.cyclic else LINE, places))
    return found

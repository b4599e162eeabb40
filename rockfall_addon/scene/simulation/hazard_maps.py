# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps of many runs in the scene: an object whose vertices are the cells that blocks reach, with all their numbers.

It is never seen; the overlay paints the terrain from it. So maps are saved, copied and undone with the scene.
"""

import json
from dataclasses import dataclass
from typing import cast

import bpy
import numpy as np

from ....core.hazard.cell_tally import CellTally
from ....core.hazard.cells import Cells
from ....core.hazard.evidence import Evidence, cell_evidence, entered, few_blocks
from ....core.hazard.face_tally import FACE_LAYERS, FaceMaps, FaceTally
from ....core.hazard.maps import LAYERS, Maps
from ....core.hazard.screens import Screen
from ....core.progress import Progress
from ....core.remarks import Remark, from_plain, gravest_first, to_plain
from ....core.vectors import Array
from ....core.workflow.hazard import run_chunks
from ....core.workflow.maps import FACES, HELD_FACES, HELD_MAPS, MAPS, map_remarks, tallies_for
from ....core.workflow.simulation import ground_of
from ..storage import store
from . import screens, simulated_sources, simulation_setup
from .simulation_setup import Plan

COLLECTION = "Maps"
CELL, EVIDENCE = "cell", "evidence"
"""Attributes: number of the cell, row by row from the south-west; 1 where few blocks enter it, 2 where it is beyond the
terrain, 3 for both."""
FACE, OF = "face", "face_of"
"""Attributes: number of the face in the ground, and of what it is among the names that the object has."""


@dataclass(frozen=True, eq=False)
class MapPlan:
    """What is to be mapped.

    Attributes
    ----------
    plan : one model, and the blocks of the maps.
    cell_m : side of a cell [m].
    model : its name.
    barriers : that hold blocks; none where the maps are of the blocks as they fall.
    """

    plan: Plan
    cell_m: float
    model: str
    barriers: tuple[Screen, ...] = ()


def plan(scene: bpy.types.Scene) -> MapPlan:
    """What the settings say.

    Raises
    ------
    RockfallError : something is missing, or cannot be.
    """
    settings = scene.rockfall_simulation
    model = settings.map_model
    planned = simulation_setup.plan(scene, simulated_sources.entry_with(scene, [model], settings.map_number))
    barriers = tuple(screen for screen in planned.screens if screen.holds) if settings.map_with_barriers else ()
    return MapPlan(planned, store.double(settings.map_cell_m), model, barriers)


def fingerprint(scene: bpy.types.Scene) -> str:
    """Of all that decides what maps there would be now."""
    settings = scene.rockfall_simulation
    runs = simulation_setup.fingerprint(scene, [settings.map_model], settings.map_number)
    held = " with barriers" if settings.map_with_barriers and has_barriers(scene) else ""
    return f"{runs} {store.double(settings.map_cell_m):g}{held}"


def has_barriers(scene: bpy.types.Scene) -> bool:
    """Whether a drawn screen holds blocks."""
    return any(screen.holds for screen in screens.screens_of(scene))


@dataclass(frozen=True, eq=False)
class Found:
    """Maps of the cells and of the faces; of faces none where blocks meet points."""

    cells: Maps
    faces: FaceMaps | None
    remarks: tuple[Remark, ...]
    evidence: Evidence
    with_barriers: bool = False


def run(asked: MapPlan, progress: Progress) -> Found:
    """Simulate and count, without Blender; what is finished at a cancel is kept.

    Raises
    ------
    RockfallError : whatever the core refuses.
    CancelledError : no block was finished.
    """
    progress("Preparing the ground", 0, 0)
    ground = ground_of(asked.plan.scenario)
    with_faces = len(ground.faces) > 0
    barriers = asked.barriers
    tallies = tallies_for(ground, asked.cell_m, with_faces, barriers)
    names = (HELD_MAPS, HELD_FACES) if barriers else (MAPS, FACES)
    tally = cast(CellTally, tallies[names[0]])
    of_faces = cast(FaceTally, tallies[names[1]]) if with_faces else None
    progress("Releasing the blocks", 0, 0)
    releases = asked.plan.scenario.releases(ground)
    wanted = [tally] if of_faces is None else [tally, of_faces]
    counted = run_chunks(ground, releases, asked.plan.scenario.settings[0], wanted, progress=progress)
    remarks = list(map_remarks({asked.model: tally}))
    if counted.blocks < counted.wanted:
        text = f"Stopped by you: the maps are of {counted.blocks} of {counted.wanted} blocks."
        remarks.append(Remark(text, "warning", "cancelled"))
    if barriers:
        names = ", ".join(barrier.name for barrier in barriers)
        remarks.append(Remark(f"Blocks end where a barrier holds them: {names}.", "note", "barriers"))
    text = "All numbers are conditional on the release: how often blocks are released is not in them."
    remarks.append(Remark(text, "note", "maps"))
    faces = None if of_faces is None else of_faces.maps(ground)
    maps = tally.maps()
    evidence = cell_evidence(maps, asked.plan.scenario.terrain)
    return Found(maps, faces, tuple(gravest_first([*asked.plan.remarks, *remarks])), evidence, bool(barriers))


def show(scene: bpy.types.Scene, found: Found, model: str, said: str) -> bpy.types.Object:
    """Keep these maps in the scene, and no others."""
    remove(scene)
    maps, remarks = found.cells, found.remarks
    if found.faces is not None:
        _show_faces(scene, found.faces)
    cells = maps.cells
    filled = np.zeros(cells.shape, np.bool_)
    for values in maps.layers.values():
        filled |= np.isfinite(values)
    cell = np.flatnonzero(filled)
    mesh = bpy.data.meshes.new("Maps")
    mesh.vertices.add(cell.size)
    row, column = np.divmod(cell, cells.columns)
    corner = np.array([cells.x0_m, cells.y0_m])
    places = np.column_stack([corner + cells.size_m * (np.column_stack([column, row]) + 0.5), np.zeros(cell.size)])
    mesh.attributes["position"].data.foreach_set("vector", places.astype(np.float32).ravel())
    mesh.attributes.new(CELL, "INT", "POINT").data.foreach_set("value", cell.astype(np.int32))
    for name, values in maps.layers.items():
        attribute = mesh.attributes.new(name, "FLOAT", "POINT")
        attribute.data.foreach_set("value", values.ravel()[cell].astype(np.float32))
    said_little = found.evidence.few + 2 * found.evidence.beyond
    mesh.attributes.new(EVIDENCE, "INT", "POINT").data.foreach_set("value", said_little.ravel()[cell].astype(np.int32))
    obj = bpy.data.objects.new("Maps", mesh)
    obj[store.ROLE], obj[store.MODEL] = store.MAPS_ROLE, model
    obj[store.MAP_CELLS] = [cells.x0_m, cells.y0_m, cells.size_m, float(cells.columns), float(cells.rows)]
    obj[store.MAP_BLOCKS] = maps.blocks
    about = {"print": said, "remarks": to_plain(remarks), "with_barriers": found.with_barriers}
    obj[store.MAP_OF] = json.dumps(about)
    obj.hide_viewport = obj.hide_render = obj.hide_select = True
    store.link(store.collection(scene, COLLECTION), obj)
    return obj


def _show_faces(scene: bpy.types.Scene, maps: FaceMaps) -> None:
    """The triangles as a mesh that is never seen, their numbers as attributes."""
    mesh, count = bpy.data.meshes.new("Face maps"), len(maps.faces)
    mesh.vertices.add(3 * count)
    mesh.attributes["position"].data.foreach_set("vector", maps.corners.astype(np.float32).ravel())
    mesh.loops.add(3 * count)
    mesh.attributes[".corner_vert"].data.foreach_set("value", np.arange(3 * count, dtype=np.int32))
    mesh.polygons.add(count)
    mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * count, 3, dtype=np.int32))
    mesh.attributes.new(FACE, "INT", "FACE").data.foreach_set("value", maps.faces.astype(np.int32))
    names = list(dict.fromkeys(maps.of.tolist()))
    of = np.array([names.index(name) for name in maps.of.tolist()], dtype=np.int32)
    mesh.attributes.new(OF, "INT", "FACE").data.foreach_set("value", of)
    for name, values in maps.layers.items():
        mesh.attributes.new(name, "FLOAT", "FACE").data.foreach_set("value", values.astype(np.float32))
    obj = bpy.data.objects.new("Face maps", mesh)
    obj[store.ROLE], obj[store.MAP_BLOCKS], obj[OF] = store.FACE_MAPS_ROLE, maps.blocks, names
    obj.hide_viewport = obj.hide_render = obj.hide_select = True
    store.link(store.collection(scene, COLLECTION), obj)


def remove(scene: bpy.types.Scene) -> None:
    """Keep no maps."""
    store.remove_objects([*store.with_role(scene, store.MAPS_ROLE), *store.with_role(scene, store.FACE_MAPS_ROLE)])
    store.remove_collection(scene, COLLECTION)


def maps_of(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """The object of the scene's maps."""
    found = next(iter(store.with_role(scene, store.MAPS_ROLE)), None)
    return found if found is not None and found.type == "MESH" and CELL in found.data.attributes else None


def faces_of(scene: bpy.types.Scene) -> FaceMaps | None:
    """The maps of the faces, kept until they are others; layers that are not there any more are left out."""
    obj = next(iter(store.with_role(scene, store.FACE_MAPS_ROLE)), None)
    if obj is None or obj.type != "MESH":
        return None
    mesh, called = obj.data, obj.get(OF)
    if not isinstance(called, list) or not called:
        return None
    for name in (FACE, OF):
        attribute = mesh.attributes.get(name)
        if attribute is None or (attribute.data_type, attribute.domain) != ("INT", "FACE"):
            return None
    count = len(mesh.polygons)
    key = mesh.session_uid, count
    if len(mesh.vertices) != 3 * count or not count:
        return None
    if not _faces or _faces[0][0] != key:
        corners = np.empty(9 * count, np.float32)
        mesh.attributes["position"].data.foreach_get("vector", corners)
        numbers = {}
        for name in (FACE, OF):
            numbers[name] = np.empty(count, np.int32)
            mesh.attributes[name].data.foreach_get("value", numbers[name])
        layers = {}
        for name in FACE_LAYERS:
            attribute = mesh.attributes.get(name)
            if attribute is not None and attribute.data_type == "FLOAT" and attribute.domain == "FACE":
                values = np.empty(count, np.float32)
                attribute.data.foreach_get("value", values)
                layers[name] = values.astype(np.float64)
        names = np.array([str(name) for name in called])
        of = names[np.clip(numbers[OF], 0, len(names) - 1)]
        corners = corners.astype(np.float64).reshape(count, 3, 3)
        _faces[:] = [(key, FaceMaps(numbers[FACE], corners, of, int(obj[store.MAP_BLOCKS]), layers))]
    return _faces[0][1]


_faces: list[tuple[tuple, FaceMaps]] = []


def read(obj: bpy.types.Object) -> Maps:
    """The maps of an object, kept until it is another one; layers that are not there any more are left out."""
    key = obj.data.session_uid, len(obj.data.vertices), tuple(obj[store.MAP_CELLS])
    if not _read or _read[0][0] != key:
        x0, y0, size, columns, rows = obj[store.MAP_CELLS]
        cells = Cells(x0, y0, size, int(columns), int(rows))
        cell = np.empty(len(obj.data.vertices), np.int32)
        obj.data.attributes[CELL].data.foreach_get("value", cell)
        inside = (cell >= 0) & (cell < len(cells))
        layers = {}
        for name in LAYERS:
            attribute = obj.data.attributes.get(name)
            if attribute is not None and attribute.data_type == "FLOAT" and attribute.domain == "POINT":
                values = np.empty(len(cell), np.float32)
                attribute.data.foreach_get("value", values)
                whole = np.full(len(cells), np.nan)
                whole[cell[inside]] = values[inside]
                layers[name] = whole.reshape(cells.shape)
        _read[:] = [(key, Maps(cells, int(obj[store.MAP_BLOCKS]), layers))]
    return _read[0][1]


_read: list[tuple[tuple, Maps]] = []


def evidence_of(obj: bpy.types.Object, maps: Maps) -> Evidence:
    """On what the maps of an object rest; older files do not say which cells are beyond the terrain."""
    reached, kept = entered(maps), np.zeros(len(maps.cells), np.int32)
    attribute = obj.data.attributes.get(EVIDENCE)
    if attribute is None or (attribute.data_type, attribute.domain) != ("INT", "POINT"):
        return Evidence(reached, few_blocks(maps), np.zeros(reached.shape, bool))
    cell, value = (np.empty(len(obj.data.vertices), np.int32) for _ in range(2))
    obj.data.attributes[CELL].data.foreach_get("value", cell)
    attribute.data.foreach_get("value", value)
    inside = (cell >= 0) & (cell < len(kept))
    kept[cell[inside]] = value[inside]
    kept = kept.reshape(maps.cells.shape)
    return Evidence(reached, kept & 1 > 0, kept & 2 > 0)


def with_barriers(obj: bpy.types.Object) -> bool:
    """Whether the maps of an object are of the blocks that barriers leave."""
    return bool(store.read_json(obj, store.MAP_OF, {}).get("with_barriers", False))


def remarks(scene: bpy.types.Scene) -> list[Remark]:
    """What there is to say about the maps, bad news first."""
    obj = maps_of(scene)
    if obj is None:
        return []
    kept = store.read_json(obj, store.MAP_OF, {})
    said = list(from_plain(kept.get("remarks", []), "note"))
    if is_stale(scene):
        text = "Terrain, structures, releases, models or settings were changed since: compute the maps again."
        said.insert(0, Remark(text, "warning", "stale"))
    return said


def is_stale(scene: bpy.types.Scene) -> bool:
    """Whether the maps are of something else than the scene now says."""
    obj = maps_of(scene)
    return obj is not None and store.read_json(obj, store.MAP_OF, {}).get("print") != fingerprint(scene)


def cell_at(cells: Cells, place: Array) -> tuple[int, int] | None:
    """Row and column of the cell that a place (2 or 3,) is in; None beside the maps."""
    column, row = np.floor((place[:2] - [cells.x0_m, cells.y0_m]) / cells.size_m).astype(int).tolist()
    return (row, column) if 0 <= row < cells.rows and 0 <= column < cells.columns else None

# SPDX-License-Identifier: GPL-3.0-or-later
"""Trees that simulated blocks meet: what the scene's settings say of them, and their stems in the scene."""

import shutil
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np

from ....core.exchange.job_inputs import input_hashes
from ....core.exchange.simulation_entry import TreesEntry
from ....core.formats.shapefile import parts_beside
from ....core.simulation.trees import Trees
from ....core.vectors import Array
from ..storage import materials, store

SIDES = 8
MOST_SHOWN = 50_000
"""Stems that are drawn: the first of more."""
BARK = (0.30, 0.20, 0.12)


def missing(scene: bpy.types.Scene) -> str:
    """What the chosen kind of trees still needs, in a sentence; empty when all is there."""
    settings = scene.rockfall_simulation
    if settings.trees == "TABLE" and not settings.trees_file:
        return "Choose the table of trees, or simulate without them."
    return ""


def entry_of(scene: bpy.types.Scene) -> TreesEntry | None:
    """The settings as a project states them; None for no trees."""
    settings = scene.rockfall_simulation
    if settings.trees == "NONE":
        return None
    entry = TreesEntry(height_m=store.double(settings.tree_height_m), species=settings.tree_species)
    if settings.trees == "TABLE":
        return replace(entry, file=_path(settings.trees_file))
    return replace(
        entry,
        stems_per_hectare=store.double(settings.stems_per_hectare),
        dbh_cm=store.double(settings.dbh_cm),
        dbh_sd_cm=store.double(settings.dbh_sd_cm),
        within=_path(settings.trees_within) if settings.trees_within else None,
    )


def keep_entry(scene: bpy.types.Scene, entry: TreesEntry | None) -> None:
    """Give the settings what a project states."""
    settings = scene.rockfall_simulation
    settings.trees = "NONE" if entry is None else "TABLE" if entry.file is not None else "DRAWN"
    if entry is None:
        return
    settings.tree_height_m, settings.tree_species = entry.height_m, entry.species
    settings.trees_file = "" if entry.file is None else str(entry.file)
    settings.trees_within = "" if entry.within is None else str(entry.within)
    if entry.stems_per_hectare is not None and entry.dbh_cm is not None:
        settings.stems_per_hectare, settings.dbh_cm = entry.stems_per_hectare, entry.dbh_cm
        settings.dbh_sd_cm = entry.dbh_sd_cm


def fingerprint(scene: bpy.types.Scene) -> list[object]:
    """Of the trees: by the content of their files, wherever these are."""
    entry = entry_of(scene)
    if entry is None:
        return []
    files = {name: file for name in ("file", "within") if (file := getattr(entry, name)) is not None}
    for name, file in list(files.items()):
        files |= {f"{name}{suffix}": part for suffix, part in parts_beside(file).items()}
    return [replace(entry, file=None, within=None), input_hashes(files)]


def copied(entry: TreesEntry | None, place: Path) -> TreesEntry | None:
    """The same with its files beside the project that is written."""
    if entry is None:
        return None
    for name, stem in (("file", "trees"), ("within", "forest")):
        source = getattr(entry, name)
        if source is not None:
            copy = place / f"{stem}{source.suffix}"
            shutil.copyfile(source, copy)
            for suffix, part in parts_beside(source).items():
                shutil.copyfile(part, copy.with_suffix(suffix))
            entry = replace(entry, **{name: copy})
    return entry


def show(scene: bpy.types.Scene, collection: bpy.types.Collection, trees: Trees | None) -> None:
    """The stems of a simulation as one object."""
    if trees is None or not len(trees):
        return
    corners, sides, tops = _prisms(trees)
    mesh = bpy.data.meshes.new("Trees")
    mesh.vertices.add(len(corners))
    mesh.attributes["position"].data.foreach_set("vector", corners.astype(np.float32).ravel())
    indices = np.concatenate([sides.ravel(), tops.ravel()])
    starts = np.concatenate([np.arange(len(sides)) * 4, sides.size + np.arange(len(tops)) * SIDES])
    mesh.loops.add(indices.size)
    mesh.loops.foreach_set("vertex_index", indices.astype(np.int32))
    mesh.polygons.add(starts.size)
    mesh.polygons.foreach_set("loop_start", starts.astype(np.int32))
    mesh.update(calc_edges=True)
    colour = mesh.attributes.new("colour", "FLOAT_COLOR", "POINT")
    colour.data.foreach_set("color", np.tile([*BARK, 1.0], (len(corners), 1)).astype(np.float32).ravel())
    material = materials.shaded_material("Rockfall trees", "colour")
    material.diffuse_color = (*BARK, 1.0)
    mesh.materials.append(material)
    obj = bpy.data.objects.new("Trees", mesh)
    obj[store.ROLE] = store.SIMULATED_TREES_ROLE
    obj.hide_select = True
    obj.color = (*BARK, 1.0)
    store.link(collection, obj)
    look(scene)


def look(scene: bpy.types.Scene) -> None:
    """Show or hide the stems as the settings say."""
    for obj in store.with_role(scene, store.SIMULATED_TREES_ROLE):
        obj.hide_viewport = obj.hide_render = not scene.rockfall_simulation.show_trees


def _prisms(trees: Trees) -> tuple[Array, Array, Array]:
    """Corners (k, 3) of the stems, the faces (m, 4) around and (t, `SIDES`) above them."""
    number = min(len(trees), MOST_SHOWN)
    angle = 2 * np.pi * np.arange(SIDES) / SIDES
    around = np.column_stack([np.cos(angle), np.sin(angle)])
    ring = trees.position[:number, None] + 0.5 * trees.dbh_m[:number, None, None] * around
    foot, top = (np.repeat(z, SIDES) for z in (trees.foot_m[:number], (trees.foot_m + trees.height_m)[:number]))
    corners = np.empty((number, 2 * SIDES, 3))
    corners[:, :SIDES, :2] = corners[:, SIDES:, :2] = ring
    corners[:, :SIDES, 2], corners[:, SIDES:, 2] = foot.reshape(number, SIDES), top.reshape(number, SIDES)
    here = np.arange(SIDES)
    then = (here + 1) % SIDES
    side = np.column_stack([here, then, then + SIDES, here + SIDES])
    first = 2 * SIDES * np.arange(number)
    return corners.reshape(-1, 3), (first[:, None, None] + side).reshape(-1, 4), first[:, None] + SIDES + here


def _path(text: str) -> Path:
    return Path(bpy.path.abspath(text))

# SPDX-License-Identifier: GPL-3.0-or-later
"""Between project.toml and the scene: what *Load demo* and a film without a window have in common, and the way back."""

import json
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path

import bpy

from ...core.analysis.completeness import NOT_STATED
from ...core.errors import RockfallError
from ...core.exchange.parameters import checked_parameters
from ...core.exchange.project import (
    CameraPlacement,
    Project,
    RenderPreset,
    Site,
    TerrainSource,
    read_project,
    write_project,
)
from ...core.exchange.screens import entry_of, screens_of
from ...core.exchange.simulation_entry import SimulationEntry, StructureEntry, ZonesEntry
from ...core.exchange.tables import write_picks
from ...core.exchange.zones import open_zones, write_attribute_zones
from ...core.impact_models.registry import COMPARED
from ...core.output import output_folder
from ...core.reconstruction.trajectory import Reconstruction
from ...core.remarks import Remark
from ...core.simulation.zones import Zones
from ...core.terrain.cloud import Cloud
from ...core.terrain.readers import read_structure
from ...core.terrain.shading import shade
from ...core.terrain.surface import Surface
from ...core.terrain.writers import write_ply
from ...core.workflow.opening import open_project, open_terrain
from . import (
    back_analysis,
    film_preset,
    fit,
    georeference,
    models,
    picks,
    posterior,
    project_videos,
    reconstruction,
    screens,
    set_aside_words,
    simulated_sources,
    simulated_trees,
    simulated_zones,
    simulation_setup,
    store,
    structures,
    sync,
    terrain,
)

MODEL_TABLES = {"A": "models", "B": "models_b"}
"""Set of parameters → its tables in project.toml, [models.NAME] and [models_b.NAME]."""
ZONE = "zone"
"""Attribute of the written terrain's faces: 0 where there is no zone."""


def load_project(scene: bpy.types.Scene, path: Path, *, with_videos: bool = True) -> Reconstruction | None:
    """Show a project in a scene: its terrain, its videos, its picks, and what is reconstructed from them.

    Returns None for a project without picks, of videos in which they are still to be made or of a simulation.

    Parameters
    ----------
    with_videos : a film needs none; with them the scene plays at the rate and the times of the first.

    Raises
    ------
    RockfallError : the project or one of its files is bad. The scene is as it was.
    """
    project = read_project(path)
    parameters = {
        which: checked_parameters(project.extra[table], path) if table in project.extra else {}
        for which, table in MODEL_TABLES.items()
    }
    if project.picks is None and ((project.videos and with_videos) or project.simulation is not None):
        surface, result = open_terrain(project), None
    else:
        surface, result = open_project(project)
    zones = _zones(project, surface)
    met, left_out = _structures(project, surface)
    entry = project.simulation
    stated_screens = () if entry is None or surface is None else screens_of(entry.screens, surface.shift)
    shading = None if surface is None else shade(surface)
    known = surface.shift if surface is not None else None if result is None else result.picks.shift
    found = project_videos.read_videos(project, surface, known) if with_videos else []
    cameras = [read.camera.path.reference.shift for read in found if read.camera is not None]

    names = [block.name for block in project.blocks] if result is None else result.picks.trajectory.tolist()
    shift = result.picks.shift if result is not None else known or next(iter(cameras), None)
    if shift is not None:
        georeference.write_shift(scene, shift)
    reconstruction.keep_settings(scene, project)
    scene[store.SITE_DESCRIPTION] = project.site.description
    scene[store.SITE_MORE] = json.dumps({k: text for k, text in project.site.extra.items() if isinstance(text, str)})
    scene[store.RENDER_PRESETS] = json.dumps([asdict(preset) for preset in film_preset.take(scene, project.render)])
    fit.forget(scene)
    posterior.forget(scene)
    back_analysis.keep_completeness(scene, project.completeness)
    for which, values in parameters.items():
        models.keep_parameters(scene, values, which)
    if surface is not None and shading is not None:
        tile = terrain.add_terrain(scene, surface, shading)
        if project.terrain is not None and project.terrain.sigma_m is not None:
            scene.rockfall_terrain.accuracy_m = project.terrain.sigma_m
        if zones is not None:
            simulated_zones.keep(scene, zones, tile)
    for name, structure in met.items():
        structures.make(scene, name, structure)
    for screen in stated_screens:
        screens.keep(scene, screen, surface)
    project_videos.show_videos(scene, found, names[0] if len(set(names)) == 1 else "")
    if result is not None:
        reconstruction.show(scene, result)
        sync.follow_spins(scene)
    if project.simulation is not None:
        said = simulated_sources.keep_entry(scene, project.simulation, left_out)
        if said:
            simulation_setup.keep(scene, {}, (Remark(said, "warning", "project"),))
    return result


def site_of(scene: bpy.types.Scene) -> Site:
    """The site's name and description, and what else the project says of it: credits, DOI of the data."""
    more = store.read_json(scene, store.SITE_MORE, {})
    return Site(str(scene.get(store.SITE, "")), str(scene.get(store.SITE_DESCRIPTION, "")), more)


def save_project(scene: bpy.types.Scene, folder: Path) -> tuple[Path, tuple[Remark, ...]]:
    """Write project.toml, picks.csv and, when there are, terrain and structures; `load_project` reads them again.

    Several tiles are written as one terrain.

    Returns
    -------
    The path of project.toml; and which trajectories are left out, and why.

    Raises
    ------
    RockfallError : there are neither picks nor terrain, no trajectory can be used, or the folder cannot be written.
    """
    surface, shift = reconstruction.ground(scene), georeference.read_shift(scene)
    table, left_out = None, tuple(set_aside_words.grave(scene))
    if picks.objects_of(scene):
        table, left_out = reconstruction.good_picks(scene)
    if table is None and surface is None:
        raise RockfallError("There is nothing to export: import a terrain or picks first, or load the demo.")
    settings = reconstruction.project_settings(scene, [] if table is None else table.trajectory.tolist())
    stated = None if surface is None or simulation_setup.missing(scene) else simulated_sources.entry_of(scene)
    zones = None
    if surface is not None and stated is not None:
        zones = simulated_zones.zones_of(scene, surface, stated.models)
    met = structures.met_of(scene)
    drawn = [entry_of(screen, shift) for screen in screens.screens_of(scene)] if surface is not None else []
    if (met or drawn) and stated is None:
        stated = SimulationEntry()
    with output_folder(folder) as place:
        if table is not None:
            write_picks(table, place / "picks.csv")
        if surface is not None:
            write_ply(surface, place / "terrain.ply", None if zones is None else {ZONE: zones.of_face})
        if zones is not None and stated is not None:
            write_attribute_zones(zones, place / "zones.csv")
            stated = replace(stated, zones=ZonesEntry(place / "zones.csv", ZONE))
        fits = None if stated is None else posterior.in_use(scene, stated.models)
        if stated is not None and fits is not None:
            posterior.write(fits, place / "posterior.csv")
            stated = replace(stated, posterior=place / "posterior.csv")
        if stated is not None:
            stated = replace(stated, trees=simulated_trees.copied(stated.trees, place))
            stated = replace(stated, structures=_write_structures(met, place), screens=tuple(drawn))
        source = TerrainSource(
            (place / "terrain.ply",),
            (shift.x, shift.y, shift.z),
            shift.crs,
            shift.vertical,
            up="z",
            sigma_m=terrain.accuracy_m(scene),
        )
        parameters = {"A": models.parameters_of(scene), "B": fit.second_set(scene)}
        project = Project(
            site=site_of(scene),
            terrain=None if surface is None else source,
            picks=None if table is None else place / "picks.csv",
            completeness=NOT_STATED if table is None else back_analysis.completeness_of(scene),
            block=settings.block,
            blocks=settings.blocks,
            reconstruction=settings.reconstruction,
            videos=project_videos.write_videos(scene, place),
            render=_presets(scene),
            simulation=stated,
            extra={MODEL_TABLES[which]: values for which, values in parameters.items() if values},
        )
        write_project(project, place / "project.toml")
    return folder / "project.toml", left_out


def _structures(project: Project, surface: Surface | None) -> tuple[dict[str, Surface | Cloud], list[str]]:
    """The structures by name, and those that are left out: all where there is no terrain."""
    entry, source = project.simulation, project.terrain
    if entry is None or surface is None or source is None:
        return {}, [] if entry is None else [f"the structure {each.name}" for each in entry.structures]
    return {each.name: read_structure(each.file, source.how) for each in entry.structures}, []


def _write_structures(met: Mapping[str, Surface | Cloud], place: Path) -> tuple[StructureEntry, ...]:
    """Names are free, and may be none of a file: the files are numbered."""
    entries = []
    for number, (name, structure) in enumerate(met.items(), start=1):
        file = place / f"structure_{number}.ply"
        write_ply(structure, file)
        entries.append(StructureEntry(name, file))
    return tuple(entries)


def _zones(project: Project, surface: Surface | None) -> Zones | None:
    entry, source = project.simulation, project.terrain
    if entry is None or entry.zones is None or surface is None or source is None:
        return None
    return open_zones(
        entry.zones.file, entry.zones.attribute, surface, entry.models or COMPARED,
        terrain_files=source.files, how=source.how,
    )  # fmt: skip


def _presets(scene: bpy.types.Scene) -> tuple[RenderPreset, ...]:
    """Those of the project that was opened, and the film that the panel asks for."""
    kept = [_preset(values) for values in store.read_json(scene, store.RENDER_PRESETS, [])]
    if any(preset.name == film_preset.NAME for preset in kept):  # of which the panel cannot show all
        return tuple(kept)
    return (*kept, replace(film_preset.preset_of(scene), name=film_preset.NAME))


def _preset(values: dict) -> RenderPreset:
    placed = values.pop("camera")
    if placed is None:
        return RenderPreset(**values)
    placed |= {name: tuple(placed[name]) for name in ("position", "target")}
    return RenderPreset(**values, camera=CameraPlacement(**placed))

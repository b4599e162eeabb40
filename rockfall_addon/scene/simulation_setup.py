# SPDX-License-Identifier: GPL-3.0-or-later
"""What the scene's settings say is to be simulated, as the core's scenario; and whether what is shown is still that."""

import hashlib
import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import bpy
import numpy as np

from ...core.analysis.measured_rebounds import measured_rebounds
from ...core.errors import RockfallError
from ...core.exchange.simulation_entry import SimulationEntry
from ...core.hazard.barriers import with_barriers
from ...core.hazard.screens import Screen, check_screens
from ...core.impact_models.registry import MODELS, find_model
from ...core.output import output_folder
from ...core.progress import Progress
from ...core.remarks import Remark, from_plain, gravest_first, to_plain
from ...core.simulation.engine import Simulation
from ...core.simulation.ground import Ground
from ...core.simulation.release import Releases
from ...core.terrain.cloud import Cloud
from ...core.terrain.surface import Surface
from ...core.workflow.maps import SCREENS, Mapped
from ...core.workflow.mesh_check import change_remarks, mesh_changes
from ...core.workflow.scenarios import make_scenario, times_as_many
from ...core.workflow.screens import outside_remarks, screen_remarks, tallies_of
from ...core.workflow.simulation import ReleaseSource, Scenario, ground_of, remarks_of, run_models
from ...core.workflow.simulation_output import default_records, write_simulations
from . import (
    fingerprints,
    models,
    posterior,
    reconstruction,
    screens,
    simulated_sources,
    simulated_trees,
    simulated_zones,
    simulation,
    store,
    structures,
    terrain,
)
from .simulation import Origin, Prepared

FAR_DIAMETERS = 3.0
"""A block that ends nearer to its start has hardly moved."""
MOST_SHOWN = 50_000
"""Blocks of all models together that Blender keeps with all their moments."""


@dataclass(frozen=True, eq=False)
class Plan:
    """What is to be simulated, and what will be stored with the result.

    Attributes
    ----------
    scenario : for the core.
    screens : at which passing blocks are measured, or held.
    origins : release → when its blocks start in the scene.
    said : the settings in words that a file keeps, and their fingerprint.
    remarks : what of the measured trajectories is missing in it.
    check_mesh : some blocks fall once more on a finer mesh.
    """

    scenario: Scenario
    screens: tuple[Screen, ...]
    origins: Mapping[str, Origin]
    said: dict[str, object]
    remarks: tuple[Remark, ...] = ()
    check_mesh: bool = False


def plan(scene: bpy.types.Scene, entry: SimulationEntry | None = None) -> Plan:
    """The scene's settings as a scenario.

    entry : instead of what they say of models and blocks.

    Raises
    ------
    RockfallError : something is missing, or cannot be.
    """
    lacking = missing(scene, None if entry is None else entry.models)
    if lacking:
        raise RockfallError(lacking)
    return planned(scene, entry or simulated_sources.entry_of(scene))


def planned(scene: bpy.types.Scene, entry: SimulationEntry) -> Plan:
    """The same of what an entry says, whatever the panels lack.

    Raises
    ------
    RockfallError : something cannot be.
    """
    surface = ground(scene)
    source_of, origins, left_out = simulated_sources.source_of(scene, entry, surface)
    scenario = scenario_of(scene, entry, surface, source_of(entry))
    scenario = replace(scenario, more_releases=lambda times: source_of(times_as_many(entry, times)))
    measured = None
    if any(MODELS[name].draws_from_impacts for name in entry.models):
        good, left_out = reconstruction.reconstruct_good(scene)
        measured = measured_rebounds(good.impacts)
    scenario = replace(scenario, measured=measured)
    check_mesh = scene.rockfall_simulation.check_mesh and entry.contact == "mesh"
    return Plan(scenario, screens.screens_of(scene), origins, {"print": fingerprint(scene)}, left_out, check_mesh)


def scenario_of(scene: bpy.types.Scene, entry: SimulationEntry, surface: Surface, source: ReleaseSource) -> Scenario:
    """How blocks from a source fall on the scene's terrain.

    Raises
    ------
    RockfallError : something cannot be.
    """
    met = surface if entry.contact == "mesh" else Cloud(surface.vertices, surface.shift, surface.name)
    drawn = posterior.in_use(scene, entry.models)
    return make_scenario(
        entry,
        reconstruction.project_settings(scene, []).reconstruction,
        met,
        source,
        models.parameters_of(scene),
        structures=structures.met_of(scene),
        zones=simulated_zones.zones_of(scene, met, list(entry.models)),
        draws={} if drawn is None else {drawn.model: drawn.draws},
    )[0]


@dataclass(frozen=True, eq=False)
class Found:
    """What a simulation gives to be shown and stored.

    Attributes
    ----------
    prepared : of each model, what is shown: blocks end where a barrier holds them.
    at_screens : see `screens.results_of`.
    """

    prepared: list[Prepared]
    at_screens: list[dict[str, object]]
    remarks: tuple[Remark, ...]


def run(plan: Plan, progress: Progress) -> Found:
    """Simulate, without Blender, and prepare what will be shown; what is finished at a cancel is kept.

    Raises
    ------
    RockfallError : more blocks than Blender can keep, or whatever the core refuses.
    CancelledError : no block was finished.
    """
    progress("Preparing the ground", 0, 0)
    ground = ground_of(plan.scenario)
    check_screens(plan.screens, ground)
    progress("Releasing the blocks", 0, 0)
    releases, models = plan.scenario.releases(ground), list(plan.scenario.models)
    if len(releases) * len(models) > MOST_SHOWN:
        raise RockfallError(
            f"{len(releases)} blocks of {len(models)} models are too many to be shown: at most {MOST_SHOWN} together. "
            "Lower the number, or use `rockfall simulate`, which has no such limit."
        )
    simulations = run_models(ground, releases, plan.scenario.settings, progress=progress)
    outside = outside_remarks(plan.screens, ground)
    of_mesh = _mesh_remarks(plan, ground, releases, progress)
    remarks = gravest_first([*plan.remarks, *remarks_of(simulations, models), *outside, *_stays(simulations), *of_mesh])
    tallies = tallies_of(simulations, plan.screens, progress)
    shown = [with_barriers(one, tallies[one.settings.model].hits) if tallies else one for one in simulations]
    return Found([simulation.prepare(one) for one in shown], screens.results_of(tallies), tuple(remarks))


def shown_counts(scene: bpy.types.Scene) -> dict[str, int]:
    """Model → how many runs are shown; fewer than were wanted after a stop."""
    return {simulation.model_of(obj): len(obj.data.curves) for obj in simulation.paths_of(scene)}


def export(plan: Plan, counts: Mapping[str, int], folder: Path, progress: Progress) -> list[str]:
    """Write the tables of what is shown, which the same seed gives again; returns the names of the files.

    Parameters
    ----------
    counts : model → how many runs are shown.

    Raises
    ------
    RockfallError : the folder cannot be written.
    """
    progress("Preparing the ground", 0, 0)
    ground = ground_of(plan.scenario)
    releases = plan.scenario.releases(ground)
    found = []
    for one in plan.scenario.settings:
        if one.model in counts:
            some = releases.take(slice(0, counts[one.model]))
            found += run_models(ground, some, [one], progress=progress)
    tallies = tallies_of(found, plan.screens, progress)
    of_mesh = _mesh_remarks(plan, ground, releases, progress)
    outside = outside_remarks(plan.screens, ground)
    remarks = gravest_first([*remarks_of(found), *outside, *screen_remarks(tallies), *of_mesh])
    with output_folder(folder) as place:
        records = default_records(len(releases))
        mapped = Mapped(tuple(found), {model: {SCREENS: tally} for model, tally in tallies.items()})
        return write_simulations(
            found, place, record=records, inputs={}, remarks=remarks, mapped=mapped, progress=progress
        )


def _mesh_remarks(plan: Plan, ground: Ground, releases: Releases, progress: Progress) -> list[Remark]:
    return change_remarks(mesh_changes(plan.scenario, ground, releases, progress=progress)) if plan.check_mesh else []


def _stays(simulations: Sequence[Simulation]) -> list[Remark]:
    """That most blocks have hardly moved, and what to do about it."""
    for one in simulations:
        away = np.hypot(*(one.position - one.releases.position)[:, :2].T)
        if np.median(away / one.releases.diameter_m) < FAR_DIAMETERS:
            title = find_model(one.settings.model).title
            text = (
                f"Most blocks with {title} stop where they start, within {np.median(away):.1f} m: "
                "release them where the terrain is steeper, or look at the friction."
            )
            return [Remark(text, "advice", "releases")]
    return []


def missing(scene: bpy.types.Scene, models: Collection[str] | None = None) -> str:
    """What is still needed before anything can be simulated, in a sentence; empty when all is there.

    models : instead of those that are chosen.
    """
    chosen = scene.rockfall_simulation.models if models is None else models
    if not terrain.tiles(scene):
        return "Blocks fall on the terrain: import it first, in step 1."
    if not chosen:
        return "Choose at least one model."
    if "observed" in chosen and not store.has_role(scene, store.PICK_ROLE):
        return "The model of measured rebounds needs measured impacts: pick some, or leave it out."
    return (
        simulated_sources.missing(scene)
        or simulated_trees.missing(scene)
        or structures.problem(scene)
        or screens.problem(scene)
    )


def ground(scene: bpy.types.Scene) -> Surface:
    """The terrain as a saved file holds it, in single precision: the same blocks fall after it is opened again.

    Raises
    ------
    RockfallError : there is none.
    """
    surface = terrain.surface_of_scene(scene)
    if surface is None:
        raise RockfallError("Blocks fall on the terrain: import it first, in step 1.")
    if not _grounds or _grounds[0][0] is not surface:
        stored = surface.vertices.astype(np.float32).astype(np.float64)
        same = np.array_equal(stored, surface.vertices)
        _grounds[:] = [(surface, surface if same else replace(surface, vertices=stored))]
    return _grounds[0][1]


_grounds: list[tuple[Surface, Surface]] = []


def fingerprint(scene: bpy.types.Scene, chosen: Collection[str] | None = None, number: int | None = None) -> str:
    """Of all that decides what is simulated: terrain, structures, screens, source, blocks, models, motion.

    chosen, number : models, and how many blocks, instead of those of the settings.
    """
    parameters, how = models.parameters_of(scene), reconstruction.project_settings(scene, []).reconstruction
    chosen = scene.rockfall_simulation.models if chosen is None else chosen
    used = {name: values for name, values in parameters.items() if name in chosen}
    sources = simulated_sources.fingerprint(scene, chosen, number)
    parts = [
        fingerprints.ground(scene), fingerprints.ground_contents(scene), sources,
        json.dumps(used, sort_keys=True), how,
    ]  # fmt: skip
    parts += [
        posterior.fingerprint(scene, chosen),
        *simulated_zones.fingerprint(scene),
        *structures.fingerprint(scene),
        *screens.fingerprint(scene),
    ]
    return hashlib.sha1(repr(parts).encode(), usedforsecurity=False).hexdigest()


def keep(
    scene: bpy.types.Scene,
    said: Mapping[str, object],
    remarks: tuple[Remark, ...],
    at_screens: Sequence[Mapping[str, object]] = (),
) -> None:
    """Store with the scene what its shown simulation is of, and what was found at the screens."""
    kept = {"remarks": to_plain(remarks), store.AT_SCREENS: list(at_screens)}
    scene[store.SIMULATION] = json.dumps(dict(said) | kept)


def screen_results(scene: bpy.types.Scene) -> list[dict[str, object]]:
    """What was found at the screens by the simulation that is shown; see `screens.results_of`."""
    return list(store.read_json(scene, store.SIMULATION, {}).get(store.AT_SCREENS, []))


def forget(scene: bpy.types.Scene) -> None:
    """Nothing simulated is shown any more."""
    simulation.remove(scene)
    scene.pop(store.SIMULATION, None)


def remarks(scene: bpy.types.Scene) -> list[Remark]:
    """What there is to say about the shown simulation, bad news first."""
    kept = store.read_json(scene, store.SIMULATION, {})
    said = list(from_plain(kept.get("remarks", []), "note"))
    if simulation.blocks_of(scene) and kept.get("print") != fingerprint(scene):
        text = "Terrain, structures, screens, releases, models or settings were changed since: simulate again."
        said.insert(0, Remark(text, "warning", "stale"))
    return said


def is_stale(scene: bpy.types.Scene) -> bool:
    """Whether something is shown that was simulated from something else than the scene now says."""
    return any(remark.about == "stale" for remark in remarks(scene))

# SPDX-License-Identifier: GPL-3.0-or-later
"""What the scene's settings say is to be simulated, as the core's scenario; and whether what is shown is still that."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import cast

import bpy
import numpy as np

from ...core.analysis.measured_rebounds import measured_rebounds
from ...core.errors import RockfallError
from ...core.impact_models.machinery.measured import MeasuredRebounds
from ...core.impact_models.registry import MODELS
from ...core.progress import Progress
from ...core.remarks import Remark, from_plain, to_plain
from ...core.simulation.engine import Rolling
from ...core.terrain.surface import Surface
from ...core.workflow.simulation import Scenario, ground_of, remarks_of, run_models
from . import (
    fingerprints,
    models,
    reconstruction,
    simulated_sources,
    simulated_zones,
    simulation,
    store,
    terrain,
)
from .simulation import Origin, Prepared

MOST_SHOWN = 50_000
"""Blocks of all models together that Blender keeps with all their moments."""


@dataclass(frozen=True, eq=False)
class Plan:
    """What is to be simulated, and what will be stored with the result.

    Attributes
    ----------
    scenario : for the core.
    measured : what the model `observed` draws from.
    origins : release → when its blocks start in the scene.
    said : the settings in words that a file keeps, and their fingerprint.
    """

    scenario: Scenario
    measured: MeasuredRebounds | None
    origins: Mapping[str, Origin]
    said: dict[str, object]


def plan(scene: bpy.types.Scene) -> Plan:
    """The scene's settings as a scenario.

    Raises
    ------
    RockfallError : something is missing, or cannot be.
    """
    lacking = missing(scene)
    if lacking:
        raise RockfallError(lacking)
    settings, surface = scene.rockfall_simulation, ground(scene)
    names = [name for name in models.ORDER if name in settings.models]
    source, origins = simulated_sources.source_of(scene, surface)
    project = reconstruction.project_settings(scene, [])
    parameters = models.parameters_of(scene)
    scenario = Scenario(
        surface,
        source,
        {name: parameters.get(name, {}) for name in names},
        rolling=cast(Rolling, settings.rolling),
        friction=store.double(settings.friction),
        drag=simulated_sources.drag(scene) if settings.use_drag else None,
        gravity_mps2=project.reconstruction.gravity_mps2,
        zones=simulated_zones.zones_of(scene, surface, names),
        seed=settings.seed,
    )
    measured = None
    if any(MODELS[name].draws_from_impacts for name in names):
        measured = measured_rebounds(reconstruction.reconstruct_scene(scene, surface=surface).impacts)
    return Plan(scenario, measured, origins, {"print": fingerprint(scene), "models": names})


def run(plan: Plan, progress: Progress) -> tuple[list[Prepared], tuple[Remark, ...]]:
    """Simulate, without Blender, and prepare what will be shown; what is finished at a cancel is kept.

    Raises
    ------
    RockfallError : more blocks than Blender can keep, or whatever the core refuses.
    CancelledError : no block was finished.
    """
    progress("Preparing the ground", 0, 0)
    ground = ground_of(plan.scenario)
    progress("Releasing the blocks", 0, 0)
    releases, models = plan.scenario.releases(ground), list(plan.scenario.models)
    if len(releases) * len(models) > MOST_SHOWN:
        raise RockfallError(
            f"{len(releases)} blocks of {len(models)} models are too many to be shown: at most {MOST_SHOWN} together. "
            "Lower the number, or use `rockfall simulate`, which has no such limit."
        )
    settings = [replace(one, measured=plan.measured) for one in plan.scenario.settings]
    simulations = run_models(ground, releases, settings, progress=progress)
    remarks = remarks_of(simulations, models)
    return [simulation.prepare(one) for one in simulations], remarks


def missing(scene: bpy.types.Scene) -> str:
    """What is still needed before anything can be simulated, in a sentence; empty when all is there."""
    settings = scene.rockfall_simulation
    if not terrain.tiles(scene):
        return "Blocks fall on the terrain: import it first, in step 1."
    if not settings.models:
        return "Choose at least one model."
    if "observed" in settings.models and not store.with_role(scene, store.PICK_ROLE):
        return "The model of measured rebounds needs measured impacts: pick some, or leave it out."
    return simulated_sources.missing(scene)


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


def fingerprint(scene: bpy.types.Scene) -> str:
    """Of all that decides what is simulated: terrain, source, blocks, models, motion."""
    settings, names = scene.rockfall_simulation, sorted(scene.rockfall_simulation.models)
    parameters = models.parameters_of(scene)
    kept = reconstruction.project_settings(scene, [])
    parts = [
        fingerprints.ground(scene), fingerprints.ground_contents(scene), simulated_sources.fingerprint(scene),
        settings.number, settings.seed, names, [sorted(parameters.get(name, {}).items()) for name in names],
        settings.rolling, settings.friction, settings.use_drag, kept.reconstruction, list(scene.get(store.DRAG, ())),
    ]  # fmt: skip
    parts += simulated_zones.fingerprint(scene)
    return hashlib.sha1(repr(parts).encode(), usedforsecurity=False).hexdigest()


def keep(scene: bpy.types.Scene, said: Mapping[str, object], remarks: tuple[Remark, ...]) -> None:
    """Store with the scene what its shown simulation is of."""
    scene[store.SIMULATION] = json.dumps(dict(said) | {"remarks": to_plain(remarks)})


def forget(scene: bpy.types.Scene) -> None:
    """Nothing simulated is shown any more."""
    simulation.remove(scene)
    scene.pop(store.SIMULATION, None)


def remarks(scene: bpy.types.Scene) -> list[Remark]:
    """What there is to say about the shown simulation, bad news first."""
    kept = json.loads(scene.get(store.SIMULATION, "{}"))
    if not simulation.blocks_of(scene):
        return []
    said = list(from_plain(kept.get("remarks", []), "note"))
    if kept.get("print") != fingerprint(scene):
        text = "Terrain, releases, models or settings were changed since: simulate again."
        said.insert(0, Remark(text, "warning", "stale"))
    return said


def is_stale(scene: bpy.types.Scene) -> bool:
    """Whether something is shown that was simulated from something else than the scene now says."""
    return any(remark.about == "stale" for remark in remarks(scene))

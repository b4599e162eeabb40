# SPDX-License-Identifier: GPL-3.0-or-later
"""What the scene's settings say of a simulation, as a project states it, and where its blocks come from."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import cast

import bpy
import numpy as np

from ...core.errors import RockfallError
from ...core.exchange.simulation_entry import MEASURED, STEEP, ReleaseEntry, SimulationEntry
from ...core.reconstruction.picks import take
from ...core.reconstruction.trajectory import Reconstruction
from ...core.remarks import Remark
from ...core.simulation.distributions import Distribution
from ...core.simulation.engine import Rolling
from ...core.simulation.ground import Contact
from ...core.simulation.measured_releases import start_times
from ...core.terrain.surface import Surface
from ...core.workflow.scenarios import measured_source, placed_source
from ...core.workflow.simulation import ReleaseSource
from . import drawn_releases, fingerprints, georeference, models, posterior, reconstruction, simulated_trees, store
from .simulation import Origin

FILMED = ("MEASURED", "PICK")
"""Sources that need picks."""
SAME_TIME_S = 1e-6
GREATEST_SEED = 2**31 - 1
"""Whole numbers of Blender's properties have 32 bits."""


def missing(scene: bpy.types.Scene) -> str:
    """What the chosen source still needs, in a sentence; empty when all is there."""
    settings = scene.rockfall_simulation
    if settings.source in FILMED and not store.has_role(scene, store.PICK_ROLE):
        return "Nothing is measured yet. Release blocks from a drawn line or area, from steep terrain, or pick first."
    if settings.source == "PICK" and selected_pick(scene) is None:
        return "Select a release or an impact in the view: blocks will start there."
    if settings.source == "DRAWN" and drawn(scene) is None:
        return "Draw where blocks start: choose below, click on the terrain, and press Enter."
    return ""


def entry_of(scene: bpy.types.Scene) -> SimulationEntry:
    """The scene's settings as a project states them.

    Raises
    ------
    RockfallError : a drawing that is none, numbers that no block has.
    """
    return replace(motion_entry(scene), releases=_release_entry(scene))


def motion_entry(scene: bpy.types.Scene) -> SimulationEntry:
    """The same without what says where blocks start."""
    settings = scene.rockfall_simulation
    return SimulationEntry(
        models=tuple(name for name in models.ORDER if name in settings.models),
        contact=cast(Contact, settings.contact),
        rolling=cast(Rolling, settings.rolling),
        friction=store.double(settings.friction),
        drag=settings.use_drag,
        seed=settings.seed,
        trees=simulated_trees.entry_of(scene),
    )


def entry_with(scene: bpy.types.Scene, models: Collection[str], number: int) -> SimulationEntry:
    """The same with other models and another number of blocks.

    Raises
    ------
    RockfallError : see `entry_of`.
    """
    entry = entry_of(scene)
    return replace(entry, models=tuple(models), releases=replace(entry.releases, number=number))


def keep_entry(scene: bpy.types.Scene, entry: SimulationEntry, left_out: Sequence[str] = ()) -> str:
    """Give the scene's settings what a project states; returns what Blender cannot take over, empty if nothing.

    Parameters
    ----------
    left_out : what is known to be left out, besides.
    """
    settings, releases = scene.rockfall_simulation, entry.releases
    if entry.models:
        settings.models = set(entry.models)
    settings.contact = entry.contact
    settings.rolling, settings.friction, settings.use_drag = entry.rolling, entry.friction, entry.drag
    settings.number = releases.number
    if entry.seed <= GREATEST_SEED:
        settings.seed = entry.seed
    simulated_trees.keep_entry(scene, entry.trees)
    settings.shape = releases.shape or "sphere"
    if releases.diameter is not None:
        settings.diameter_law, settings.diameter_m = releases.diameter.law, releases.diameter.first
        settings.diameter_second_m = releases.diameter.second or settings.diameter_second_m
    if releases.density is not None:
        settings.density_kgpm3 = releases.density.mean
    if releases.proportions is not None:
        settings.proportions = releases.proportions
    if releases.source == MEASURED:
        settings.source = "PICK" if releases.trajectory else "MEASURED"
        settings.pick = _pick_at(scene, releases) if releases.trajectory else ""
    elif releases.source == STEEP:
        settings.source, settings.steeper_than_deg = "STEEP", releases.steeper_than_deg
    elif releases.points_m:
        settings.source = "DRAWN"
        settings.drawn = _drawing(scene, releases)
    absent = [f"its releases from {Path(releases.file).name}"] if releases.file is not None else []
    absent += [f"{entry.observed.name} for the model observed"] if entry.observed is not None else []
    if entry.posterior is not None:
        try:
            posterior.read(scene, entry.posterior)
        except RockfallError as error:
            absent.append(f"the posterior {entry.posterior.name} ({error})")
    if entry.seed > GREATEST_SEED:
        absent.append(f"the seed {entry.seed}, which is above {GREATEST_SEED}")
    absent += left_out
    return f"Of the project's simulation Blender leaves out {', '.join(absent)}." if absent else ""


def source_of(
    scene: bpy.types.Scene, entry: SimulationEntry, surface: Surface
) -> tuple[Callable[[SimulationEntry], ReleaseSource], Mapping[str, Origin], tuple[Remark, ...]]:
    """What puts the blocks on the ground, when the blocks of each release start in the scene, and what is missing.

    The first is asked with the entry, or with one of another number of blocks; it touches nothing of Blender.

    Raises
    ------
    RockfallError : whatever the reconstruction refuses.
    """
    block = reconstruction.project_settings(scene, []).block
    if entry.releases.source != MEASURED:
        return lambda asked: placed_source(asked, block), {}, ()
    table, left_out = reconstruction.good_picks(scene)
    if entry.releases.trajectory:
        onward = table.trajectory == entry.releases.trajectory
        if entry.releases.time_s is not None:
            onward &= table.time_s >= entry.releases.time_s - SAME_TIME_S
        table = take(table, onward)
    measured = reconstruction.reconstruct_scene(scene, table, surface=surface)
    return lambda asked: measured_source(asked, block, measured), _origins(measured), left_out


def fingerprint(scene: bpy.types.Scene, models: Collection[str], number: int | None = None) -> str:
    """Of all that decides where blocks start, as what, and how they move.

    models, number : instead of those of the settings, where a number is given.
    """
    try:
        entry = entry_of(scene) if number is None else entry_with(scene, models, number)
        parts: list[object] = [replace(entry, trees=None), *simulated_trees.fingerprint(scene)]
    except RockfallError as error:
        parts = [str(error)]
    if scene.rockfall_simulation.source in FILMED or "observed" in models:
        parts += [sorted(fingerprints.remembered(scene).items()), scene.get(store.BLOCKS, "")]
    return repr(parts)


def drawn(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """The drawing that blocks start from, as long as it is in the scene."""
    obj = scene.rockfall_simulation.drawn
    return obj if obj is not None and obj.name in scene.objects else None


def selected_pick(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """The release or impact that blocks start from: the active object, else the one that was chosen last."""
    obj = bpy.context.view_layer.objects.active if bpy.context.view_layer is not None else None
    if _can_start(obj):
        return obj
    kept = scene.rockfall_simulation.pick
    return next((obj for obj in store.with_role(scene, store.PICK_ROLE) if obj.get(store.ID) == kept), None)


def _can_start(obj: bpy.types.Object | None) -> bool:
    is_pick = obj is not None and obj.get(store.ROLE) == store.PICK_ROLE and store.is_own(obj)
    return is_pick and obj.get(store.KIND) in ("release", "impact")


def _release_entry(scene: bpy.types.Scene) -> ReleaseEntry:
    settings = scene.rockfall_simulation
    if settings.source == "MEASURED":
        return ReleaseEntry(MEASURED, number=settings.number)
    if settings.source == "PICK":
        obj = selected_pick(scene)
        if obj is None:
            raise RockfallError(missing(scene))
        return ReleaseEntry(
            MEASURED, trajectory=obj[store.TRAJECTORY], time_s=float(obj[store.TIME]), number=settings.number
        )
    second = 0.0 if settings.diameter_law == "fixed" else store.double(settings.diameter_second_m)
    is_round = settings.shape in ("sphere", "cube")
    what = {
        "number": settings.number,
        "shape": settings.shape,
        "diameter": Distribution(settings.diameter_law, store.double(settings.diameter_m), second),
        "proportions": None if is_round else tuple(store.double(value) for value in settings.proportions),
        "density": Distribution("fixed", store.double(settings.density_kgpm3)),
    }
    if settings.source == "STEEP":
        return ReleaseEntry(STEEP, steeper_than_deg=store.double(settings.steeper_than_deg), **what)
    obj = drawn(scene)
    if obj is None:
        raise RockfallError(missing(scene))
    kind, points = drawn_releases.read(obj)
    survey = georeference.read_shift(scene).to_survey(points)
    return ReleaseEntry(kind, points_m=tuple(map(tuple, survey.tolist())), name=obj.name, **what)


def _drawing(scene: bpy.types.Scene, entry: ReleaseEntry) -> bpy.types.Object:
    """The object of a project's points, line or polygon; those without height are put on the terrain by the core."""
    given = np.array([[*point, np.nan][:3] for point in entry.points_m])
    local = georeference.read_shift(scene).to_local(given)
    return drawn_releases.make(scene, entry.source, list(local), entry.name)


def _pick_at(scene: bpy.types.Scene, entry: ReleaseEntry) -> str:
    """Id of the pick of a trajectory from which on a project releases blocks."""
    own = [obj for obj in store.with_role(scene, store.PICK_ROLE) if obj.get(store.TRAJECTORY) == entry.trajectory]
    own.sort(key=lambda obj: abs(float(obj[store.TIME]) - (entry.time_s or -np.inf)))
    return own[0][store.ID] if own else ""


def _origins(measured: Reconstruction) -> dict[str, Origin]:
    """When the blocks of each trajectory start."""
    return {name: Origin(name, time_s) for name, time_s in start_times(measured).items()}

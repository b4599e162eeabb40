# SPDX-License-Identifier: GPL-3.0-or-later
"""What of the scene is shown to others, on a page or as an animation: the measured blocks, and the simulated ones."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import bpy

from ....core.errors import RockfallError
from ....core.exchange.project import Site
from ....core.film.composed.ground import FROM_FOOTAGE, TerrainColours, coloured
from ....core.outreach.photographs import Filmed
from ....core.outreach.show import Show, show_of, with_photographs
from ....core.progress import Progress
from ....core.reconstruction.trajectory import Reconstruction
from ....core.remarks import Remark
from ....core.terrain.surface import Surface
from ....core.workflow.simulation import ground_of, run_models
from ..project import site_of
from ..simulation import simulation, simulation_setup
from ..simulation.simulation_setup import Plan
from ..terrain import terrain
from ..terrain import terrain_colours as colours_of_scene
from . import picks, reconstruction

STALE = "Settings have changed since the simulation: simulate again first, or export without simulated blocks."
MOST_BLOCKS = 3000
"""More simulated blocks than this hide each other, and make files that nobody can open."""


@dataclass(frozen=True, eq=False)
class Asked:
    """What a show is made of, without Blender.

    Attributes
    ----------
    plan : of the simulated blocks; None without any.
    counts : model → how many of its runs are shown.
    left_out : what of the measured trajectories is missing.
    filmed : videos whose colours the terrain has.
    """

    site: Site
    surface: Surface | None
    measured: Reconstruction
    plan: Plan | None
    counts: Mapping[str, int]
    together: bool
    left_out: tuple[Remark, ...]
    filmed: tuple[Filmed, ...] = ()


def missing(scene: bpy.types.Scene) -> str:
    """What is still needed, in a sentence; empty when all is there."""
    return "" if picks.objects_of(scene) else "There are no trajectories to show: import picks first, or load the demo"


def ask(scene: bpy.types.Scene, *, simulated: bool, together: bool, terrain_colours: TerrainColours = "auto") -> Asked:
    """What the scene says.

    Raises
    ------
    RockfallError : simulated blocks are wanted, and are too many or no longer what the settings say.
    """
    measured, left_out = reconstruction.reconstruct_good(scene)
    with_them = simulated and bool(simulation.blocks_of(scene))
    counts = simulation_setup.shown_counts(scene) if with_them else {}
    if with_them and simulation_setup.is_stale(scene):
        raise RockfallError(STALE)
    if sum(counts.values()) > MOST_BLOCKS:
        raise RockfallError(
            f"{sum(counts.values())} simulated blocks are too many to be shown to others: {MOST_BLOCKS} at most. "
            "Simulate fewer, or export without them."
        )
    site = site_of(scene)
    site = site if site.name else replace(site, name="Rockfall")
    surface = terrain.surface_of_scene(scene)
    surface = None if surface is None else coloured(surface, terrain_colours)
    filmed = colours_of_scene.filmed(scene) if terrain_colours in FROM_FOOTAGE and surface is not None else ()
    plan = simulation_setup.plan(scene) if with_them else None
    return Asked(site, surface, measured, plan, counts, together, left_out, filmed)


def show(asked: Asked, progress: Progress) -> Show:
    """The show; simulated blocks fall again as they did, which the same seed gives. Nothing of Blender is touched."""
    found, starts = [], {}
    if asked.plan is not None:
        progress("Preparing the ground", 0, 0)
        ground = ground_of(asked.plan.scenario)
        releases = asked.plan.scenario.releases(ground)
        for one in asked.plan.scenario.settings:
            if one.model in asked.counts:
                found += run_models(ground, releases.take(slice(0, asked.counts[one.model])), [one], progress=progress)
        starts = {name: origin.time_s for name, origin in asked.plan.origins.items()}
    progress("Placing the blocks", 0, 0)
    made = show_of(
        asked.site, asked.surface, asked.measured, found, starts_s=starts, together=asked.together,
        remarks=map(str, asked.left_out),
    )  # fmt: skip
    if asked.surface is None or not asked.filmed:
        return made
    return with_photographs(made, asked.surface, asked.filmed, progress=progress)

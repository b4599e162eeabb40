# SPDX-License-Identifier: GPL-3.0-or-later
"""The design sheet of the screens that are drawn: what barriers there must have, with what was measured on the site."""

from dataclasses import dataclass
from pathlib import Path

import bpy

from ...core.exchange.partial_factors import USUAL, open_factors, shipped_names
from ...core.exchange.screens import write_screens
from ...core.extras import FIGURES, is_there
from ...core.output import output_folder
from ...core.progress import Progress
from ...core.reconstruction.trajectory import Reconstruction
from ...core.workflow.design_page import write_design
from ...core.workflow.design_sheet import design_sheet
from ...core.workflow.enough import as_many_as
from ...core.workflow.simulation import ground_of
from . import picks, reconstruction, screens, simulation_setup, store, video_files, videos
from .simulation_setup import Plan

MOST_BLOCKS = 50_000
"""So many fall at most with each model, until the values at the screens are known."""


@dataclass(frozen=True, eq=False)
class Asked:
    """What a sheet is made of.

    Attributes
    ----------
    plan : what falls, and the screens.
    measured : trajectories of the site; None without any.
    factors : name of the table of partial factors.
    holdout : whether models predict trajectories that they were not fitted to.
    inputs : what it is → file, for the hashes.
    """

    plan: Plan
    title: str
    measured: Reconstruction | None
    factors: str
    holdout: bool
    inputs: dict[str, Path]


def factor_tables() -> list[tuple[str, str]]:
    """Name and title of the tables of partial factors, the usual one first."""
    names = sorted(shipped_names(), key=lambda name: (name != USUAL, name))
    return [(name, open_factors(name).title) for name in names]


def missing(scene: bpy.types.Scene) -> str:
    """What is still needed, in a sentence; empty when all is there."""
    if not screens.objects_of(scene):
        return "Draw a screen first, in step 7: a line across the slope, where the barrier is to stand."
    return simulation_setup.missing(scene)


def ask(scene: bpy.types.Scene, factors: str, holdout: bool) -> Asked:
    """What the scene says.

    Raises
    ------
    RockfallError : something is missing, or cannot be.
    """
    measured = reconstruction.reconstruct_good(scene)[0] if picks.objects_of(scene) else None
    title = str(scene.get(store.SITE, ""))
    return Asked(simulation_setup.plan(scene), title, measured, factors, holdout, _inputs(scene))


def write(asked: Asked, folder: Path, progress: Progress) -> list[str]:
    """Simulate, and write the sheet into a folder; returns the names of the files. Nothing of Blender is touched.

    Raises
    ------
    RockfallError : no block comes to any screen, or whatever the core refuses.
    """
    progress("Preparing the ground", 0, 0)
    scenario = asked.plan.scenario
    ground = ground_of(scenario)
    sheet = design_sheet(
        ground,
        as_many_as(scenario, ground, MOST_BLOCKS),
        scenario.settings,
        asked.plan.screens,
        open_factors(asked.factors),
        title=asked.title,
        measured=asked.measured,
        until_known=True,
        holdout=asked.holdout,
        progress=progress,
    )
    with output_folder(folder) as place:
        written = write_design(sheet, place, asked.inputs, drawn=is_there(FIGURES), progress=progress)
        tallies = {one.settings.model: one.tally for one in sheet.models}
        write_screens(tallies, place / "screens.csv", {one.settings.model: one.values for one in sheet.models})
    return [*written, "screens.csv"]


def _inputs(scene: bpy.types.Scene) -> dict[str, Path]:
    """Files of terrain and videos that are there, and the .blend."""
    said = {f"terrain {obj.name}": obj.get(store.TERRAIN_FILE) for obj in store.with_role(scene, store.TERRAIN_ROLE)}
    said |= {f"video {camera.name}": video_files.file_of(camera) for camera in videos.cameras(scene)}
    said["Blender file"] = bpy.data.filepath
    files = {name: Path(bpy.path.abspath(str(file))) for name, file in said.items() if file}
    return {name: file for name, file in files.items() if file.is_file()}

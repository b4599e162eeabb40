# SPDX-License-Identifier: GPL-3.0-or-later
"""What ``simulate`` is asked for: the scenario of a project or of options, and its runs, screens and tables."""

import argparse
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from ..errors import InputError
from .motion_options import motion_as_asked, stated_or_asked
from .options import (
    OF_PROJECT,
    known_names,
    measured_as_asked,
    model_parameters,
    models_as_asked,
    naming,
    reading_as_asked,
    refuse_terrain_options,
    terrain_as_asked,
)
from .progress import PrintedProgress
from .release_options import blocks_as_asked, blocks_said, releases_as_asked, sources_given, zones_as_asked

if TYPE_CHECKING:
    from ..hazard.screens import Screen
    from ..reconstruction.trajectory import Reconstruction
    from ..remarks import Remark
    from ..simulation.ground import Ground
    from ..simulation.parameter_draws import ParameterDraws
    from ..simulation.release import Releases
    from ..terrain.cloud import Cloud
    from ..terrain.surface import Surface
    from ..workflow.simulation import Scenario


class Asked(NamedTuple):
    """What is simulated, the tables beside runs.csv that a project names, the files that decide it, the cells of the
    maps, whether faces have maps, and what the project has measured, where that is to be written beside it."""

    scenario: "Scenario"
    record: tuple[str, ...] | None
    inputs: dict[str, Path]
    cell_m: float | None
    faces: bool
    measured: "Reconstruction | None" = None


@dataclass(frozen=True, eq=False)
class Work:
    """Everything that the runs need, and what is written of them.

    Attributes
    ----------
    releases, first_run : of the runs that were asked for, and the place of the first among all.
    record : tables beside runs.csv.
    cell_m, faces : maps; None and False for none.
    until_known : share of the blocks at a screen whose energy and height are to be known; None lets all blocks fall.
    measured : what the project has measured, where that is to be written beside it.
    inputs : what it is → the file that decides it.
    mesh_remarks : what a finer mesh changes, where that was asked for.
    """

    scenario: "Scenario"
    ground: "Ground"
    releases: "Releases"
    first_run: int
    screens: "tuple[Screen, ...]"
    record: tuple[str, ...]
    cell_m: float | None
    faces: bool
    until_known: float | None
    measured: "Reconstruction | None"
    inputs: Mapping[str, Path]
    mesh_remarks: "tuple[Remark, ...]" = ()


def work_as_asked(arguments: argparse.Namespace, progress: PrintedProgress) -> Work:
    """What the options, or a project, say.

    Raises
    ------
    InputError : anything that is wrong with the files or the options.
    """
    from ..exchange.saved_blend import is_project
    from ..exchange.simulation_entry import RECORDS
    from ..workflow.enough import in_chance_order
    from ..workflow.simulation import ground_of
    from ..workflow.simulation_output import default_records

    record = None if arguments.record is None else known_names(arguments.record, RECORDS, "--record")
    prepare = _project if is_project(arguments.releases or "") else _scenario
    asked = prepare(arguments, progress)
    ground = ground_of(asked.scenario)
    screens, screen_files = _screens(arguments.screen, ground, asked.scenario.screens)
    progress("Releasing the blocks")
    releases, first_run = _asked_runs(asked.scenario.releases(ground), arguments.runs)
    if arguments.until_known is not None:
        if not screens:
            raise InputError(
                "--until-known is known nowhere", advice="Give --screen: a line, or the closed outline of an area"
            )
        releases = in_chance_order(releases, asked.scenario.seed)
    if record is None:
        record = default_records(len(releases)) if asked.record is None else asked.record
    return Work(
        asked.scenario, ground, releases, first_run, screens, record, asked.cell_m, asked.faces,
        arguments.until_known, asked.measured, asked.inputs | screen_files,
    )  # fmt: skip


def _screens(
    files: list[str], ground: "Ground", stated: "tuple[Screen, ...]"
) -> "tuple[tuple[Screen, ...], dict[str, Path]]":
    """The screens that a project states and those of some files, and these files."""
    from ..exchange.screens import read_screens
    from ..hazard.screens import check_screens

    screens = (*stated, *(screen for file in files for screen in read_screens(file, ground.shift)))
    with naming(" and ".join(files)) if files else nullcontext():
        check_screens(screens, ground)
        for screen in screens:
            if screen.name in ground.structures:
                raise InputError(f"{screen.name!r} is a screen and a structure", advice="Give each a name of its own")
    return screens, {f"screens:{Path(file).name}": Path(file) for file in files}


def _scenario(arguments: argparse.Namespace, progress: PrintedProgress) -> Asked:
    """What the options say."""
    from ..exchange.project import terrain_inputs
    from ..terrain.readers import read_structure, read_tile_points
    from ..workflow.scenarios import make_scenario

    for option in ("terrain", "model"):
        if not getattr(arguments, option):
            raise InputError(f"--{option} is missing", advice="Only a project, project.toml, can do without it")
    models = models_as_asked(arguments.model)
    parameters = model_parameters(arguments, models)
    draws = _posteriors(arguments, models)
    measured = measured_as_asked(arguments, models, needed=True)
    files = _structures(arguments.structure)
    source, release_files = releases_as_asked(arguments)
    reading = reading_as_asked(arguments)
    if arguments.contact == "points":
        if arguments.max_edge is not None:
            raise InputError("--max-edge is of a mesh, and --contact points makes none", advice="Leave out one of them")
        terrain: Surface | Cloud = read_tile_points(arguments.terrain, reading, progress=progress)
    else:
        terrain = terrain_as_asked(arguments, arguments.terrain, progress)
    zones, zone_files = zones_as_asked(arguments, terrain, models)
    scenario, tree_files = make_scenario(
        *motion_as_asked(arguments, models),
        terrain,
        source,
        parameters,
        measured=measured,
        structures={name: read_structure(file, reading, progress=progress) for name, file in files.items()},
        zones=zones,
        draws=draws,
        progress=progress,
    )
    inputs = {
        **_posterior_inputs(arguments.posterior),
        **release_files,
        **zone_files,
        **tree_files,
        **terrain_inputs(arguments.terrain),
    }
    if measured is not None:
        inputs["observed"] = Path(arguments.observed)
    inputs |= {name: Path(file) for name, file in files.items()}
    return Asked(scenario, None, inputs, arguments.cell, arguments.faces)


def _project(arguments: argparse.Namespace, progress: PrintedProgress) -> Asked:
    """A project, in which options replace what its [simulation] says."""
    from ..exchange.project import read_project
    from ..terrain.surface import Surface
    from ..workflow.opening import reconstruct_project
    from ..workflow.scenarios import open_simulation

    own = ["--terrain", "--structure", "--gravity", "--zone-attribute", "--spin", "--evenly"]
    for option in (*own, *sources_given(arguments)[1:]):
        if getattr(arguments, option.strip("-").replace("-", "_")) not in (None, [], False):
            raise InputError(f"{option} is what a project says itself", advice="Write it into the project")
    refuse_terrain_options(arguments, *OF_PROJECT)
    file = Path(arguments.releases)
    project = read_project(file)
    entry = project.stated_simulation
    releases = entry.releases if arguments.number is None else replace(entry.releases, number=arguments.number)
    if blocks_said(arguments):
        blocks = blocks_as_asked(arguments)
        if blocks.measured is not None:
            raise InputError("A project takes no table of measured sizes", advice="Give a number, a range or a law")
        said = {
            name: getattr(blocks, name)
            for name in ("shape", "diameter", "proportions", "density")
            if getattr(arguments, name) is not None
        }
        if len(set(blocks.proportions)) > 1:
            said |= {"proportions": blocks.proportions, "shape": blocks.shape}
        releases = replace(releases, **said)
    entry = replace(
        stated_or_asked(arguments, entry),
        models=models_as_asked(arguments.model, entry.models),
        releases=releases,
        contact=arguments.contact or entry.contact,
        observed=entry.observed if arguments.observed is None else Path(arguments.observed),
    )
    scenario, inputs = open_simulation(replace(project, simulation=entry), file, progress)
    known = model_parameters(arguments, list(scenario.models), scenario.models)
    models = {name: known.get(name, {}) for name in scenario.models}
    zones, zone_files = zones_as_asked(arguments, scenario.terrain, list(models))
    scenario = replace(scenario, models=models, zones=scenario.zones if zones is None else zones)
    if arguments.posterior:
        scenario = replace(scenario, draws=_posteriors(arguments, list(models)))
        inputs = {name: file for name, file in inputs.items() if name != "posterior"}
    inputs = inputs | zone_files | _posterior_inputs(arguments.posterior)
    measured = None
    if arguments.geopackage and project.picks is not None:
        measured = reconstruct_project(project, scenario.terrain if isinstance(scenario.terrain, Surface) else None)
    faces = arguments.faces or entry.faces
    return Asked(scenario, entry.record, inputs, arguments.cell or entry.cell_m, faces, measured)


def _posteriors(arguments: argparse.Namespace, models: Sequence[str]) -> "dict[str, ParameterDraws]":
    """What ``--posterior`` says, by model; not together with options that set the same."""
    from ..exchange.posterior_tables import posteriors_of

    found = posteriors_of([Path(file) for file in arguments.posterior], models)
    for model, draws in found.items():
        for name in draws.names:
            typed = any(text.partition("=")[0].strip() == f"{model}.{name}" for text in arguments.set)
            if typed or (name == "friction" and arguments.friction is not None):
                raise InputError(f"{name} is both drawn from --posterior and set", advice="Leave out one of the two")
    return found


def _posterior_inputs(files: Sequence[str]) -> dict[str, Path]:
    """The files of ``--posterior`` by what they are."""
    several = len(files) > 1
    return {f"posterior {i}" if several else "posterior": Path(file) for i, file in enumerate(files, 1)}


def _asked_runs(releases: "Releases", runs: tuple[int, int] | None) -> tuple["Releases", int]:
    """The releases of the runs that were asked for, and the place of the first."""
    if runs is None:
        return releases, 0
    first, last = runs
    if last > len(releases):
        raise InputError(f"--runs asks for run {last} of {len(releases)}", advice="Choose among these")
    return releases.take(slice(first - 1, last)), first - 1


def _structures(texts: list[str]) -> dict[str, str]:
    """NAME=FILE texts as name → file."""
    found: dict[str, str] = {}
    for text in texts:
        name, equals, file = text.partition("=")
        if not (equals and name.strip() and file):
            raise InputError(f"--structure {text} names no file", advice="Write NAME=FILE, for example wall=wall.ply")
        if name.strip() in found:
            raise InputError(f"--structure {name} is given twice", advice="Give each structure a name of its own")
        found[name.strip()] = file
    return found

# SPDX-License-Identifier: GPL-3.0-or-later
"""What ``compare-runs`` and ``back-analyse`` share: observed runs, sections, and what is simulated beside them."""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from ..constants import GRAVITY_MPS2, ROCK_DENSITY_KGPM3
from ..errors import InputError
from .options import (
    add_figure_options,
    add_motion_options,
    add_out,
    add_parameter_options,
    add_terrain_files,
    add_terrain_options,
    model_parameters,
    models_as_asked,
    positive,
    terrain_as_asked,
    whole,
)
from .progress import PrintedProgress
from .release_options import add_zone_options, zones_as_asked
from .tree_options import add_tree_options, trees_said

if TYPE_CHECKING:
    from ..analysis.observed_runs import Observed
    from ..analysis.sections import Section
    from ..reconstruction.choices import FlightEnds
    from ..reconstruction.trajectory import Reconstruction
    from ..simulation.ground import Ground
    from ..simulation.release import Releases
    from ..workflow.simulation import Scenario

DIAMETER_M = 0.35


def add_observed_arguments(parser: argparse.ArgumentParser) -> None:
    """The observed runs, and how blocks that start as they did are simulated."""
    parser.add_argument(
        "table", metavar="OBSERVED", help="project.toml or picks.csv; with --stops the releases.csv of the blocks"
    )
    add_out(parser)
    parser.add_argument(
        "--stops", metavar="FILE", help="where blocks stopped, without footage: release, x_m, y_m (z_m)"
    )
    add_terrain_files(parser, "mesh, grid or cloud; a project names its own")
    add_parameter_options(parser)
    parser.add_argument(
        "--seed", type=whole, metavar="S", help="of the random numbers (default: the project's, else 0)"
    )
    section = parser.add_argument_group("sections (default: three contour levels, or three drops below the starts)")
    section.add_argument("--contours", metavar="Z,Z", help="heights in survey coordinates, below which blocks fall [m]")
    section.add_argument("--drops", metavar="H,H", help="heights below each block's own start [m]")
    section.add_argument(
        "--section", action="append", default=[], metavar="NAME=FILE", help="a line in plan, a table of x_m, y_m"
    )
    motion = parser.add_argument_group("motion (default: as the project says)")
    add_motion_options(motion)
    motion.add_argument(
        "--gravity", type=positive, metavar="G", help=f"[m/s²] (default {GRAVITY_MPS2:g}); not for a project"
    )
    block = parser.add_argument_group("blocks of which the table does not say; not for a project")
    block.add_argument("--diameter", type=positive, metavar="M", help=f"[m] (default {DIAMETER_M:g})")
    block.add_argument("--density", type=positive, metavar="RHO", help=f"[kg/m³] (default {ROCK_DENSITY_KGPM3:g})")
    add_zone_options(parser)
    add_tree_options(parser)
    add_figure_options(parser)
    parser.add_argument("--threads", type=whole, metavar="N", help="default: all cores; the result is the same")
    add_terrain_options(parser)


class ObservedCase(NamedTuple):
    """What is observed, what is simulated, and the files that decide it."""

    scenario: "Scenario"
    ground: "Ground"
    observed: "Observed"
    releases: "Releases"
    inputs: dict[str, Path]


def case_as_asked(
    arguments: argparse.Namespace,
    models: Sequence[str],
    number: int,
    progress: PrintedProgress,
    flights: "FlightEnds | None" = None,
) -> ObservedCase:
    """What the options say.

    Parameters
    ----------
    models : those that were asked for; none takes those of the project, or that are compared by default.
    number : blocks for each observed run.
    flights : what the observed flights join; None for what the project says, or contacts.

    Raises
    ------
    InputError : anything that is wrong with the files or the options.
    """
    project = arguments.table.lower().endswith(".toml")
    return (_of_project if project else _of_table)(arguments, models, number, progress, flights)


def _of_project(
    arguments: argparse.Namespace,
    names: Sequence[str],
    number: int,
    progress: PrintedProgress,
    flights: "FlightEnds | None",
) -> ObservedCase:
    """The measured runs of a project; options replace what its [simulation] says."""
    from ..exchange.opening import reconstruct_project
    from ..exchange.project import read_project
    from ..exchange.simulation_entry import ReleaseEntry
    from ..exchange.simulation_project import open_simulation
    from ..workflow.simulation import ground_of

    for option in ("--terrain", "--stops", "--gravity", "--diameter", "--density", "--zone-attribute"):
        if getattr(arguments, option.strip("-").replace("-", "_")) not in (None, []):
            raise InputError(f"{option} is what a project says itself", advice="Write it into the project")
    file = Path(arguments.table)
    project = read_project(file)
    entry = project.stated_simulation
    entry = replace(
        entry,
        models=models_as_asked(names, entry.models),
        releases=ReleaseEntry(),
        rolling=arguments.rolling or entry.rolling,
        friction=entry.friction if arguments.friction is None else arguments.friction,
        drag=arguments.drag or entry.drag,
        seed=entry.seed if arguments.seed is None else arguments.seed,
        trees=trees_said(arguments, entry.trees),
    )
    scenario, inputs = open_simulation(replace(project, simulation=entry), file, progress)
    known = model_parameters(arguments, list(scenario.models), scenario.models)
    models = {name: known.get(name, {}) for name in scenario.models}
    zones, zone_files = zones_as_asked(arguments, scenario.terrain, list(models))
    scenario = replace(scenario, models=models, zones=scenario.zones if zones is None else zones)
    inputs = inputs | zone_files
    ground = ground_of(scenario)
    progress("Reconstructing")
    if flights is not None:
        project = replace(project, reconstruction=replace(project.reconstruction, flights=flights))
    return _measured(number, scenario, ground, reconstruct_project(project, ground.surface), inputs)


def _of_table(
    arguments: argparse.Namespace,
    names: Sequence[str],
    number: int,
    progress: PrintedProgress,
    flights: "FlightEnds | None",
) -> ObservedCase:
    """The runs of a table of picks, or of releases and stops."""
    from ..analysis.measured_rebounds import measured_rebounds
    from ..exchange.project import terrain_inputs
    from ..exchange.simulation_tables import read_releases
    from ..exchange.tables import read_picks
    from ..exchange.trees import open_trees
    from ..exchange.whole_run_tables import stopped_runs
    from ..impact_models.registry import COMPARED, find_model
    from ..reconstruction.block import Block
    from ..reconstruction.drag import Drag
    from ..reconstruction.trajectory import reconstruct
    from ..simulation.blocks import block_of
    from ..simulation.measured_releases import from_reconstruction
    from ..workflow.simulation import Scenario, ground_of

    if not arguments.terrain:
        raise InputError("--terrain is missing", advice="Only a project, project.toml, can do without it")
    models = [find_model(name) for name in models_as_asked(names, COMPARED)]
    parameters = model_parameters(arguments, [model.name for model in models])
    given = {name: getattr(arguments, name) for name in ("rolling", "friction") if getattr(arguments, name) is not None}
    gravity = GRAVITY_MPS2 if arguments.gravity is None else arguments.gravity
    diameter = DIAMETER_M if arguments.diameter is None else arguments.diameter
    density = ROCK_DENSITY_KGPM3 if arguments.density is None else arguments.density
    surface = terrain_as_asked(arguments, arguments.terrain, progress)
    zones, zone_files = zones_as_asked(arguments, surface, [model.name for model in models])
    entry = trees_said(arguments)
    trees, tree_files = (None, {}) if entry is None else open_trees(entry, surface, arguments.seed or 0)
    progress(f"Reading {arguments.table}")
    scenario = Scenario(
        surface,
        partial(
            read_releases,
            arguments.table,
            blocks=block_of("sphere", diameter, diameter, diameter, density),
            number=number,
        ),
        {model.name: parameters.get(model.name, {}) for model in models},
        zones=zones,
        trees=trees,
        drag=Drag() if arguments.drag else None,
        gravity_mps2=gravity,
        seed=arguments.seed or 0,
        **given,
    )
    inputs = {"observed": Path(arguments.table), **terrain_inputs(arguments.terrain), **zone_files, **tree_files}
    drawing = [model.name for model in models if model.draws_from_impacts]
    ground = ground_of(scenario)
    if arguments.stops:
        if drawing:
            raise InputError(
                f"The model {drawing[0]} draws from measured impacts, and stops have none", advice="Give picks.csv"
            )
        runs = stopped_runs(ground, scenario.releases, arguments.stops)
        return ObservedCase(scenario, ground, runs.observed, runs.releases, inputs | {"stops": Path(arguments.stops)})
    picks = read_picks(arguments.table, surface.shift)
    block = Block(diameter, diameter, diameter, density)
    ends = flights or "contacts"
    made = reconstruct(picks, surface=surface, block=block, gravity_mps2=gravity, drag=scenario.drag, flights=ends)
    scenario = replace(
        scenario,
        releases=partial(from_reconstruction, reconstruction=made, number=number),
        measured=measured_rebounds(made.impacts) if drawing else None,
    )
    return _measured(number, scenario, ground, made, inputs)


def _measured(
    number: int,
    scenario: "Scenario",
    ground: "Ground",
    made: "Reconstruction",
    inputs: dict[str, Path],
) -> ObservedCase:
    """Runs that were reconstructed from picks."""
    from ..workflow.whole_runs import measured_runs

    runs = measured_runs(ground, made, number)
    return ObservedCase(scenario, ground, runs.observed, runs.releases, inputs)


def sections_as_asked(arguments: argparse.Namespace, ground: "Ground") -> "tuple[Section, ...]":
    """Those that were asked for."""
    from ..analysis.sections import Section
    from ..exchange.whole_run_tables import read_section

    low, high = ground.shift.to_survey(ground.terrain.bounds)[:, 2].tolist()
    sections = []
    for z in _numbers(arguments.contours, "--contours"):
        if not low <= z <= high:
            raise InputError(
                f"--contours has {z:g}, where there is no terrain", advice=f"It reaches from {low:.0f} to {high:.0f} m"
            )
        sections.append(Section(f"{z:g} m", level_m=z - ground.shift.z))
    for height in _numbers(arguments.drops, "--drops"):
        if height <= 0:
            raise InputError(f"--drops has {height:g}", advice="Give heights above zero: so far below the start")
        sections.append(Section(f"{height:g} m below the start", drop_m=height))
    for text in arguments.section:
        name, equals, file = text.partition("=")
        if not (equals and name.strip() and file):
            raise InputError(f"--section {text} names no file", advice="Write NAME=FILE, for example road=road.csv")
        sections.append(read_section(file, name.strip(), ground))
    names = [section.name for section in sections]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"The section {name} is given twice", advice="Give each section once, with its own name")
    return tuple(sections)


def _numbers(text: str | None, option: str) -> list[float]:
    values = []
    for part in (text or "").split(","):
        if part.strip():
            try:
                values.append(float(part))
            except ValueError:
                raise InputError(f"{option} has '{part}'", advice="Give numbers between commas") from None
    return values

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
from .motion_options import motion_as_asked, stated_or_asked
from .options import (
    OF_PROJECT,
    add_figure_options,
    add_motion_options,
    add_out,
    add_parameter_options,
    add_terrain_files,
    add_terrain_options,
    model_parameters,
    models_as_asked,
    naming,
    positive,
    refuse_terrain_options,
    seed,
    terrain_as_asked,
    whole,
)
from .progress import PrintedProgress
from .release_options import add_zone_options, zones_as_asked
from .tree_options import add_tree_options

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..analysis.completeness import Completeness
    from ..analysis.observed_runs import Observed
    from ..analysis.sections import Section
    from ..reconstruction.choices import FlightEnds
    from ..reconstruction.picks import Picks
    from ..reconstruction.trajectory import Reconstruction
    from ..simulation.ground import Ground
    from ..simulation.release import Releases
    from ..workflow.simulation import ReleaseSource, Scenario

DIAMETER_M = 0.35


def add_observed_arguments(parser: argparse.ArgumentParser) -> None:
    """The observed runs, and how blocks that start as they did are simulated."""
    parser.add_argument(
        "table",
        metavar="OBSERVED",
        help="a project (.toml, .blend) or picks.csv; with --stops the releases.csv of the blocks",
    )
    add_out(parser)
    parser.add_argument(
        "--stops", metavar="FILE", help="where blocks stopped, without footage: release, x_m, y_m (z_m)"
    )
    parser.add_argument(
        "--completeness",
        metavar="HOW",
        help="whether the observed runs are all that fell: complete; longest:N, those that came farthest of N falls "
        "(longest: of all given releases); or unknown (default: the project's, else not stated)",
    )
    more = parser.add_argument_group("further observed runs, on the same terrain; each can be given again")
    more.add_argument(
        "--more-picks", action="append", default=[], metavar="FILE",
        help="trajectories of another picks.csv, reconstructed as those of OBSERVED",
    )  # fmt: skip
    more.add_argument(
        "--more-stops", action="append", default=[], nargs=2, metavar=("RELEASES", "STOPS"),
        help="blocks without footage: their releases.csv, and where they stopped",
    )  # fmt: skip
    add_terrain_files(parser, "mesh, grid or cloud; a project names its own")
    add_parameter_options(parser)
    parser.add_argument("--seed", type=seed, metavar="S", help="of the random numbers (default: the project's, else 0)")
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
    completeness: "Completeness"


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
    from ..analysis.completeness import parse_completeness
    from ..exchange.saved_blend import is_project

    parse_completeness(arguments.completeness or "")  # before anything is read
    return (_of_project if is_project(arguments.table) else _of_table)(arguments, models, number, progress, flights)


def _of_project(
    arguments: argparse.Namespace,
    names: Sequence[str],
    number: int,
    progress: PrintedProgress,
    flights: "FlightEnds | None",
) -> ObservedCase:
    """The measured runs of a project; options replace what it says."""
    from ..analysis.completeness import parse_completeness
    from ..exchange.project import read_project
    from ..exchange.simulation_entry import TABLE, ReleaseEntry
    from ..workflow.opening import reconstruct_project
    from ..workflow.scenarios import open_simulation, placed_source
    from ..workflow.simulation import ground_of
    from ..workflow.whole_runs import measured_runs

    for option in ("--terrain", "--stops", "--gravity", "--diameter", "--density", "--zone-attribute"):
        if getattr(arguments, option.strip("-").replace("-", "_")) not in (None, []):
            raise InputError(f"{option} is what a project says itself", advice="Write it into the project")
    refuse_terrain_options(arguments, *OF_PROJECT)
    file = Path(arguments.table)
    project = read_project(file)
    entry = project.stated_simulation
    entry = replace(
        stated_or_asked(arguments, entry), models=models_as_asked(names, entry.models), releases=ReleaseEntry()
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
    measured = measured_runs(ground, reconstruct_project(project, ground.surface), number)
    stated = project.completeness if arguments.completeness is None else parse_completeness(arguments.completeness)
    case = ObservedCase(scenario, ground, measured.observed, measured.releases, inputs, stated)

    def placed(file: str) -> "ReleaseSource":
        table = replace(entry, releases=ReleaseEntry(TABLE, number=number, file=Path(file)))
        return placed_source(table, project.block)

    return _with_more(arguments, case, number, partial(reconstruct_project, project, ground.surface), placed, progress)


def _of_table(
    arguments: argparse.Namespace,
    names: Sequence[str],
    number: int,
    progress: PrintedProgress,
    flights: "FlightEnds | None",
) -> ObservedCase:
    """The runs of a table of picks, or of releases and stops."""
    from ..analysis.completeness import parse_completeness
    from ..analysis.measured_rebounds import measured_rebounds
    from ..exchange.project import terrain_inputs
    from ..exchange.simulation_tables import read_releases
    from ..exchange.tables import read_picks
    from ..impact_models.registry import COMPARED, find_model
    from ..reconstruction.block import Block
    from ..reconstruction.trajectory import reconstruct
    from ..simulation.blocks import block_of
    from ..simulation.measured_releases import from_reconstruction
    from ..workflow.scenarios import make_scenario
    from ..workflow.simulation import ground_of
    from ..workflow.whole_runs import measured_runs, stopped_runs

    if not arguments.terrain:
        raise InputError("--terrain is missing", advice="Only a project, project.toml, can do without it")
    models = models_as_asked(names, COMPARED)
    parameters = model_parameters(arguments, models)
    diameter = DIAMETER_M if arguments.diameter is None else arguments.diameter
    density = ROCK_DENSITY_KGPM3 if arguments.density is None else arguments.density
    surface = terrain_as_asked(arguments, arguments.terrain, progress)
    zones, zone_files = zones_as_asked(arguments, surface, models)
    progress(f"Reading {arguments.table}")
    blocks = block_of("sphere", diameter, diameter, diameter, density)

    def placed(file: str) -> "ReleaseSource":
        return partial(read_releases, file, blocks=blocks, number=number)

    motion = motion_as_asked(arguments, models)
    scenario, tree_files = make_scenario(
        *motion, surface, placed(arguments.table), parameters, zones=zones, progress=progress
    )
    inputs = {"observed": Path(arguments.table), **terrain_inputs(arguments.terrain), **zone_files, **tree_files}
    drawing = [name for name in models if find_model(name).draws_from_impacts]
    ground, stated = ground_of(scenario), parse_completeness(arguments.completeness or "")
    made_of = partial(
        reconstruct,
        surface=surface,
        block=Block(diameter, diameter, diameter, density),
        gravity_mps2=scenario.gravity_mps2,
        drag=scenario.drag,
        flights=flights or "contacts",
    )
    if arguments.stops:
        _refuse_drawing(drawing)
        runs = stopped_runs(ground, scenario.releases, arguments.stops)
        inputs["stops"] = Path(arguments.stops)
        case = ObservedCase(scenario, ground, runs.observed, runs.releases, inputs, stated)
        return _with_more(arguments, case, number, made_of, placed, progress)
    made = made_of(read_picks(arguments.table, surface.shift))
    scenario = replace(
        scenario,
        releases=partial(from_reconstruction, reconstruction=made, number=number),
        measured=measured_rebounds(made.impacts) if drawing else None,
    )
    runs = measured_runs(ground, made, number)
    case = ObservedCase(scenario, ground, runs.observed, runs.releases, inputs, stated)
    return _with_more(arguments, case, number, made_of, placed, progress)


def _refuse_drawing(models: Sequence[str]) -> None:
    """Models that draw from measured impacts have none of runs known by their stops."""
    for name in models:
        raise InputError(f"The model {name} draws from measured impacts, and stops have none", advice="Give picks.csv")


def _with_more(
    arguments: argparse.Namespace,
    case: ObservedCase,
    number: int,
    reconstruct: "Callable[[Picks], Reconstruction]",
    placed: "Callable[[str], ReleaseSource]",
    progress: PrintedProgress,
) -> ObservedCase:
    """The same with the runs of further tables.

    Parameters
    ----------
    reconstruct : picks as those of the first table.
    placed : the blocks of a table of releases.
    """
    from ..exchange.tables import read_picks
    from ..impact_models.registry import find_model
    from ..workflow.whole_runs import ObservedRuns, join_runs, measured_runs, stopped_runs

    if arguments.more_stops:
        _refuse_drawing([name for name in case.scenario.models if find_model(name).draws_from_impacts])
    parts, inputs = [ObservedRuns(case.observed, case.releases)], dict(case.inputs)
    for i, file in enumerate(arguments.more_picks, start=1):
        progress(f"Reading {file}")
        with naming(file):
            made = reconstruct(read_picks(file, case.ground.surface.shift))
        parts.append(measured_runs(case.ground, made, number))
        inputs[f"more_picks_{i}"] = Path(file)
    for i, (releases, stops) in enumerate(arguments.more_stops, start=1):
        progress(f"Reading {stops}")
        parts.append(stopped_runs(case.ground, placed(releases), stops))
        inputs |= {f"more_releases_{i}": Path(releases), f"more_stops_{i}": Path(stops)}
    runs = join_runs(parts)
    return case._replace(observed=runs.observed, releases=runs.releases, inputs=inputs)


def sections_as_asked(arguments: argparse.Namespace, ground: "Ground") -> "tuple[Section, ...]":
    """Those that were asked for."""
    from ..exchange.whole_run_tables import read_section
    from ..workflow.whole_runs import stated_sections

    lines = []
    for text in arguments.section:
        name, equals, file = text.partition("=")
        if not (equals and name.strip() and file):
            raise InputError(f"--section {text} names no file", advice="Write NAME=FILE, for example road=road.csv")
        lines.append(read_section(file, name.strip(), ground))
    return stated_sections(ground, arguments.contours or "", arguments.drops or "", lines)

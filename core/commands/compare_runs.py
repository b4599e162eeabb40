# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall compare-runs``: whole runs of observed blocks beside simulated ones → tables and figures."""

import argparse
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ..constants import GRAVITY_MPS2, ROCK_DENSITY_KGPM3
from ..errors import InputError
from .options import (
    add_out,
    add_parameter_options,
    add_terrain_options,
    model_parameters,
    not_negative,
    positive,
    terrain_as_asked,
    whole,
)
from .progress import PrintedProgress, stopped_by_interrupt

if TYPE_CHECKING:
    from ..analysis.observed_runs import Observed
    from ..analysis.sections import Section
    from ..analysis.whole_runs import WholeRuns
    from ..exchange.project import Project
    from ..exchange.simulation_entry import StructureEntry
    from ..impact_models.machinery.parameters import Value
    from ..progress import Progress
    from ..reconstruction.drag import Drag
    from ..reconstruction.trajectory import Reconstruction
    from ..simulation.ground import Ground
    from ..simulation.release import Releases

NUMBER = 100


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "observed", metavar="OBSERVED", help="project.toml or picks.csv; with --stops the releases.csv of the blocks"
    )
    add_out(parser)
    parser.add_argument(
        "--stops", metavar="FILE", help="where blocks stopped, without footage: release, x_m, y_m (z_m)"
    )
    parser.add_argument("--terrain", metavar="FILE", help="mesh, grid or cloud; a project names its own")
    parser.add_argument(
        "--model",
        action="extend",
        nargs="+",
        metavar="NAME",
        help="models to simulate with (default: the project's, else the six of Noël et al. 2018)",
    )
    add_parameter_options(parser)
    parser.add_argument(
        "--number",
        type=whole,
        default=NUMBER,
        metavar="N",
        help="blocks for each observed one and model (default %(default)s)",
    )
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
    motion.add_argument("--drag", action="store_true", help="flights with the drag of air; not for a project")
    motion.add_argument(
        "--rolling",
        choices=("azzoni_1995", "coulomb", "none"),
        help="on the ground: rolling (default), sliding, a stop",
    )
    motion.add_argument("--friction", type=not_negative, metavar="MU", help="of either (default 0.5)")
    motion.add_argument(
        "--gravity", type=positive, default=GRAVITY_MPS2, metavar="G", help="[m/s²], not for a project (default 9.81)"
    )
    block = parser.add_argument_group("blocks of which the table does not say; not for a project")
    block.add_argument("--diameter", type=positive, default=0.35, metavar="M", help="[m] (default %(default)s)")
    block.add_argument(
        "--density", type=positive, default=ROCK_DENSITY_KGPM3, metavar="RHO", help="[kg/m³] (default %(default)s)"
    )
    parser.add_argument("--tables-only", action="store_true", help="no figures")
    parser.add_argument("--threads", type=whole, metavar="N", help="default: all cores; the result is the same")
    add_terrain_options(parser)


@dataclass(frozen=True, eq=False)
class _Case:
    """What is compared with what."""

    ground: "Ground"
    observed: "Observed"
    releases: "Releases"
    drag: "Drag | None"
    gravity_mps2: float
    inputs: dict[str, Path]


def run(arguments: argparse.Namespace) -> int:
    """Simulate, compare, write the tables, print the summary."""
    from ..analysis.whole_runs import whole_run_remarks
    from ..exchange.output import output_folder
    from ..exchange.project import read_project
    from ..exchange.simulation_tables import summary, write_runs, write_summary
    from ..exchange.whole_run_tables import write_whole_runs, write_whole_values
    from ..impact_models.registry import COMPARED, find_model
    from ..simulation.engine import FRICTION, Settings
    from ..workflow.whole_runs import compare_whole_runs

    project = read_project(arguments.observed) if Path(arguments.observed).suffix.lower() == ".toml" else None
    stated = project.simulation if project else None
    models = [find_model(name).name for name in arguments.model or (stated.models if stated else ()) or COMPARED]
    parameters = model_parameters(arguments, models, _known(project, arguments.observed))
    seed = arguments.seed if arguments.seed is not None else stated.seed if stated else 0
    friction = arguments.friction if arguments.friction is not None else stated.friction if stated else FRICTION
    with output_folder(arguments.out) as folder, PrintedProgress() as progress:
        case = _case(arguments, project, progress)
        settings = [
            Settings(
                name,
                parameters.get(name, {}),
                rolling=arguments.rolling or (stated.rolling if stated else "azzoni_1995"),
                friction=friction,
                gravity_mps2=case.gravity_mps2,
                drag=case.drag,
                seed=seed,
            )
            for name in dict.fromkeys(models)
        ]
        with stopped_by_interrupt(progress) as counted:
            done = compare_whole_runs(
                case.ground,
                case.observed,
                case.releases,
                settings,
                _sections(arguments, case.ground),
                seed=seed,
                threads=arguments.threads,
                progress=counted,
            )
        remarks = (*done.remarks, *whole_run_remarks(done.comparison))
        progress("Writing the tables")
        write_whole_runs(done.comparison, folder / "whole_runs.csv")
        write_whole_values(done.comparison, folder / "whole_values.csv")
        write_runs(done.simulations, folder / "runs.csv")
        write_summary(summary(done.simulations, case.inputs, remarks), folder / "summary.json")
        notes = [] if arguments.tables_only else _draw(done.comparison, case.ground, folder, progress)
        names = ("whole_runs.csv", "whole_values.csv", "runs.csv", "summary.json", "figures")
        written = [name for name in names if (folder / name).exists()]
    for line in (*remarks, *notes):
        print(line)
    print(f"Written: {', '.join(written)} in {arguments.out}")
    return 0


def _case(arguments: argparse.Namespace, project: "Project | None", progress: "Progress") -> _Case:
    """The observed runs, and the releases of the simulated ones."""
    from ..exchange.opening import open_project
    from ..exchange.simulation_tables import read_releases
    from ..exchange.tables import read_picks
    from ..exchange.whole_run_tables import read_stops
    from ..reconstruction.block import Block
    from ..reconstruction.drag import Drag
    from ..reconstruction.trajectory import reconstruct
    from ..simulation.blocks import Blocks
    from ..simulation.distributions import Distribution
    from ..simulation.ground import make_ground

    inputs = {"observed": Path(arguments.observed)}
    if project is not None:
        for option, given in (
            ("--terrain", arguments.terrain),
            ("--stops", arguments.stops),
            ("--drag", arguments.drag),
        ):
            if given:
                raise InputError(
                    f"{option} is given with a project", advice="Leave it out: the project says so; or give picks.csv"
                )
        progress("Reading the project", 0, 0)
        surface, made = open_project(project)
        if surface is None or project.terrain is None:
            raise InputError("The project has no terrain", file=arguments.observed, advice="Add [terrain] to it")
        inputs["terrain"] = project.terrain.file
        structures = {one.name: terrain_as_asked(arguments, str(one.file), progress) for one in _structures(project)}
        ground = make_ground(surface, structures)
        return _measured(arguments, ground, made, inputs, progress)
    if not arguments.terrain:
        raise InputError("No terrain is given", advice="Give it with --terrain, or a project.toml that names one")
    surface = terrain_as_asked(arguments, arguments.terrain, progress)
    inputs["terrain"] = Path(arguments.terrain)
    ground = make_ground(surface)
    drag = Drag() if arguments.drag else None
    progress(f"Reading {arguments.observed}", 0, 0)
    if arguments.stops:
        inputs["stops"] = Path(arguments.stops)
        blocks = Blocks(
            "sphere", Distribution("fixed", arguments.diameter), density=Distribution("fixed", arguments.density)
        )
        releases = read_releases(arguments.observed, ground, blocks, number=arguments.number)
        observed = read_stops(arguments.stops, releases, ground)
        return _Case(ground, observed, releases, drag, arguments.gravity, inputs)
    picks = read_picks(arguments.observed, surface.shift)
    block = Block(arguments.diameter, arguments.diameter, arguments.diameter, arguments.density)
    made = reconstruct(picks, surface=surface, block=block, gravity_mps2=arguments.gravity, drag=drag)
    return _measured(arguments, ground, made, inputs, progress)


def _measured(
    arguments: argparse.Namespace,
    ground: "Ground",
    made: "Reconstruction",
    inputs: dict[str, Path],
    progress: "Progress",
) -> _Case:
    """Runs that were reconstructed from picks."""
    from ..analysis.observed_runs import observe_runs
    from ..workflow.whole_runs import released_as_observed

    progress("Errors of what was observed", 0, 0)
    observed = observe_runs(made, ground)
    releases = released_as_observed(ground, observed, made, arguments.number)
    return _Case(ground, observed, releases, made.drag, made.gravity_mps2, inputs)


def _structures(project: "Project") -> "tuple[StructureEntry, ...]":
    return project.simulation.structures if project.simulation else ()


def _known(project: "Project | None", file: str) -> "Mapping[str, Mapping[str, Value]] | None":
    """The parameters of models that the project has."""
    from ..exchange.parameters import checked_parameters

    if project is None or "models" not in project.extra:
        return None
    return checked_parameters(project.extra["models"], file)


def _sections(arguments: argparse.Namespace, ground: "Ground") -> "tuple[Section, ...]":
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
        sections.append(read_section(name.strip(), file, ground))
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


def _draw(comparison: "WholeRuns", ground: "Ground", folder: Path, progress: "Progress") -> list[str]:
    """The figures, if their library is there; else what to install."""
    from ..analysis.extras import FIGURES, install_command, is_there
    from ..analysis.whole_run_figures import save_whole_run_figures

    if not is_there(FIGURES):
        return [f"No figures without Matplotlib. Install it: {install_command(FIGURES)}"]
    progress("Drawing the figures", 0, 0)
    save_whole_run_figures(comparison, ground, folder / "figures")
    return []

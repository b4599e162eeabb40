# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall simulate``: blocks that fall down the terrain → tables of runs, impacts, motion, hits; maps."""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from ..constants import GRAVITY_MPS2
from ..errors import InputError
from .options import (
    add_model_option,
    add_motion_options,
    add_observed_option,
    add_out,
    add_parameter_options,
    add_terrain_files,
    add_terrain_options,
    known_names,
    measured_as_asked,
    model_parameters,
    models_as_asked,
    positive,
    reading_as_asked,
    share,
    terrain_as_asked,
    whole,
    whole_range,
)
from .progress import PrintedProgress, stopped_by_interrupt
from .release_options import (
    add_release_options,
    blocks_as_asked,
    blocks_said,
    releases_as_asked,
    sources_given,
    zones_as_asked,
)
from .tree_options import add_tree_options, trees_said
from .worker_options import add_worker_options, forget_chunks, several_workers, simulate_on_workers

if TYPE_CHECKING:
    from ..exchange.chunk_store import ChunkStore
    from ..hazard.screens import Screen
    from ..reconstruction.trajectory import Reconstruction
    from ..simulation.ground import Ground
    from ..simulation.parameter_draws import ParameterDraws
    from ..simulation.release import Releases
    from ..terrain.cloud import Cloud
    from ..terrain.surface import Surface
    from ..workflow.simulation import Scenario


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "releases",
        metavar="RELEASES",
        nargs="?",
        help="releases.csv: x_m, y_m and, if not on the terrain, z_m; or project.toml with all that is needed; else "
        "one of the sources below",
    )
    add_out(parser)
    add_terrain_files(parser, "mesh, grid or cloud; a project names its own")
    add_model_option(parser, "impact models, each of which gets the same blocks")
    add_parameter_options(parser)
    add_observed_option(parser, "needed by that model; a project can give its own")
    parser.add_argument(
        "--posterior",
        action="extend",
        nargs="+",
        default=[],
        metavar="FILE",
        help="posterior.csv of a back-analysis: each block draws its parameters, so results show what is not known",
    )
    parser.add_argument("--seed", type=whole, metavar="S", help="of the random numbers (default 0)")
    add_release_options(parser)
    add_tree_options(parser)
    motion = parser.add_argument_group("motion")
    add_motion_options(motion)
    motion.add_argument("--gravity", type=positive, metavar="G", help=f"[m/s²] (default {GRAVITY_MPS2:g})")
    motion.add_argument(
        "--structure",
        action="append",
        default=[],
        metavar="NAME=FILE",
        help="a wall, a road, a house: a mesh, or a cloud, whose points blocks meet",
    )
    motion.add_argument(
        "--screen",
        action="append",
        default=[],
        metavar="FILE",
        help="lines across the slope, GeoJSON, a GeoPackage or a table of points: what passes there; with the "
        "properties height_m and capacity_kJ a barrier, and what it holds",
    )
    motion.add_argument(
        "--contact",
        choices=("mesh", "points"),
        help="what of the terrain blocks meet: a surface (default; clouds and grids are meshed), or points alone, "
        "those of a cloud, of a mesh its vertices",
    )
    parser.add_argument(
        "--record",
        metavar="A,B",
        help="tables beside runs.csv: impacts, trajectories, or none (default both; impacts alone from 20000 blocks "
        "on, none from a million)",
    )
    parser.add_argument(
        "--cell",
        type=positive,
        metavar="M",
        help="side of the cells of maps [m]: reach probability, passages, deposits, speed, energy, height → "
        "maps/NAME.tif (default: no maps)",
    )
    parser.add_argument(
        "--faces",
        action="store_true",
        help="maps of the faces of the mesh as well, for cliffs and overhangs: contacts, speed, energy → "
        "maps/faces.gpkg, maps/faces.csv",
    )
    parser.add_argument(
        "--geopackage",
        action="store_true",
        help="also simulation.gpkg for a GIS: releases, stops, screens, what --record names as impacts and paths in "
        "space, and what a project has measured",
    )
    parser.add_argument(
        "--until-known",
        type=share,
        metavar="P",
        help="end as soon as the energy and height that this share of the hits of a screen does not exceed are known "
        "to 5 %%, 0.95 for example; --number is then the most",
    )
    parser.add_argument(
        "--runs",
        type=whole_range,
        metavar="FIRST-LAST",
        help="only these of all blocks, as a part of the same simulation (default all)",
    )
    parser.add_argument("--threads", type=whole, metavar="N", help="default: all cores; the result is the same")
    add_worker_options(parser)
    add_terrain_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Simulate, write the tables, print the summary."""
    from ..exchange.simulation_entry import RECORDS
    from ..exchange.simulation_geopackage import GEOPACKAGE, write_simulation_geopackage
    from ..exchange.simulation_output import default_records, recorded_for, write_simulations
    from ..output import output_folder
    from ..remarks import gravest_first
    from ..workflow.enough import enough_remarks, in_chance_order
    from ..workflow.maps import Mapped, map_models, map_remarks
    from ..workflow.screens import screen_remarks
    from ..workflow.simulation import ground_of, remarks_of, run_models

    record = None if arguments.record is None else known_names(arguments.record, RECORDS, "--record")
    on_workers = several_workers(arguments)
    prepare = _project if (arguments.releases or "").endswith(".toml") else _scenario
    with output_folder(arguments.out) as folder, PrintedProgress() as progress:
        asked = prepare(arguments, progress)
        scenario = asked.scenario
        ground = ground_of(scenario)
        screens, screen_files = _screens(arguments.screen, ground, scenario.screens)
        progress("Releasing the blocks")
        releases, first_run = _asked_runs(scenario.releases(ground), arguments.runs)
        if arguments.until_known is not None:
            if not screens:
                raise InputError(
                    "--until-known is known nowhere", advice="Give --screen: a line, or the closed outline of an area"
                )
            releases = in_chance_order(releases, scenario.seed)
        if record is None:
            record = default_records(len(releases)) if asked.record is None else asked.record
        kept: tuple[ChunkStore, ...] = ()
        if on_workers:
            if arguments.until_known is not None:
                raise InputError(
                    "Workers do not ask what is known already", advice="Leave out --workers or --until-known"
                )
            written, remarks, kept = simulate_on_workers(
                arguments, scenario, ground, releases,
                record=record, cell_m=asked.cell_m, faces=asked.faces, screens=screens, first_run=first_run,
                measured=asked.measured, folder=folder, inputs=asked.inputs | screen_files, progress=progress,
            )  # fmt: skip
        else:
            with stopped_by_interrupt(progress) as counted:
                how = {
                    "record": recorded_for(record, bool(scenario.structures)),
                    "first_run": first_run,
                    "threads": arguments.threads,
                    "progress": counted,
                }
                if asked.cell_m is None and not asked.faces and not screens:
                    mapped = Mapped(run_models(ground, releases, scenario.settings, **how), {}, {}, {})
                else:
                    until = arguments.until_known
                    mapped = map_models(
                        ground, releases, scenario.settings, asked.cell_m, screens,
                        faces=asked.faces, until_known=until, **how,
                    )  # fmt: skip
            simulations = mapped.simulations
            said = (
                *remarks_of(simulations, list(scenario.models)),
                *map_remarks(mapped.cells),
                *screen_remarks(mapped.screens),
            )
            if arguments.until_known is not None:
                for model, tally in mapped.screens.items():
                    said += tuple(enough_remarks(model, tally, arguments.until_known))
            remarks = gravest_first([*said])
            written = write_simulations(
                simulations, folder, record=record, inputs=asked.inputs | screen_files, maps=mapped.cells,
                faces=mapped.faces, screens=mapped.screens, remarks=remarks, progress=progress,
            )  # fmt: skip
            if arguments.geopackage:
                write_simulation_geopackage(
                    simulations, folder / GEOPACKAGE, measured=asked.measured, screens=screens, progress=progress
                )
                written.append(GEOPACKAGE)
    forget_chunks(kept)
    for sentence in (*scenario.terrain.summary, *remarks):
        print(sentence)
    print(f"Written: {', '.join(written)} in {arguments.out}")
    return 0


def _screens(
    files: list[str], ground: "Ground", stated: "tuple[Screen, ...]"
) -> "tuple[tuple[Screen, ...], dict[str, Path]]":
    """The screens that a project states and those of some files, and these files."""
    from ..exchange.screens import read_screens
    from ..hazard.screens import check_screens

    screens = (*stated, *(screen for file in files for screen in read_screens(file, ground.shift)))
    check_screens(screens, ground)
    for screen in screens:
        if screen.name in ground.structures:
            raise InputError(f"{screen.name!r} is a screen and a structure", advice="Give each a name of its own")
    return screens, {f"screens:{Path(file).name}": Path(file) for file in files}


class _Asked(NamedTuple):
    """What is simulated, the tables beside runs.csv that a project names, the files that decide it, the cells of the
    maps, whether faces have maps, and what the project has measured, where that is to be written beside it."""

    scenario: "Scenario"
    record: tuple[str, ...] | None
    inputs: dict[str, Path]
    cell_m: float | None
    faces: bool
    measured: "Reconstruction | None" = None


def _scenario(arguments: argparse.Namespace, progress: PrintedProgress) -> _Asked:
    """What the options say."""
    from ..exchange.project import terrain_inputs
    from ..exchange.trees import open_trees
    from ..reconstruction.drag import Drag
    from ..terrain.readers import read_structure, read_tile_points
    from ..workflow.simulation import Scenario

    for option in ("terrain", "model"):
        if not getattr(arguments, option):
            raise InputError(f"--{option} is missing", advice="Only a project, project.toml, can do without it")
    models = models_as_asked(arguments.model)
    parameters = model_parameters(arguments, models)
    draws = _posteriors(arguments, models)
    measured = measured_as_asked(arguments, models, needed=True)
    files = _structures(arguments.structure)
    given = {
        name: getattr(arguments, option)
        for option, name in (
            ("rolling", "rolling"), ("friction", "friction"), ("gravity", "gravity_mps2"), ("seed", "seed"),
        )
        if getattr(arguments, option) is not None
    }  # fmt: skip
    source, release_files = releases_as_asked(arguments)
    reading = reading_as_asked(arguments)
    if arguments.contact == "points":
        if arguments.max_edge is not None:
            raise InputError("--max-edge is of a mesh, and --contact points makes none", advice="Leave out one of them")
        terrain: Surface | Cloud = read_tile_points(arguments.terrain, reading, progress=progress)
    else:
        terrain = terrain_as_asked(arguments, arguments.terrain, progress)
    zones, zone_files = zones_as_asked(arguments, terrain, models)
    entry = trees_said(arguments)
    trees, tree_files = (None, {}) if entry is None else open_trees(entry, terrain, arguments.seed or 0)
    scenario = Scenario(
        terrain,
        source,
        {name: parameters.get(name, {}) for name in models},
        measured,
        structures={name: read_structure(file, reading, progress=progress) for name, file in files.items()},
        zones=zones,
        drag=Drag() if arguments.drag else None,
        draws=draws,
        trees=trees,
        **given,
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
    return _Asked(scenario, None, inputs, arguments.cell, arguments.faces)


def _project(arguments: argparse.Namespace, progress: PrintedProgress) -> _Asked:
    """A project, in which options replace what its [simulation] says."""
    from ..exchange.opening import reconstruct_project
    from ..exchange.project import read_project
    from ..exchange.simulation_project import open_simulation
    from ..terrain.surface import Surface

    own = ["--terrain", "--structure", "--gravity", "--zone-attribute", *sources_given(arguments)[1:]]
    for option in own:
        if getattr(arguments, option.strip("-").replace("-", "_")) not in (None, []):
            raise InputError(f"{option} is what a project says itself", advice="Write it into the project")
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
        entry,
        models=models_as_asked(arguments.model, entry.models),
        releases=releases,
        contact=arguments.contact or entry.contact,
        rolling=arguments.rolling or entry.rolling,
        friction=entry.friction if arguments.friction is None else arguments.friction,
        drag=arguments.drag or entry.drag,
        observed=entry.observed if arguments.observed is None else Path(arguments.observed),
        seed=entry.seed if arguments.seed is None else arguments.seed,
        trees=trees_said(arguments, entry.trees),
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
    return _Asked(scenario, entry.record, inputs, arguments.cell or entry.cell_m, faces, measured)


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

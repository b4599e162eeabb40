# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall simulate``: blocks that fall down the terrain → runs.csv, impacts.csv, trajectories.csv, hits.csv."""

import argparse
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from ..constants import GRAVITY_MPS2, ROCK_DENSITY_KGPM3
from ..errors import InputError
from .options import (
    add_observed_option,
    add_out,
    add_parameter_options,
    add_terrain_options,
    known_names,
    measured_as_asked,
    model_parameters,
    not_negative,
    positive,
    terrain_as_asked,
    whole,
    whole_range,
)
from .progress import PrintedProgress, stopped_by_interrupt

if TYPE_CHECKING:
    from ..simulation.release import Releases

RECORDS = ("impacts", "trajectories")
LARGE = 20_000
"""From so many blocks on, motion in time is written only when it is asked for."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("releases", metavar="RELEASES", help="releases.csv: x_m, y_m and, if not on the terrain, z_m")
    add_out(parser)
    parser.add_argument("--terrain", metavar="FILE", required=True, help="mesh, grid or cloud")
    parser.add_argument(
        "--model",
        action="append",
        metavar="NAME",
        required=True,
        help="impact model; may be given several times: each gets the same blocks. `rockfall models` lists all",
    )
    add_parameter_options(parser)
    add_observed_option(parser, "needed by that model")
    parser.add_argument("--seed", type=whole, default=0, metavar="S", help="of the random numbers (default 0)")
    parser.add_argument(
        "--number", type=whole, default=1, metavar="N", help="blocks from each release without a number (default 1)"
    )
    block = parser.add_argument_group("blocks of releases that do not say")
    block.add_argument("--diameter", type=positive, default=0.35, metavar="M", help="[m] (default %(default)s)")
    block.add_argument(
        "--density", type=positive, default=ROCK_DENSITY_KGPM3, metavar="RHO", help="[kg/m³] (default %(default)s)"
    )
    motion = parser.add_argument_group("motion")
    motion.add_argument("--drag", action="store_true", help="flights with the drag of air")
    motion.add_argument(
        "--rolling",
        choices=("azzoni_1995", "coulomb", "none"),
        default="azzoni_1995",
        help="on the ground: rolling (default), sliding, or a stop where a block would begin to",
    )
    motion.add_argument(
        "--friction", type=not_negative, default=0.5, metavar="MU", help="of either (default %(default)s)"
    )
    motion.add_argument(
        "--gravity", type=positive, default=GRAVITY_MPS2, metavar="G", help="[m/s²] (default %(default)s)"
    )
    motion.add_argument(
        "--structure", action="append", default=[], metavar="NAME=FILE", help="a wall, a road, a house: a mesh"
    )
    parser.add_argument(
        "--record",
        metavar="A,B",
        help="tables beside runs.csv: impacts, trajectories, or none (default both; impacts alone from "
        f"{LARGE} blocks on)",
    )
    parser.add_argument(
        "--runs",
        type=whole_range,
        metavar="FIRST-LAST",
        help="only these of all blocks, as a part of the same simulation (default all)",
    )
    parser.add_argument("--threads", type=whole, metavar="N", help="default: all cores; the result is the same")
    add_terrain_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Simulate, write the tables, print the summary."""
    from ..exchange.output import output_folder
    from ..exchange.simulation_tables import read_releases, summary, write_hits, write_runs, write_summary
    from ..exchange.tables import write_impacts, write_trajectories
    from ..impact_models.registry import find_model
    from ..reconstruction.drag import Drag
    from ..simulation.results import impacts_of, sample_runs
    from ..workflow.simulation import Scenario, ground_of, remarks_of, run_models

    models = [find_model(name).name for name in arguments.model]
    parameters = model_parameters(arguments, models)
    measured = measured_as_asked(arguments, models, needed=True)
    files = _structures(arguments.structure)
    with output_folder(arguments.out) as folder, PrintedProgress() as progress:
        terrain = terrain_as_asked(arguments, arguments.terrain, progress)
        scenario = Scenario(
            terrain,
            partial(
                read_releases,
                arguments.releases,
                diameter_m=arguments.diameter,
                density_kgpm3=arguments.density,
                number=arguments.number,
            ),
            {name: parameters.get(name, {}) for name in models},
            measured,
            structures={name: terrain_as_asked(arguments, file, progress) for name, file in files.items()},
            rolling=arguments.rolling,
            friction=arguments.friction,
            drag=Drag() if arguments.drag else None,
            gravity_mps2=arguments.gravity,
            seed=arguments.seed,
        )
        ground = ground_of(scenario)
        progress(f"Reading {arguments.releases}")
        releases, first_run = _asked_runs(scenario.releases(ground), arguments.runs)
        asked = RECORDS[: 1 if len(releases) >= LARGE else 2]
        record = known_names(arguments.record, RECORDS, "--record") if arguments.record is not None else asked
        with stopped_by_interrupt(progress) as counted:
            simulations = run_models(
                ground,
                releases,
                scenario.settings,
                record=bool(record or files),
                first_run=first_run,
                threads=arguments.threads,
                progress=counted,
            )
        remarks = remarks_of(simulations, models)
        progress("Writing the tables")
        write_runs(simulations, folder / "runs.csv")
        written = ["runs.csv"]
        if "impacts" in record:
            write_impacts([impacts_of(one) for one in simulations], folder / "impacts.csv")
            written.append("impacts.csv")
        if "trajectories" in record:
            samples = [sample_runs(one, progress=progress) for one in simulations]
            write_trajectories(samples, folder / "trajectories.csv")
            written.append("trajectories.csv")
        if files:
            write_hits(simulations, folder / "hits.csv")
            written.append("hits.csv")
        inputs = {"releases": Path(arguments.releases), "terrain": Path(arguments.terrain)}
        if measured is not None:
            inputs["observed"] = Path(arguments.observed)
        inputs |= {name: Path(file) for name, file in files.items()}
        write_summary(summary(simulations, inputs, remarks), folder / "summary.json")
        written.append("summary.json")
    for sentence in (*terrain.summary, *remarks):
        print(sentence)
    print(f"Written: {', '.join(written)} in {arguments.out}")
    return 0


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

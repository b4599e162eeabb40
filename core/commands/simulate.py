# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall simulate``: blocks that fall down the terrain → runs.csv, impacts.csv, trajectories.csv, hits.csv."""

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING

from ..constants import GRAVITY_MPS2, ROCK_DENSITY_KGPM3
from ..errors import InputError
from .options import (
    add_out,
    add_parameter_options,
    add_terrain_options,
    known_names,
    model_parameters,
    not_negative,
    positive,
    terrain_as_asked,
    whole,
)
from .progress import PrintedProgress

if TYPE_CHECKING:
    from ..simulation.engine import Simulation

RECORDS = ("impacts", "trajectories")
LARGE = 20_000
"""From so many blocks on, motion in time is written only when it is asked for."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("releases", metavar="RELEASES", help="releases.csv: x_m, y_m and, if not on the terrain, z_m")
    add_out(parser)
    parser.add_argument("--terrain", metavar="FILE", required=True, help="mesh, grid or cloud")
    parser.add_argument("--model", metavar="NAME", required=True, help="impact model; `rockfall models` lists all")
    add_parameter_options(parser)
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
    parser.add_argument("--threads", type=whole, metavar="N", help="default: all cores; the result is the same")
    add_terrain_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Simulate, write the tables, print the summary."""
    from ..exchange.output import output_folder
    from ..exchange.simulation_tables import read_releases, summary, write_hits, write_runs, write_summary
    from ..exchange.tables import write_impacts, write_trajectories
    from ..impact_models.registry import find_model
    from ..reconstruction.drag import Drag
    from ..simulation.engine import Settings, simulate
    from ..simulation.ground import make_ground
    from ..simulation.results import impacts_of, sample_runs

    model = find_model(arguments.model)
    parameters = model_parameters(arguments, [model.name])
    files = _structures(arguments.structure)
    with output_folder(arguments.out) as folder, PrintedProgress() as progress:
        terrain = terrain_as_asked(arguments, arguments.terrain, progress)
        structures = {name: terrain_as_asked(arguments, file, progress) for name, file in files.items()}
        ground = make_ground(terrain, structures)
        progress(f"Reading {arguments.releases}")
        releases = read_releases(
            arguments.releases,
            ground,
            diameter_m=arguments.diameter,
            density_kgpm3=arguments.density,
            number=arguments.number,
        )
        asked = ("impacts", "trajectories")[: 1 if len(releases) >= LARGE else 2]
        record = known_names(arguments.record, RECORDS, "--record") if arguments.record is not None else asked
        settings = Settings(
            model.name,
            parameters.get(model.name, {}),
            rolling=arguments.rolling,
            friction=arguments.friction,
            gravity_mps2=arguments.gravity,
            drag=Drag() if arguments.drag else None,
            seed=arguments.seed,
        )
        started = time.perf_counter()
        simulation = simulate(
            ground, releases, settings, record=bool(record or files), threads=arguments.threads, progress=progress
        )
        seconds = time.perf_counter() - started
        progress("Writing the tables")
        write_runs(simulation, folder / "runs.csv")
        written = ["runs.csv"]
        if "impacts" in record:
            write_impacts(impacts_of(simulation), folder / "impacts.csv")
            written.append("impacts.csv")
        if "trajectories" in record:
            write_trajectories(sample_runs(simulation, progress=progress), folder / "trajectories.csv")
            written.append("trajectories.csv")
        if files:
            write_hits(simulation, folder / "hits.csv")
            written.append("hits.csv")
        inputs = {"releases": Path(arguments.releases), "terrain": Path(arguments.terrain)}
        inputs |= {name: Path(file) for name, file in files.items()}
        write_summary(summary(simulation, inputs, seconds), folder / "summary.json")
        written.append("summary.json")
    for sentence in (*terrain.summary, *_sentences(simulation, seconds)):
        print(sentence)
    print(f"Written: {', '.join(written)} in {arguments.out}")
    return 0


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


def _sentences(simulation: "Simulation", seconds: float) -> list[str]:
    """How the runs ended, the unusual first."""
    import numpy as np

    from ..simulation.engine import ENDS, LIMIT, STOPPED

    n, counts = len(simulation), np.bincount(simulation.end, minlength=len(ENDS))
    words = {
        STOPPED: "stopped",
        "left_terrain": "left the terrain",
        LIMIT: "were cut off at the limit of time or impacts",
    }
    sentences = []
    if n < simulation.wanted:
        sentences.append(f"Stopped by you: {n} of {simulation.wanted} blocks are finished and written.")
    if counts[ENDS.index(LIMIT)]:
        sentences.append(f"{counts[ENDS.index(LIMIT)]} of {n} blocks {words[LIMIT]}: they are not at rest.")
    ended = ", ".join(f"{count} {words[name]}" for name, count in zip(ENDS, counts.tolist(), strict=True) if count)
    sentences.append(f"{n} blocks with {simulation.settings.model}, {simulation.impacts.sum()} impacts: {ended}.")
    flat = np.hypot(*(simulation.position - simulation.releases.position)[:, :2].T)
    sentences.append(
        f"Run-out in plan {np.median(flat):.1f} m (median), {flat.max():.1f} m at most; speeds up to "
        f"{simulation.v_max_mps.max():.1f} m/s. It took {seconds:.1f} s."
    )
    if simulation.ground.flat:
        sentences.append(f"{simulation.ground.flat} triangles without area were left out.")
    return sentences

# SPDX-License-Identifier: GPL-3.0-or-later
"""``--workers`` and ``--scheduler``: the runs of a simulation in chunks, on several processes or machines."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from ..errors import InputError, RockfallError
from ..extras import CLUSTER, demand
from .options import whole
from .progress import PrintedProgress, stopped_by_interrupt
from .simulation_work import Work

if TYPE_CHECKING:
    from ..remarks import Remark
    from ..workflow.chunk_store import ChunkStore

CHUNKS = ".chunks"
"""Ends the name of the folder beside the output in which finished chunks are kept until all are."""


def add_worker_options(parser: argparse.ArgumentParser) -> None:
    """Who computes."""
    group = parser.add_argument_group("several workers (Dask); the result is the same")
    group.add_argument("--workers", type=whole, metavar="N", help="so many processes on this machine")
    group.add_argument(
        "--scheduler", metavar="ADDRESS", help="the workers of a scheduler of Dask that runs, such as tcp://node7:8786"
    )


def several_workers(arguments: argparse.Namespace) -> bool:
    """Whether the options ask for workers.

    Raises
    ------
    InputError : options that exclude each other.
    """
    if arguments.workers is None and arguments.scheduler is None:
        return False
    if arguments.workers is not None and arguments.scheduler is not None:
        raise InputError("--workers are started here, and --scheduler has its own", advice="Give one of them")
    if arguments.workers == 0:
        raise InputError("--workers 0 compute nothing", advice="Give at least one")
    if arguments.threads is not None:
        raise InputError("--threads is of one process, and each worker has its own", advice="Leave out --threads")
    demand(CLUSTER)
    if arguments.until_known is not None:
        raise InputError("--until-known is of one process, and workers do not ask it", advice="Leave out one of them")
    return True


class Done(NamedTuple):
    """The names of the files that were written, what to say, what is kept of it until the folder is complete, and the
    number of a signal that has ended it before all was simulated."""

    written: list[str]
    remarks: "Sequence[Remark]"
    kept: "tuple[ChunkStore, ...]" = ()
    asked: int = 0


def simulate_on_workers(arguments: argparse.Namespace, work: Work, folder: Path, progress: PrintedProgress) -> Done:
    """Simulate, and write the tables into the folder.

    Raises
    ------
    RockfallError : no workers, or not the right ones; the disk is full.
    """
    from ..exchange.simulation_geopackage import GEOPACKAGE, write_simulation_geopackage
    from ..exchange.simulation_tables import summary, write_summary
    from ..interrupts import Interrupt
    from ..output import final_path
    from ..progress import CancelledError
    from ..remarks import gravest_first
    from ..workflow.dask_pool import DaskPool
    from ..workflow.maps import map_remarks
    from ..workflow.screens import outside_remarks, screen_remarks
    from ..workflow.simulation import check_models, remarks_of
    from ..workflow.simulation_chunks import simulate_in_chunks, write_chunk_tables
    from ..workflow.simulation_output import write_all_maps, write_met_trees

    scenario = work.scenario
    check_models(work.ground, scenario.settings)
    if arguments.geopackage and work.record:
        raise InputError(
            "Blocks on workers leave no paths and impacts for a GeoPackage",
            advice="Give --record none, for one with the releases, stops and screens, or leave out --workers",
        )
    out = final_path(Path(arguments.out).absolute())
    kept = out.with_name(f"{out.name}{CHUNKS}")
    goes_on = f"what is finished is kept in {kept}, and the same command goes on with the rest"
    progress("Looking for workers")
    try:
        with stopped_by_interrupt(progress) as counted, DaskPool(arguments.scheduler, arguments.workers or 1) as pool:
            try:
                mapped, stores = simulate_in_chunks(
                    work.ground, work.releases, scenario.settings, pool, kept, record=work.record, cell_m=work.cell_m,
                    faces=work.faces, screens=work.screens, first_run=work.first_run, progress=counted,
                )  # fmt: skip
            except CancelledError as error:
                raise Interrupt(counted.asked, goes_on) from error
        simulations = mapped.simulations
        said = (
            *remarks_of(simulations, list(scenario.models)),
            *work.mesh_remarks,
            *map_remarks(mapped.cells),
            *outside_remarks(work.screens, work.ground),
            *screen_remarks(mapped.screens),
            *(remark for store in stores for remark in store.remarks),
        )
        remarks = gravest_first([*said])
        written = write_chunk_tables(stores, folder, simulations, mapped.screens, progress=progress)
        written += write_all_maps(mapped, folder, progress)
        written += write_met_trees(simulations, folder)
        if arguments.geopackage:
            write_simulation_geopackage(
                simulations, folder / GEOPACKAGE, measured=work.measured, screens=work.screens, progress=progress
            )
            written.append(GEOPACKAGE)
        write_summary(summary(simulations, work.inputs, remarks), folder / "summary.json")
    except RockfallError:
        if kept.is_dir():
            print(f"rockfall: {goes_on[:1].upper()}{goes_on[1:]}.", file=sys.stderr)
        raise
    return Done([*written, "summary.json"], remarks, stores)


def forget_chunks(stores: "tuple[ChunkStore, ...]") -> None:
    """The output is complete."""
    for store in stores:
        store.remove()

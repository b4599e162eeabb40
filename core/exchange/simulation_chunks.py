# SPDX-License-Identifier: GPL-3.0-or-later
"""A simulation in chunks on several workers, with the same tables as one in one piece."""

import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from ..hazard.run_tally import COLUMNS, RunTally
from ..progress import Progress, silent
from ..simulation.engine import Records, Settings, Simulation
from ..simulation.ground import Ground
from ..simulation.release import Releases
from ..vectors import Array
from ..versions import versions
from ..workflow.ensembles import CHUNK, Pool, Tables, Work, run_ensemble
from .chunk_store import ChunkStore
from .content_digest import content_digest
from .simulation_output import recorded_for, write_tables

RUNS = "runs"
KEY_LETTERS = 16


@dataclass(frozen=True)
class TablesOf:
    """Makes the tables of a chunk, on the worker; `record` as in `write_simulations`."""

    record: tuple[str, ...]

    def __call__(self, simulation: Simulation) -> Tables:
        with TemporaryDirectory() as folder:
            names = write_tables([simulation], Path(folder), record=self.record)
            return {name: (Path(folder) / name).read_bytes() for name in names}


def simulate_in_chunks(
    ground: Ground,
    releases: Releases,
    settings: Sequence[Settings],
    pool: Pool,
    kept: Path,
    *,
    record: Collection[str],
    first_run: int = 0,
    size: int = CHUNK,
    progress: Progress = silent,
) -> tuple[tuple[Simulation, ...], tuple[ChunkStore, ...]]:
    """Let the same blocks fall once for each of the settings, chunk by chunk.

    Parameters
    ----------
    kept : folder for what is finished; from there the same simulation goes on after it was ended.
    record : tables beside runs.csv, see `write_simulations`.
    first_run, progress : see `run_models`.

    Returns
    -------
    The simulations, without the moments of their motion, and what has their tables, for `write_chunk_tables`.

    Raises
    ------
    InputError, CancelledError : see `run_ensemble`.
    """
    tables = TablesOf(tuple(sorted(record)))
    recorded = recorded_for(record, bool(ground.structures))
    simulations, stores = [], []
    for one in settings:
        began = time.perf_counter()
        decides = (ground, releases, one, first_run, size, tables, versions())
        store = ChunkStore(kept / content_digest(*decides)[:KEY_LETTERS])
        work = Work(ground, one, {RUNS: RunTally()}, recorded, tables)
        ends = run_ensemble(work, releases, pool, first_run=first_run, size=size, store=store, progress=progress)[
            RUNS
        ].arrays()
        columns = {name: ends[name].astype(np.intp if kind is np.int32 else kind) for name, kind in COLUMNS.items()}
        simulations.append(
            Simulation(
                one, ground, releases, **columns, records=_no_records(), wanted=len(releases), recorded="ends",
                seconds=time.perf_counter() - began, first_run=first_run,
            )
        )  # fmt: skip
        stores.append(store)
    return tuple(simulations), tuple(stores)


def write_chunk_tables(
    stores: Sequence[ChunkStore], folder: Path, runs: int, *, size: int = CHUNK, progress: Progress = silent
) -> list[str]:
    """Write the tables of `simulate_in_chunks`; returns their names."""
    progress("Writing the tables", 0, 0)
    names = stores[0].tables()
    for name in names:
        for store in stores:
            store.write_table(name, -(-runs // size), folder / name)
    return names


def _no_records() -> Records:
    def vectors() -> Array:
        return np.empty((0, 3))

    none = np.empty(0, np.intp)
    return Records(
        none, np.empty(0, np.int8), np.empty(0), vectors(), vectors(), vectors(), vectors(), vectors(), vectors(), none
    )

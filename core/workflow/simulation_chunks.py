# SPDX-License-Identifier: GPL-3.0-or-later
"""A simulation in chunks on several workers, with the same tables as one in one piece."""

import time
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from ..exchange.content_digest import content_digest
from ..exchange.screens import write_screens
from ..exchange.simulation_tables import append_screen_hits, drawn_names
from ..hazard.run_tally import COLUMNS, RunTally
from ..hazard.screen_tally import ScreenTally
from ..hazard.screens import Screen
from ..hazard.tally import Tally
from ..progress import Progress, silent
from ..simulation.engine import Recorded, Records, Settings, Simulation
from ..simulation.ground import Ground
from ..simulation.release import Releases
from ..vectors import Array
from ..versions import versions
from .chunk_store import ChunkStore
from .ensembles import CHUNK, Pool, Tables, Work, run_ensemble
from .maps import Mapped, tallies_for
from .simulation_output import recorded_for, write_tables

RUNS = "runs"
HITS = "hits.csv"
KEY_LETTERS = 16


@dataclass(frozen=True)
class TablesOf:
    """Makes the tables of a chunk, on the worker.

    `record` is as in `write_simulations`, `recorded` what they need, `drawn` as in `write_runs`.
    """

    record: tuple[str, ...]
    recorded: Recorded
    drawn: tuple[str, ...] = ()

    def __call__(self, simulation: Simulation) -> Tables:
        with TemporaryDirectory() as folder:
            less = simulation.with_records(self.recorded)
            names = write_tables([less], Path(folder), record=self.record, drawn=self.drawn)
            return {name: (Path(folder) / name).read_bytes() for name in names}


def simulate_in_chunks(
    ground: Ground,
    releases: Releases,
    settings: Sequence[Settings],
    pool: Pool,
    kept: Path,
    *,
    record: Collection[str],
    cell_m: float | None = None,
    faces: bool = False,
    screens: Sequence[Screen] = (),
    first_run: int = 0,
    size: int = CHUNK,
    progress: Progress = silent,
) -> tuple[Mapped, tuple[ChunkStore, ...]]:
    """Let the same blocks fall once for each of the settings, chunk by chunk.

    Parameters
    ----------
    kept : folder for what is finished; from there the same simulation goes on after it was ended.
    record : tables beside runs.csv, see `write_simulations`.
    cell_m, faces : see `map_models`.
    first_run, progress : see `run_models`.

    Returns
    -------
    The simulations, without the moments of their motion, with what was counted; and what has the tables, for
    `write_chunk_tables`.

    Raises
    ------
    InputError, CancelledError : see `run_ensemble`.
    """
    recorded = kept_records = recorded_for(record, bool(ground.structures))
    tables = TablesOf(tuple(sorted(record)), recorded, drawn_names(settings))
    tallies: dict[str, Tally] = {RUNS: RunTally()}
    tallies |= tallies_for(ground, cell_m, faces, screens)
    if len(tallies) > 1:
        recorded = "all"
    simulations, stores = [], []
    counted = dict[str, dict[str, Tally]]()
    for one in settings:
        began = time.perf_counter()
        decides = (ground, releases, one, first_run, size, tables, cell_m, faces, tuple(screens), versions())
        scenario = content_digest(*decides)
        store = ChunkStore(kept / scenario[:KEY_LETTERS], scenario)
        work = Work(ground, one, tallies, recorded, tables, kept_records)
        found = run_ensemble(work, releases, pool, first_run=first_run, size=size, store=store, progress=progress)
        ends = found.pop(RUNS).arrays()
        counted[one.model] = found
        columns = {name: ends[name].astype(np.intp if kind is np.int32 else kind) for name, kind in COLUMNS.items()}
        simulations.append(
            Simulation(
                one, ground, releases, **columns, records=_no_records(), wanted=len(releases), recorded="ends",
                seconds=time.perf_counter() - began, number=np.arange(first_run + 1, first_run + len(releases) + 1),
            )
        )  # fmt: skip
        stores.append(store)
    return Mapped(tuple(simulations), counted), tuple(stores)


def write_chunk_tables(
    stores: Sequence[ChunkStore],
    folder: Path,
    simulations: Sequence[Simulation],
    screens: Mapping[str, ScreenTally],
    *,
    size: int = CHUNK,
    progress: Progress = silent,
) -> list[str]:
    """Write the tables of `simulate_in_chunks`; returns their names."""
    progress("Writing the tables", 0, 0)
    names = stores[0].tables()
    for name in names:
        for store in stores:
            store.write_table(name, -(-len(simulations[0]) // size), folder / name)
    if screens:
        append_screen_hits(screens, simulations[0].ground.shift, folder / HITS)
        write_screens(screens, folder / "screens.csv")
        names = [*(name for name in names if name != HITS), HITS, "screens.csv"]
    return names


def _no_records() -> Records:
    def vectors() -> Array:
        return np.empty((0, 3))

    none = np.empty(0, np.intp)
    return Records(
        none, np.empty(0, np.int8), np.empty(0), vectors(), vectors(), vectors(), vectors(), vectors(), vectors(), none
    )

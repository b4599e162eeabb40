# SPDX-License-Identifier: GPL-3.0-or-later
"""The same runs with barriers: those that one holds end there."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..simulation.engine import ENDED, ENDS, IMPACT, ON_GROUND, STOPPED, TREE, Records, Simulation
from ..vectors import norm
from .cell_tally import CellTally
from .cells import Cells
from .face_tally import FaceTally
from .screen_tally import held
from .screens import Screen, ScreenHits, hits_at


class HeldCellTally(CellTally):
    """A `CellTally` of the runs as barriers leave them."""

    def __init__(self, cells: Cells, barriers: Sequence[Screen] = ()) -> None:
        super().__init__(cells)
        self.barriers = tuple(barriers)

    def empty(self) -> "HeldCellTally":
        """One for the same cells and barriers to which nothing was added."""
        return HeldCellTally(self.cells, self.barriers)

    def add(self, simulation: Simulation) -> None:
        """See `CellTally.add`."""
        super().add(with_barriers(simulation, hits_at(simulation, self.barriers)))


class HeldFaceTally(FaceTally):
    """A `FaceTally` of the runs as barriers leave them."""

    def __init__(self, faces: int, barriers: Sequence[Screen] = ()) -> None:
        super().__init__(faces)
        self.barriers = tuple(barriers)

    def empty(self) -> "HeldFaceTally":
        """One for the same faces and barriers to which nothing was added."""
        return HeldFaceTally(self.faces, self.barriers)

    def add(self, simulation: Simulation) -> None:
        """See `FaceTally.add`."""
        super().add(with_barriers(simulation, hits_at(simulation, self.barriers)))


def with_barriers(simulation: Simulation, hits: ScreenHits) -> Simulation:
    """Runs that are cut where a barrier holds the block: it comes to rest there; the others are as they were.

    hits : of the simulation, `hits_at` its barriers.
    """
    hits = hits.take(held(hits))
    if not len(hits):
        return simulation
    run = simulation.place_of(hits.number)
    until = np.full(len(simulation), np.inf)
    until[run] = hits.time_s
    records = simulation.records
    keep = records.time_s < until[records.run]
    kept = np.flatnonzero(keep)
    last = np.searchsorted(records.run[kept], run, side="right") - 1
    row = kept[last]  # what each was last seen at, before the barrier
    at_ground = records.what[np.minimum(row + 1, len(records) - 1)] == ON_GROUND
    columns = {name: getattr(records, name) for name in Records.__dataclass_fields__}
    still = np.zeros((len(hits), 3))
    spin = records.omega2[row]
    stop = {
        "run": run, "time_s": hits.time_s, "position": hits.position, "v1": hits.velocity, "omega1": spin,
        "normal": records.normal[row], "face": np.full(len(hits), -1),
    }  # fmt: skip
    end = stop | {"what": np.full(len(hits), ENDED, np.int8), "v2": still, "omega2": still}
    on = stop | {"what": np.full(len(hits), ON_GROUND, np.int8), "v2": hits.velocity, "omega2": spin}
    moved = {name: np.concatenate([columns[name][keep], on[name][at_ground], end[name]]) for name in columns}
    order = np.lexsort((np.r_[np.zeros(kept.size), np.ones(int(at_ground.sum())), np.full(len(hits), 2)], moved["run"]))
    records = Records(**{name: values[order] for name, values in moved.items()})
    ended = {name: getattr(simulation, name).copy() for name in ("end", "time_s", "length_m", "v_max_mps", "position")}
    ended["end"][run], ended["time_s"][run] = ENDS.index(STOPPED), hits.time_s
    ended["position"][run] = hits.position
    met = [np.bincount(records.run[records.what == what], minlength=len(simulation)) for what in (IMPACT, TREE)]
    way, fastest = _ways(records, run)
    ended["length_m"][run], ended["v_max_mps"][run] = way, fastest
    return replace(simulation, records=records, impacts=met[0], tree_hits=met[1], **ended)


def _ways(records: Records, run: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lengths along the chords between moments, and greatest speeds, of some runs."""
    chord = norm(np.diff(records.position, axis=0)) * (np.diff(records.run) == 0)
    way = np.bincount(records.run[1:], chord, minlength=int(records.run[-1]) + 1)
    begin = np.searchsorted(records.run, np.arange(int(records.run[-1]) + 2))
    speed = np.maximum(norm(records.v1), norm(records.v2))
    return way[run], np.maximum.reduceat(speed, begin[:-1])[run]

# SPDX-License-Identifier: GPL-3.0-or-later
"""What passes through the cells of maps, and what comes to rest in them."""

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..simulation.engine import Simulation
from ..terrain.ordering import along_curve
from ..vectors import Array
from .cells import Cells
from .maps import CLASSES_KJ, QUANTITIES, SHARES, Maps
from .quantiles import Sketches
from .tally import Arrays

UNITS = (2.0**-20, 2.0**-10, 2.0**-10, 2.0**-20)
"""Of the sums of speeds [m/s], energies [J] and heights [m]."""
JOULES = 1000.0
"""In a kJ."""
MOST_RUNS = 2**31 - 1
"""That are told apart in the work space of the kernel before it begins again."""
MOST_WAITING = 256
"""Chunks whose deposits wait: to count those of a few blocks in all cells costs more than to find them."""
PER_METRE, PER_RUN = 1.4, 8
"""Passages through cells of 1 m that room is made for at first."""


class CellTally:
    """Passages and deposits in each cell: makes `Maps`.

    A passage is one stay of a run in a cell; a run that comes back has another. It has the greatest speed, energies and
    height above the terrain of this stay, on the exact path; see `cell_kernels`. Those of a release and of a block that
    rests are passages too. What is beside the cells is not counted.
    """

    def __init__(self, cells: Cells) -> None:
        self.cells, self.blocks = cells, 0
        self._spaces = list[_Space]()
        self._resting = list[NDArray[np.intp]]()
        self._deposits: NDArray[np.int64] | None = None
        limits = [JOULES * limit for limit in CLASSES_KJ]
        self.passages = Sketches(len(cells), UNITS, column=list(QUANTITIES).index("E"), limits=limits)

    def empty(self) -> "CellTally":
        """One for the same cells to which nothing was added."""
        other = CellTally(self.cells)
        other._spaces = self._spaces
        return other

    def add(self, simulation: Simulation) -> None:
        """Count the runs of a simulation.

        Raises
        ------
        InputError : it did not record all; the terrain is a cloud of points.
        """
        key, values = passages_of(simulation, self.cells, self._spaces)
        self.passages.add(key, values)
        self._resting.append(_cells_at(self.cells, simulation))
        self.blocks += len(simulation)

    @property
    def deposits(self) -> NDArray[np.int64]:
        """(cells,) blocks that came to rest in each."""
        waiting, self._resting = self._resting, []
        if waiting or self._deposits is None:
            more = np.bincount(np.concatenate([np.empty(0, np.intp), *waiting]), minlength=len(self.cells))
            self._deposits = more if self._deposits is None else self._deposits + more
        return self._deposits

    def merge(self, other: "CellTally") -> None:
        """Count what another one has counted."""
        if other.cells != self.cells:
            raise InputError("Maps of other cells cannot be added", advice="Take the same terrain and size of cells")
        self.passages.merge(other.passages)
        self._resting += other._resting
        if other._deposits is not None:
            self._deposits = self.deposits + other._deposits
        elif len(self._resting) > MOST_WAITING:
            _ = self.deposits
        self.blocks += other.blocks

    def arrays(self) -> Arrays:
        """See `Tally`."""
        cells = self.cells
        deposits = self.deposits
        resting = np.flatnonzero(deposits)
        return {
            "corner": np.array([cells.x0_m, cells.y0_m, cells.size_m]),
            "shape": np.array([cells.columns, cells.rows]),
            "blocks": np.array(self.blocks),
            "resting": resting,
            "deposits": deposits[resting],
            **{f"passages_{name}": values for name, values in self.passages.arrays().items()},
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Self:
        """See `Tally`."""
        made = cls(Cells(*arrays["corner"].tolist(), *arrays["shape"].tolist()))
        made.blocks = int(arrays["blocks"])
        made._deposits = np.zeros(len(made.cells), np.int64)
        made._deposits[arrays["resting"]] = arrays["deposits"]
        own = {name[9:]: values for name, values in arrays.items() if name.startswith("passages_")}
        made.passages = Sketches.from_arrays(own)
        return made

    def reached_by_few(self, few: int) -> tuple[int, int]:
        """How many cells are reached by fewer blocks than `few`, and how many by any."""
        reach = self.passages.figures([]).reach
        return int((reach < few).sum()), int(reach.size)

    def maps(self) -> Maps:
        """All `LAYERS`."""
        figures = self.passages.figures([share / 100 for share in SHARES])
        rows, columns = np.divmod(figures.key, self.cells.columns)

        def layer(values: NDArray[Any]) -> Array:
            filled = np.full(self.cells.shape, np.nan)
            filled[rows, columns] = values
            return filled

        number = self.deposits
        deposits = np.where(number > 0, number, np.nan).reshape(self.cells.shape)
        layers = {
            "Reach_probability": layer(100.0 * figures.reach / max(self.blocks, 1)),
            "Nr_passages": layer(figures.count),
            "Nr_blocks": layer(figures.reach),
            "Nr_deposited": deposits,
        }
        for column, (prefix, (_, unit, _)) in enumerate(QUANTITIES.items()):
            part = 1.0 / JOULES if unit == "kJ" else 1.0
            layers[f"{prefix}_mean"] = layer(part * figures.mean[:, column])
            for place, share in enumerate(SHARES):
                layers[f"{prefix}_{share}CI"] = layer(part * figures.quantiles[:, column, place])
            layers[f"{prefix}_max"] = layer(part * figures.greatest[:, column])
            layers[f"{prefix}_95CI_error"] = layer(part * figures.error[:, column])
        for place, limit in enumerate(CLASSES_KJ):
            layers[f"E_over_{limit}kJ"] = layer(100.0 * figures.over[:, place] / figures.count)
        return Maps(self.cells, self.blocks, layers)


def passages_of(
    simulation: Simulation, cells: Cells, spaces: "list[_Space] | None" = None
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """All passages of a simulation: (p,) the cells, −1 − cell for the first passage of a run through it; (p, 4) of each
    the speed [m/s], kinetic energy, translational energy [J] and height [m].

    Parameters
    ----------
    spaces : memory to use, and to give back.

    Raises
    ------
    InputError : see `CellTally.add`.
    """
    from .cell_kernels import walk

    if simulation.recorded != "all":
        raise InputError("Maps need the whole motion of the blocks", advice="Record all of it")
    records, releases, ground = simulation.records, simulation.releases, simulation.ground
    size = int(PER_METRE * simulation.length_m.sum() / cells.size_m) + PER_RUN * len(simulation)
    space = spaces.pop() if spaces else _Space(len(cells))
    order = np.argsort(along_curve(releases.position[:, :2]), kind="stable")
    mass, radius = releases.mass_kg, releases.radius_m
    begin = np.searchsorted(records.run, np.arange(len(simulation) + 1))
    halves = 0.5 * mass, 0.5 * releases.inertia * mass * radius**2
    drag, count = releases.drag_per_m(simulation.settings.drag), 0
    while True:
        space.make_room(size, order.size + 1, count)
        done, count = walk(
            cells.x0_m, cells.y0_m, cells.size_m, cells.columns, cells.rows, ground.plan, ground.terrain_tree, order,
            begin, records.what, records.time_s, records.position, records.v2, records.omega2, records.v1,
            records.omega1, *halves, drag, simulation.settings.gravity_mps2, space.seen, space.runs, space.keys,
            space.values, count, *space.stacks,
        )  # fmt: skip
        space.runs += done + 1  # the next one has left traces
        order, size = order[done:], 2 * len(space.keys)
        if not order.size:
            break
    found = space.keys[:count].copy(), space.values[:count].copy()
    if spaces is not None:
        spaces.append(space)
    return found


class _Space:
    """Memory of the kernel that is used again: to take fresh memory costs more than to fill it.

    Attributes
    ----------
    keys, values : its passages.
    seen : (cells,) the last run in each, of all `runs` that were followed, from 1.
    stacks : of searches in the terrain.
    """

    def __init__(self, cells: int) -> None:
        from ..terrain.kernels import STACK_SIZE

        self.seen, self.runs = np.zeros(cells, np.int32), 0
        self.keys, self.values = np.empty(0, np.int32), np.empty((0, len(QUANTITIES)), np.float32)
        self.stacks = np.empty(STACK_SIZE, np.int64), np.empty(STACK_SIZE), np.empty(STACK_SIZE, np.int64)

    def make_room(self, passages: int, runs: int, filled: int) -> None:
        """For so many passages, of which some are there, and so many further runs."""
        if passages > len(self.keys):
            keys, values = np.empty(passages, np.int32), np.empty((passages, len(QUANTITIES)), np.float32)
            keys[:filled], values[:filled] = self.keys[:filled], self.values[:filled]
            self.keys, self.values = keys, values
        if self.runs + runs >= MOST_RUNS:
            self.seen[:], self.runs = 0, 0


def _cells_at(cells: Cells, simulation: Simulation) -> NDArray[np.intp]:
    """The cells in which blocks have come to rest."""
    places = simulation.position[simulation.at_rest, :2]
    column = np.floor((places[:, 0] - cells.x0_m) / cells.size_m).astype(np.intp)
    row = np.floor((places[:, 1] - cells.y0_m) / cells.size_m).astype(np.intp)
    within = (column >= 0) & (column < cells.columns) & (row >= 0) & (row < cells.rows)
    inside: NDArray[np.intp] = (row * cells.columns + column)[within]
    return inside

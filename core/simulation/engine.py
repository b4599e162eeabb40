# SPDX-License-Identifier: GPL-3.0-or-later
"""Blocks on the ground, all at once: each its own run, the same bits for any number of threads and batches."""

import os
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cache
from threading import Lock
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..constants import GRAVITY_MPS2
from ..errors import InputError
from ..impact_models.machinery.base import ImpactModel
from ..impact_models.machinery.measured import MeasuredRebounds
from ..impact_models.registry import find_model
from ..memory import available_bytes
from ..plausibility import GREATEST_SEED
from ..progress import Progress, silent
from ..reconstruction.drag import Drag
from ..vectors import Array, Indices, Mask
from .block_scale import step_of
from .ground import Ground
from .memory import check_records
from .parameter_draws import FRICTION_NAME, ParameterDraws, check_draws
from .release import Releases
from .structures import held_by
from .trees import Trees, in_cells
from .turns import take_turns

Rolling = Literal["azzoni_1995", "coulomb", "none"]
ROLLING: tuple[Rolling, ...] = ("none", "azzoni_1995", "coulomb")
"""In the order of the kernels' codes."""
Recorded = Literal["ends", "impacts", "all"]
RECORDED: tuple[Recorded, ...] = ("ends", "impacts", "all")
"""How each run begins and ends; also flights and impacts; also each step on the ground. In the kernels' order."""
FRICTION = 0.5
"""Coefficient of friction on the ground where none is given."""
ROOM: dict[Recorded, int] = {"ends": 8, "impacts": 64, "all": 256}
"""Records of one run that there is room for at first, among those of a batch."""
ENOUGH = 1000
"""So many runs tell how much memory all will need."""

STOPPED, LEFT_TERRAIN, LIMIT = "stopped", "left_terrain", "limit"
ENDS = (STOPPED, LEFT_TERRAIN, LIMIT)
RELEASED, IMPACT, ON_GROUND, FLIES_OFF, ENDED, TREE = range(6)
"""What a record is about, as the kernels write it."""


@dataclass(frozen=True)
class Settings:
    """What decides a simulation beside the ground and the releases.

    Attributes
    ----------
    model : name of the impact model.
    parameters : those of the model that are not to have their default, for all zones.
    measured : what a model that draws from measured impacts draws from; others do not look at it.
    zones : zone → parameters of its own there.
    rolling : how a block moves on the ground: Azzoni et al. 1995, Coulomb's sliding, or none, which stops it there.
    friction : coefficient μ of either; `zone_friction` where a zone has its own.
    draws : sets of which each run has one, in place of `parameters` and `friction`; what a zone has of its own stays.
    drag : in flight and on the ground; None for none.
    seed : of all random numbers.
    most_impacts, most_s : a run that is longer ends with "limit"; hits of trees count as well.
    trees : that blocks meet; None for none. Each run finds all of them standing.
    """

    model: str
    parameters: Mapping[str, object] = field(default_factory=dict)
    measured: MeasuredRebounds | None = None
    zones: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    rolling: Rolling = "azzoni_1995"
    friction: float = FRICTION
    zone_friction: Mapping[str, float] = field(default_factory=dict)
    draws: ParameterDraws | None = None
    gravity_mps2: float = GRAVITY_MPS2
    drag: Drag | None = None
    seed: int = 0
    most_impacts: int = 10_000
    most_s: float = 3600.0
    trees: Trees | None = None


@dataclass(frozen=True, eq=False)
class Records:
    """k moments of all runs, in the order of the runs and of time.

    Between two of them a block flies; before an `ON_GROUND` it keeps to the ground. A `TREE` that a block meets on the
    ground follows an `ON_GROUND` of the same moment. There, where all is recorded, its
    acceleration is nearly constant from v2 of the first to v1 of the second; `parabolas` follows it.

    Attributes
    ----------
    run : (k,) place of the run in the simulation, from 0.
    what : (k,) `RELEASED`, `IMPACT`, `ON_GROUND` (a step on the ground ends), `FLIES_OFF`, `ENDED` or `TREE` (a stem).
    time_s : (k,) since the release.
    position : (k, 3) of the centre, local [m].
    v2, omega2 : (k, 3) just after [m/s], [rad/s].
    v1, omega1 : (k, 3) just before.
    normal : (k, 3) from the contact to the centre.
    face : (k,) element of the ground: a triangle or, behind the last of them, a point; −1 for none. At a `TREE` its
        place among the trees.
    """

    run: Indices
    what: NDArray[np.int8]
    time_s: Array
    position: Array
    v2: Array
    omega2: Array
    v1: Array
    omega1: Array
    normal: Array
    face: Indices

    def __len__(self) -> int:
        return self.time_s.size


@dataclass(frozen=True, eq=False)
class Simulation:
    """What became of n blocks.

    Attributes
    ----------
    settings, releases, ground : what was simulated; of the releases those that were finished.
    end : (n,) place in `ends`.
    time_s, length_m, v_max_mps : (n,) until the end, of the path, the greatest speed.
    impacts : (n,) how many.
    tree_hits : (n,) how many stems each met.
    position : (n, 3) of the centre at the end, local [m].
    records : the moments that were asked for, releases and ends at least.
    wanted : how many blocks were asked for; more than n after a cancel.
    recorded : what `records` has, see `RECORDED`.
    seconds : how long it took.
    number : (n,) of each run, from 1, as tables say it; they rise.
    """

    settings: Settings
    ground: Ground
    releases: Releases
    end: Indices
    time_s: Array
    length_m: Array
    v_max_mps: Array
    impacts: Indices
    tree_hits: Indices
    position: Array
    records: Records
    wanted: int
    recorded: Recorded
    seconds: float
    number: Indices

    def __len__(self) -> int:
        return self.end.size

    @property
    def first_run(self) -> int:
        """Number of the first run, from 0."""
        return int(self.number[0]) - 1

    def place_of(self, number: Indices) -> Indices:
        """(k,) where the runs with these numbers (k,) are among all, from 0."""
        return np.searchsorted(self.number, number)

    @property
    def ends(self) -> tuple[str, ...]:
        """All ways to end: those of `ENDS`, and to be held by each of the structures."""
        return (*ENDS, *(f"structure:{name}" for name in self.ground.structures))

    @property
    def at_rest(self) -> Mask:
        """(n,) whether the block has stopped, on the ground or at a structure."""
        stopped: Mask = (self.end == ENDS.index(STOPPED)) | (self.end >= len(ENDS))
        return stopped

    def part(self, start: int, stop: int) -> "Simulation":
        """The runs from one place to another, as if they alone had been simulated."""
        rows = slice(*np.searchsorted(self.records.run, [start, stop]).tolist())
        columns = {name: getattr(self.records, name)[rows] for name in Records.__dataclass_fields__}
        own = {name: getattr(self, name)[start:stop] for name in _OF_RUNS}
        return replace(
            self,
            **own,
            releases=self.releases.take(slice(start, stop)),
            records=Records(**columns | {"run": columns["run"] - start}),
            wanted=len(own["end"]),
        )

    def with_records(self, record: Recorded) -> "Simulation":
        """The same, recorded with less: as if it had been simulated so."""
        what, level = self.records.what, RECORDED.index(record)
        if level >= RECORDED.index(self.recorded):
            return self
        kept = (what == RELEASED) | (what == ENDED)
        if record == "impacts":
            first = np.append(True, what[:-1] != ON_GROUND)
            kept |= (what == IMPACT) | (what == FLIES_OFF) | (what == TREE) | ((what == ON_GROUND) & first)
        columns = {name: getattr(self.records, name)[kept] for name in Records.__dataclass_fields__}
        return replace(self, records=Records(**columns), recorded=record)


AT_ONCE = 512
"""Runs that are best simulated and looked at together: the records of more leave the processor's cache."""


class RecordSpace:
    """Memory for the records of one simulation after the other: to take fresh memory costs more than to fill it."""

    def __init__(self) -> None:
        self.rows = np.empty((0, 0))


_OF_RUNS = ("end", "time_s", "length_m", "v_max_mps", "impacts", "tree_hits", "position", "number")


def simulate(
    ground: Ground,
    releases: Releases,
    settings: Settings,
    *,
    record: Recorded = "all",
    first_run: int = 0,
    runs: Indices | None = None,
    threads: int | None = None,
    space: RecordSpace | None = None,
    progress: Progress = silent,
) -> Simulation:
    """Let blocks fall.

    Parameters
    ----------
    first_run : number of the first of these runs, from 0. A run depends on its number and the seed, not on the others:
        runs 50 to 99 of a hundred blocks are those of the blocks 50 to 99 with the first run 50.
    runs : (n,) all their numbers, rising, where they do not follow one another.
    record : what to keep of the motion, see `RECORDED`; it changes nothing of the runs.
    threads : None takes all cores. The result does not depend on it.
    space : where the records go: one thread writes them there, run after run, and progress is not asked between. They
        are lost when it is used again.
    progress : called with the number of finished blocks. A `CancelledError` raised in it ends the simulation with the
        runs that are finished, from the first on without a gap; for that it goes on for up to `WINDOW_S` or one batch.

    Raises
    ------
    InputError : settings that cannot be; records that will not fit into the memory.
    """
    n = len(releases)
    numbers, friction = check_settings(ground, settings)
    model = find_model(settings.model)
    if not n:
        raise InputError("There is nothing to simulate: no block is released", advice="Give at least one release")
    ground.refuse_small(releases.radius_m)
    tree, zone = ground.tree, ground.zone_in_tree
    results = np.empty((n, 7))

    from .record_kernels import COLUMNS, in_turn

    progress("Compiling where needed, then simulating", 0, n)
    scales, scale = np.unique(step_of(releases.radius_m), return_inverse=True)
    facets, stems = ground.facets_at(scales.tolist()), in_cells(settings.trees)
    run_blocks = _compiled_runs(tree, facets, stems)
    columns = (
        releases.position, releases.velocity, releases.angular_velocity, releases.radius_m, releases.mass_kg,
        releases.inertia, releases.principal_kgm2, releases.drag_per_m(settings.drag),
    )  # fmt: skip
    blocks = [np.ascontiguousarray(column, dtype=np.float64) for column in columns]
    runs = np.arange(first_run, first_run + n) if runs is None else runs
    own = _own_rows(settings, len(ground.zones), runs)
    law, level = ROLLING.index(settings.rolling), RECORDED.index(record)
    room = ROOM[record]

    def recorded(part: Indices, rows: Array) -> tuple[Array, int]:
        """The records of some runs, one run after the other: in these rows, or in more of them; and how many."""
        ended = np.empty((part.size, 7))
        rows, count = run_blocks(
            tree, facets, scale[part], zone, model.compiled, numbers, friction, own[part], model.draws, part,
            runs[part], settings.seed, *(column[part] for column in blocks), settings.gravity_mps2, law,
            settings.most_impacts, settings.most_s, level, stems, ended, rows,
        )  # fmt: skip
        results[part] = ended
        return rows, count

    there, started, moments, whole = available_bytes(), time.perf_counter(), list[Array](), n

    def batch(part: Indices) -> int:
        rows, count = recorded(part, np.empty((room * part.size, COLUMNS)))
        moments.append(rows[:count].copy())
        return count

    so_many = 0

    def told(count: int, finished: int) -> None:
        nonlocal so_many
        so_many += count
        if finished >= ENOUGH:
            check_records(n, finished, so_many, there)
        progress("Simulating", finished, n)

    progress("Simulating", 0, n)
    if space is not None:
        if len(space.rows) < room * n:
            space.rows = np.empty((room * n, COLUMNS))
        space.rows, count = recorded(np.arange(n), space.rows)
        rows = space.rows[:count]
    else:
        cores = threads or os.process_cpu_count() or 1
        with ThreadPoolExecutor(cores) as pool:
            whole = take_turns(pool, cores, batch, releases.position[:, :2], told)
            begin = np.concatenate([[0], np.cumsum(results[:whole, 6].astype(np.intp))])
            rows = np.empty((begin[-1], COLUMNS))
            # Each batch is given up for its place among all, so that memory lasts.
            list(pool.map(lambda _: in_turn(moments.pop(), begin, rows), range(len(moments))))
    records = _records(rows, ground.element)
    end = results[:whole, 0].astype(np.intp)
    last = np.flatnonzero(records.what == ENDED)
    if ground.structures:
        stopped = np.flatnonzero(end == ENDS.index(STOPPED))
        held = held_by(ground, records.position[last[stopped]], releases.radius_m[stopped])
        end[stopped[held >= 0]] = len(ENDS) + held[held >= 0]
    return Simulation(
        settings, ground, releases.take(slice(0, whole)), end, results[:whole, 1], results[:whole, 3],
        results[:whole, 4], results[:whole, 2].astype(np.intp), results[:whole, 5].astype(np.intp),
        records.position[last], records, n, record, time.perf_counter() - started, runs[:whole] + 1,
    )  # fmt: skip


def joined(parts: Sequence[Simulation], releases: Releases) -> Simulation:
    """Parts of a simulation as one, in the order of the runs; `releases` are those of all."""
    own = {name: np.concatenate([getattr(part, name) for part in parts]) for name in _OF_RUNS}
    order = np.argsort(own["number"], kind="stable")
    place = np.argsort(order, kind="stable")
    begins = np.cumsum([0, *(len(part) for part in parts)]).tolist()
    run = np.concatenate([place[part.records.run + begin] for part, begin in zip(parts, begins, strict=False)])
    rows = np.argsort(run, kind="stable")
    columns = {
        name: np.concatenate([getattr(part.records, name) for part in parts])[rows]
        for name in Records.__dataclass_fields__
        if name != "run"
    }
    return replace(
        parts[0],
        releases=releases,
        records=Records(run=run[rows], **columns),
        wanted=sum(part.wanted for part in parts),
        seconds=sum(part.seconds for part in parts),
        **{name: values[order] for name, values in own.items()},
    )


def check_settings(ground: Ground, settings: Settings) -> tuple[Array, Array]:
    """(s·z, k) the model's numbers in each of z zones, and (s·z,) the friction, for each of s sets of drawn parameters.

    Raises
    ------
    InputError : settings that cannot be.
    """
    if settings.rolling not in ROLLING:
        raise InputError(f"There is no rolling law {settings.rolling!r}", advice=f"There are {', '.join(ROLLING)}")
    for what, value in (
        ("gravity", settings.gravity_mps2),
        ("limit of time", settings.most_s),
        ("limit of impacts", settings.most_impacts),
    ):
        if not (np.isfinite(value) and value > 0):
            raise InputError(f"The {what} is {value}", advice="Give a number above zero")
    if not 0 <= settings.seed <= GREATEST_SEED:
        raise InputError("The seed is out of range", advice=f"Give a whole number from 0 to {GREATEST_SEED} (2^63 - 1)")
    for name in (*settings.zones, *settings.zone_friction):
        if name not in ground.zones:
            raise InputError(f"There is no zone {name!r}", advice=f"There are {', '.join(ground.zones)}")
    model = find_model(settings.model)
    rows = [
        model.numbers({**settings.parameters, **settings.zones.get(name, {})}, settings.measured)
        for name in ground.zones
    ]
    friction = np.array([settings.zone_friction.get(name, settings.friction) for name in ground.zones])
    if not (np.isfinite(friction) & (friction >= 0)).all():
        raise InputError(f"The friction is {friction.min()}", advice="Give a number of zero or more")
    if settings.draws is None:
        return np.array(rows), friction
    return _drawn(settings, model, settings.draws, list(ground.zones), np.array(rows), friction)


def _drawn(
    settings: Settings, model: ImpactModel, draws: ParameterDraws, zones: list[str], rows: Array, friction: Array
) -> tuple[Array, Array]:
    """The rows of all sets: those of the zones, with what is drawn where a zone has none of its own."""
    check_draws(draws, model)
    all_rows, all_friction = np.tile(rows, (len(draws), 1, 1)), np.tile(friction, (len(draws), 1))
    place = {spec.name: i for i, spec in enumerate(model.parameters)}
    for name, column in zip(draws.names, draws.values.T, strict=True):
        for z, zone in enumerate(zones):
            if name == FRICTION_NAME:
                if zone not in settings.zone_friction:
                    all_friction[:, z] = column
            elif name not in settings.zones.get(zone, {}):
                all_rows[:, z, place[name]] = column
    return all_rows.reshape(-1, rows.shape[1]), all_friction.ravel()


def _own_rows(settings: Settings, zones: int, runs: Indices) -> Indices:
    """(n,) where the rows of each run begin among those of `check_settings`."""
    if settings.draws is None:
        return np.zeros(runs.size, dtype=np.intp)
    return settings.draws.set_of(settings.seed, runs) * zones


_COMPILING = Lock()
"""Of threads that begin together one compiles."""


@cache
def _compiled_for(tree_type: Any, facets_type: Any, stems_type: Any) -> Any:
    """`run_blocks` for one kind of ground, trees or none, and any model (a pointer to a function): compiled once."""
    from numba import types

    from ..impact_models.machinery.compilation import rebound_type
    from .motion_kernels import run_blocks

    numba_types: Any = types
    line, lines, whole, number = types.float64[::1], types.float64[:, ::1], types.intp, types.float64
    block = (lines, lines, lines, line, line, line, lines, line)
    run_blocks.disable_compile(False)
    run_blocks.compile(
        numba_types.Tuple((lines, types.int64))(
            tree_type, facets_type, types.intp[::1], types.int32[::1], rebound_type(), lines, line, types.intp[::1],
            whole, types.intp[::1], types.int64[::1], whole, *block, number, whole, whole, number, whole, stems_type,
            lines, lines,
        )
    )  # fmt: skip
    run_blocks.disable_compile()
    return run_blocks


def _compiled_runs(tree: Any, facets: Any, stems: Any) -> Any:
    import numba

    typeof: Any = numba.typeof
    with _COMPILING:
        return _compiled_for(typeof(tree), typeof(facets), typeof(stems))


def _records(rows: Array, element: NDArray[np.int32]) -> Records:
    place, what = rows[:, 21].astype(np.intp), rows[:, 1].astype(np.int8)
    met = what == TREE
    place[met] = -1
    face = np.where(place >= 0, element[place], -1)
    face[met] = rows[met, 21].astype(np.intp)
    return Records(
        run=rows[:, 0].astype(np.intp),
        what=what,
        time_s=rows[:, 2],
        position=rows[:, 3:6],
        v2=rows[:, 6:9],
        omega2=rows[:, 9:12],
        v1=rows[:, 12:15],
        omega1=rows[:, 15:18],
        normal=rows[:, 18:21],
        face=face,
    )

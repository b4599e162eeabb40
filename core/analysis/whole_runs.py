# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole runs, simulated against observed: can the observed ones come from the simulated ones?

Every observed run is compared with the simulated runs of its own release. Where they cross sections: time, place,
speed, height above the terrain, kinetic energy; on the stretch that was observed: impacts per metre, greatest speed and
height; and how far they get: how many reach each section, run-out, energy line and place of the stop.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..reconstruction.block import per_pick
from ..reconstruction.chains import find_segments
from ..reconstruction.flight import solve_flights
from ..remarks import Remark
from ..simulation.ground import Ground
from ..vectors import Array, Indices, Mask, Names, dot
from .paths import Paths, first_flights, observed_paths
from .ranks import FEWEST, RankTest, holm, rank_test, reach_test
from .sections import Axis, Section, axis_of, crossings, extremes, heights_at, impacts_apart, impacts_per_metre

if TYPE_CHECKING:
    from ..reconstruction.picks import Picks
    from ..reconstruction.trajectory import Reconstruction

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
SIGNIFICANT = 0.05
"""Of the probability that is corrected for the number of tests of a model."""
ERROR_DRAWS = 64
"""So many times the picks are moved by their errors, for the standard deviations of what is read off."""
SHORTEST_S = 0.2
"""Between two impacts that a person tells apart, where no observed ones say."""


@dataclass(frozen=True)
class Quantity:
    """What is compared.

    Attributes
    ----------
    name : in tables. title, unit : in figures and sentences. tested : else it says the same as another.
    """

    name: str
    title: str
    unit: str
    tested: bool = True


AT_SECTIONS = (
    Quantity("time_s", "time", "s"),
    Quantity("along_m", "place along it", "m"),
    Quantity("speed_mps", "speed", "m/s"),
    Quantity("height_m", "height", "m"),
    Quantity("kinetic_J", "kinetic energy", "J", tested=False),
)
OF_RUNS = (
    Quantity("impacts_per_m", "impacts per metre", "1/m"),
    Quantity("v_max_mps", "greatest speed", "m/s"),
    Quantity("height_max_m", "greatest height", "m"),
    Quantity("runout_m", "run-out", "m"),
    Quantity("energy_line_deg", "energy line", "°"),
    Quantity("stop_aside_m", "place of the stop", "m"),
)
REACH = Quantity("reach", "blocks that reach it", "")
QUANTITIES = {one.name: one for one in (*AT_SECTIONS, *OF_RUNS, REACH)}


@dataclass(frozen=True, eq=False)
class Observed:
    """Runs that were observed.

    Attributes
    ----------
    paths : each of a name of its own.
    from_impact : (n,) the release was not seen: the run is known from an impact on.
    moved : the same with all picks moved at random by their standard deviations; none where these are not known.
    """

    paths: Paths
    from_impact: Mask
    moved: tuple[Paths, ...] = ()


@dataclass(frozen=True, eq=False)
class Compared:
    """One quantity of one model, at a section (its name) or of whole runs ("").

    Attributes
    ----------
    observed, sigma : (n,) of each observed run, NaN where there is none; sigma is NaN where it is not known.
    count, quantiles : (n,) and (n, 5) of the simulated values of the same release, see `QUANTILES`.
    all_quantiles : (5,) of all simulated values of the releases with an observed one.
    test : None for a quantity that is not tested.
    p, p_holm : probability that the observed come from the simulated; the latter corrected for all tests of the model.
    """

    model: str
    section: str
    quantity: Quantity
    observed: Array
    sigma: Array
    count: Indices
    quantiles: Array
    all_quantiles: Array
    test: RankTest | None
    p: float
    p_holm: float = np.nan

    @property
    def n(self) -> int:
        """How many were observed."""
        return int(np.isfinite(self.observed).sum())

    @property
    def differs(self) -> bool:
        """Whether chance alone hardly gives such a difference."""
        return bool(self.p_holm < SIGNIFICANT)

    @property
    def verdict(self) -> str:
        """In words, with numbers."""
        if not self.quantity.tested:
            return "tested as speed"
        if np.isnan(self.p):
            what = "observed" if self.n < FEWEST else "with enough simulated"
            return f"too few {what} to tell ({self.test.n if self.test else self.n}, not {FEWEST})"
        if not self.differs:
            return f"no difference seen (p = {self.p:.2g})"
        if self.test is None:
            return f"differs (p = {self.p_holm:.2g})"
        lower = 100 * float(np.nanmedian(self.test.place))
        return f"differs (p = {self.p_holm:.2g}): the median observed is above {lower:.0f} % of the simulated"


@dataclass(frozen=True, eq=False)
class WholeRuns:
    """The comparison.

    Attributes
    ----------
    names : (n,) of the observed runs.
    observed : their paths. simulated : by model.
    sections, axis : see there.
    shortest_s : impacts nearer than this in time count as one, as they do in what was observed.
    compared : by model, section and quantity.
    """

    names: Names
    observed: Paths
    simulated: Mapping[str, Paths]
    sections: tuple[Section, ...]
    axis: Axis
    shortest_s: float
    compared: tuple[Compared, ...]

    def of(self, model: str) -> tuple[Compared, ...]:
        """What there is of a model."""
        return tuple(one for one in self.compared if one.model == model)

    def find(self, model: str, section: str, quantity: str) -> Compared:
        """One of them."""
        return next(one for one in self.of(model) if (one.section, one.quantity.name) == (section, quantity))


def observe_runs(reconstruction: "Reconstruction", ground: Ground, draws: int = ERROR_DRAWS, seed: int = 0) -> Observed:
    """The reconstructed trajectories, and what they would be had the picks' errors been others.

    Raises
    ------
    InputError : there is no flight.
    """
    paths = observed_paths(reconstruction)
    if not len(paths):
        raise InputError("There is no flight among the picks", advice="Give picks of blocks that fly")
    picks = reconstruction.picks
    kinds = picks.kind[reconstruction.flights.first_pick[first_flights(reconstruction)]]
    from_impact = np.asarray(kinds == "impact")
    if not (np.isfinite(picks.sigma_position_m) | np.isfinite(picks.sigma_time_s)).any():
        return Observed(paths, from_impact)
    nodes = _nodes(reconstruction, ground)
    drag = reconstruction.drag
    drag_per_m = None if drag is None else per_pick(picks, reconstruction.block, drag.per_metre)
    rng = np.random.default_rng(seed)
    moved = []
    for _ in range(draws):
        others = _moved(nodes, rng)
        flights = solve_flights(others, find_segments(others), reconstruction.gravity_mps2, drag_per_m)
        moved.append(observed_paths(replace(reconstruction, picks=others, flights=flights)))
    return Observed(paths, from_impact, tuple(moved))


def observe_stops(name: Names, start: Array, stop: Array, mass_kg: Array) -> Observed:
    """Runs of which only the start and the stop (n, 3) are known, local [m]."""
    n = len(name)
    none, still = np.zeros(n, dtype=np.bool_), np.zeros((n, 3))
    return Observed(
        Paths(
            name, mass_kg, stop, none, none, np.arange(n), none, np.zeros(n), np.zeros(n), start, start, still, still,
            np.zeros(n), np.zeros(0, dtype=np.intp), 1.0,
        ),
        none,
    )  # fmt: skip


def compare_runs(
    observed: Observed,
    simulated: Mapping[str, Paths],
    ground: Ground,
    sections: Sequence[Section],
    axis: Axis | None = None,
    seed: int = 0,
) -> WholeRuns:
    """Compare observed runs with the simulated runs of the same releases, model by model.

    Parameters
    ----------
    simulated : by model; the names of their releases are those of the observed runs.
    axis : None takes that of the observed runs.
    seed : of the observation errors that the simulated values are given, and of the test.

    Notes
    -----
    The standard deviation of an observed value is added to its simulated values as a random error, so that like is
    compared with like. What counts only on the observed stretch is read off the simulated runs on the same length in
    plan, or up to the same number of impacts. A stop counts only where it was observed; a block that leaves the terrain
    has its run-out there.
    """
    paths = observed.paths
    axis = axis or axis_of(paths)
    shortest = _shortest(paths)
    limits = _Limits(np.bincount(paths.run[paths.impact_piece], minlength=len(paths)), paths.length_m, shortest)
    values = _measure(paths, sections, axis, ground, limits)
    sigma = _sigma(observed, values, sections, axis, ground, limits)
    compared: list[Compared] = []
    for model, runs in simulated.items():
        own = [np.flatnonzero(runs.name == name) for name in paths.name]
        place = np.repeat(np.arange(len(paths)), [part.size for part in own])
        runs = runs.take(np.concatenate(own))
        their = _measure(runs, sections, axis, ground, limits.take(place))
        reach = [_reach(model, section, paths, runs, axis, place) for section in sections]
        found = [
            _compare(model, section, quantity, values[section, quantity], sigma[section, quantity], part, place, seed)
            for (section, quantity), part in their.items()
        ]
        corrected = holm(np.array([one.p for one in (*reach, *found)]))
        pairs = zip((*reach, *found), corrected.tolist(), strict=True)
        compared += [replace(one, p_holm=p) for one, p in pairs]
    return WholeRuns(paths.name, paths, dict(simulated), tuple(sections), axis, shortest, tuple(compared))


@dataclass(frozen=True, eq=False)
class _Limits:
    """(n,) impacts and metres in plan up to which runs were observed."""

    impacts: Indices
    length_m: Array
    shortest_s: float

    def take(self, rows: Indices) -> "_Limits":
        return _Limits(self.impacts[rows], self.length_m[rows], self.shortest_s)


def _measure(
    paths: Paths, sections: Sequence[Section], axis: Axis, ground: Ground, limits: _Limits
) -> dict[tuple[str, str], Array]:
    """Everything that is compared: (section, quantity) → (n,), NaN where there is none."""
    crossed = [crossings(paths, section, axis) for section in sections]
    heights = heights_at(ground, [one.position for one in crossed])
    values: dict[tuple[str, str], Array] = {}
    for section, one, height in zip(sections, crossed, heights, strict=True):
        square = dot(one.velocity, one.velocity)
        columns = (one.time_s, one.along_m, np.sqrt(square), height, 0.5 * paths.mass_kg * square)
        for quantity, column in zip(AT_SECTIONS, columns, strict=True):
            values[section.name, quantity.name] = column
    greatest = extremes(paths, limits.length_m, ground)
    seen: Mask = limits.impacts > 0
    way = paths.stop - paths.start[paths.first_piece[:-1]]
    flat = np.hypot(*way[:, :2].T)
    aside = np.where(paths.beyond, np.nan, axis.aside(paths.stop))
    columns_of_runs = (
        impacts_per_metre(paths, limits.impacts, limits.shortest_s),
        np.where(seen, greatest.v_max_mps, np.nan),
        np.where(seen, greatest.height_max_m, np.nan),
        flat,
        np.where(flat > 0, np.degrees(np.arctan2(-way[:, 2], flat)), np.nan),
        aside,
    )
    for quantity, column in zip(OF_RUNS, columns_of_runs, strict=True):
        values["", quantity.name] = column
    return values


def _sigma(
    observed: Observed,
    values: Mapping[tuple[str, str], Array],
    sections: Sequence[Section],
    axis: Axis,
    ground: Ground,
    limits: _Limits,
) -> dict[tuple[str, str], Array]:
    """(n,) standard deviations of the observed values, NaN where less than half of the moved runs have one."""
    if not observed.moved:
        return {key: np.full(column.size, np.nan) for key, column in values.items()}
    draws = [_measure(paths, sections, axis, ground, limits) for paths in observed.moved]
    sigma = {}
    for key, column in values.items():
        drawn = np.stack([draw[key] for draw in draws])
        enough = np.isfinite(column) & (2 * np.isfinite(drawn).sum(axis=0) >= len(draws))
        sigma[key] = np.full(column.size, np.nan)
        sigma[key][enough] = np.nanstd(drawn[:, enough], axis=0, ddof=1)
    return sigma


def _compare(
    model: str, section: str, name: str, observed: Array, sigma: Array, simulated: Array, place: Indices, seed: int
) -> Compared:
    """One quantity: observed (n,) against simulated (m,), of which each belongs to the observed one at `place` (m,)."""
    quantity = QUANTITIES[name]
    rng = np.random.default_rng([seed, len(section), len(name)])
    as_seen = simulated + np.nan_to_num(sigma)[place] * rng.standard_normal(simulated.size)
    borders = np.searchsorted(place, np.arange(1, len(sigma)))
    parts = [part[np.isfinite(part)] for part in np.split(simulated, borders)]
    known = np.isfinite(observed)
    test = rank_test(observed, np.split(as_seen, borders), seed) if quantity.tested else None
    some = [part for part, there in zip(parts, known.tolist(), strict=True) if there]
    together = np.concatenate(some) if some else np.zeros(0)
    return Compared(
        model, section, quantity, observed, sigma, np.array([part.size for part in parts]),
        np.stack([_quantiles(part) for part in parts]), _quantiles(together), test, test.p if test else np.nan,
    )  # fmt: skip


def _reach(model: str, section: Section, paths: Paths, runs: Paths, axis: Axis, place: Indices) -> Compared:
    """How many blocks reach a section: 1 for each observed one that does, 0 for one that stops before."""
    own, their = crossings(paths, section, axis), crossings(runs, section, axis)
    stayed = paths.whole & np.isfinite(paths.stop[:, 0]) & ~own.crosses & ~own.given
    number = np.bincount(place, minlength=len(paths))
    share = (np.bincount(place, their.crosses, len(paths)) + 1) / (number + 2)
    known = own.crosses | stayed
    among = ~own.given & (number > 0) & (paths.length_m > 0)
    p = reach_test(own.crosses[among], stayed[among], share[among]) if known.sum() >= FEWEST else np.nan
    observed = np.where(known, own.crosses.astype(np.float64), np.nan)
    nothing = np.full((len(paths), len(QUANTILES)), np.nan)
    nothing[:, 2] = np.bincount(place, their.crosses, len(paths)) / np.maximum(number, 1)
    mean = np.full(len(QUANTILES), np.nan)
    mean[2] = nothing[among, 2].mean() if among.any() else np.nan
    return Compared(model, section.name, REACH, observed, np.full(len(paths), np.nan), number, nothing, mean, None, p)


def _quantiles(values: Array) -> Array:
    return np.asarray(np.quantile(values, QUANTILES)) if values.size else np.full(len(QUANTILES), np.nan)


def _shortest(paths: Paths) -> float:
    """The shortest time between impacts that were told apart [s]."""
    piece = paths.impact_piece
    apart = impacts_apart(paths, 0.0)
    run, time = paths.run[piece][apart], (paths.time_s + paths.duration_s)[piece][apart]
    gaps = np.diff(time)[run[1:] == run[:-1]]
    return float(gaps.min()) if gaps.size else SHORTEST_S


def _nodes(reconstruction: "Reconstruction", ground: Ground) -> "Picks":
    """The picks at the places that the flights join."""
    from ..reconstruction.motion import GROUNDED, block_centres
    from ..reconstruction.placement import pick_normals

    picks = reconstruction.picks
    if reconstruction.ends == "contacts":
        return picks
    radius = per_pick(picks, reconstruction.block, lambda one: one.radius_m)
    normals = pick_normals(picks, ground.surface, 2 * radius, None, np.isin(picks.kind, GROUNDED))
    return block_centres(picks, normals, radius)


def _moved(picks: "Picks", rng: np.random.Generator) -> "Picks":
    """The picks with other errors; the times keep their order."""
    n = len(picks)
    gap = np.diff(picks.time_s, prepend=-np.inf, append=np.inf)
    gap[picks.group_starts] = np.inf
    room = 0.45 * np.minimum(gap[:-1], gap[1:])
    late = np.nan_to_num(picks.sigma_time_s) * rng.standard_normal(n)
    off = np.nan_to_num(picks.sigma_position_m)[:, None] * rng.standard_normal((n, 3))
    return replace(picks, time_s=picks.time_s + np.clip(late, -room, room), position=picks.position + off)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs that were observed: reconstructed from picks, with what errors may change, or known by their stops alone."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..reconstruction.block import per_pick
from ..reconstruction.chains import find_segments
from ..reconstruction.flight import solve_flights
from ..simulation.ground import Ground
from ..vectors import Array, Mask, Names
from .paths import Paths, first_flights, observed_paths

if TYPE_CHECKING:
    from ..reconstruction.picks import Picks
    from ..reconstruction.trajectory import Reconstruction

ERROR_DRAWS = 64
"""So many times the picks are moved by their errors, for the standard deviations of what is read off."""


@dataclass(frozen=True, eq=False)
class Observed:
    """Runs that were observed.

    Attributes
    ----------
    paths : each of a name of its own.
    from_impact : (n,) the release was not seen: the run is known from an impact on.
    moved : the same with all picks moved at random by their standard deviations; none where these are not known.
    errors_known : (n,) whether they are, of each run; None for all or, without `moved`, none.
    """

    paths: Paths
    from_impact: Mask
    moved: tuple[Paths, ...] = ()
    errors_known: Mask | None = None


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
    from_impact = np.asarray(kinds != "release")
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


def join_observed(parts: Sequence[Observed]) -> Observed:
    """All runs of several sources.

    Raises
    ------
    InputError : runs of two sources have one name.
    """
    if len(parts) == 1:
        return parts[0]
    names = Counter(name for one in parts for name in dict.fromkeys(one.paths.name.tolist()))
    for name in (name for name, number in names.items() if number > 1):
        raise InputError(f"Observed runs of two sources are called {name}", advice="Rename them in one of the sources")
    draws = max(len(one.moved) for one in parts)
    known = np.concatenate([np.full(len(one.paths), bool(one.moved)) for one in parts])
    return Observed(
        Paths.joined([one.paths for one in parts]),
        np.concatenate([one.from_impact for one in parts]),
        tuple(
            Paths.joined([one.moved[i % len(one.moved)] if one.moved else one.paths for one in parts])
            for i in range(draws)
        ),
        known,
    )


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

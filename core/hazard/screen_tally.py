# SPDX-License-Identifier: GPL-3.0-or-later
"""What passes screens over many runs: how many blocks, how many hits, and a fair sample of these."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..simulation.convergence import Quantile, quantile
from ..simulation.engine import Simulation
from ..vectors import Array, Indices, Mask
from .screens import HELD, OUTCOMES, Screen, ScreenHits, blocks_at, hits_at
from .tally import Arrays

MOST_KEPT = 2_000_000
"""Hits that are kept of all screens together; of more, a sample by chance that depends on the runs' numbers only."""
PLACES = 100
"""Parts of a screen's length in which hits are counted."""


SHARES = (0.5, 0.95, 0.99)
"""Of the quantiles that are told."""


@dataclass(frozen=True)
class Known:
    """What is known of a quantity: its mean, greatest value, and quantiles at `SHARES` with their intervals."""

    mean: float
    greatest: float
    quantiles: tuple[Quantile, ...]

    def quantile(self, share: float) -> Quantile:
        """One of the quantiles."""
        return next(one for one in self.quantiles if one.share == share)


@dataclass(frozen=True, eq=False)
class ScreenFigures:
    """What is known of one screen, of all blocks that come there without barriers or with them.

    Attributes
    ----------
    screen : which.
    blocks : released.
    reach : of them, that come to the screen at least once.
    hits : crossings, those of a block that comes again included.
    outcomes : outcome → how many hits.
    along : (PLACES,) hits by place along the screen.
    speed_mps, energy_j, height_m : of the blocks that come, of each its greatest; None where there is none. The energy
        is that of translation and rotation, the height that of the centre vertically above the terrain. The intervals
        are of blocks, and those from one place of release are not taken as independent.
    angle_deg : of the hits, to the screen's normal.
    sample : the hits that these are known from: all of them, unless they are more than are kept.
    """

    screen: Screen
    blocks: int
    reach: int
    hits: int
    outcomes: Mapping[str, int]
    along: NDArray[np.int64]
    speed_mps: Known | None
    energy_j: Known | None
    height_m: Known | None
    angle_deg: Known | None
    sample: ScreenHits

    @property
    def share(self) -> float:
        """Of the released blocks that come to the screen."""
        return self.reach / self.blocks if self.blocks else np.nan

    @property
    def beyond(self) -> float:
        """The share of the released blocks that go on beyond a barrier, over it or through it, each at most once.

        1 − held/reached for blocks that come once, which nearly all do.
        """
        going = self.hits - self.outcomes[OUTCOMES[HELD]]
        return min(going, self.reach) / self.blocks if self.blocks else np.nan


class ScreenTally:
    """The hits of some screens; see `Tally`."""

    def __init__(self, screens: Sequence[Screen]) -> None:
        self.screens = tuple(screens)
        self.blocks = 0
        k = len(self.screens)
        self._counts = np.zeros((2, k, 2 + len(OUTCOMES)), np.int64)  # all, those that reach: blocks, hits, outcomes
        self._along = np.zeros((2, k, PLACES), np.int64)
        self._kept: list[ScreenHits] = []

    def empty(self) -> "ScreenTally":
        """One for the same screens without hits."""
        return ScreenTally(self.screens)

    def add(self, simulation: Simulation) -> None:
        """Count the runs of a simulation that recorded all."""
        self.blocks += len(simulation)
        if not self.screens:
            return
        hits = hits_at(simulation, self.screens)
        for which, own in enumerate((np.ones(len(hits), np.bool_), hits.reaches)):
            some = hits.take(own)
            for place, screen in enumerate(self.screens):
                at = some.take(some.screen == place)
                counts = np.bincount(at.outcome, minlength=len(OUTCOMES))
                self._counts[which, place] += [np.unique(at.number).size, len(at), *counts.tolist()]
                part = np.minimum((at.along_m / screen.length_m * PLACES).astype(np.intp), PLACES - 1)
                self._along[which, place] += np.bincount(np.maximum(part, 0), minlength=PLACES)
        self._keep(hits)

    def merge(self, other: "ScreenTally") -> None:
        """Count what another one of the same screens has counted."""
        if not _same(self.screens, other.screens):
            raise InputError("Hits of other screens cannot be added", advice="Add those of one simulation")
        self.blocks += other.blocks
        self._counts += other._counts
        self._along += other._along
        for hits in other._kept:
            self._keep(hits)

    def arrays(self) -> Arrays:
        """All that it knows."""
        hits = self.hits
        return {
            "blocks": np.array([self.blocks]),
            "counts": self._counts,
            "along": self._along,
            "line": np.concatenate([np.zeros((0, 2)), *(screen.line for screen in self.screens)]),
            "points": np.array([len(screen.line) for screen in self.screens], np.int64),
            "name": np.array([screen.name for screen in self.screens], np.str_),
            "height_m": np.array([screen.height_m for screen in self.screens]),
            "capacity_j": np.array([np.nan if s.capacity_j is None else s.capacity_j for s in self.screens]),
            **{f"hit_{name}": getattr(hits, name) for name in ScreenHits.__dataclass_fields__},
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Self:
        """What `arrays` gave."""
        lines = np.split(arrays["line"], np.cumsum(arrays["points"])[:-1]) if arrays["points"].size else []
        capacity = [None if np.isnan(value) else value for value in arrays["capacity_j"].tolist()]
        rows = zip(arrays["name"].tolist(), lines, arrays["height_m"].tolist(), capacity, strict=True)
        made = cls([Screen(*row) for row in rows])
        made.blocks = int(arrays["blocks"][0])
        made._counts, made._along = arrays["counts"].copy(), arrays["along"].copy()
        made._kept = [ScreenHits(**{name: arrays[f"hit_{name}"] for name in ScreenHits.__dataclass_fields__})]
        return made

    @property
    def hits(self) -> ScreenHits:
        """The hits that are kept, in the order of the runs and of time."""
        self._kept = [_sampled(_joined(self._kept))]
        return self._kept[0]

    def figures(self, *, with_barriers: bool = False) -> tuple[ScreenFigures, ...]:
        """What is known of each screen: of what comes there without barriers, or with them."""
        which, hits = int(with_barriers), self.hits
        if with_barriers:
            hits = hits.take(hits.reaches)
        found = []
        for place, screen in enumerate(self.screens):
            at, counts = hits.take(hits.screen == place), self._counts[which, place].tolist()
            blocks = blocks_at(at)
            found.append(
                ScreenFigures(
                    screen,
                    self.blocks,
                    counts[0],
                    counts[1],
                    dict(zip(OUTCOMES, counts[2:], strict=True)),
                    self._along[which, place],
                    _known(blocks.speed_mps, blocks.place),
                    _known(blocks.energy_j, blocks.place),
                    _known(blocks.up_m, blocks.place),
                    _known(np.degrees(at.angle)),
                    at,
                )
            )
        return tuple(found)

    def _keep(self, hits: ScreenHits) -> None:
        self._kept.append(hits)
        if sum(len(one) for one in self._kept) > 2 * MOST_KEPT:
            self._kept = [_sampled(_joined(self._kept))]


def _same(a: Sequence[Screen], b: Sequence[Screen]) -> bool:
    return len(a) == len(b) and all(
        one.name == other.name
        and np.array_equal(one.line, other.line)
        and (one.height_m, one.capacity_j) == (other.height_m, other.capacity_j)
        for one, other in zip(a, b, strict=True)
    )


def _joined(parts: Sequence[ScreenHits]) -> ScreenHits:
    if not parts:
        none, three = np.zeros(0), np.zeros((0, 3))
        return ScreenHits(
            np.zeros(0, np.int16), np.zeros(0, np.int64), none, three, three, none, none, none, none, none, none,
            np.zeros(0, np.int8), np.zeros(0, np.bool_), np.zeros(0, np.intp),
        )  # fmt: skip
    return ScreenHits(
        **{name: np.concatenate([getattr(one, name) for one in parts]) for name in ScreenHits.__dataclass_fields__}
    )


def _sampled(hits: ScreenHits) -> ScreenHits:
    """In the order of the runs; of too many those of the runs that chance takes: the same whatever came first."""
    if len(hits) > MOST_KEPT:
        chance = _chance(hits.number)
        limit = np.partition(chance, MOST_KEPT)[MOST_KEPT]
        hits = hits.take(chance < limit)  # all hits of a run, or none
    return hits.take(np.lexsort((hits.screen, hits.time_s, hits.number)))


def _chance(number: NDArray[np.int64]) -> NDArray[np.uint64]:
    """A whole number by chance for each run (SplitMix64, Steele et al. 2014)."""
    z = number.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


def held(hits: ScreenHits) -> Mask:
    """(h,) where blocks end at a barrier."""
    return (hits.outcome == HELD) & hits.reaches


def _known(values: Array, place: Indices | None = None) -> Known | None:
    there = np.isfinite(values)
    values = values[there]
    if not values.size:
        return None
    cluster = None if place is None else place[there]
    quantiles = tuple(quantile(values, share, cluster) for share in SHARES)
    return Known(float(values.mean()), float(values.max()), quantiles)

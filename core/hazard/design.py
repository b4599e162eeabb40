# SPDX-License-Identifier: GPL-3.0-or-later
"""From what comes to a screen to what a barrier there must hold: characteristic values times partial factors."""

from dataclasses import dataclass, replace
from math import ceil, inf, isfinite, nan, prod
from typing import Literal, get_args

import numpy as np

from ..errors import InputError
from ..simulation.convergence import Quantile, fewest, quantile, values_needed
from ..vectors import Array
from .screen_tally import ScreenTally
from .screens import Screen, ScreenHits, blocks_at

On = Literal["speed", "mass", "energy", "height", "capacity"]
ON: tuple[On, ...] = get_args(On)
"""What a factor multiplies: actions, and last what a barrier must have more than they ask for."""
SHARES = (0.95, 0.99)
"""Usual shares of the blocks that characteristic values are not exceeded by."""
LEVELS_KJ = (100.0, 250.0, 500.0, 1000.0, 1500.0, 2000.0, 3000.0, 4500.0)
"""Maximum energy levels of the classes 0 to 7 of EAD 340059-00-0106 (ETAG 027); class 8 is everything above."""
LEAST_DIFFERENT = 0.9
"""Part of the blocks that must differ for them to be a sample."""
KNOWN_TO = 0.05
"""A value is known when half its interval is not more than this part of it."""
SURE = 0.95
"""Probability that a number of further blocks brings as many to the screen as are needed."""

Verdict = Literal["enough", "not_enough", "not_known"]


@dataclass(frozen=True)
class Factor:
    """A partial factor.

    Attributes
    ----------
    symbol, meaning, source : of the standard; where the value is from.
    on : one of `ON`.
    value : NaN where it is still to be given.
    verified : false where nobody has compared the value with the standard or with a source that may be cited.
    """

    symbol: str
    on: On
    value: float
    meaning: str = ""
    source: str = ""
    verified: bool = True


@dataclass(frozen=True)
class PartialFactors:
    """A table of partial factors.

    Attributes
    ----------
    title, note : what it is; what to know of it.
    share : of the blocks that do not exceed the characteristic values.
    clearance_m : least free height of a barrier above the design height [m]; the block's radius where that is more.
    factors : several for one quantity multiply.
    """

    title: str
    note: str
    share: float
    clearance_m: float
    factors: tuple[Factor, ...]

    def product(self, on: On) -> float:
        """What a quantity is multiplied by.

        Raises
        ------
        InputError : a factor that has no value.
        """
        for factor in self.factors:
            if factor.on == on and not isfinite(factor.value):
                raise InputError(
                    f"{factor.symbol} of {self.title} has no value",
                    advice="Copy the table, write it there, and give the copy: --factors FILE",
                )
        return prod(factor.value for factor in self.factors if factor.on == on)

    def unverified(self, *on: On) -> tuple[Factor, ...]:
        """The factors on some quantities that are not verified and change the result."""
        return tuple(one for one in self.factors if one.on in on and not one.verified and one.value != 1.0)


@dataclass(frozen=True)
class More:
    """What would tell what is not known yet.

    Attributes
    ----------
    blocks : so many further ones are to be released.
    elsewhere : each from a place of its own, as in an area; else from the same places.
    """

    blocks: int
    elsewhere: bool = False


@dataclass(frozen=True)
class DesignValues:
    """What a barrier at a screen must have, as far as it is known.

    Attributes
    ----------
    screen, factors : for which.
    blocks, reach, hits : released, of them that come there, how often.
    released_from, places : places from which blocks were released, and from which some come; see `Releases`.
    speed_mps, energy_j, translation_j, height_m : characteristic values with their intervals, of the blocks that come,
        of each its greatest. The energy is that of translation and rotation, beside it that of translation alone; the
        height is that of the centre vertically above the terrain.
    different : how many of the blocks differ from all others. Models without chance give the same run to the same
        release again and again: then blocks are no sample, and nothing is known of their intervals.
    radius_m : of the blocks that come, the same quantile [m].
    clearance_m : free height above the design height [m].
    least_share : of the blocks that come there, at least this with the probability `SURE`.

    Notes
    -----
    Design values, what is needed and the verdict are of the upper ends of the intervals, so that chance in the
    simulation does not make a barrier too weak. Where an upper end is not known they are NaN, and there is no verdict.
    """

    screen: Screen
    factors: PartialFactors
    blocks: int
    released_from: int
    places: int
    reach: int
    hits: int
    speed_mps: Quantile
    energy_j: Quantile
    translation_j: Quantile
    height_m: Quantile
    different: int
    radius_m: float
    clearance_m: float
    least_share: float

    @property
    def design_speed_mps(self) -> float:
        """The upper end of the speed times its factors [m/s]."""
        return self.speed_mps.high * self.factors.product("speed")

    @property
    def design_energy_j(self) -> float:
        """The upper end of the energy times the factors of the mass, of the energy and, squared, of the speed [J]."""
        return self.energy_j.high * self._on_energy

    @property
    def design_height_m(self) -> float:
        """The upper end of the height times its factors [m]."""
        return self.height_m.high * self.factors.product("height")

    @property
    def needed_energy_j(self) -> float:
        """What the capacity of the barrier must be [J]."""
        return self.design_energy_j * self.factors.product("capacity")

    @property
    def needed_height_m(self) -> float:
        """What the height of the barrier must be [m]."""
        return self.design_height_m + self.clearance_m

    @property
    def least_needed_energy_j(self) -> float:
        """The same as `needed_energy_j` of the lower end: surely needed."""
        return self.energy_j.low * self._on_energy * self.factors.product("capacity")

    @property
    def least_needed_height_m(self) -> float:
        """The same as `needed_height_m` of the lower end: surely needed."""
        return self.height_m.low * self.factors.product("height") + self.clearance_m

    @property
    def _on_energy(self) -> float:
        of = self.factors
        return of.product("mass") * of.product("speed") ** 2 * of.product("energy")

    @property
    def level_kj(self) -> float:
        """The lowest maximum energy level that is enough [kJ]; NaN above all of them, and where it is not known."""
        return next((level for level in LEVELS_KJ if 1000 * level >= self.needed_energy_j), nan)

    @property
    def level(self) -> int | None:
        """Class of that level, from 0; 8 above all of them; None where it is not known."""
        if not isfinite(self.needed_energy_j):
            return None
        return next((i for i, level in enumerate(LEVELS_KJ) if 1000 * level >= self.needed_energy_j), len(LEVELS_KJ))

    @property
    def is_sample(self) -> bool:
        """Whether nearly all blocks differ."""
        return self.different >= LEAST_DIFFERENT * self.reach

    @property
    def is_known(self) -> bool:
        """Whether the blocks are enough for an upper bound of all characteristic values."""
        return all(isfinite(one.high) for one in (self.speed_mps, self.energy_j, self.height_m))

    @property
    def known_to(self) -> float:
        """How well energy and height are known: half the interval as a part of the value, of the less known one."""
        return max(self.energy_j.known_to, self.height_m.known_to)

    @property
    def verdict(self) -> Verdict | None:
        """Whether the barrier that stands there is enough; None for a screen that only measures.

        It is enough when it has what the upper ends ask for. It is not enough when it lacks what even the lower ends
        ask for, or what the upper ends ask for once these are known to `KNOWN_TO`.
        """
        if self.screen.capacity_j is None:
            return None
        if self.is_known and not self._lacking(self.needed_energy_j, self.needed_height_m):
            return "enough"
        if self._lacking(self.least_needed_energy_j, self.least_needed_height_m):
            return "not_enough"
        return "not_enough" if self.is_known and self.known_to <= KNOWN_TO else "not_known"

    def _lacking(self, energy_j: float, height_m: float) -> bool:
        return (self.screen.capacity_j or 0.0) < energy_j or self.screen.height_m < height_m

    @property
    def faults(self) -> tuple[str, ...]:
        """Why the barrier that stands there is not enough; empty where it is, where that is not known, and for a screen
        that only measures."""
        if self.verdict != "not_enough":
            return ()
        found, capacity = [], self.screen.capacity_j or 0.0
        energy, least = self.needed_energy_j, self.least_needed_energy_j
        if capacity < energy or capacity < least:
            needed = f"{energy / 1000:.4g} kJ" if isfinite(energy) else f"{least / 1000:.4g} kJ or more"
            found.append(f"its capacity of {capacity / 1000:.4g} kJ is below the needed {needed}")
        height, least = self.needed_height_m, self.least_needed_height_m
        if self.screen.height_m < height or self.screen.height_m < least:
            needed = f"{height:.2f} m" if isfinite(height) else f"{least:.2f} m or more"
            found.append(f"its height of {self.screen.height_m:.4g} m is below the needed {needed}")
        return tuple(found)

    @property
    def more(self) -> More | None:
        """What would tell what is not known; None where all is, and where no number of blocks tells it.

        What is to be known: an upper bound of each value, the verdict on a barrier, at a screen without one energy and
        height to `KNOWN_TO`.
        """
        if not self.is_sample:
            return None
        asked = [(one, fewest(one.share) / one.effective) for one in self._values if not isfinite(one.high)]
        asked += self._to_tell()
        asked = [(one, times) for one, times in asked if times > 1]
        if not asked:
            return None
        further = max(values_needed(one, times) for one, times in asked)
        if isfinite(further):
            return More(ceil((further - 1) * self.reach / self.least_share))
        return More(ceil(max(times * one.effective for one, times in asked) / self.least_share), elsewhere=True)

    @property
    def _values(self) -> tuple[Quantile, ...]:
        return self.speed_mps, self.energy_j, self.height_m

    def _to_tell(self) -> list[tuple[Quantile, float]]:
        """How many times as many independent values the verdict takes, or a value at a screen without a barrier."""
        limits = (inf, inf)
        if self.screen.capacity_j is not None:
            if self.verdict != "not_known":
                return []
            limits = (
                self.screen.capacity_j / (self._on_energy * self.factors.product("capacity")),
                (self.screen.height_m - self.clearance_m) / self.factors.product("height"),
            )
        found = []
        for one, limit in zip((self.energy_j, self.height_m), limits, strict=True):
            high = one.high if isfinite(one.high) else 2 * one.value - one.low  # as far up as down, until it is known
            exact = ((high - one.low) / 2 / one.value / KNOWN_TO) ** 2 if one.value else 0.0
            if one.low <= limit < high and isfinite(limit):
                end, away = (high if limit >= one.value else one.low), abs(limit - one.value)
                found.append((one, min(((end - one.value) / away) ** 2 if away else inf, exact)))
            elif self.screen.capacity_j is None and self.is_known:
                found.append((one, exact))
        return found


def _least_share(reach: Array, blocks: int, released_from: int) -> float:
    """Of the blocks, at least this share comes to a screen, with the probability `SURE` (Clopper and Pearson).

    Parameters
    ----------
    reach : (p,) blocks that come, of each place from which some do; the others of `released_from` have none.
    """
    from scipy import stats

    n, came = float(blocks), float(reach.sum())
    if 1 < released_from < blocks:
        part = np.zeros(released_from)
        part[: reach.size] = reach * released_from / blocks
        variance = float(part.var(ddof=1)) / released_from
        share = came / n
        if variance > 0:
            n = min(n, max(share * (1 - share) / variance, 1.0))
            came = n * share
    return float(stats.beta.ppf(1 - SURE, came, n - came + 1))


def design_values(
    screen: Screen,
    hits: ScreenHits,
    factors: PartialFactors,
    blocks: int,
    share: float | None = None,
    released_from: int | None = None,
) -> DesignValues:
    """What a barrier at a screen must have.

    Parameters
    ----------
    hits : of this screen, or a sample of them.
    blocks : that were released.
    share : of the blocks that do not exceed the characteristic values; None takes that of the factors.
    released_from : places from which blocks were released; None takes those from which some come.

    Raises
    ------
    InputError : no block comes to the screen, a factor without a value.
    """
    share = factors.share if share is None else share
    if not len(hits):
        raise InputError(
            f"None of {blocks} blocks comes to {screen.name!r}: there is nothing to design for",
            advice="Draw the screen where blocks pass, or release more",
        )
    for on in ON:
        factors.product(on)
    each = blocks_at(hits)
    columns = (each.speed_mps, each.energy_j, each.kinetic_j, np.nan_to_num(each.up_m, nan=0.0))
    known = tuple(quantile(values, share, each.place) for values in columns)
    different = int(np.unique(each.energy_j).size)
    if different < LEAST_DIFFERENT * len(each):
        known = tuple(replace(one, low=nan, high=nan) for one in known)
    speed, energy, translation, height = known
    radius = float(np.quantile(each.radius_m, share))
    reach = np.unique(each.place, return_counts=True)[1].astype(np.float64)
    places = int(reach.size)
    released_from = places if released_from is None else released_from
    return DesignValues(
        screen,
        factors,
        blocks,
        released_from,
        places,
        len(each),
        len(hits),
        speed,
        energy,
        translation,
        height,
        different,
        radius,
        max(factors.clearance_m, radius),
        _least_share(reach, blocks, released_from),
    )


NO_FACTORS = PartialFactors("none", "The characteristic values themselves, without any margin.", 0.95, 0.0, ())


def design_of(
    tally: ScreenTally,
    factors: PartialFactors = NO_FACTORS,
    share: float | None = None,
    released_from: int | None = None,
) -> dict[str, DesignValues]:
    """Screen → what a barrier there must have, for those that blocks come to; see `design_values`.

    What comes to a screen is what the barriers above it do not hold; to a barrier itself come all of these.
    """
    hits, found = tally.hits, {}
    hits = hits.take(hits.reaches)
    for place, screen in enumerate(tally.screens):
        own = hits.take(hits.screen == place)
        if len(own):
            found[screen.name] = design_values(screen, own, factors, tally.blocks, share, released_from)
    return found

# SPDX-License-Identifier: GPL-3.0-or-later
"""From what comes to a screen to what a barrier there must hold: characteristic values times partial factors."""

from dataclasses import dataclass, replace
from math import isfinite, nan, prod
from typing import Literal, get_args

import numpy as np

from ..errors import InputError
from ..simulation.convergence import Quantile, quantile
from ..vectors import norm
from .screens import Screen, ScreenHits

On = Literal["speed", "mass", "energy", "height", "capacity"]
ON: tuple[On, ...] = get_args(On)
"""What a factor multiplies: actions, and last what a barrier must have more than they ask for."""
SHARES = (0.95, 0.99)
"""Usual shares of the hits that characteristic values are not exceeded by."""
LEVELS_KJ = (100.0, 250.0, 500.0, 1000.0, 1500.0, 2000.0, 3000.0, 4500.0)
"""Maximum energy levels of the classes 0 to 7 of EAD 340059-00-0106 (ETAG 027); class 8 is everything above."""
LEAST_DIFFERENT = 0.9
"""Part of the hits that must differ for them to be a sample."""


@dataclass(frozen=True)
class Factor:
    """A partial factor.

    Attributes
    ----------
    symbol, meaning, source : of the standard; where the value is from.
    on : one of `ON`.
    value : NaN where it is still to be given.
    """

    symbol: str
    on: On
    value: float
    meaning: str = ""
    source: str = ""


@dataclass(frozen=True)
class PartialFactors:
    """A table of partial factors.

    Attributes
    ----------
    title, note : what it is; what to know of it.
    share : of the hits that do not exceed the characteristic values.
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


@dataclass(frozen=True)
class DesignValues:
    """What a barrier at a screen must have.

    Attributes
    ----------
    screen, factors : for which.
    blocks, reach, hits : released, of them that come there, how often.
    speed_mps, energy_j, height_m : characteristic values with their intervals. The energy is that of translation and
        rotation, the height that of the centre vertically above the terrain.
    different : how many of the hits differ from all others. Models without chance give the same run to the same release
        again and again: then hits are no sample, and nothing is known of their intervals.
    radius_m : of the blocks that come, the same quantile [m].
    design_speed_mps, design_energy_j, design_height_m : times their factors; the energy times those of the mass and,
        squared, of the speed as well.
    clearance_m : free height above the design height [m].
    needed_energy_j, needed_height_m : of the barrier: what its capacity and height must be.
    """

    screen: Screen
    factors: PartialFactors
    blocks: int
    reach: int
    hits: int
    speed_mps: Quantile
    energy_j: Quantile
    height_m: Quantile
    different: int
    radius_m: float
    design_speed_mps: float
    design_energy_j: float
    design_height_m: float
    clearance_m: float
    needed_energy_j: float
    needed_height_m: float

    @property
    def level_kj(self) -> float:
        """The lowest maximum energy level that is enough [kJ]; NaN above all of them."""
        return next((level for level in LEVELS_KJ if 1000 * level >= self.needed_energy_j), nan)

    @property
    def level(self) -> int:
        """Class of that level, from 0; 8 above all of them."""
        return next((i for i, level in enumerate(LEVELS_KJ) if 1000 * level >= self.needed_energy_j), len(LEVELS_KJ))

    @property
    def is_sample(self) -> bool:
        """Whether nearly all hits differ."""
        return self.different >= LEAST_DIFFERENT * self.hits

    @property
    def is_known(self) -> bool:
        """Whether the hits are enough for an upper bound of all characteristic values."""
        return all(isfinite(one.high) for one in (self.speed_mps, self.energy_j, self.height_m))

    @property
    def faults(self) -> tuple[str, ...]:
        """Why the barrier that stands there is not enough; empty where it is, and for a screen that only measures."""
        if self.screen.capacity_j is None:
            return ()
        found = []
        if self.screen.capacity_j < self.needed_energy_j:
            found.append(
                f"its capacity of {self.screen.capacity_j / 1000:.4g} kJ is below the needed "
                f"{self.needed_energy_j / 1000:.4g} kJ"
            )
        if self.screen.height_m < self.needed_height_m:
            found.append(f"its height of {self.screen.height_m:.4g} m is below the needed {self.needed_height_m:.2f} m")
        return tuple(found)


def design_values(
    screen: Screen, hits: ScreenHits, factors: PartialFactors, blocks: int, share: float | None = None
) -> DesignValues:
    """What a barrier at a screen must have.

    Parameters
    ----------
    hits : of this screen, or a sample of them.
    blocks : that were released.
    share : of the hits that do not exceed the characteristic values; None takes that of the factors.

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
    speed = factors.product("speed")
    energy = factors.product("mass") * speed**2 * factors.product("energy")
    known = {
        "speed": quantile(norm(hits.velocity), share),
        "energy": quantile(hits.energy_j, share),
        "height": quantile(np.nan_to_num(hits.up_m, nan=0.0), share),
    }
    different = int(np.unique(hits.energy_j).size)
    if different < LEAST_DIFFERENT * len(hits):
        known = {name: replace(one, low=nan, high=nan) for name, one in known.items()}
    radius = float(np.quantile(hits.radius_m, share))
    clearance = max(factors.clearance_m, radius)
    design_energy, design_height = known["energy"].value * energy, known["height"].value * factors.product("height")
    return DesignValues(
        screen,
        factors,
        blocks,
        int(np.unique(hits.number).size),
        len(hits),
        known["speed"],
        known["energy"],
        known["height"],
        different,
        radius,
        known["speed"].value * speed,
        design_energy,
        design_height,
        clearance,
        design_energy * factors.product("capacity"),
        design_height + clearance,
    )

# SPDX-License-Identifier: GPL-3.0-or-later
"""The falling block: its size, mass and inertia."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import isfinite, pi

import numpy as np

from ..constants import ROCK_DENSITY_KGPM3
from ..errors import RockfallError
from ..plausibility import check_plausible
from ..vectors import Array
from .picks import Picks

SHAPES = ("ellipsoid", "box")


@dataclass(frozen=True)
class Block:
    """A block, by its three diameters and its density.

    Attributes
    ----------
    d1, d2, d3 : the three diameters, at right angles to each other [m].
    density : [kg/m³].
    shape : "ellipsoid" (volume π/6·d1·d2·d3) or "box" (d1·d2·d3).

    Raises
    ------
    RockfallError : a diameter or the density is not a positive number or such as no block has, or the shape is unknown.

    Notes
    -----
    The default is the middle of the 30–40 cm blocks of Noël et al. 2018.
    """

    d1: float = 0.35
    d2: float = 0.35
    d3: float = 0.35
    density: float = ROCK_DENSITY_KGPM3
    shape: str = "ellipsoid"

    def __post_init__(self) -> None:
        for name, value in (("d1", self.d1), ("d2", self.d2), ("d3", self.d3), ("density", self.density)):
            if not (isfinite(value) and value > 0):
                raise RockfallError(f"The block's {name} must be a positive number, not {value}.")
            check_plausible(f"{name}_kgpm3" if name == "density" else f"{name}_m", value, f"block's {name}")
        if self.shape not in SHAPES:
            raise RockfallError(f"Unknown block shape {self.shape!r}: use one of {', '.join(SHAPES)}.")

    @property
    def diameter_m(self) -> float:
        """Mean diameter (d1 + d2 + d3)/3 [m]: twice the radius of Noël et al. 2017."""
        return self.d1 + ((self.d2 - self.d1) + (self.d3 - self.d1)) / 3  # exact for a round block

    @property
    def radius_m(self) -> float:
        """Half the mean diameter [m]."""
        return self.diameter_m / 2

    @property
    def volume_m3(self) -> float:
        """[m³]."""
        box = self.d1 * self.d2 * self.d3
        return box if self.shape == "box" else pi / 6 * box

    @property
    def mass_kg(self) -> float:
        """[kg]."""
        return self.density * self.volume_m3

    @property
    def inertia_kgm2(self) -> float:
        """Mean of the three principal moments of inertia of the solid [kg m²].

        Notes
        -----
        The block's attitude is not observed, so the rotational energy ½Iω² takes this mean: m·Σd²/30 for the ellipsoid
        (2/5·m·r² for a sphere) and m·Σd²/18 for the box (m·d²/6 for a cube).
        """
        squares = self.d1**2 + self.d2**2 + self.d3**2
        return self.mass_kg * squares / (18 if self.shape == "box" else 30)


def per_pick(picks: Picks, block: Block | Mapping[str, Block], value: Callable[[Block], float]) -> Array:
    """(n,) a property of the block of each pick; `block` is one for all, or one per trajectory name.

    Raises
    ------
    RockfallError : a trajectory has no block.
    """
    if isinstance(block, Block):
        return np.full(len(picks), value(block))
    starts = picks.group_starts
    names = [str(name) for name in picks.trajectory[starts]]
    missing = [name for name in names if name not in block]
    if missing:
        raise RockfallError(f"No block is given for trajectory {missing[0]}. Blocks are given for: {', '.join(block)}.")
    sizes = np.diff(np.r_[starts, len(picks)])
    return np.repeat(np.array([value(block[name]) for name in names], dtype=np.float64), sizes)

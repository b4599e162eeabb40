# SPDX-License-Identifier: GPL-3.0-or-later
"""What falls: blocks of a shape, with sizes and densities that are fixed, drawn from laws, or from measured blocks."""

from dataclasses import dataclass, field

import numpy as np

from ..constants import ROCK_DENSITY_KGPM3
from ..errors import InputError
from ..impact_models.machinery.parameters import suggestion
from ..vectors import Array
from .block_shapes import ROUND, SHAPES, Shape
from .distributions import Distribution, check_values


@dataclass(frozen=True, eq=False)
class MeasuredSizes:
    """k blocks of a table, from which blocks are drawn with replacement.

    Attributes
    ----------
    axes_m : (k, 3) the diameters d1, d2, d3; three times the same where only one was measured.
    density_kgpm3 : (k,) NaN where not measured.
    """

    axes_m: Array
    density_kgpm3: Array


@dataclass(frozen=True, eq=False)
class Blocks:
    """The law of the blocks of a release source.

    Attributes
    ----------
    shape : of all of them.
    diameter : of the mean diameter (d1 + d2 + d3)/3 [m].
    proportions : d1 : d2 : d3 of a box or an ellipsoid.
    density : [kg/m³].
    measured : in place of `diameter` and `proportions`, and of `density` where the table has one.

    Raises
    ------
    InputError : an unknown shape, proportions that are not above zero, a sphere or cube with unequal ones; a law with
        diameters or densities that cannot be.
    """

    shape: Shape = "sphere"
    diameter: Distribution = field(default_factory=lambda: Distribution("fixed", 0.35))
    proportions: tuple[float, float, float] = (1.0, 1.0, 1.0)
    density: Distribution = field(default_factory=lambda: Distribution("fixed", ROCK_DENSITY_KGPM3))
    measured: MeasuredSizes | None = None

    def __post_init__(self) -> None:
        if self.shape not in SHAPES:
            raise InputError(f"There is no shape {self.shape!r}", advice=suggestion(self.shape, SHAPES))
        if len(self.proportions) != 3 or not (np.isfinite(self.proportions).all() and min(self.proportions) > 0):
            raise InputError(
                f"{self.proportions} are no proportions of a block", advice="Give three numbers above zero"
            )
        if self.shape in ROUND and len(set(self.proportions)) > 1:
            raise InputError(
                f"A {self.shape} has three equal diameters", advice="Choose box or ellipsoid, or one diameter"
            )
        check_values(self.diameter, "diameter_m", "diameter")
        check_values(self.density, "density_kgpm3", "density")


def block_of(shape: Shape, d1: float, d2: float, d3: float, density_kgpm3: float = ROCK_DENSITY_KGPM3) -> Blocks:
    """The law of blocks that are all alike, of three diameters [m].

    Raises
    ------
    InputError : see `Blocks`; a diameter or density that is not above zero.
    """
    mean = Distribution("fixed", (d1 + d2 + d3) / 3)
    return Blocks(shape, mean, (d1, d2, d3), Distribution("fixed", density_kgpm3))


def draw_blocks(blocks: Blocks, number: int, seed: int) -> tuple[Array, Array]:
    """Diameters (n, 3) [m] and densities (n,) [kg/m³] of the blocks of runs 0 … n − 1.

    Notes
    -----
    A function of the seed and the run alone: one more block changes no other. A sphere and a cube take the mean of
    three measured diameters.
    """
    from .chance_kernels import BLOCK, fill_runs

    u = np.empty((number, 2))
    fill_runs(seed, np.arange(len(u)), BLOCK, u)
    density = blocks.density.values(u[:, 1])
    if blocks.measured is None:
        parts = np.array(blocks.proportions)
        return blocks.diameter.values(u[:, 0])[:, None] * (parts / parts.mean()), density
    rows = (u[:, 0] * len(blocks.measured.axes_m)).astype(np.intp)
    axes, own = blocks.measured.axes_m[rows], blocks.measured.density_kgpm3[rows]
    if blocks.shape in ROUND:
        axes = np.broadcast_to(axes.mean(axis=1, keepdims=True), axes.shape)
    return axes, np.where(np.isnan(own), density, own)

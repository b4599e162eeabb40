# SPDX-License-Identifier: GPL-3.0-or-later
"""Trees that blocks meet: stems as vertical cylinders, and the energy that each can take away.

The greatest loss of energy is that of Dorren and Berger (2006, Tree Physiology 26, 63–71), from real blocks against
silver firs, E = F 38.7 D^2.31 J with the diameter D at breast height in cm and F = 1 for the fir. How much of it a hit
beside the axis takes is the sigmoid of Rockyfor3D (Dorren 2016, ecorisQ paper, 5.2, section 3.4). Numbers of both are
second-hand, as Rockyfor3D's description is commonly quoted: neither text was at hand. Where the block goes then is no
part of that law: see `against_stem`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..terrain.cloud import Cloud
from ..terrain.surface import Surface
from ..vectors import Array, Indices, Mask, Names
from .coverage import check_areas, heights_at
from .polygons import Polygon

ENERGY_J, EXPONENT = 38.7, 2.31
"""Of the greatest loss of energy, for a diameter in cm."""
SPECIES: Mapping[str, float] = {"coniferous": 0.93, "broadleaved": 1.59, "silver_fir": 1.0}
"""Kind of tree → F, its greatest loss beside that of a silver fir of the same diameter; the first two are means."""
KIND = "coniferous"
LAW = (
    "Energy: Dorren and Berger (2006), with the offset of the hit as in Rockyfor3D; direction: along the side of a "
    "stem that stands, an impulse at right angles to one that gives way."
)
NOT_KNOWN = (
    "Not known to it: stems that an earlier block has broken, that fall or lie, stumps, roots, shrubs and branches; "
    "the height of the hit, season and health of the tree; rotation that bark gives or takes."
)
HEIGHT_M = 10.0
"""Up to which a stem is met where no height is given."""
THICKEST_M = 5.0
MOST = 20_000_000
PER_CELL = 2.0
MOST_CELLS = 4_000_000
NARROWEST_M = 0.5
HECTARE_M2 = 1e4


@dataclass(frozen=True, eq=False)
class Trees:
    """t stems on a terrain.

    Attributes
    ----------
    position : (t, 2) of the axis in plan, local [m].
    foot_m : (t,) height of the ground there, local [m].
    height_m : (t,) above the foot up to which a stem is met [m].
    dbh_m : (t,) diameter at breast height [m].
    energy_j : (t,) the greatest loss of energy [J].
    name : (t,) of each, or empty.
    left_out : sentences about trees that could not be placed.
    """

    position: Array
    foot_m: Array
    height_m: Array
    dbh_m: Array
    energy_j: Array
    name: Names
    left_out: tuple[str, ...] = ()

    def __len__(self) -> int:
        return self.dbh_m.size

    def labels(self, which: Indices) -> tuple[str, ...]:
        """Names of some; the number from 1 where there is none."""
        return tuple(str(self.name[i]) or str(i + 1) for i in which.tolist())


def greatest_loss(dbh_m: Array, factor: Array | float = 1.0) -> Array:
    """(t,) the most energy that stems take away [J]. factor : see `SPECIES`."""
    loss: Array = np.asarray(factor, dtype=np.float64) * ENERGY_J * (100.0 * dbh_m) ** EXPONENT
    return loss


def taken_of(offset: Array) -> Array:
    """The part 0…1 of the greatest loss that hits take, by how far beside the axis: 0 is central, 1 the stem's side."""
    from .tree_kernels import taken

    return np.array([taken(one) for one in np.ravel(offset)]).reshape(np.shape(offset))


def factor_of(species: str) -> float:
    """F of a kind of tree.

    Raises
    ------
    InputError : an unknown one.
    """
    try:
        return SPECIES[species.strip().lower().replace(" ", "_")]
    except KeyError:
        raise InputError(f"There is no kind of tree {species!r}", advice=f"There are {', '.join(SPECIES)}") from None


def placed_trees(
    terrain: Surface | Cloud,
    position: Array,
    dbh_m: Array,
    height_m: Array,
    energy_j: Array,
    name: Names | None = None,
) -> Trees:
    """Stems on the terrain; those that stand beside it are left out, and named.

    Parameters
    ----------
    position : (t, 2) local [m].

    Raises
    ------
    InputError : one that is too thick; no tree that stands on the terrain.
    """
    position = np.asarray(position, dtype=np.float64).reshape(-1, 2)
    names: Names = np.full(len(position), "", np.str_) if name is None else name
    if len(dbh_m) and float(dbh_m.max()) > THICKEST_M:
        raise InputError(
            f"A tree has a diameter of {dbh_m.max():g} m",
            advice=f"Diameters are in cm and below {100 * THICKEST_M:g}: is its unit another one?",
        )
    foot = heights_at(terrain, position)
    there: Mask = np.isfinite(foot)
    if not there.any():
        raise InputError("No tree stands on the terrain", advice="Give their coordinates in the terrain's system")
    left_out: tuple[str, ...] = ()
    if not there.all():
        beside = np.flatnonzero(~there)
        first = ", ".join(names[i] or str(i + 1) for i in beside[:5].tolist()) + (", …" if beside.size > 5 else "")
        left_out = (f"{beside.size} of {len(there)} trees stand beside the terrain and are left out: {first}.",)
    return Trees(
        np.ascontiguousarray(position[there]), foot[there], np.asarray(height_m, np.float64)[there],
        np.asarray(dbh_m, np.float64)[there], np.asarray(energy_j, np.float64)[there], names[there], left_out,
    )  # fmt: skip


def random_trees(
    terrain: Surface | Cloud,
    per_hectare: float,
    mean_dbh_m: float,
    sd_dbh_m: float,
    seed: int,
    *,
    height_m: float = HEIGHT_M,
    factor: float = SPECIES[KIND],
    among: Sequence[Polygon] = (),
) -> Trees:
    """A forest that is not known stem by stem: its density and the law of its diameters.

    The number on an area is drawn from Poisson's law and each place anywhere on it, in plan and independent of the
    others, thus without the distances that stands keep. Diameters follow a gamma law with the mean and standard
    deviation.

    Parameters
    ----------
    seed : of number, places and diameters; they depend on nothing else but the terrain's extent in plan.
    among : outside of these there are none; without one they are everywhere.

    Raises
    ------
    InputError : more trees than fit, or thicker ones than there are; no tree on the terrain, an area outside of it.
    """
    if mean_dbh_m > THICKEST_M:
        raise InputError(
            f"The mean diameter is {mean_dbh_m:g} m", advice=f"Diameters are in cm, and below {100 * THICKEST_M:g}"
        )
    if sd_dbh_m > THICKEST_M:
        raise InputError(
            f"The standard deviation of the diameters is {sd_dbh_m:g} m",
            advice=f"It is in cm, and below {100 * THICKEST_M:g}",
        )
    places = terrain.vertices if isinstance(terrain, Surface) else terrain.points
    low, high = places[:, :2].min(axis=0), places[:, :2].max(axis=0)
    expected = per_hectare * float(np.prod(high - low)) / HECTARE_M2
    if expected > MOST:
        raise InputError(
            f"{per_hectare:g} stems per hectare are {expected:.3g} trees on this terrain", advice=f"{MOST:.0g} fit"
        )
    remarks = check_areas(terrain, among, "forest", "no tree stands there")
    chance = np.random.Generator(np.random.Philox(seed))
    number = int(chance.poisson(expected))
    position = chance.uniform(low, high, (number, 2))
    dbh = np.full(number, mean_dbh_m)
    if sd_dbh_m > 0:
        shape = (mean_dbh_m / sd_dbh_m) ** 2
        dbh = np.maximum(chance.gamma(shape, mean_dbh_m / shape, number), 1e-3)
    if among:
        inside = np.zeros(number, np.bool_)
        for polygon in among:
            inside |= polygon.contains(position)
        position, dbh = position[inside], dbh[inside]
    dbh = np.minimum(dbh, THICKEST_M)
    on = np.isfinite(heights_at(terrain, position))
    position, dbh = position[on], dbh[on]
    if not len(dbh):
        raise InputError("No tree was drawn", advice="Give more stems per hectare, or a larger area on the terrain")
    trees = placed_trees(terrain, position, dbh, np.full(len(dbh), height_m), greatest_loss(dbh, factor))
    return replace(trees, left_out=(*trees.left_out, *map(str, remarks)))


def in_cells(trees: Trees | None) -> Any:
    """What the kernels take of trees, see `tree_kernels`: none become an empty tuple."""
    if trees is None or not len(trees):
        return ()
    low, high = trees.position.min(axis=0), trees.position.max(axis=0)
    extent = np.maximum(high - low, 1.0)
    area = float(np.prod(extent))
    size = max(np.sqrt(PER_CELL * area / len(trees)), np.sqrt(area / MOST_CELLS), NARROWEST_M)
    columns, rows = (max(ceil(side / size), 1) for side in extent.tolist())
    place = np.minimum(np.floor((trees.position - low) / size).astype(np.intp), [columns - 1, rows - 1])
    cell: Indices = place[:, 1] * columns + place[:, 0]
    order = np.argsort(cell, kind="stable")
    begin: NDArray[np.int64] = np.searchsorted(cell[order], np.arange(columns * rows + 1)).astype(np.int64)
    radius = 0.5 * trees.dbh_m
    stem = np.column_stack([trees.position, radius, trees.foot_m, trees.foot_m + trees.height_m, trees.energy_j])[order]
    cells = np.array([low[0], low[1], size, radius.max()])
    return cells, np.array([columns, rows]), begin, np.ascontiguousarray(stem), order.astype(np.int64)

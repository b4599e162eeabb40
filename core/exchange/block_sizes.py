# SPDX-License-Identifier: GPL-3.0-or-later
"""Sizes and densities of blocks as a user writes them: a number, a range, a law, three diameters, a table."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..reading import reader
from ..simulation.block_shapes import Shape
from ..simulation.blocks import Blocks, MeasuredSizes, block_of
from ..simulation.distributions import Distribution, parse_distribution
from ..vectors import Mask
from .csv_text import read_table

AXES = ("d1_m", "d2_m", "d3_m")
KNOWN = (*AXES, "diameter_m", "density_kgpm3")
THREE = re.compile(r"^\s*([^x×]+)[x×]([^x×]+)[x×]([^x×]+)$")
"""1.2x0.8x0.5"""


@reader("table of blocks")
def read_sizes(path: str | Path) -> MeasuredSizes:
    """Read a table of measured blocks: d1_m, d2_m, d3_m or diameter_m, and density_kgpm3 where it was measured.

    Raises
    ------
    InputError : anything wrong with the table, a size or density that is not above zero, with the row.
    """
    table = read_table(path, (), KNOWN)
    axes = table.vectors(AXES)
    three: Mask = np.asarray(np.isfinite(axes).all(axis=1))
    diameter, density = table.numbers("diameter_m"), table.numbers("density_kgpm3")
    for i in np.flatnonzero(~three & np.isnan(diameter))[:1].tolist():
        raise table.error(i, "The block has no size", "Give d1_m, d2_m and d3_m, or diameter_m")
    axes = np.where(three[:, None], axes, diameter[:, None])
    for i in np.flatnonzero((axes <= 0).any(axis=1))[:1].tolist():
        raise table.error(i, f"The diameter is {axes[i].min():g}", "Give a number above zero")
    for i in np.flatnonzero(density <= 0)[:1].tolist():
        raise table.error(i, f"The density is {density[i]:g}", "Give a number above zero, or leave it empty")
    return MeasuredSizes(axes, density)


def parse_blocks(diameter: str, density: str, shape: Shape | None) -> Blocks:
    """The law of blocks from texts.

    Parameters
    ----------
    diameter : [m] "0.5", "0.3..0.6", "normal:0.5,0.1", "lognormal:0.5,0.2", "1.2x0.8x0.5" for d1, d2 and d3, or the
        name of a table of measured sizes.
    density : [kg/m³] in the same forms, without three numbers and tables.
    shape : None is an ellipsoid where there are three diameters, else a sphere.

    Raises
    ------
    InputError : none of these forms; see `Distribution`, `Blocks`, `read_sizes`.
    """
    dense = _law("density", density)
    three = THREE.match(diameter)
    if three:
        try:
            axes = [float(number) for number in three.groups()]
        except ValueError as error:
            raise InputError(
                f"{diameter!r} is not three diameters", advice="Write them as 1.2x0.8x0.5, in metres"
            ) from error
        return replace(block_of(shape or "ellipsoid", axes[0], axes[1], axes[2]), density=dense)
    if Path(diameter).suffix.lower() in (".csv", ".txt") or Path(diameter).is_file():
        sizes = read_sizes(diameter)
        solid = bool((sizes.axes_m != sizes.axes_m[:, :1]).any())
        return Blocks(shape or ("ellipsoid" if solid else "sphere"), density=dense, measured=sizes)
    return Blocks(shape or "sphere", _law("diameter", diameter), density=dense)


def _law(what: str, text: str) -> Distribution:
    try:
        return parse_distribution(text)
    except InputError as error:
        raise InputError(f"The {what} cannot be {text}. {error.problem}", advice=error.advice) from error

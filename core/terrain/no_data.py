# SPDX-License-Identifier: GPL-3.0-or-later
"""Cells of a grid that have no height: declared as such, or with a number that no place on Earth can have."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..vectors import Array, Mask

NO_HEIGHT = 1e30
"""Beyond this a value is a filler, as float32's lowest number often is, however many digits of it are written."""
FILLERS = (
    -9999.0, -99999.0, -999999.0, -32768.0, -32767.0, 32767.0, 65535.0, -2147483648.0, -2147483647.0, 2147483647.0,
    4294967295.0, 9999.0, 99999.0, -1e6,
)  # fmt: skip
"""What programs fill cells with that have no height; counted as such beyond all other heights only."""
ZERO_GAP_M = 50.0
"""Cells of exactly zero have no height where no other one is nearer to zero than this. A coast has heights between."""


def declared(values: NDArray[Any], text: str) -> Mask:
    """Which values are the declared no-data value, in their own precision.

    Parameters
    ----------
    values : as stored, before a scale.
    text : as the file writes it; empty when it declares none.

    Raises
    ------
    InputError : the text is no number.
    """
    none = np.zeros(values.shape, np.bool_)
    text = text.strip("\0 ").replace(",", ".")
    if not text:
        return none
    try:
        number = float(text)
    except ValueError as error:
        raise InputError(f'The NODATA value "{text}" is not a number', advice="Correct it, or export again") from error
    if values.dtype.kind == "f":
        with np.errstate(over="ignore"):
            return none if np.isnan(number) else values == values.dtype.type(number)
    whole = int(text) if text.lstrip("+-").isdigit() else int(number) if number.is_integer() else None
    limits = np.iinfo(values.dtype)
    return none if whole is None or not limits.min <= whole <= limits.max else values == whole


def without_fillers(values: Array, empty: Mask, zero_gap: float | None = ZERO_GAP_M) -> tuple[Array, list[str]]:
    """Heights with NaN where there is none, and what to say of those that the file did not declare.

    Parameters
    ----------
    values : of the cells, before a unit is applied; not changed.
    empty : cells that are known to have none.
    zero_gap : see `ZERO_GAP_M`, in units of the values; None where zero is a height like others.
    """
    heights = np.where(empty | ~(np.abs(values) <= NO_HEIGHT), np.nan, values)
    notes = []
    found = [filler for filler in FILLERS if (heights == filler).any()]
    if found:
        is_filler = np.isin(heights, found)
        rest = heights[~is_filler & np.isfinite(heights)]
        if rest.size:
            low, high = float(rest.min()), float(rest.max())
            beyond = [filler for filler in found if filler < low - (high - low) or filler > high + (high - low)]
            for filler in beyond:
                cells = heights == filler
                heights[cells] = np.nan
                notes.append(_sentence(int(cells.sum()), f"{filler:.0f}", "beyond all other heights"))
    zero = heights == 0.0
    if zero_gap is not None and zero.any():
        rest = np.abs(heights[~zero & np.isfinite(heights)])
        if rest.size and float(rest.min()) > zero_gap:
            heights[zero] = np.nan
            notes.append(_sentence(int(zero.sum()), "0", f"the height nearest to it is {float(rest.min()):g}"))
    return heights, notes


def empty_sentence(cells: int, why: str) -> str:
    """On cells that the file says are empty."""
    return f"{cells:,} cell{'s have' if cells != 1 else ' has'} no height ({why})."


def _sentence(cells: int, value: str, why: str) -> str:
    what = f"{cells:,} cell{'s' if cells != 1 else ''}"
    return f"{what} of exactly {value} {'are' if cells != 1 else 'is'} taken as without height: {why}."

# SPDX-License-Identifier: GPL-3.0-or-later
"""What a chapter of the verification manual is made of: numbers of Rockfall beside numbers from elsewhere."""

import math
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

Source = Literal["printed", "closed form", "independent", "measured"]
"""Where the other numbers are from: a publication, algebra, another computation, an experiment."""

ROUNDING, COARSE = 1e-8, 1e-6
"""Differences below the first differ from machine to machine; above the second two digits are shown."""


@dataclass(frozen=True)
class Check:
    """One comparison.

    Attributes
    ----------
    what : quantity, with its equation.
    against : what it is compared with, and where that is from.
    source : which kind that is.
    difference : greatest one between Rockfall's number and the other, in `unit` ("1" for numbers without one) or, where
        that is empty, relative to the greatest number.
    allowed : above this the check fails.
    cases : how many numbers were compared.
    """

    what: str
    against: str
    source: Source
    difference: float
    allowed: float
    cases: int
    unit: str = ""

    @property
    def holds(self) -> bool:
        """Whether the difference is allowed; one that is no number is not."""
        return bool(self.difference <= self.allowed)


def compared(
    what: str,
    against: str,
    source: Source,
    found: ArrayLike,
    expected: ArrayLike,
    allowed: float,
    unit: str = "",
) -> Check:
    """A check of numbers: absolute differences with a unit, differences relative to the expected size without."""
    one, other = np.broadcast_arrays(np.asarray(found, dtype=float), np.asarray(expected, dtype=float))
    difference = np.abs(one - other)
    if not unit:
        difference = difference / max(float(np.abs(other).max()), np.finfo(float).tiny)
    greatest = float(difference.max()) if difference.size and np.isfinite(difference).all() else math.nan
    return Check(what, against, source, greatest, allowed, one.size, unit)


def table(checks: Sequence[Check]) -> list[str]:
    """The checks as rows of Markdown."""
    lines = [
        "| quantity | compared with | source | numbers | greatest difference | allowed |",
        "|---|---|---|---|---|---|",
    ]
    for check in checks:
        unit = "" if check.unit == "1" else f" {check.unit}" if check.unit else " of it"
        failed = "" if check.holds else " **fails**"
        lines.append(
            f"| {_cell(check.what)} | {_cell(check.against)} | {check.source} | {check.cases} | "
            f"{_with_unit(bounded(check.difference), unit)}{failed} | {check.allowed:.2g}{unit} |"
        )
    return lines


def _with_unit(text: str, unit: str) -> str:
    return text if text == "rounding" else text + unit


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def bounded(difference: float) -> str:
    """A difference from above, in so few digits that it is the same text on every machine."""
    if not math.isfinite(difference):
        return "no number"
    if difference < ROUNDING:
        return "rounding"
    power = math.floor(math.log10(difference))
    if difference < COARSE:
        return f"< 1e{power + 1}"
    return f"< {(math.floor(difference / 10.0 ** (power - 1)) + 1) * 10.0 ** (power - 1):.2g}"


def verdict(checks: Iterable[Check]) -> str:
    """How many hold, in a sentence."""
    every = list(checks)
    failing = [check.what for check in every if not check.holds]
    if failing:
        return f"**{len(failing)} of {len(every)} checks fail**: {'; '.join(failing)}."
    return f"All {len(every)} checks hold."


def paragraph(text: str) -> list[str]:
    """A paragraph of Markdown in lines."""
    return textwrap.wrap(text, 116, break_long_words=False, break_on_hyphens=False)

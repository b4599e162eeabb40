# SPDX-License-Identifier: GPL-3.0-or-later
"""A size or a density that is fixed, or drawn from a law: one uniform number in, one value out."""

from dataclasses import dataclass
from math import isfinite, log, sqrt
from typing import Literal

import numpy as np

from ..errors import InputError
from ..impact_models.machinery.parameters import suggestion
from ..plausibility import implausible
from ..vectors import Array

Law = Literal["fixed", "uniform", "normal", "lognormal"]
LAWS: tuple[Law, ...] = ("fixed", "uniform", "normal", "lognormal")
LEAST_PART = 0.1
"""A normal law is cut off at this part of its mean: what it has below, negative sizes too, is not drawn."""
MOST_CUT = 0.1
"""A normal law with more than this share below there is refused."""
WIDEST = 100.0
"""A standard deviation of a lognormal law with more than so many times its mean is refused."""
RARE = 1e-4
"""Values that fewer blocks have, at either end, do not make a law implausible."""
FORMS = "0.5, 0.3..0.6, normal:MEAN,SD or lognormal:MEAN,SD"


@dataclass(frozen=True)
class Distribution:
    """How values above zero are drawn.

    Attributes
    ----------
    law : "fixed", "uniform", "normal", or "lognormal".
    first, second : the value; lowest and highest; mean and standard deviation of the values themselves, also of the
        lognormal law.

    Raises
    ------
    InputError : numbers that are not finite, a value or mean that is not above zero, limits the wrong way round, a
        normal law with more than `MOST_CUT` below `LEAST_PART` of its mean.
    """

    law: Law
    first: float
    second: float = 0.0

    def __post_init__(self) -> None:
        if self.law not in LAWS:
            raise InputError(f"There is no law {self.law!r}", advice=suggestion(self.law, LAWS))
        if not (isfinite(self.first) and isfinite(self.second)):
            raise InputError(f"{self.text} has a number that is not finite", advice=f"Write {FORMS}")
        what = {"fixed": "value", "uniform": "lowest value"}.get(self.law, "mean")
        if self.first <= 0:
            raise InputError(f"The {what} of {self.text} is not above zero", advice="Give a number above zero")
        if self.law == "uniform" and self.second < self.first:
            raise InputError(f"{self.text} ends below its beginning", advice="Give the lowest value first")
        if self.law in ("normal", "lognormal") and self.second < 0:
            raise InputError(f"The standard deviation of {self.text} is negative", advice="Give zero or more")
        if self.law == "lognormal" and self.second > WIDEST * self.first:
            raise InputError(
                f"The standard deviation of {self.text} is more than {WIDEST:g} times its mean",
                advice="Give a smaller one: it is that of the values, not of their logarithms",
            )
        if self.law == "normal" and self.cut > MOST_CUT:
            raise InputError(
                f"{self.text} has {self.cut:.0%} of its values below a tenth of its mean, or below zero",
                advice="Give a smaller standard deviation, or a lognormal law",
            )

    @property
    def text(self) -> str:
        """As `parse_distribution` reads it."""
        match self.law:
            case "fixed":
                return f"{self.first:g}"
            case "uniform":
                return f"{self.first:g}..{self.second:g}"
            case _:
                return f"{self.law}:{self.first:g},{self.second:g}"

    @property
    def cut(self) -> float:
        """The share of a normal law that is not drawn."""
        from scipy.special import ndtr

        if self.law != "normal" or self.second == 0:
            return 0.0
        return float(ndtr((LEAST_PART - 1) * self.first / self.second))

    @property
    def mean(self) -> float:
        """Of the law, before anything is cut off."""
        return 0.5 * (self.first + self.second) if self.law == "uniform" else self.first

    def values(self, u: Array) -> Array:
        """(n,) values from uniform numbers, 0 ≤ u < 1."""
        from scipy.special import ndtri

        if self.law == "uniform":
            return self.first + u * (self.second - self.first)
        if self.law == "fixed" or self.second == 0:
            return np.full(u.shape, self.first)
        inside = np.maximum(u, 2.0**-54)
        if self.law == "normal":
            drawn: Array = self.first + self.second * ndtri(self.cut + inside * (1.0 - self.cut))
            return np.maximum(drawn, LEAST_PART * self.first)
        spread = log(1.0 + (self.second / self.first) ** 2)
        return np.exp(log(self.first) - spread / 2 + sqrt(spread) * ndtri(inside))


def check_values(law: Distribution, name: str, what: str) -> None:
    """Refuse a law with values that cannot be.

    Parameters
    ----------
    name, what : see `check_plausible`.

    Raises
    ------
    InputError : one block in ten thousand, or more, has such a value.
    """
    ends = (law.first, law.second) if law.law == "uniform" else law.values(np.array([RARE, 1.0 - RARE])).tolist()
    for value in ends:
        problem = implausible(name, value)
        if problem:
            drawn = "" if law.law == "fixed" else f", which {law.text} gives to blocks,"
            raise InputError(f"A {what} of {value:.3g}{drawn} {problem}", advice="Check it, its deviation and its unit")


def parse_distribution(text: str) -> Distribution:
    """A number, ``0.3..0.6``, ``uniform:0.3,0.6``, ``normal:MEAN,SD`` or ``lognormal:MEAN,SD``.

    Raises
    ------
    InputError : another form, or see `Distribution`.
    """
    name, colon, rest = text.strip().partition(":")
    try:
        if colon:
            law = name.strip().lower()
            if law not in LAWS:
                raise InputError(f"There is no law {name.strip()!r} in {text!r}", advice=suggestion(law, LAWS))
            numbers = [float(part) for part in rest.split(",")]
            if len(numbers) != (1 if law == "fixed" else 2):
                raise ValueError
            return Distribution(law, *numbers)
        low, dots, high = text.partition("..")
        return Distribution("uniform", float(low), float(high)) if dots else Distribution("fixed", float(low))
    except ValueError as error:
        raise InputError(f"{text!r} is no number and no law", advice=f"Write {FORMS}") from error

# SPDX-License-Identifier: GPL-3.0-or-later
"""What films say, in the language that is asked for: words from ``assets/film/texts.toml``, and numbers."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from math import floor, log10
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...exchange.toml_text import read_toml
from ...versions import versions

FILE = Path(__file__).resolve().parents[3] / "assets" / "film" / "texts.toml"
THIN_SPACE = "\N{NARROW NO-BREAK SPACE}"
TONNE_KG = 1000.0


@dataclass(frozen=True, eq=False)
class Texts:
    """The words of one language.

    Attributes
    ----------
    language : "en", "fr" or "de".
    words : key → text, in which names in braces are filled in.
    """

    language: str
    words: Mapping[str, str]

    def say(self, key: str, **values: object) -> str:
        """A text, its braces filled in."""
        return self.words[key].format(version=_version(), **values)

    def whole(self, value: int) -> str:
        """A whole number, thousands apart."""
        return f"{value:,}".replace(",", THIN_SPACE)

    def number(self, value: float, digits: int = 3) -> str:
        """A number with so many significant digits, never in powers of ten, thousands apart."""
        if value == 0 or value != value:
            return "0" if value == 0 else "–"
        rounded = float(f"{value:.{digits - 1}e}")
        decimals = max(digits - 1 - floor(log10(abs(rounded))), 0)
        whole, _, part = f"{rounded:,.{decimals}f}".replace(",", THIN_SPACE).partition(".")
        return f"{whole}{self.words['decimal']}{part}" if part else whole

    def about(self, value: float, sigma: float, digits: int = 2) -> str:
        """A number with its standard deviation, to the last digit that means something; "≈" where that is not known."""
        if not (np.isfinite(value) and np.isfinite(sigma) and sigma > 0):
            return f"≈ {self.number(value, digits)}"
        decimals = max(-floor(log10(sigma)), 0)
        return f"{value:,.{decimals}f} ± {sigma:,.{decimals}f}".replace(",", THIN_SPACE).replace(
            ".", self.words["decimal"]
        )

    def mass(self, mass_kg: float) -> str:
        """kg, or t from a tonne on."""
        return f"{self.number(mass_kg / TONNE_KG, 2)} t" if mass_kg >= TONNE_KG else f"{self.number(mass_kg, 2)} kg"

    def energy(self, joule: float) -> str:
        """J, kJ or MJ."""
        size, unit = _energy_unit(joule)
        return f"{self.number(joule / size, 2)} {unit}"

    def about_energy(self, joule: float, sigma_j: float) -> str:
        """J, kJ or MJ, with the standard deviation."""
        size, unit = _energy_unit(joule)
        return f"{self.about(joule / size, sigma_j / size)} {unit}"

    def measured_roughly(self) -> "Texts":
        """The same words, in which what is measured is called approximate."""
        return Texts(self.language, {**self.words, "measured": self.words["measured_roughly"]})

    def pace(self, rate: float) -> str:
        """How fast the film runs against the fall, always said: real time, so many times slower or faster, or still."""
        if rate < 1e-9:
            return self.say("stands")
        if abs(rate - 1.0) < 0.02:
            return f"1× {self.say('real_time')}"
        factor = self.whole(round(max(rate, 1 / rate)))
        if factor == "1":
            return self.say("nearly_real_time")
        return self.say("slower" if rate < 1 else "faster", factor=factor)


def _energy_unit(joule: float) -> tuple[float, str]:
    return next(((size, unit) for size, unit in ((1e6, "MJ"), (1e3, "kJ")) if joule >= size), (1.0, "J"))


@lru_cache
def _version() -> str:
    return versions()["rockfall"]


@lru_cache
def languages() -> tuple[str, ...]:
    """Those that there are."""
    return tuple(read_toml(FILE, "texts of films"))


def texts(language: str = "en") -> Texts:
    """The words of a language.

    Raises
    ------
    InputError : it is not there; the message names those that are.
    """
    if language not in languages():
        raise InputError(f"Films do not speak {language!r}", advice=f"Known languages: {', '.join(languages())}")
    return Texts(language, read_toml(FILE, "texts of films")[language])

# SPDX-License-Identifier: GPL-3.0-or-later
"""What films say, in the language that is asked for: words from ``assets/film/texts.toml``, and numbers."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

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
        from math import floor, log10

        rounded = float(f"{value:.{digits - 1}e}")
        decimals = max(digits - 1 - floor(log10(abs(rounded))), 0)
        whole, _, part = f"{rounded:,.{decimals}f}".replace(",", THIN_SPACE).partition(".")
        return f"{whole}{self.words['decimal']}{part}" if part else whole

    def mass(self, mass_kg: float) -> str:
        """kg, or t from a tonne on."""
        return f"{self.number(mass_kg / TONNE_KG, 2)} t" if mass_kg >= TONNE_KG else f"{self.number(mass_kg, 2)} kg"

    def energy(self, joule: float) -> str:
        """J, kJ or MJ."""
        for size, unit in ((1e6, "MJ"), (1e3, "kJ")):
            if joule >= size:
                return f"{self.number(joule / size, 2)} {unit}"
        return f"{self.number(joule, 2)} J"

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

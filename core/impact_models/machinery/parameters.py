# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters of a model: the one table from which validation, help, sliders and project files come."""

from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from math import isfinite, nan

from ...errors import InputError

Value = float | str
"""A number, or the name of a choice."""

SWITCH = ("off", "on")
"""Choices of a parameter that is a switch."""
_SPELLINGS = {"true": "on", "yes": "on", "false": "off", "no": "off"}


@dataclass(frozen=True)
class ParameterSpec:
    """One parameter of a model.

    Attributes
    ----------
    name, symbol : in tables and on the command line; in equations.
    unit : "" for a pure number or a choice.
    default : a number, or one of `choices`.
    minimum, maximum : inclusive range of a number; NaN for a choice.
    choices : names; empty for a number. `SWITCH` for on and off.
    description, source : sentences without a final full stop.
    verified : whether default and role were checked against a text that was read; else they rest on common knowledge.
    first_code : number of the first choice; a choice may also be given by its number.
    follows : (name of a choice parameter, value for each of its choices): the default when this one is not given.
    """

    name: str
    symbol: str
    unit: str
    default: Value
    minimum: float = nan
    maximum: float = nan
    choices: tuple[str, ...] = ()
    description: str = ""
    source: str = ""
    verified: bool = True
    first_code: int = 0
    follows: tuple[str, tuple[float, ...]] | None = None

    @property
    def is_switch(self) -> bool:
        """Whether it is on or off."""
        return self.choices == SWITCH

    @property
    def range_text(self) -> str:
        """The range or the choices, for people."""
        return " | ".join(self.choices) if self.choices else f"{self.minimum:g}…{self.maximum:g}"

    def checked(self, value: object, model: str) -> Value:
        """`value` (a number, a text or a bool) as a number in range, or as the name of a choice.

        Raises
        ------
        InputError : it is neither.
        """
        return self._choice(value, model) if self.choices else self._number(value, model)

    def code(self, value: Value) -> float:
        """A checked value as the number that the compiled model takes."""
        return float(self.choices.index(str(value)) + self.first_code) if self.choices else float(value)

    def _number(self, value: object, model: str) -> float:
        full = f"{model}.{self.name}"
        try:
            number = float(value)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            number = nan
        if not isfinite(number):
            raise InputError(f"{full} is {value!r}, not a number", advice=f"Give a number, {self.range_text}")
        if not self.minimum <= number <= self.maximum:
            unit = f" {self.unit}" if self.unit else ""
            raise InputError(
                f"{full} is {number:g}{unit}, outside its range {self.range_text}{unit}",
                advice="Give a value within the range; `rockfall models` lists all ranges",
            )
        return number

    def _choice(self, value: object, model: str) -> str:
        text = ("on" if value else "off") if isinstance(value, bool) else str(value).strip().lower()
        if self.is_switch:
            text = _SPELLINGS.get(text, text)
        if text in self.choices:
            return text
        try:
            number = float(text) - self.first_code
        except ValueError:
            number = nan
        if number in range(len(self.choices)):
            return self.choices[int(number)]
        raise InputError(
            f"{model}.{self.name} is {value!r}, which is none of its choices", advice=suggestion(text, self.choices)
        )


def suggestion(name: str, names: Iterable[str]) -> str:
    """Advice after a name that is none of `names`."""
    names = list(names)
    near = get_close_matches(name.lower(), names, n=1, cutoff=0.4)
    return f"Did you mean {near[0]}? There are {', '.join(names)}" if near else f"There are {', '.join(names)}"

# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters of a model: the one table from which validation, help, sliders and project files come.

A model declares them in a named tuple, and its function reads them from it by name::

    class Parameters(NamedTuple):
        rn: float = number(0.35, 0, 1, "normal coefficient of restitution", "Noël et al. 2018", symbol="R_N")
        definition: float = choice("velocity", DEFINITIONS, "what the coefficients are ratios of", "the report")
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from difflib import get_close_matches
from math import isfinite, nan
from typing import Any

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
    name : in tables and on the command line.
    default : a number, or one of `choices`.
    minimum, maximum : inclusive range of a number; NaN for a choice.
    choices : names; empty for a number. `SWITCH` for on and off.
    description, source : sentences without a final full stop.
    unit : "" for a pure number or a choice.
    symbol : in equations.
    verified : whether default and role were checked against a text that was read; else they rest on common knowledge.
    first_code : number of the first choice; a choice may also be given by its number.
    follows : (name of a choice parameter, value for each of its choices): the default when this one is not given.
    """

    name: str
    default: Value
    minimum: float
    maximum: float
    choices: tuple[str, ...]
    description: str
    source: str
    unit: str = ""
    symbol: str = ""
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


def number(
    default: float,
    minimum: float,
    maximum: float,
    description: str,
    source: str,
    *,
    unit: str = "",
    symbol: str = "",
    verified: bool = True,
    follows: tuple[str, tuple[float, ...]] | None = None,
) -> Any:
    """A number in a range, as the default of a field; see `ParameterSpec`."""
    limits = float(minimum), float(maximum)
    return ParameterSpec("", float(default), *limits, (), description, source, unit, symbol, verified, follows=follows)


def choice(
    default: str,
    choices: Iterable[str],
    description: str,
    source: str,
    *,
    symbol: str = "",
    verified: bool = True,
    first_code: int = 0,
) -> Any:
    """One of several names, as the default of a field: the function reads its place among them plus `first_code`."""
    return ParameterSpec("", default, nan, nan, tuple(choices), description, source, "", symbol, verified, first_code)


def switch(default: str, description: str, source: str, *, symbol: str = "", verified: bool = True) -> Any:
    """On or off, as the default of a field: the function reads 1 or 0."""
    return choice(default, SWITCH, description, source, symbol=symbol, verified=verified)


def declared(parameters: type[Any]) -> tuple[ParameterSpec, ...]:
    """The specifications that a named tuple has as the defaults of its fields, with the names of the fields."""
    defaults: dict[str, ParameterSpec] = parameters._field_defaults
    return tuple(replace(defaults[name], name=name) for name in parameters._fields)


def suggestion(name: str, names: Iterable[str]) -> str:
    """Advice after a name that is none of `names`."""
    names = list(names)
    near = get_close_matches(name.lower(), names, n=1, cutoff=0.4)
    return f"Did you mean {near[0]}? There are {', '.join(names)}" if near else f"There are {', '.join(names)}"

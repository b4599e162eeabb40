# SPDX-License-Identifier: GPL-3.0-or-later
"""What an impact model is: a pure function of the incident state, parameters and random numbers, and its table."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError
from ...vectors import Array, Indices, dot
from .compilation import compiled_driver, compiled_model
from .measured import MeasuredRebounds
from .parameters import ParameterSpec, Value, declared, suggestion
from .triples import Motion

Rebound = Callable[..., Motion]
"""``rebound(v1, n, omega1, radius, mass, p, u) -> (v2, omega2)``: triples of floats, floats, the model's parameters as
numbers by name, and its uniform random numbers by name (NaN for the mean). A model that draws from measured impacts
takes them, as `MeasuredRebounds.numbers`, after these."""

UNIT_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class Incident:
    """n blocks just before their impact.

    Attributes
    ----------
    velocity : (n, 3) [m/s]; only v·n < 0 is an impact, other rows give NaN.
    normal : (n, 3) unit, out of the ground.
    angular_velocity : (n, 3) [rad/s], right-handed.
    radius_m, mass_kg : (n,).

    Raises
    ------
    InputError : shapes that do not agree, a normal that is not of length 1.
    """

    velocity: Array
    normal: Array
    angular_velocity: Array
    radius_m: Array
    mass_kg: Array

    def __post_init__(self) -> None:
        for name in ("velocity", "normal", "angular_velocity", "radius_m", "mass_kg"):
            values = np.ascontiguousarray(getattr(self, name), dtype=np.float64)
            object.__setattr__(self, name, values)
        n = len(self.velocity)
        for name in ("velocity", "normal", "angular_velocity"):
            if getattr(self, name).shape != (n, 3):
                raise InputError(f"The {name} has the shape {getattr(self, name).shape}, not ({n}, 3)")
        for name in ("radius_m", "mass_kg"):
            if getattr(self, name).shape != (n,):
                raise InputError(f"The {name} has the shape {getattr(self, name).shape}, not ({n},)")
        wrong = np.flatnonzero(np.abs(dot(self.normal, self.normal) - 1.0) > 2 * UNIT_TOLERANCE)
        if wrong.size:
            raise InputError(f"The normal {self.normal[wrong[0]]} is not of length 1", advice="Divide it by its length")

    def __len__(self) -> int:
        return len(self.velocity)


@dataclass(frozen=True, eq=False)
class Outgoing:
    """n blocks just after their impact; NaN where there was none.

    Attributes
    ----------
    velocity : (n, 3) [m/s].
    angular_velocity : (n, 3) [rad/s].
    """

    velocity: Array
    angular_velocity: Array


class NoDraws(NamedTuple):
    """The random numbers of a model without chance."""


@dataclass(frozen=True, eq=False)
class ImpactModel:
    """A published impact model.

    Attributes
    ----------
    name : author_year, as in tables and on the command line.
    title : for people, with the program that uses it.
    reference : the publication.
    function : the model itself.
    parameter_type : a named tuple of its parameters, whose defaults are made by `number`, `choice` and `switch`.
    draw_type : a named tuple of the uniform random numbers that one impact takes.
    colour : sRGB, in films, legends and the viewport.
    compared : whether it is compared when no models are chosen.
    energy_never_grows : whether ½m(v² + c·r²ω²) after the impact is never above that before, whatever the parameters.
    turns_with_the_frame : whether the result turns with the frame about any axis; else the vertical (z) is special.
    draws_from_impacts : whether it is no formula but needs measured impacts.
    """

    name: str
    title: str
    reference: str
    function: Rebound
    parameter_type: type[Any]
    draw_type: type[Any] = NoDraws
    colour: tuple[float, float, float] = (0.95, 0.95, 0.95)
    compared: bool = False
    energy_never_grows: bool = True
    turns_with_the_frame: bool = True
    draws_from_impacts: bool = False

    @cached_property
    def parameters(self) -> tuple[ParameterSpec, ...]:
        """Its table, in the order in which the compiled model takes the numbers."""
        return declared(self.parameter_type)

    @property
    def draws(self) -> int:
        """How many uniform random numbers one impact takes; 0 for a model without chance."""
        return len(self.draw_type._fields)

    @property
    def is_random(self) -> bool:
        """Whether chance has a part in it."""
        return self.draws > 0

    @cached_property
    def compiled(self) -> Any:
        """`function` for compiled callers, which give it all numbers as two arrays; compiled by numba when needed."""
        return compiled_model(self.function, self.parameter_type, self.draw_type, self.draws_from_impacts)

    def parameter(self, name: str) -> ParameterSpec:
        """The specification of one parameter.

        Raises
        ------
        InputError : there is none of this name; the nearest is suggested.
        """
        for spec in self.parameters:
            if spec.name == name:
                return spec
        names = [spec.name for spec in self.parameters]
        raise InputError(f"{self.name} has no parameter {name!r}", advice=suggestion(name, names))

    def settings(self, given: Mapping[str, object] | None = None) -> dict[str, Value]:
        """All parameters, checked: those given, the others by default.

        Parameters
        ----------
        given : name → number, name of a choice, bool for a switch, or any of these as text.

        Raises
        ------
        InputError : unknown name, value out of range, not a number, none of the choices.
        """
        given = given or {}
        for name in given:
            self.parameter(name)
        result: dict[str, Value] = {}
        for spec in self.parameters:
            value: object = given.get(spec.name, spec.default)
            if spec.follows and spec.name not in given:
                leader = self.parameter(spec.follows[0])
                value = spec.follows[1][leader.choices.index(str(result[leader.name]))]
            result[spec.name] = spec.checked(value, self.name)
        return result

    def numbers(self, given: Mapping[str, object] | None = None, measured: MeasuredRebounds | None = None) -> Array:
        """(k,) all parameters as the numbers that the compiled model takes, then the measured impacts' if it needs any.

        Parameters
        ----------
        given : as in `settings`.
        measured : what a model that `draws_from_impacts` draws from; others do not look at it.

        Raises
        ------
        InputError : see `settings`; no measured impacts for a model that needs them.
        """
        settings = self.settings(given)
        own = np.array([spec.code(settings[spec.name]) for spec in self.parameters], dtype=np.float64)
        if not self.draws_from_impacts:
            return own
        if measured is None:
            raise InputError(
                f"{self.name} draws from measured impacts, and there are none",
                advice="Give a table of measured impacts, such as reconstruct or merge writes",
            )
        return np.concatenate([own, measured.numbers])

    def rebound(
        self,
        incident: Incident,
        parameters: Mapping[str, object] | None = None,
        rng: np.random.Generator | None = None,
        *,
        draws: Array | None = None,
        measured: MeasuredRebounds | None = None,
    ) -> Outgoing:
        """What the model makes of n impacts.

        Parameters
        ----------
        parameters : those that are not to have their default.
        rng : None for the model at the mean of its random parameters.
        draws : (n, `draws`) uniform numbers to be used instead of those of `rng`; NaN for the mean of a law.
        measured : see `numbers`.

        Raises
        ------
        InputError : see `numbers`.
        """
        n = len(incident)
        if draws is None:
            draws = rng.random((n, self.draws)) if rng is not None else np.full((n, self.draws), np.nan)
        draws = np.ascontiguousarray(draws, dtype=np.float64)
        if draws.shape != (n, self.draws):
            raise InputError(f"The draws have the shape {draws.shape}, not ({n}, {self.draws})")
        follows = np.full(n, -1, dtype=np.intp)
        _, v2, omega2 = self.chain(incident, follows, self.numbers(parameters, measured), draws[None])
        return Outgoing(v2[0], omega2[0])

    def chain(self, incident: Incident, follows: Indices, numbers: Array, draws: Array) -> tuple[Array, Array, Array]:
        """Replicates of n impacts, in which an impact may take over the spin that the model gave to an earlier one.

        Parameters
        ----------
        follows : (n,) row of that earlier impact, less than its own; −1 takes the incident's angular velocity.
        numbers : (k,) as of `numbers`.
        draws : (replicates, n, `draws`) uniform; NaN for the mean.

        Returns
        -------
        omega1, v2, omega2 : (replicates, n, 3).
        """
        shape = (draws.shape[0], len(incident), 3)
        omega1, v2, omega2 = np.empty(shape), np.empty(shape), np.empty(shape)
        compiled_driver()(
            self.compiled,
            incident.velocity,
            incident.normal,
            incident.angular_velocity,
            follows,
            incident.radius_m,
            incident.mass_kg,
            numbers,
            draws,
            omega1,
            v2,
            omega2,
        )
        return omega1, v2, omega2

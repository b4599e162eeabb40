# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known of a parameter before any run is looked at: a law over a range, and places 0…1 where it is even."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Literal

import numpy as np

from ..errors import InputError
from ..impact_models.machinery.base import ImpactModel
from ..impact_models.machinery.parameters import ParameterSpec, suggestion
from ..simulation.engine import FRICTION
from ..simulation.parameter_draws import FRICTION_NAME
from ..vectors import Array
from .fitting import Axis

FRICTION_RANGE = (0.0, 1.5)
"""Of the coefficient μ on the ground, where nothing else is asked for."""
FORMS = "NAME=LOW..HIGH or NAME=normal:MEAN,SD"


@dataclass(frozen=True)
class Prior:
    """The law of one parameter.

    Attributes
    ----------
    name, unit, default : of the parameter.
    axis : its range; where it is wide, the law is even on a scale that is logarithmic beyond the default.
    law : "even", or "normal" with `mean` and `sd`, cut off at the ends of the range.
    """

    name: str
    unit: str
    default: float
    axis: Axis
    law: Literal["even", "normal"] = "even"
    mean: float = 0.0
    sd: float = 1.0

    @property
    def text(self) -> str:
        """For people."""
        ends = f"{self.axis.low:g}…{self.axis.high:g}"
        if self.law == "normal":
            return f"normal, {self.mean:g} ± {self.sd:g}, within {ends}"
        return f"even in {ends}" + (" (logarithmic towards the upper end)" if self.axis.bend else "")

    def values(self, place: Array) -> Array:
        """(n,) values at places (n,) from 0 to 1."""
        from scipy.special import ndtr, ndtri

        low, high = self.axis.low, self.axis.high
        if self.law == "normal":
            first, last = ndtr((np.array([low, high]) - self.mean) / self.sd)
            return np.clip(self.mean + self.sd * ndtri(first + place * (last - first)), low, high)
        if self.axis.bend:
            bend = self.axis.bend
            return np.minimum(high, low + bend * np.sinh(place * np.arcsinh((high - low) / bend)))
        return np.asarray(low + place * (high - low))


def laws_in(text: str) -> dict[str, str]:
    """Parameter → law, of a text with several, between commas or semicolons: rn = 0.2..0.6, friction = normal:0.5,0.1.

    Raises
    ------
    InputError : a part without a name or a law, a name twice.
    """
    found: dict[str, str] = {}
    for part in re.split(r"[;,]\s*(?=[\w.]+\s*=)", text.strip().strip(";,")) if text.strip() else []:
        name, equals, law = (each.strip() for each in part.partition("="))
        if not (equals and name and law):
            raise InputError(f'"{part.strip()}" gives no law', advice=f"Write {FORMS}, as in rn = 0.2..0.6")
        if name in found:
            raise InputError(f"{name} has two laws", advice="Leave one of them out")
        found[name] = law
    return found


def make_priors(model: ImpactModel, names: list[str], asked: Mapping[str, str]) -> tuple[Prior, ...]:
    """The priors of parameters of a model, and of friction.

    Parameters
    ----------
    names : of the parameters; with or without the name of the model before a point.
    asked : name → a law as text, where its range is not to be that of the parameter: `LOW..HIGH`, `normal:MEAN,SD`.

    Raises
    ------
    InputError : none, or one that the model does not have, that is a choice, or twice; a law that cannot be.
    """
    plain = list(dict.fromkeys(name.removeprefix(f"{model.name}.") for name in names))
    if model.draws_from_impacts:
        raise InputError(
            f"{model.name} has no coefficients to fit: its rebounds are the measured ones",
            advice="Choose a model with coefficients (`rockfall models` lists them)",
        )
    if not plain:
        raise InputError(f"No parameter of {model.name} is to be fitted", advice=f"Name some of {_known(model)}")
    laws = {name.removeprefix(f"{model.name}."): text for name, text in asked.items()}
    for name in laws:
        if name not in plain:
            raise InputError(
                f"A prior is given for {name}, which is not fitted", advice="Fit it, or leave the prior out"
            )
    return tuple(_prior(_spec(model, name), model.name, laws.get(name)) for name in plain)


def _known(model: ImpactModel) -> str:
    return ", ".join([*(spec.name for spec in model.parameters if not spec.choices), FRICTION_NAME])


def _spec(model: ImpactModel, name: str) -> ParameterSpec:
    if name == FRICTION_NAME:
        text = "coefficient of friction on the ground"
        return ParameterSpec(name, FRICTION, *FRICTION_RANGE, (), text, "Azzoni et al. 1995")
    found = {spec.name: spec for spec in model.parameters}.get(name)
    if found is None:
        names = _known(model).split(", ")
        raise InputError(f"{model.name} has no parameter {name!r}", advice=suggestion(name, names))
    if found.choices:
        raise InputError(
            f"{model.name}.{name} is a choice, not a number", advice=f"Set it to one of {', '.join(found.choices)}"
        )
    return found


def _prior(spec: ParameterSpec, model: str, text: str | None) -> Prior:
    default = float(spec.default)
    if text is None:
        return Prior(spec.name, spec.unit, default, Axis.of(spec))
    limits = (0.0, 10.0) if spec.name == FRICTION_NAME else (spec.minimum, spec.maximum)
    name, colon, rest = text.partition(":")
    try:
        if colon:
            mean, sd = (float(part) for part in rest.split(","))
            if name.strip() != "normal" or not (isfinite(mean) and isfinite(sd) and sd > 0):
                raise ValueError
            if not limits[0] <= mean <= limits[1]:
                raise InputError(
                    f"The prior of {model}.{spec.name} has its mean {mean:g} outside the range {spec.range_text}",
                    advice="Give a mean within the range",
                )
            return Prior(spec.name, spec.unit, default, Axis(*limits), "normal", mean, sd)
        low, high = (float(part) for part in text.split(".."))
    except ValueError as error:
        raise InputError(f"The prior {spec.name}={text} is no law", advice=f"Write {FORMS}") from error
    if not limits[0] <= low < high <= limits[1]:
        raise InputError(
            f"The prior of {model}.{spec.name}, {low:g}…{high:g}, is no part of its range "
            f"{limits[0]:g}…{limits[1]:g}{' ' + spec.unit if spec.unit else ''}",
            advice="Give the lower limit first, both within the range",
        )
    return Prior(spec.name, spec.unit, default, Axis(low, high))

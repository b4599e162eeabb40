# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters of which each block has values of its own, drawn from a posterior: so what is not known is simulated."""

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..impact_models.machinery.base import ImpactModel
from ..vectors import Array, Indices

FRICTION_NAME = "friction"
"""The coefficient μ of the motion on the ground, beside the names of the model's parameters."""
LARGEST_FRICTION = 10.0


@dataclass(frozen=True, eq=False)
class ParameterDraws:
    """s sets of values for some parameters of a model, and of friction.

    Attributes
    ----------
    names : of p parameters of the model that are numbers, and `FRICTION_NAME`.
    values : (s, p).
    weight : (s,) zero or more: how probable a set is beside the others.
    runs_each : None lets each run draw its set by the weights, as a function of the seed and its number alone. A number
        gives the first so many runs the first set, the next so many the second, and begins again after the last.
    before : for people, of each parameter what was thought possible, and what is left of it; none where not known.
    doubts : for people, what the back-analysis that they are from says against it.

    Raises
    ------
    InputError : shapes that do not agree, a name twice, weights that are no weights.
    """

    names: tuple[str, ...]
    values: Array
    weight: Array
    runs_each: int | None = None
    before: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        sets = len(self.weight)
        if self.values.shape != (sets, len(self.names)) or not sets or not self.names:
            raise InputError(
                f"The drawn parameters have the shape {self.values.shape}, not ({sets}, {len(self.names)})",
                advice="Give a parameter or more, with a row of values for each weight",
            )
        for name in self.names:
            if self.names.count(name) > 1:
                raise InputError(f"The drawn parameter {name} is there twice", advice="Give it once")
        with np.errstate(over="ignore"):
            total = self.weight.sum()
        if not ((self.weight >= 0).all() and 0 < total < np.inf):
            raise InputError("The weights of the drawn parameters are no weights", advice="Give zero or more each")

    def __len__(self) -> int:
        return self.weight.size

    def set_of(self, seed: int, runs: Indices) -> Indices:
        """(n,) the set of each of the runs (n,), whose numbers are from 0."""
        if self.runs_each is not None:
            return np.asarray((runs // self.runs_each) % len(self), dtype=np.intp)
        from .chance_kernels import PARAMETERS, fill_runs

        uniform = np.empty((runs.size, 1))
        fill_runs(seed, runs, PARAMETERS, uniform)
        up_to = np.cumsum(self.weight)
        found = np.searchsorted(up_to, uniform[:, 0] * up_to[-1], side="right")
        return np.minimum(found, np.flatnonzero(self.weight)[-1])

    def mean(self) -> dict[str, float]:
        """The weighted mean of each."""
        values = np.average(self.values, axis=0, weights=self.weight).tolist()
        return dict(zip(self.names, values, strict=True))


def check_draws(draws: ParameterDraws, model: ImpactModel) -> None:
    """Whether a model can have them.

    Raises
    ------
    InputError : a parameter that it does not have, that is a choice, or that leaves its range; a model without numbers.
    """
    if model.draws_from_impacts:
        raise InputError(
            f"{model.name} draws from measured impacts: its blocks cannot draw their parameters",
            advice="Take a model with coefficients",
        )
    for name, column in zip(draws.names, draws.values.T, strict=True):
        if name == FRICTION_NAME:
            low, high = 0.0, LARGEST_FRICTION
        else:
            spec = model.parameter(name)
            if spec.choices:
                raise InputError(f"{model.name}.{name} is a choice and cannot be drawn", advice="Set it to one of them")
            low, high = spec.minimum, spec.maximum
        wrong = np.flatnonzero(~((column >= low) & (column <= high)))
        if wrong.size:
            raise InputError(
                f"{model.name}.{name} is {column[wrong[0]]:g} among the drawn parameters, outside its range "
                f"{low:g}…{high:g}",
                advice="Give values within the range",
            )

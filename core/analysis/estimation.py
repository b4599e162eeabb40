# SPDX-License-Identifier: GPL-3.0-or-later
"""From names of parameters to estimates: which combinations of choices are tried, what is fitted, how sure it is."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from math import nan, prod

import numpy as np

from ..errors import InputError
from ..impact_models.machinery.base import ImpactModel
from ..impact_models.machinery.parameters import ParameterSpec, Value
from ..progress import Progress
from ..remarks import Remark
from ..vectors import Array
from .clouds import Contest
from .courses import Spin
from .fitting import Axis, Fit, Sums, fit, interval, resample, watched
from .verdicts import about_choice, about_number

MOST_COMBINATIONS = 64
FEWEST_IMPACTS = 5
"""For each fitted number."""
IDLE_SPAN = 1e-9
"""A parameter that moves the mean score by less than this, over its whole range, has no effect."""


@dataclass(frozen=True)
class FitOptions:
    """How parameters are fitted.

    Attributes
    ----------
    starts : descents, from the best places of a scan of the whole range.
    seed : of all that is left to chance.
    replicates : draws of a random model for each impact, the same for all parameters that are tried.
    resamples : of the trajectories, for the intervals.
    spin, radius_m : of the blocks, as for `compare`.

    Raises
    ------
    InputError : too few of anything; says what is needed.
    """

    starts: int = 4
    seed: int = 0
    replicates: int = 16
    resamples: int = 200
    spin: Spin = "rolling"
    radius_m: float | None = None

    def __post_init__(self) -> None:
        if self.starts < 1 or self.seed < 0 or self.replicates < 2 or self.resamples < 20:
            raise InputError(
                "A fit needs a start or more, 2 replicates or more, 20 resamples or more, and a seed from 0"
            )


@dataclass(frozen=True)
class Estimate:
    """One fitted parameter.

    Attributes
    ----------
    name, unit : of the parameter.
    default : its value without a fit.
    value : fitted: a number, or the name of a choice.
    low, high : 95 % interval of a number; NaN for a choice.
    remarks : how far the value can be trusted.
    """

    name: str
    unit: str
    default: Value
    value: Value
    low: float
    high: float
    remarks: tuple[Remark, ...]

    @property
    def verdict(self) -> str:
        """The remarks as one text."""
        return " ".join(map(str, self.remarks))

    @property
    def is_determined(self) -> bool:
        """Whether the data tell the value."""
        return all(remark.severity != "problem" for remark in self.remarks)


@dataclass(frozen=True, eq=False)
class FittedModel:
    """Parameters of a model, fitted to what impacts should come to.

    Attributes
    ----------
    model : name.
    estimates : the fitted parameters, in the order asked for.
    settings : all parameters of the model, as `compare` takes them.
    impacts, trajectories : how many count.
    remarks : what the result is worth.
    """

    model: str
    estimates: tuple[Estimate, ...]
    settings: Mapping[str, Value]
    impacts: int
    trajectories: int
    remarks: tuple[Remark, ...]


@dataclass(frozen=True, eq=False)
class Question:
    """What is to be fitted.

    Attributes
    ----------
    numbers, choices : specifications of the parameters that are fitted, as numbers and by enumeration.
    axes : of the numbers.
    combinations : all settings of the model, for each combination of the choices; the first is the default.
    """

    model: ImpactModel
    numbers: tuple[ParameterSpec, ...]
    choices: tuple[ParameterSpec, ...]
    axes: tuple[Axis, ...]
    combinations: tuple[Mapping[str, Value], ...]

    def default_place(self, combination: int) -> Array:
        """(k,) of the values before the fit."""
        settings = self.combinations[combination]
        return np.array(
            [axis.place(float(settings[spec.name])) for spec, axis in zip(self.numbers, self.axes, strict=True)]
        )

    def values(self, place: Array) -> dict[str, Value]:
        """The fitted numbers at a place of the unit cube."""
        return {spec.name: axis.value(x) for spec, axis, x in zip(self.numbers, self.axes, place.tolist(), strict=True)}

    def sums(self, contest: Contest, combination: int) -> Sums:
        """The scores as a function of the place, for one combination."""
        base = self.model.numbers(self.combinations[combination])
        names = [spec.name for spec in self.model.parameters]
        where = [names.index(spec.name) for spec in self.numbers]

        def at(place: Array) -> Array:
            numbers = base.copy()
            numbers[where] = [axis.value(x) for axis, x in zip(self.axes, place.tolist(), strict=True)]
            return contest.sums(numbers)

        return at


@dataclass(frozen=True, eq=False)
class Estimation:
    """The answer.

    Attributes
    ----------
    estimates : one for each parameter that was asked for, in that order.
    settings : all parameters of the model.
    sums, default_sums : (clusters,) sums of the scores with the fitted and with the default settings.
    fits : of each combination of choices.
    best : the combination that won.
    """

    estimates: tuple[Estimate, ...]
    settings: Mapping[str, Value]
    sums: Array
    default_sums: Array
    fits: tuple[Fit, ...]
    best: int


def ask(model: ImpactModel, names: Sequence[str], fixed: Mapping[str, object] | None) -> Question:
    """Check what is to be fitted.

    Raises
    ------
    InputError : no or unknown parameter, one that is both fitted and fixed, too many combinations of choices.
    """
    names, fixed = tuple(dict.fromkeys(names)), fixed or {}
    if not names:
        raise InputError(
            f"No parameter of {model.name} is to be fitted",
            advice=f"Name some of {', '.join(spec.name for spec in model.parameters)}",
        )
    specs = [model.parameter(name) for name in names]
    both = [name for name in names if name in fixed]
    if both:
        raise InputError(f"{model.name}.{both[0]} is both fitted and set", advice="Leave out one of the two")
    choices = tuple(spec for spec in specs if spec.choices)
    number = prod(len(spec.choices) for spec in choices)
    if number > MOST_COMBINATIONS:
        raise InputError(
            f"{', '.join(spec.name for spec in choices)} have {number} combinations of choices, too many to try",
            advice=f"Choose fewer: at most {MOST_COMBINATIONS} combinations",
        )
    usual = model.settings(fixed)
    tried = sorted(product(*(spec.choices for spec in choices)), key=lambda one: _changes(one, choices, usual))
    combinations = [
        model.settings({**fixed, **{spec.name: one for spec, one in zip(choices, these, strict=True)}})
        for these in tried
    ]
    numbers = tuple(spec for spec in specs if not spec.choices)
    return Question(model, numbers, choices, tuple(Axis.of(spec) for spec in numbers), tuple(combinations))


def estimate(
    question: Question,
    contest: Contest,
    names: Sequence[str],
    options: FitOptions,
    progress: Progress,
) -> Estimation:
    """Fit all combinations, take the best, and resample the trajectories for its intervals.

    Raises
    ------
    InputError : too few impacts.
    """
    counts = contest.target.counts
    _check_enough(question, int(counts.sum()))
    fits, total = [], len(question.combinations)
    for i in range(total):
        sums = watched(question.sums(contest, i), partial(progress, f"Fitting {question.model.name}", i, total))
        fits.append(fit(sums, counts, question.default_place(i), options.starts, options.seed))
    best = int(np.argmin([found.sums.sum() for found in fits]))
    found, sums = fits[best], question.sums(contest, best)
    places = resample(sums, counts, found, options.resamples, options.seed, progress)
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = np.atleast_2d(np.corrcoef(places, rowvar=False)) if places.size else np.empty((0, 0))
    values = question.values(found.place)
    usual = question.combinations[0]
    made = {}
    for j, (spec, axis) in enumerate(zip(question.numbers, question.axes, strict=True)):
        made[spec.name] = _number(question, j, found, places, correlation, usual[spec.name], axis, sums, counts)
    for spec in question.choices:
        made[spec.name] = _choice(question, spec, fits, best, counts)
    return Estimation(
        estimates=tuple(made[name] for name in dict.fromkeys(names)),
        settings={**question.combinations[best], **values},
        sums=found.sums,
        default_sums=fits[0].scanned_sums[0],
        fits=tuple(fits),
        best=best,
    )


def _number(
    question: Question,
    j: int,
    found: Fit,
    places: Array,
    correlation: Array,
    default: Value,
    axis: Axis,
    sums: Sums,
    counts: Array,
) -> Estimate:
    spec, place = question.numbers[j], float(found.place[j])
    idle = _span(sums, found.place, j, counts) < IDLE_SPAN
    low, high = (0.0, 1.0) if idle or not len(places) else interval(places[:, j], counts.size)
    others = [(other.name, float(correlation[j, i])) for i, other in enumerate(question.numbers) if i != j]
    value = float(default) if idle else axis.value(place)
    ends = axis.value(min(low, place)), axis.value(max(high, place))
    span = place, min(low, place), max(high, place)
    remarks = tuple(about_number(spec, float(default), value, ends, span, idle, others))
    return Estimate(spec.name, spec.unit, default, value, *ends, remarks)


def _span(sums: Sums, place: Array, j: int, counts: Array) -> float:
    """How far the mean score moves when one parameter goes through its range."""
    totals = []
    for x in np.linspace(0.0, 1.0, 9):
        moved = place.copy()
        moved[j] = x
        totals.append(sums(moved))
    return float(np.max(np.ptp(np.array(totals), axis=0) / counts))


def _choice(question: Question, spec: ParameterSpec, fits: Sequence[Fit], best: int, counts: Array) -> Estimate:
    """The choice that won, and how clearly over the best of the others."""
    value = question.combinations[best][spec.name]
    others = [i for i, settings in enumerate(question.combinations) if settings[spec.name] != value]
    rival = min(others, key=lambda i: float(fits[i].sums.sum()))
    gain, error = paired_gain(fits[rival].sums, fits[best].sums, counts)
    remark = about_choice(spec.name, str(value), str(question.combinations[rival][spec.name]), gain, error, counts.size)
    return Estimate(spec.name, spec.unit, question.combinations[0][spec.name], value, nan, nan, (remark,))


def paired_gain(before: Array, after: Array, counts: Array) -> tuple[float, float]:
    """Mean score `before` less `after`, and its standard error over the clusters."""
    total = float(counts.sum())
    gain = float((before - after).sum()) / total
    if counts.size < 2:
        return gain, float("inf")
    left = before - after - gain * counts
    return gain, float(np.sqrt(counts.size / (counts.size - 1) * (left @ left)) / total)


def _changes(these: tuple[str, ...], choices: Sequence[ParameterSpec], usual: Mapping[str, Value]) -> int:
    return sum(one != usual[spec.name] for spec, one in zip(choices, these, strict=True))


def _check_enough(question: Question, impacts: int) -> None:
    needed = FEWEST_IMPACTS * max(len(question.numbers), 1)
    if impacts < needed:
        raise InputError(
            f"{impacts} impact{'s' * (impacts != 1)} can be used, which is too few to fit "
            f"{len(question.numbers) + len(question.choices)} parameter(s)",
            advice=f"Use at least {needed} impacts with a measured velocity before and after, or fit fewer parameters",
        )

# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs that are predicted from others, with a model and without any.

Without a model, a run can be predicted by what the other observed runs did: their own distribution. A model that does
not predict better than that has told nothing of the slope, however well it can be made to give what was observed.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..remarks import Remark
from ..vectors import Array, Indices
from .likelihood_free import Posterior, SimulatedSets, find_posterior, weighted_quantiles
from .ranks import FEWEST
from .run_statistics import ObservedValues, Scales, crps, find_scales, statistics_of
from .verdicts import clear_errors

FOLDS = 5
NINETY = np.array([0.05, 0.95])
SHOWN = 3
"""Quantities that a sentence names; the table has all."""
LEAST_UNIT = 0.05
"""Of the score with the model: that without it counts as no smaller, as where all observed runs are alike."""
FITTED, SET, PRIOR, ALONE = range(4)
"""Columns of scores: the posterior of the other runs, the parameters as they were set, the prior, the other observed
runs alone."""
RUN_OUT = ("", "runout_m")


@dataclass(frozen=True)
class HeldOut:
    """Runs that were predicted from the others.

    Attributes
    ----------
    names : of the runs. values : how many of theirs were predicted.
    fitted, default, prior : mean scores with the posterior of the others, with the parameters as they were set, with
        parameters drawn from the prior: the CRPS of each quantity as a part of the mean one that the distribution of
        the other observed runs has, without a model. 0 is perfect, 1 is what needs no model.
    observed_alone : that of the other observed runs themselves: 1, but for the chance of the part.
    inside : of the values within the predicted 90 % interval.
    """

    names: tuple[str, ...]
    values: int
    fitted: float
    default: float
    prior: float
    observed_alone: float
    inside: int


@dataclass(frozen=True)
class PredictedQuantity:
    """How well one quantity is predicted of runs held out: mean scores (CRPS) in its own unit, see `HeldOut`."""

    title: str
    unit: str
    section: str
    quantity: str
    n: int
    fitted: float
    default: float
    prior: float
    observed_alone: float

    @property
    def helps(self) -> bool:
        """Whether the model predicts it better than the other observed runs alone."""
        return self.fitted < self.observed_alone


@dataclass(frozen=True)
class Prediction:
    """All runs held out.

    Attributes
    ----------
    folds : in parts. quantities : by what was predicted.
    gain, error : mean over the runs of how much smaller the model's score is than that of the other observed runs
        alone, and its standard error; NaN without runs.
    runs : of which a value was predicted.
    """

    folds: tuple[HeldOut, ...]
    quantities: tuple[PredictedQuantity, ...]
    gain: float
    error: float
    runs: int

    @property
    def values(self) -> int:
        """How many were predicted."""
        return sum(fold.values for fold in self.folds)

    def score(self, of: str) -> float:
        """Mean of all values of one of the scores of `HeldOut`."""
        total = sum(getattr(fold, of) * fold.values for fold in self.folds if fold.values)
        return float(total / self.values) if self.values else np.nan

    @property
    def helps(self) -> bool:
        """Whether the model predicts better than the observed runs alone."""
        return self.gain > 0

    @property
    def is_clear(self) -> bool:
        """Whether the difference is more than chance."""
        return bool(abs(self.gain) > clear_errors(self.runs) * self.error)

    def verdict(self, model: str) -> str:
        """The model beside the observed runs alone, in a sentence."""
        if not self.values:
            return "No run could be held out: how well it predicts is not known."
        where = "; ".join(
            f"{one.title} {_amount(one.observed_alone)} without it, {_amount(one.fitted)} {one.unit}".rstrip() + " with"
            for one in self._shown()
        )
        told = f"({where}; score {self.score('fitted'):.2f}, where they have 1)"
        chance = "" if self.is_clear else ", though not clearly"
        if self.helps:
            return f"It predicts runs held out better than the other observed runs alone{chance} {told}."
        return (
            f"The other observed runs alone predict the runs held out better than {model} does{chance} {told}: "
            "their own distribution is the better forecast."
        )

    def _shown(self) -> list[PredictedQuantity]:
        """The run-out, and those that the model predicts worst beside the observed runs alone."""
        ordered = sorted(
            self.quantities,
            key=lambda one: (
                (one.section, one.quantity) != RUN_OUT,
                -one.fitted / one.observed_alone if one.observed_alone else 0.0,
            ),
        )
        return ordered[:SHOWN]

    def remarks(self, model: str) -> Iterator[Remark]:
        """How runs held out come out; whether the fit helps beside the parameters as they were set."""
        if not self.values:
            return
        inside = sum(fold.inside for fold in self.folds)
        fitted, default = self.score("fitted"), self.score("default")
        text = (
            f"Runs held out: {100 * inside / self.values:.0f} % of {self.values} values lie in the predicted 90 % "
            f"interval; score {fitted:.3f} fitted, {default:.3f} with {model} as it was set, "
            f"{self.score('prior'):.3f} with anything thought possible; 1 is that of the other observed runs alone, "
            "0 is perfect."
        )
        yield Remark(text, "note" if fitted <= default else "warning", "hold-out")
        if fitted > default:
            text = "The fit predicts runs that it has not seen no better than the parameters as they were set."
            yield Remark(text, "warning", "hold-out")


def _amount(value: float) -> str:
    return f"{value:.3g}"


def fifths(runs: int, seed: int) -> list[Indices]:
    """Each run in one of five parts, at random; as many parts as runs where these are fewer; none of a single run."""
    if runs < 2:
        return []
    return np.array_split(np.random.default_rng([seed, 20]).permutation(runs), min(FOLDS, runs))


def halves(runs: int, splits: int, seed: int) -> list[Indices]:
    """Both halves of the runs, as often as they are split at random."""
    rng = np.random.default_rng([seed, 23])
    return [half for _ in range(splits) for half in np.array_split(rng.permutation(runs), 2)]


def hold_out(
    observed: ObservedValues,
    table: SimulatedSets,
    values: Array,
    prior_sets: int,
    default: Array,
    parts: Sequence[Indices],
    *,
    by_rank: bool = False,
) -> Prediction:
    """Each part of the runs predicted from the posterior of the others.

    Parameters
    ----------
    values : (N, n, Q) of the sets in the table, the first `prior_sets` of them from the prior.
    default : (S, n, Q) simulated with the parameters as they were set.
    parts : of the runs, see `fifths` and `halves`; a run can be in several.
    by_rank : the rows are places in an order, not runs of releases of their own: a run that is held out is any of them.
    """
    n = len(observed)
    scales = find_scales(values[:prior_sets])
    predicted: list[tuple[Indices, Array, int]] = []
    for part in parts:
        others = np.setdiff1d(np.arange(n), part)
        if not np.isfinite(observed.value[others]).any() or not np.isfinite(observed.value[part]).any():
            continue
        seen = observed.seen[others]
        own = Scales(scales.centre[others], scales.spread[others])
        statistics = statistics_of(values[:, others], own, seen)
        reduced = SimulatedSets(table.place, table.weight, statistics)
        found = find_posterior(reduced, statistics_of(observed.value[others], own, seen))
        scores, inside = _scores(observed, part, others, values, found, prior_sets, default, by_rank)
        predicted.append((part, scores, inside))
    each = np.concatenate([np.zeros((0, 6)), *(scores for _, scores, _ in predicted)])
    unit = _units(each, len(observed.keys))
    folds = []
    for part, scores, inside in predicted:
        fitted, as_set, prior, alone = _in_units(scores, unit).mean(axis=0).tolist() if len(scores) else [np.nan] * 4
        names = tuple(observed.names[part].tolist())
        folds.append(HeldOut(names, len(scores), fitted, as_set, prior, alone, inside))
    return Prediction(tuple(folds), tuple(_by_quantity(observed, each)), *_gain(each, unit))


def _units(each: Array, columns: int) -> Array:
    """(Q,) the mean score of each quantity without a model; where runs were all alike, a part of that with it."""
    unit = np.ones(columns)
    for column in np.unique(each[:, 1]).astype(np.intp).tolist():
        mean = each[each[:, 1] == column, 2:].mean(axis=0)
        unit[column] = max(mean[ALONE], LEAST_UNIT * mean[FITTED]) or 1.0
    return unit


def _in_units(each: Array, unit: Array) -> Array:
    """(m, 4) scores."""
    return np.asarray(each[:, 2:] / unit[each[:, 1].astype(np.intp)][:, None])


def _scores(
    observed: ObservedValues,
    part: Indices,
    others: Indices,
    values: Array,
    found: Posterior,
    prior_sets: int,
    default: Array,
    by_rank: bool,
) -> tuple[Array, int]:
    """(m, 6) run, column and four scores of each value of the runs `part`, and how many are inside the interval."""
    rows, inside = [], 0
    n = len(observed)
    for run in part.tolist():
        taken = slice(None) if by_rank else slice(run, run + 1)
        times = n if by_rank else 1
        for column in np.flatnonzero(np.isfinite(observed.value[run])).tolist():
            seen = float(observed.value[run, column])
            alone = observed.value[others, column]
            samples = (
                (values[found.source, taken, column].ravel(), np.repeat(found.weight, times)),
                (default[:, taken, column].ravel(), np.ones(len(default) * times)),
                (values[:prior_sets, taken, column].ravel(), np.ones(prior_sets * times)),
            )
            known = [np.isfinite(sample) for sample, _ in samples]
            if any(there.sum() < FEWEST for there in known) or not np.isfinite(alone).any():
                continue
            alone = alone[np.isfinite(alone)]
            scores = [
                crps(sample[there], weight[there], seen) for (sample, weight), there in zip(samples, known, strict=True)
            ]
            rows.append([run, column, *scores, crps(alone, np.ones(alone.size), seen)])
            low, high = weighted_quantiles(samples[0][0][known[0]], samples[0][1][known[0]], NINETY)
            inside += int(low <= seen <= high)
    return np.array(rows, dtype=np.float64).reshape(-1, 6), inside


def _by_quantity(observed: ObservedValues, each: Array) -> Iterator[PredictedQuantity]:
    for i, (section, quantity) in enumerate(observed.keys):
        own = each[each[:, 1] == i]
        if len(own):
            means = own[:, 2:6].mean(axis=0).tolist()
            runs = np.unique(own[:, 0]).size
            yield PredictedQuantity(observed.title(i), observed.quantity(i).unit, section, quantity, runs, *means)


def _gain(each: Array, unit: Array) -> tuple[float, float, int]:
    """Mean and standard error over the runs of the score without a model less that with it; how many runs."""
    runs, place = np.unique(each[:, 0], return_inverse=True)
    if not runs.size:
        return np.nan, np.nan, 0
    scaled = _in_units(each, unit)
    mean = np.bincount(place, scaled[:, ALONE] - scaled[:, FITTED]) / np.bincount(place)
    error = float(mean.std(ddof=1) / np.sqrt(runs.size)) if runs.size > 1 else np.inf
    return float(mean.mean()), error, int(runs.size)

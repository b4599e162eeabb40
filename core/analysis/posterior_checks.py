# SPDX-License-Identifier: GPL-3.0-or-later
"""What a posterior is worth: intervals, whether the model gives what was observed, and words."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..remarks import Remark
from ..vectors import Array
from .held_out import Prediction
from .likelihood_free import Posterior
from .priors import Prior
from .ranks import FEWEST, holm
from .run_statistics import ObservedValues, Scales, plain_means, statistics_of, tails
from .verdicts import TOGETHER

INTERVAL = np.array([0.025, 0.25, 0.5, 0.75, 0.975])
FLAT = 0.75
"""Of the prior: an interval that keeps more of it says nothing."""
WIDE = 0.5
"""One that keeps more says little."""
EDGE, PILED = 0.05, 4.0
"""The posterior piles up at an end of the range where the outermost part has so many times its prior probability."""
UNLIKELY = 0.05
"""Of the corrected probability of what was observed."""
FEWEST_COVERED = 0.85
"""Of known parameters within their 95 % intervals; with fewer the intervals are said to be too narrow."""
NOTHING = 1e-9


@dataclass(frozen=True)
class PosteriorEstimate:
    """One parameter.

    Attributes
    ----------
    name, unit, default : of the parameter. prior : in words.
    median, low, high : 95 % interval. half_low, half_high : 50 % interval.
    kept : how much of the prior the 95 % interval keeps, 0…1; that of the prior itself is 1.
    place : of the median in the prior, 0…1: the share of it that is below.
    covered : of simulated data sets like the observed one with known parameters, the share whose parameter lies in its
        95 % interval.
    remarks : how far it can be trusted.
    """

    name: str
    unit: str
    default: float
    prior: str
    median: float
    low: float
    high: float
    half_low: float
    half_high: float
    kept: float
    place: float
    covered: float
    remarks: tuple[Remark, ...]

    @property
    def verdict(self) -> str:
        """The remarks as one text."""
        return " ".join(map(str, self.remarks))

    @property
    def left(self) -> str:
        """How much of the prior is left, and where in it, for people."""
        where = (
            "all over it" if self.kept > FLAT else ("lower", "middle", "upper")[min(int(3 * self.place), 2)] + " part"
        )
        return f"{100 * self.kept:.0f} % left, {where}"

    @property
    def is_determined(self) -> bool:
        """Whether the runs tell it."""
        return all(remark.severity != "problem" for remark in self.remarks)


@dataclass(frozen=True)
class PredictiveCheck:
    """One quantity, averaged over the observed runs, beside the same of data sets simulated with posterior draws.

    Attributes
    ----------
    title, unit, section, quantity : what. n : runs that have it.
    observed, low, median, high : means over the runs; the last three are 5, 50 and 95 % of the simulated ones.
    share, low_share, high_share : of the runs that have it, among those of which that is known.
    p, p_holm : of a mean as far out as the observed one; corrected for the number of quantities.
    """

    title: str
    unit: str
    section: str
    quantity: str
    n: int
    observed: float
    low: float
    median: float
    high: float
    share: float
    low_share: float
    high_share: float
    p: float
    p_holm: float

    @property
    def fits(self) -> bool:
        """Whether the model can give it."""
        return not self.p_holm < UNLIKELY


def estimates_of(priors: Sequence[Prior], found: Posterior, places: Array) -> tuple[PosteriorEstimate, ...]:
    """One for each parameter.

    Parameters
    ----------
    places : (q, k) of known parameters in the posteriors of their own data, see `places_of_truth`.
    """
    at = found.quantiles(INTERVAL)
    correlation = correlations(priors, found)
    made = []
    for j, prior in enumerate(priors):
        values = prior.values(at[:, j])
        covered = float(((places[:, j] > 0.025) & (places[:, j] < 0.975)).mean())
        kept = min(float(at[-1, j] - at[0, j]) / 0.95, 1.0)
        others = [(one.name, float(correlation[j, i])) for i, one in enumerate(priors) if i != j]
        remarks = tuple(_about(prior, found, j, values, kept, covered, others))
        low, half_low, median, half_high, high = values.tolist()
        made.append(
            PosteriorEstimate(
                prior.name, prior.unit, prior.default, prior.text, median, low, high, half_low, half_high, kept,
                float(at[2, j]), covered, remarks,
            )
        )  # fmt: skip
    return tuple(made)


def correlations(priors: Sequence[Prior], found: Posterior) -> Array:
    """(k, k) of the values."""
    values = np.column_stack([prior.values(column) for prior, column in zip(priors, found.place.T, strict=True)])
    covariance = np.atleast_2d(np.cov(values, rowvar=False, aweights=found.weight))
    sd = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    return np.asarray(covariance / np.outer(sd, sd))


def _about(
    prior: Prior,
    found: Posterior,
    j: int,
    values: Array,
    kept: float,
    covered: float,
    others: Sequence[tuple[str, float]],
) -> Iterator[Remark]:
    name, place = prior.name, found.place[:, j]
    low, _, _, _, high = values.tolist()
    if kept > FLAT:
        text = f"The runs cannot tell: the 95 % interval keeps {100 * kept:.0f} % of what was thought possible before."
        yield Remark(text, "problem", name)
    elif kept > WIDE:
        text = f"The runs say little: the 95 % interval keeps {100 * kept:.0f} % of what was thought possible before."
        yield Remark(text, "warning", name)
    else:
        yield Remark(f"The runs tell it: {100 * kept:.0f} % of what was thought possible is left.", "note", name)
    for which, part in (("lower", place < EDGE), ("upper", place > 1 - EDGE)):
        if kept <= FLAT and float(found.weight[part].sum()) > PILED * EDGE:
            limit = prior.axis.low if which == "lower" else prior.axis.high
            text = f"It piles up at the {which} end of its range, {limit:g}: the true value may lie beyond."
            yield Remark(text, "warning", name)
    for other, value in others:
        if abs(value) >= TOGETHER:
            text = f"It moves with {other} (correlation {value:+.2f}): only the pair is determined."
            yield Remark(text, "warning", name)
    if kept <= FLAT:
        same = low <= prior.default <= high
        text = "is among what fits" if same else "does not fit"
        yield Remark(f"The default {prior.default:g} {text}.", "note", name)
    if covered < FEWEST_COVERED:
        text = (
            f"Of simulated data sets with known parameters {100 * covered:.0f} % have theirs in the 95 % interval: "
            "it is too narrow. Simulate more sets."
        )
        yield Remark(text, "warning", name)


def predictive_checks(observed: ObservedValues, simulated: Array, scales: Scales) -> tuple[PredictiveCheck, ...]:
    """Each quantity of the observed runs beside data sets (S, n, Q) simulated with draws of the posterior."""
    seen = observed.seen
    q = len(observed.keys)
    own = statistics_of(observed.value, scales, seen)
    their = statistics_of(simulated, scales, seen)
    counted = np.isfinite(simulated).any(axis=-2)
    p = tails(np.where(counted, their[:, :q], np.nan), own[:q])
    p = np.where(np.isfinite(observed.value).any(axis=0), p, np.nan)
    share_p = tails(their[:, q : 2 * q], own[q : 2 * q])
    at_section = np.array([bool(section) for section, _ in observed.keys])
    both = np.where(at_section, np.fmin(1.0, 2 * np.fmin(p, share_p)), p)
    corrected = holm(both)
    means, own_means = plain_means(simulated, seen), plain_means(observed.value, seen)
    made = []
    for i, (section, quantity) in enumerate(observed.keys):
        known = means[np.isfinite(means[:, i]), i]
        low, middle, high = np.quantile(known, [0.05, 0.5, 0.95]).tolist() if known.size else [np.nan] * 3
        low_share, high_share = np.quantile(their[:, q + i], [0.05, 0.95]).tolist()
        made.append(
            PredictiveCheck(
                observed.title(i), observed.quantity(i).unit, section, quantity,
                int(np.isfinite(observed.value[:, i]).sum()), float(own_means[i]), low, middle, high,
                float(own[q + i]), low_share, high_share, float(both[i]), float(corrected[i]),
            )
        )  # fmt: skip
    return tuple(made)


def posterior_remarks(
    model: str, runs: int, estimates: Sequence[PosteriorEstimate], checks: Sequence[PredictiveCheck],
    prediction: Prediction, effective: float,
) -> Iterator[Remark]:  # fmt: skip
    """What the result is worth, the bad news first.

    Notes
    -----
    That the model can give what was observed is never said without how well it predicts runs that it has not seen,
    beside what the observed runs alone predict.
    """
    wrong = [one for one in checks if not one.fits]
    if wrong:
        named = ", ".join(
            f"{one.title} (observed {_short(one.observed)}, simulated {_short(one.low)}…{_short(one.high)} {one.unit})"
            for one in sorted(wrong, key=lambda one: one.p)[:3]
        )
        text = (
            f"No parameters within these ranges make {model} give what was observed in {len(wrong)} of {len(checks)} "
            f"quantities: {named}. The intervals are those of a model that does not fit; do not design with them. "
            f"{prediction.verdict(model)}"
        )
        yield Remark(text, "warning", "fit")
    unsure = [one.name for one in estimates if not one.is_determined]
    if unsure:
        text = f"These runs cannot tell {', '.join(unsure)}: what was thought possible before is still possible."
        yield Remark(text, "warning", "parameters")
    if runs < FEWEST:
        text = (
            f"Only {runs} run{'s were' if runs > 1 else ' was'} observed: intervals rest on what these happened to do."
        )
        yield Remark(text, "warning", "runs")
    if effective < 100:
        text = f"The posterior rests on {effective:.0f} sets of parameters: take more sets, or more rounds."
        yield Remark(text, "warning", "sets")
    if not wrong and checks:
        text = f"{model} can give what was observed in all {len(checks)} quantities. {prediction.verdict(model)}"
        yield Remark(text, "note" if prediction.helps else "warning", "fit")
    yield from prediction.remarks(model)


def doubts_of(remarks: Iterable[Remark]) -> tuple[str, ...]:
    """What speaks against carrying a posterior on: a model that does not fit or predict, runs that are not all."""
    return tuple(str(one) for one in remarks if one.severity == "warning" and one.about in ("fit", "completeness"))


def _short(value: float) -> str:
    """Three digits, without the rounding of what is zero."""
    return f"{0.0 if abs(value) < NOTHING else value:.3g}"

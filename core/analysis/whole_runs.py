# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole runs, simulated against observed: can the observed ones come from the simulated ones?

Every observed run is compared with the simulated runs of its own release. Where they cross sections: time, place,
speed, height above the terrain, kinetic energy; on the stretch that was observed: impacts per metre, greatest speed and
height; and how far they get: how many reach each section, run-out, energy line and place of the stop.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..impact_models.registry import find_model
from ..remarks import Remark
from ..simulation.ground import Ground
from ..vectors import Array, Indices, Names
from .observed_runs import Observed
from .paths import Paths
from .ranks import FEWEST, RankTest, holm, rank_test, reach_test
from .run_measures import QUANTITIES, REACH, Limits, Quantity, errors_of, measure_runs
from .run_statistics import crps
from .sections import Axis, Section, axis_of, crossings

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
SIGNIFICANT = 0.05
"""Of the probability that is corrected for the number of tests of a model."""


@dataclass(frozen=True, eq=False)
class Compared:
    """One quantity of one model, at a section (its name) or of whole runs ("").

    Attributes
    ----------
    observed, sigma : (n,) of each observed run, NaN where there is none; sigma is NaN where it is not known.
    count, quantiles : (n,) and (n, 5) of the simulated values of the same release, see `QUANTILES`.
    simulated, all_quantiles : (s,) all simulated values of the releases with an observed one, and their (5,) quantiles.
    score, alone : mean CRPS (0 is perfect, in the unit of the quantity) of the simulated values for the observed ones,
        and of the values of the other observed runs, without a model; NaN where nothing can be predicted.
    test : None for a quantity that is not tested.
    p, p_holm : probability that the observed come from the simulated; the latter corrected for all tests of the model.
    """

    model: str
    section: str
    quantity: Quantity
    observed: Array
    sigma: Array
    count: Indices
    quantiles: Array
    simulated: Array
    all_quantiles: Array
    score: float
    alone: float
    test: RankTest | None
    p: float
    p_holm: float = np.nan

    @property
    def n(self) -> int:
        """How many were observed."""
        return int(np.isfinite(self.observed).sum())

    @property
    def differs(self) -> bool:
        """Whether chance alone hardly gives such a difference."""
        return bool(self.p_holm < SIGNIFICANT)

    @property
    def verdict(self) -> str:
        """In words, with numbers."""
        if not self.quantity.tested:
            return "tested as speed"
        if np.isnan(self.p):
            what = "observed" if self.n < FEWEST else "with enough simulated"
            return f"too few {what} to tell ({self.test.n if self.test else self.n}, not {FEWEST})"
        if not self.differs:
            return f"no difference seen (p = {self.p:.2g}); {self.forecast}"
        if self.test is None:
            return f"differs (p = {self.p_holm:.2g}); {self.forecast}"
        lower = 100 * float(np.nanmedian(self.test.place))
        above = f"the median observed is above {lower:.0f} % of the simulated"
        return f"differs (p = {self.p_holm:.2g}): {above}; {self.forecast}"

    @property
    def helps(self) -> bool:
        """Whether the model predicts it better than the other observed runs alone."""
        return self.score < self.alone

    @property
    def forecast(self) -> str:
        """How well it is predicted with the model and without it, in words."""
        if np.isnan(self.score):
            return "nothing to predict it from"
        unit = f" {self.quantity.unit}" if self.quantity.unit else ""
        better = "better" if self.helps else "worse"
        return (
            f"predicted {better} than by the other observed runs alone ({self.score:.3g}{unit} with the model, "
            f"{self.alone:.3g}{unit} without)"
        )


@dataclass(frozen=True, eq=False)
class WholeRuns:
    """The comparison.

    Attributes
    ----------
    names : (n,) of the observed runs.
    observed : their paths. simulated : by model.
    sections, axis : see there.
    shortest_s : impacts nearer than this in time count as one, as they do in what was observed.
    compared : by model, section and quantity.
    """

    names: Names
    observed: Paths
    simulated: Mapping[str, Paths]
    sections: tuple[Section, ...]
    axis: Axis
    shortest_s: float
    compared: tuple[Compared, ...]

    def of(self, model: str) -> tuple[Compared, ...]:
        """What there is of a model."""
        return tuple(one for one in self.compared if one.model == model)

    def find(self, model: str, section: str, quantity: str) -> Compared:
        """One of them."""
        return next(one for one in self.of(model) if (one.section, one.quantity.name) == (section, quantity))


def whole_run_remarks(comparison: WholeRuns) -> tuple[Remark, ...]:
    """What is not seen, and a sentence for each model."""
    remarks = []
    unseen = int(np.isnan(comparison.observed.stop[:, 0]).sum())
    if unseen:
        text = (
            f"{unseen} of {len(comparison.observed)} observed runs are not seen to their stop: they do not count there."
        )
        remarks.append(Remark(text, "note", "stops"))
    for model in comparison.simulated:
        title = find_model(model).title
        known = [one for one in comparison.of(model) if np.isfinite(one.p_holm)]
        if not known:
            text = f"{title}: too few runs were observed to tell anything ({FEWEST} are needed)."
            remarks.append(Remark(text, "warning", model))
            continue
        clearest = min(known, key=lambda one: one.p)
        differ = sum(one.differs for one in known)
        where = f" at {clearest.section}" if clearest.section else ""
        what = f"{clearest.quantity.title}{where} (p = {clearest.p:.2g}, corrected {clearest.p_holm:.2g}"
        what += f"{_medians(clearest)})"
        forecast, helps = _forecast(known)
        if differ:
            text = f"{title} differs from what was observed in {differ} of {len(known)} tests, most in {what}."
        else:
            few = min(one.test.n if one.test else one.n for one in known)
            text = (
                f"{title}: no difference seen in {len(known)} tests, of {few} runs and more: a difference that is "
                f"small beside their scatter would not show. The least probable is {what}."
            )
        remarks.append(Remark(f"{text} {forecast}", "note" if helps else "warning", model))
    return tuple(remarks)


def _forecast(tests: Sequence[Compared]) -> tuple[str, bool]:
    """How the model predicts beside the other observed runs alone, and whether better in more than half."""
    known = [one for one in tests if np.isfinite(one.score)]
    if not known:
        return "Nothing shows how well it predicts.", False
    worse = [one for one in known if not one.helps]
    told = max(known, key=lambda one: (one.quantity.name == "runout_m", one.score / max(one.alone, 1e-12)))
    unit = f" {told.quantity.unit}" if told.quantity.unit else ""
    where = f" at {told.section}" if told.section else ""
    amounts = (
        f"{told.quantity.title}{where} to {told.alone:.3g}{unit} without the model, {told.score:.3g}{unit} with it"
    )
    if 2 * len(worse) < len(known):
        text = f"It predicts {len(known) - len(worse)} of {len(known)} quantities better than the other observed runs"
        return f"{text} alone do ({amounts}).", True
    text = f"The other observed runs alone predict {len(worse)} of {len(known)} quantities better than it does"
    return f"{text} ({amounts}).", False


def _medians(one: Compared) -> str:
    """Of both."""
    if one.test is None:
        return ""
    unit = f" {one.quantity.unit}"
    return f"; medians {np.nanmedian(one.observed):.3g}{unit} observed, {one.all_quantiles[2]:.3g}{unit} simulated"


def compare_runs(
    observed: Observed,
    simulated: Mapping[str, Paths],
    ground: Ground,
    sections: Sequence[Section],
    axis: Axis | None = None,
    seed: int = 0,
) -> WholeRuns:
    """Compare observed runs with the simulated runs of the same releases, model by model.

    Parameters
    ----------
    simulated : by model; the names of their releases are those of the observed runs.
    axis : None takes that of the observed runs.
    seed : of the observation errors that the simulated values are given, and of the test.

    Notes
    -----
    The standard deviation of an observed value is added to its simulated values as a random error, so that like is
    compared with like. What counts only on the observed stretch is read off the simulated runs on the same length in
    plan, or up to the same number of impacts. A stop counts only where it was observed; a block that leaves the terrain
    has its run-out there.
    """
    paths = observed.paths
    axis = axis or axis_of(paths)
    limits = Limits.of(paths)

    def measure(these: Paths) -> dict[tuple[str, str], Array]:
        return measure_runs(these, sections, axis, ground, limits)

    values = measure(paths)
    sigma = errors_of(observed, values, measure)
    compared: list[Compared] = []
    for model, runs in simulated.items():
        own = [np.flatnonzero(runs.name == name) for name in paths.name]
        place = np.repeat(np.arange(len(paths)), [part.size for part in own])
        runs = runs.take(np.concatenate(own))
        their = measure_runs(runs, sections, axis, ground, limits.take(place))
        reach = [_reach(model, section, paths, runs, axis, place) for section in sections]
        found = [
            _compare(model, section, quantity, values[section, quantity], sigma[section, quantity], part, place, seed)
            for (section, quantity), part in their.items()
        ]
        corrected = holm(np.array([one.p for one in (*reach, *found)]))
        pairs = zip((*reach, *found), corrected.tolist(), strict=True)
        compared += [replace(one, p_holm=p) for one, p in pairs]
    return WholeRuns(paths.name, paths, dict(simulated), tuple(sections), axis, limits.shortest_s, tuple(compared))


def _compare(
    model: str, section: str, name: str, observed: Array, sigma: Array, simulated: Array, place: Indices, seed: int
) -> Compared:
    """One quantity: observed (n,) against simulated (m,), of which each belongs to the observed one at `place` (m,)."""
    quantity = QUANTITIES[name]
    rng = np.random.default_rng([seed, len(section), len(name)])
    as_seen = simulated + np.nan_to_num(sigma)[place] * rng.standard_normal(simulated.size)
    borders = np.searchsorted(place, np.arange(1, len(sigma)))
    parts = [part[np.isfinite(part)] for part in np.split(simulated, borders)]
    known = np.isfinite(observed)
    test = rank_test(observed, np.split(as_seen, borders), seed) if quantity.tested else None
    some = [part for part, there in zip(parts, known.tolist(), strict=True) if there]
    together = np.concatenate(some) if some else np.zeros(0)
    count, quantiles = np.array([part.size for part in parts]), np.stack([_quantiles(part) for part in parts])
    score, alone = _scores(observed, np.split(as_seen, borders))
    return Compared(
        model, section, quantity, observed, sigma, count, quantiles, together, _quantiles(together), score, alone, test,
        test.p if test else np.nan,
    )  # fmt: skip


def _scores(observed: Array, simulated: Sequence[Array]) -> tuple[float, float]:
    """Mean scores of observed values (n,) by the simulated ones of each, and by the other observed ones.

    Both are of those values alone that each can predict.
    """
    known = np.flatnonzero(np.isfinite(observed))
    scores = []
    for i in known.tolist():
        others = observed[known[known != i]]
        own = simulated[i][np.isfinite(simulated[i])]
        if own.size >= FEWEST and others.size:
            value = float(observed[i])
            scores.append([crps(each, np.ones(each.size), value) for each in (own, others)])
    score, alone = np.mean(scores, axis=0).tolist() if scores else (np.nan, np.nan)
    return score, alone


def _reach(model: str, section: Section, paths: Paths, runs: Paths, axis: Axis, place: Indices) -> Compared:
    """How many blocks reach a section: 1 for each observed one that does, 0 for one that stops before."""
    own, their = crossings(paths, section, axis), crossings(runs, section, axis)
    stayed = paths.whole & np.isfinite(paths.stop[:, 0]) & ~own.crosses & ~own.given
    number = np.bincount(place, minlength=len(paths))
    share = (np.bincount(place, their.crosses, len(paths)) + 1) / (number + 2)
    known = own.crosses | stayed
    among = ~own.given & (number > 0) & (paths.length_m > 0)
    p = reach_test(own.crosses[among], stayed[among], share[among]) if known.sum() >= FEWEST else np.nan
    observed = np.where(known, own.crosses.astype(np.float64), np.nan)
    nothing = np.full((len(paths), len(QUANTILES)), np.nan)
    nothing[:, 2] = np.bincount(place, their.crosses, len(paths)) / np.maximum(number, 1)
    mean = np.full(len(QUANTILES), np.nan)
    mean[2] = nothing[among, 2].mean() if among.any() else np.nan
    score, alone = _reach_scores(observed[known & among], nothing[known & among, 2])
    unknown = np.full(len(paths), np.nan)
    return Compared(
        model, section.name, REACH, observed, unknown, number, nothing, np.zeros(0), mean, score, alone, None, p
    )  # fmt: skip


def _reach_scores(reached: Array, share: Array) -> tuple[float, float]:
    """As `_scores`, of blocks that reach a section (1) or not (0); of two outcomes the CRPS is a square (Brier)."""
    if reached.size < 2:
        return np.nan, np.nan
    others = (reached.sum() - reached) / (reached.size - 1)
    return float(((share - reached) ** 2).mean()), float(((others - reached) ** 2).mean())


def _quantiles(values: Array) -> Array:
    return np.asarray(np.quantile(values, QUANTILES)) if values.size else np.full(len(QUANTILES), np.nan)

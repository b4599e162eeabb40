# SPDX-License-Identifier: GPL-3.0-or-later
"""Back-analysis: parameters of a model, and friction, with which whole runs come out as those that were observed.

Sets of parameters are simulated, each with a block for every observed run that starts as that one did; what is read
off them is compared with what was read off the observed ones. See `likelihood_free` for how the posterior is found.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..analysis.back_analysis import BackAnalysis
from ..analysis.completeness import (
    NOT_STATED,
    PART,
    RUN_OUT,
    Completeness,
    IfLongest,
    check_stops,
    completeness_remarks,
    find_short_runs,
    longest_first,
    names_that_fell,
    posterior_if_longest,
    run_outs,
)
from ..analysis.held_out import fifths, hold_out
from ..analysis.likelihood_free import Posterior, SimulatedSets, check_size, places_of_truth, sample_posterior
from ..analysis.observed_runs import Observed
from ..analysis.paths import Paths, simulated_paths
from ..analysis.posterior_checks import (
    correlations,
    doubts_of,
    estimates_of,
    posterior_remarks,
    predictive_checks,
)
from ..analysis.priors import Prior
from ..analysis.ranks import FEWEST
from ..analysis.run_measures import AT_SECTIONS, Limits, errors_of, measure_rebounds, measure_runs
from ..analysis.run_statistics import (
    LEAST_ERROR,
    Key,
    ObservedValues,
    Scales,
    columns_of,
    find_scales,
    statistics_of,
    with_errors,
)
from ..analysis.sections import Axis, Section, axis_of, crossings, default_sections
from ..errors import InputError
from ..impact_models.registry import find_model
from ..progress import CancelledError, Progress, silent
from ..remarks import gravest_first
from ..simulation.engine import Recorded, Settings, check_settings, simulate
from ..simulation.ground import Ground
from ..simulation.parameter_draws import FRICTION_NAME, ParameterDraws
from ..simulation.release import Releases
from ..vectors import Array, Indices, Names

SETS, ROUNDS = 2000, 3
"""Sets of parameters in a round, and rounds."""
CHECKED = 500
"""Sets that are drawn from the posterior and simulated anew, and as many with the parameters as they were set."""
TRUTHS = 200
"""Simulated data sets with known parameters that are analysed as the observed one is."""
RUNS_AT_ONCE = 16_384
FAR_M = 1e9
"""No run is longer."""


def back_analyse(
    ground: Ground,
    observed: Observed,
    releases: Releases,
    settings: Settings,
    priors: Sequence[Prior],
    sections: Sequence[Section] = (),
    *,
    sets: int = SETS,
    rounds: int = ROUNDS,
    completeness: Completeness = NOT_STATED,
    parts: Sequence[Indices] | None = None,
    threads: int | None = None,
    progress: Progress = silent,
) -> BackAnalysis:
    """Find the posterior of some parameters.

    Parameters
    ----------
    releases : one or several for each observed run, of its name; see `released_as_observed`.
    settings : the model, and all that is not fitted; their seed is that of everything here.
    sections : none takes the default ones of the observed runs.
    sets, rounds : sets of parameters in a round.
    completeness : whether the observed runs are all that fell. Of the longest of a number of falls as many blocks are
        simulated, and the longest of them compared.
    parts : runs that are predicted from the others, see `analysis.held_out`; None takes fifths.

    Raises
    ------
    InputError : no run that says anything, a run without a release, settings that cannot be, too few sets, a
        completeness that cannot be.
    CancelledError : the work was ended.
    """
    started = time.perf_counter()
    check_size(sets, rounds)
    check_settings(ground, settings)
    for prior in priors:
        for zone, own in settings.zones.items():
            if prior.name in own:
                raise InputError(
                    f"The zone {zone} has a {prior.name} of its own", advice="Leave it out there to fit it"
                )
    if not sections and observed.paths.impact_piece.size:
        sections = default_sections(observed.paths, FEWEST, ground.shift.z)
    values = observe_values(observed, sections, ground)
    by_rank = completeness.kind == "longest"
    fell = names_that_fell(completeness, observed.paths.name, releases.name)
    check_stops(completeness, values)
    if by_rank:
        values = values.take(np.argsort(-run_outs(values), kind="stable"))
        completeness = replace(completeness, falls=fell.size)
    work = _Work(
        ground, observed, releases, settings, tuple(priors), tuple(sections), values, fell, by_rank, threads, progress
    )
    total = rounds * sets + 2 * CHECKED
    table, found, simulated, scales = _sampled(work, sets, rounds, total)
    progress("Checking the posterior", rounds * sets, total)
    chosen = found.place[_by_weight(found.weight, CHECKED, settings.seed)]
    drawn = work.simulated(_values_at(priors, chosen), len(table), total)
    predicted = work.seen(drawn, scales, len(table))
    as_set = len(table) + CHECKED
    plain = work.seen(work.simulated(None, as_set, total), scales, as_set)
    progress("Predicting runs that are held out", total, total)
    places = places_of_truth(table, found, TRUTHS, settings.seed)
    estimates = estimates_of(priors, found, places)
    checks = predictive_checks(values, predicted, scales)
    held_out = fifths(len(values), settings.seed) if parts is None else parts
    prediction = hold_out(values, table, simulated, sets, plain, held_out, by_rank=by_rank)
    short_runs = None if by_rank else find_short_runs(values, work.seen(drawn, scales, len(table), 0.0))
    if_longest = (
        None
        if completeness.kind in ("complete", "longest")
        else _if_longest(priors, posterior_if_longest(values, table, simulated, sets))
    )
    title = find_model(settings.model).title
    remarks = [*posterior_remarks(title, len(values), estimates, checks, prediction, found.effective)]
    remarks += completeness_remarks(completeness, short_runs, if_longest, len(values))
    draws = ParameterDraws(
        tuple(prior.name for prior in priors), _values_at(priors, found.place), found.weight,
        before=tuple(f"{one.prior}: {one.left}" for one in estimates), doubts=doubts_of(remarks),
    )  # fmt: skip
    return BackAnalysis(
        settings.model, settings, tuple(priors), values, draws, correlations(priors, found), estimates, checks,
        prediction, predicted, found.effective, total * fell.size, time.perf_counter() - started, completeness,
        fell.size, short_runs, if_longest, tuple(gravest_first([*releases.remarks, *remarks])),
    )  # fmt: skip


def _if_longest(priors: Sequence[Prior], found: Posterior | None) -> IfLongest | None:
    if found is None:
        return None
    at = found.quantiles(np.array([0.025, 0.5, 0.975]))
    low, median, high = (tuple(float(prior.values(row[j : j + 1])[0]) for j, prior in enumerate(priors)) for row in at)
    return IfLongest(PART, tuple(prior.name for prior in priors), median, low, high)


def observe_values(observed: Observed, sections: Sequence[Section], ground: Ground) -> ObservedValues:
    """What is read off the observed runs, of those that say anything.

    Raises
    ------
    InputError : none does.
    """
    paths = observed.paths
    axis, limits = axis_of(paths), _limits(paths)

    def measure(these: Paths) -> dict[Key, Array]:
        return _measured(these, sections, axis, ground, limits)

    found = measure(paths)
    few = np.bincount(paths.run[paths.impact_piece], minlength=len(paths)) < 2
    found["", "impacts_per_m"][few] = np.nan  # the way to the first impact is that of the release
    sigma = errors_of(observed, found, measure)
    seen = {key: np.isfinite(column) for key, column in found.items()}
    for section in sections:
        crossed = crossings(paths, section, axis)
        stayed = paths.whole & np.isfinite(paths.stop[:, 0]) & ~crossed.crosses & ~crossed.given
        for quantity in AT_SECTIONS:
            seen[section.name, quantity.name] |= stayed
    keys = tuple(key for key in found if np.isfinite(found[key]).any() and key[1] != "kinetic_J")
    if not keys:
        raise InputError(
            "No observed run says anything: there is no impact followed by a flight, and no stop",
            advice="Give runs with two impacts or more, or with a stop",
        )
    return ObservedValues(
        paths.name, keys, columns_of(keys, found), columns_of(keys, sigma), columns_of(keys, seen).astype(np.bool_)
    )


def _limits(paths: Paths) -> Limits:
    """Up to where runs were observed; those that were seen to their stop have no limit: it would tell of them."""
    limits, whole = Limits.of(paths), paths.whole & np.isfinite(paths.stop[:, 0])
    return Limits(
        np.where(whole, np.iinfo(np.intp).max, limits.impacts),
        np.where(whole, FAR_M, limits.length_m),
        limits.shortest_s,
    )


def _measured(
    paths: Paths, sections: Sequence[Section], axis: Axis, ground: Ground, limits: Limits
) -> dict[Key, Array]:
    return measure_runs(paths, sections, axis, ground, limits) | measure_rebounds(paths, limits)


def _values_at(priors: Sequence[Prior], place: Array) -> Array:
    return np.column_stack([prior.values(column) for prior, column in zip(priors, place.T, strict=True)])


def _by_weight(weight: Array, number: int, seed: int) -> Indices:
    """(number,) draws, each as often as its weight says (systematic resampling)."""
    start = np.random.default_rng([seed, 21]).random()
    up_to = np.cumsum(weight)
    chosen = np.searchsorted(up_to, (np.arange(number) + start) / number * up_to[-1])
    return np.asarray(np.minimum(chosen, weight.size - 1))


@dataclass(frozen=True, eq=False)
class _Work:
    """Everything that one set of parameters is simulated with.

    Attributes
    ----------
    fell : of the release of each block that falls with a set.
    by_rank : whether the longest of them are compared, in their order; else each with the run of its own release.
    """

    ground: Ground
    observed: Observed
    releases: Releases
    settings: Settings
    priors: tuple[Prior, ...]
    sections: tuple[Section, ...]
    values: ObservedValues
    fell: Names
    by_rank: bool
    threads: int | None
    progress: Progress

    def simulated(self, sets: Array | None, first: int, total: int) -> Array:
        """(S, n, Q) values of sets (S, k), the first of which has the number `first`; None for `CHECKED` plain ones.

        They are without the errors of the observed ones.
        """
        number = CHECKED if sets is None else len(sets)
        at_once = max(1, RUNS_AT_ONCE // self.fell.size)
        parts = [
            self._chunk(None if sets is None else sets[start : start + at_once], first + start, size, total)
            for start in range(0, number, at_once)
            if (size := min(at_once, number - start))
        ]
        return np.concatenate(parts)

    def seen(self, values: Array, scales: Scales, first: int, least: float = LEAST_ERROR) -> Array:
        """(S, n, Q) values as they would have been observed, of sets from the number `first` on; see `with_errors`.

        Those of the longest have their own errors alone: others would change which are the longest, and the scatter of
        a few ranks, and with it what fits.
        """
        if self.by_rank:
            least = 0.0
        return with_errors(self.values, scales, values, np.random.default_rng([self.settings.seed, 19, first]), least)

    def _chunk(self, sets: Array | None, first: int, size: int, total: int) -> Array:
        n = self.fell.size
        settings = self.settings
        if sets is not None:
            names = tuple(prior.name for prior in self.priors)
            in_turn = np.roll(sets, first % size, axis=0)  # run r takes the set (r // n) % size
            settings = replace(settings, draws=ParameterDraws(names, in_turn, np.ones(size), runs_each=n))

        def counted(_: str, done: int = 0, __: int = 0) -> None:
            self.progress("Simulating sets of parameters", first + done // n, total)

        record: Recorded = "all" if self.observed.paths.impact_piece.size else "ends"
        simulation = simulate(
            self.ground, self.releases.take(self._rows(first, size)), settings,
            record=record, first_run=first * n, threads=self.threads, progress=counted,
        )  # fmt: skip
        if len(simulation) < simulation.wanted:
            raise CancelledError
        paths = self.observed.paths
        limits, axis = _limits(paths), axis_of(paths)
        if self.by_rank:  # each of them was seen to its stop
            limits = limits.take(np.zeros(n, dtype=np.intp))
        limits = limits.take(np.tile(np.arange(n), size))
        found = _measured(simulated_paths(simulation), self.sections, axis, self.ground, limits)
        values = columns_of(self.values.keys, found).reshape(size, n, -1)
        if not self.by_rank:
            return values
        return longest_first(values, found[RUN_OUT].reshape(size, n), len(self.values))

    def _rows(self, first: int, size: int) -> Indices:
        """(size · n,) releases of the sets from the number `first` on, run by run."""
        columns = []
        for place, name in enumerate(self.fell.tolist()):
            own = np.flatnonzero(self.releases.name == name)
            if not own.size:
                raise InputError("No block is released for this run", trajectory=name, advice="Give its release")
            again = int((self.fell[:place] == name).sum())
            columns.append(own[(np.arange(first, first + size) + again) % own.size])
        return np.stack(columns, axis=1).ravel()


def _sampled(work: _Work, sets: int, rounds: int, total: int) -> tuple[SimulatedSets, Posterior, Array, Scales]:
    """The posterior, and what the sets that it is from gave: (N, n, Q)."""
    kept: list[Array] = []
    scales: list[Scales] = []

    def simulated(place: Array, first: int) -> Array:
        values = work.simulated(_values_at(work.priors, place), first, total)
        if not scales:
            scales.append(find_scales(values))
        values = work.seen(values, scales[0], first)
        kept.append(values)
        return statistics_of(values, scales[0], work.values.seen)

    def seen() -> Array:
        return statistics_of(work.values.value, scales[0], work.values.seen)

    table, found = sample_posterior(simulated, seen, len(work.priors), sets, rounds, work.settings.seed)
    return table, found, np.concatenate(kept), scales[0]


def posterior_settings(analysis: BackAnalysis) -> tuple[dict[str, object], float]:
    """The parameters of the model with the medians of the posterior, and friction."""
    medians = {one.name: one.median for one in analysis.estimates}
    friction = medians.pop(FRICTION_NAME, analysis.settings.friction)
    return {**analysis.settings.parameters, **medians}, friction

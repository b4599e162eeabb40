# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether the observed runs are all that fell: what is stated, what the runs look like, and what it would change.

An inventory often has only the blocks that came far. Parameters that are fitted to these as if they were all make every
block come as far. Where it is stated that the observed runs are the longest of a number of falls, as many are
simulated, and the longest of them are compared (the k largest of n values: order statistics). Where nothing is stated,
the shortest observed runs and their scatter are held against those of data sets simulated with the posterior, which an
inventory that lacks the short runs differs from; and it is computed what the parameters would be if it did.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..errors import InputError
from ..remarks import Remark
from ..vectors import Array, Names
from .likelihood_free import Posterior, SimulatedSets, find_posterior
from .ranks import FEWEST
from .run_statistics import ObservedValues, find_scales, statistics_of

Kind = Literal["", "complete", "longest", "unknown"]
KINDS: tuple[Kind, ...] = ("complete", "longest", "unknown")
FORMS = "complete, longest:N (of N falls) or unknown"
RUN_OUT = ("", "runout_m")
PART = 1 / 3
"""Of the falls, of which it is computed what the parameters would be if only the longest of so many were known."""
UNLIKELY = 0.05
FEWEST_SETS = 20
"""Draws of equal weight; from fewer nothing is said."""
FEWEST_SIMULATED = 19


@dataclass(frozen=True)
class Completeness:
    """What is stated of the observed runs.

    Attributes
    ----------
    kind : "complete": all that fell; "longest": those that came farthest; "unknown"; empty where nothing is stated.
    falls : of "longest", how many fell in all; None takes as many as releases are given.
    """

    kind: Kind = ""
    falls: int | None = None

    @property
    def text(self) -> str:
        """As `parse_completeness` takes it."""
        return f"{self.kind}:{self.falls}" if self.falls else self.kind


NOT_STATED = Completeness()


def parse_completeness(text: str) -> Completeness:
    """What a text states: `complete`, `longest`, `longest:N`, `unknown`, or nothing.

    Raises
    ------
    InputError : anything else.

    >>> parse_completeness("longest:80")
    Completeness(kind='longest', falls=80)
    """
    kind, colon, number = (part.strip() for part in text.strip().partition(":"))
    if not text.strip():
        return Completeness()
    whole = number.isdecimal() and 0 < int(number) < 10**9
    for known in KINDS:
        if kind == known and (not colon or (known == "longest" and whole)):
            return Completeness(known, int(number) if colon else None)
    raise InputError(f"'{text}' says nothing of whether all falls were recorded", advice=f"Write {FORMS}")


def names_that_fell(stated: Completeness, observed: Names, released: Names) -> Names:
    """(n,) of the release of each block that fell, the observed ones first.

    Parameters
    ----------
    observed : (k,) names of the observed runs. released : those that blocks are released with.

    Raises
    ------
    InputError : the longest of an unknown number, of fewer falls than runs or releases.

    Notes
    -----
    Falls of which there is no release are taken to have started as the others did.
    """
    if stated.kind != "longest":
        return observed
    others = np.array([name for name in dict.fromkeys(released.tolist()) if name not in set(observed.tolist())])
    known = np.concatenate([observed, others.astype(observed.dtype)]) if others.size else observed
    number = stated.falls or known.size
    if stated.falls is None and not others.size:
        raise InputError(
            f"The {len(observed)} observed runs are the longest, and it is not stated of how many falls",
            advice="Write longest:N, or give the releases of all blocks that fell",
        )
    if number < known.size:
        what = f"{known.size} blocks that were released" if others.size else f"{known.size} observed runs"
        raise InputError(
            f"There are {what}, more than the {number} falls that are stated", advice="Correct the number of falls"
        )
    return known[np.arange(number) % known.size]


def check_stops(stated: Completeness, observed: ObservedValues) -> None:
    """Whether the run-out of all runs is known, where the longest are.

    Raises
    ------
    InputError : it is not.
    """
    if stated.kind != "longest":
        return
    for name in observed.names[np.isnan(run_outs(observed))].tolist():
        raise unseen_stop(name)


def unseen_stop(name: str) -> InputError:
    """That a run of which nobody saw the stop cannot be one of the longest."""
    return InputError(
        "The observed runs are stated to be the longest, and this one is not seen to its stop",
        trajectory=name,
        advice="Give its stop, or leave it out",
    )


def run_outs(observed: ObservedValues) -> Array:
    """(n,) run-out of each, NaN where it is not known."""
    if RUN_OUT not in observed.keys:
        return np.full(len(observed), np.nan)
    return observed.value[:, observed.keys.index(RUN_OUT)]


def longest_first(values: Array, run_out: Array, number: int) -> Array:
    """The `number` longest of the runs of each data set, the longest first: (S, number, Q) of (S, n, Q).

    Parameters
    ----------
    run_out : (S, n), NaN where there is none.
    """
    order = np.argsort(-np.nan_to_num(run_out, nan=-np.inf), axis=1, kind="stable")[:, :number]
    return np.asarray(np.take_along_axis(values, order[..., None], axis=1))


@dataclass(frozen=True)
class ShortRuns:
    """Whether short runs are missing among the observed ones.

    Attributes
    ----------
    n : runs whose run-out is known.
    shortest, simulated_shortest : of the observed runs, and the median of that of simulated data sets [m].
    p_shortest : share of the simulated data sets whose shortest run is as long beside the others.
    p_scatter : share of those whose run-outs scatter as little.
    p : of both together.
    """

    n: int
    shortest: float
    simulated_shortest: float
    p_shortest: float
    p_scatter: float

    @property
    def p(self) -> float:
        """The smaller one, for two tests."""
        return min(1.0, 2 * min(self.p_shortest, self.p_scatter))


def find_short_runs(observed: ObservedValues, simulated: Array) -> ShortRuns | None:
    """Hold the shortest observed run and the scatter against data sets (S, n, Q); None with fewer than `FEWEST` runs.

    Notes
    -----
    The blocks of a data set start as the observed ones did, so that starts that are not alike scatter on both sides.
    """
    known = np.flatnonzero(np.isfinite(run_outs(observed)))
    if known.size < FEWEST:
        return None
    their = simulated[:, known, observed.keys.index(RUN_OUT)]
    their = their[np.isfinite(their).all(axis=1)]
    if len(their) < FEWEST_SIMULATED:
        return None
    own = run_outs(observed)[known]
    shortest, scatter = _shortest_and_scatter(their)
    own_shortest, own_scatter = _shortest_and_scatter(own[None])
    number = len(their) + 1
    return ShortRuns(
        int(known.size), float(own.min()), float(np.median(their.min(axis=1))),
        float(((shortest >= own_shortest).sum() + 1) / number), float(((scatter <= own_scatter).sum() + 1) / number),
    )  # fmt: skip


def _shortest_and_scatter(run_out: Array) -> tuple[Array, Array]:
    """(S,) of run-outs (S, n): the shortest less the mean, and the mean deviation."""
    away = run_out - run_out.mean(axis=1, keepdims=True)
    return away.min(axis=1), np.abs(away).mean(axis=1)


@dataclass(frozen=True)
class IfLongest:
    """What the parameters would be if only the longest part of the falls had been observed.

    Attributes
    ----------
    part : of the falls, 0…1.
    names : of the parameters. median, low, high : of each, with the 95 % interval.
    """

    part: float
    names: tuple[str, ...]
    median: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]


def posterior_if_longest(
    observed: ObservedValues, table: SimulatedSets, values: Array, prior_sets: int, part: float = PART
) -> Posterior | None:
    """The posterior if the observed runs were the longest part of the falls; None where that cannot be told.

    Parameters
    ----------
    values : (N, n, Q) of the sets in the table, a run for each observed one, the first `prior_sets` from the prior.

    Notes
    -----
    The sets are those that were simulated: of each the longest part of its runs stands for the longest part of more. So
    its interval is that of fewer runs than were observed, too wide rather than too narrow.
    """
    n = len(observed)
    number = round(part * n)
    if number < FEWEST or np.isnan(run_outs(observed)).any():
        return None
    column = observed.keys.index(RUN_OUT)
    longest = longest_first(values, values[..., column], number)
    pooled = find_scales(longest[:prior_sets].reshape(-1, 1, len(observed.keys)))
    all_count = np.ones((number, len(observed.keys)), dtype=np.bool_)
    statistics = statistics_of(longest, pooled, all_count)
    found = find_posterior(
        SimulatedSets(table.place, table.weight, statistics), statistics_of(observed.value, pooled, observed.seen)
    )
    return found if found.effective >= FEWEST_SETS else None


def completeness_remarks(
    stated: Completeness, found: ShortRuns | None, changed: IfLongest | None, runs: int
) -> Iterator[Remark]:
    """What is stated of the observed runs, whether they look like it, and what it would change.

    Parameters
    ----------
    runs : that were observed.
    """
    if stated.kind == "longest":
        yield _of_the_longest(stated, runs)
        return
    sign = ""
    if found is not None and found.p < UNLIKELY:
        what = (
            f"the shortest observed run is {found.shortest:.3g} m, where that of simulated ones is "
            f"{found.simulated_shortest:.3g} m"
            if found.p_shortest <= found.p_scatter
            else "the run-outs scatter less than simulated ones"
        )
        sign = f"Short runs seem to be missing: {what} (p = {found.p:.2g})."
    if stated.kind == "complete":
        if sign:
            text = f"{sign} The record is stated to be complete; if it is, the model does not scatter as the blocks do."
            yield Remark(text, "warning", "completeness")
        return
    if not sign:
        sign = "Too few run-outs are known to test it."
        if found is not None:
            sign = f"The test finds no missing short runs (p = {found.p:.2g}); with few runs it finds them rarely."
    if changed is not None:
        values = ", ".join(
            f"{name} {median:.3g} ({low:.3g} … {high:.3g})"
            for name, median, low, high in zip(changed.names, changed.median, changed.low, changed.high, strict=True)
        )
        sign += f" If they are the longest third of all falls, the parameters are {values}."
    missing = found is not None and found.p < UNLIKELY
    text = f"{_not_known(stated)} {sign}{_how_to_state(stated)}"
    yield Remark(text, "warning" if missing else "advice", "completeness")


def _of_the_longest(stated: Completeness, runs: int) -> Remark:
    text = (
        f"The {runs} observed runs are compared with the longest of {stated.falls} that fall, as it is stated of them."
    )
    return Remark(text, "note", "completeness")


def _not_known(stated: Completeness) -> str:
    if stated.kind:
        return "Whether all falls were recorded is stated to be unknown."
    return "It is not stated whether all falls were recorded, or only those that came far."


def _how_to_state(stated: Completeness) -> str:
    return "" if stated.kind else f" State the completeness: {FORMS}."


def compared_completeness(stated: Completeness, runs: int) -> Iterator[Remark]:
    """What is stated of observed runs that simulated ones are compared with."""
    if stated.kind == "longest":
        yield _of_the_longest(stated, runs)
    elif stated.kind != "complete":
        text = (
            f"{_not_known(stated)} Where short ones are missing, models look as if their blocks stopped too soon, and "
            "the other observed runs alone look like a better forecast than they are."
        )
        yield Remark(f"{text}{_how_to_state(stated)}", "advice", "completeness")

# SPDX-License-Identifier: GPL-3.0-or-later
"""What observed statistics say of parameters when only simulations, and no likelihood, relate the two.

Approximate Bayesian computation (Beaumont et al. 2002, 2009). Parameters are places in the unit cube, where the prior
is even. Sets of them are simulated in rounds: the first from the prior, each later one around the posterior so far;
weights 1/q make up for how they were proposed. The statistics, which may be many, are projected to one for each
parameter, its estimate by a regression (Fearnhead & Prangle 2012); the sets whose projections are nearest to the
observed ones are taken, and what is left of the difference is taken out by a local linear regression of the normal
quantile of the place, so that no draw leaves the range. Both regressions say of each set what they would without it:
else the intervals are too narrow.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..errors import InputError
from ..vectors import Array, Indices
from .projection import LEAST_LEFT, Projection, project

DEFENSIVE = 0.2
"""This part of later rounds is from the prior, so that no weight is larger than its inverse."""
WIDENED = 2.0
"""Proposals are around the draws with so many times their covariance (Beaumont et al. 2009)."""
ACCEPTED = (0.1, 0.05, 0.025)
"""One of these parts of all sets is taken, the nearest ones, that from which most draws count; `FEWEST_ACCEPTED` at
least. Where the posterior is narrow, the first reaches sets far away whose weights are large."""
FEWEST_ACCEPTED = 150
NEARER = 0.35
"""Of the sets, those among which the nearest are looked for once more."""
INSIDE = 1e-6
"""Places keep so far from the ends of the range, whose normal quantile is infinite."""
CONFIDENCE = 0.95


@dataclass(frozen=True, eq=False)
class SimulatedSets:
    """N sets of k parameters, and what simulations with them gave.

    Attributes
    ----------
    place : (N, k) in the unit cube.
    weight : (N,) prior over proposal density.
    statistics : (N, D), all finite.
    """

    place: Array
    weight: Array
    statistics: Array

    def __len__(self) -> int:
        return self.weight.size

    @cached_property
    def wanted(self) -> Array:
        """(N, k) normal quantiles of the places."""
        from scipy.special import ndtri

        return np.asarray(ndtri(self.place))


@dataclass(frozen=True, eq=False)
class Posterior:
    """What is known of the parameters.

    Attributes
    ----------
    place : (m, k) draws in the unit cube.
    weight : (m,) their sum is 1.
    source : (m,) of each the simulated set that it is from.
    rough, fine : projections of the statistics, over all sets and over the nearer ones.
    """

    place: Array
    weight: Array
    source: Indices
    rough: Projection
    fine: Projection

    @property
    def effective(self) -> float:
        """How many draws of equal weight say as much (Kish)."""
        return float(1.0 / (self.weight**2).sum())

    def quantiles(self, parts: Array) -> Array:
        """(len(parts), k) weighted quantiles of the places."""
        return np.stack([weighted_quantiles(column, self.weight, parts) for column in self.place.T], axis=1)


Simulate = Callable[[Array, int], Array]
"""(places (s, k), number of the first set) → statistics (s, D)."""


def sample_posterior(
    simulate: Simulate, observed: Callable[[], Array], parameters: int, sets: int, rounds: int, seed: int
) -> tuple[SimulatedSets, Posterior]:
    """Simulate in rounds, and draw from the posterior.

    Parameters
    ----------
    simulate : called once a round with `sets` places.
    observed : gives the observed statistics (D,); asked after each round, when it may depend on what was simulated.
    parameters : k.

    Raises
    ------
    InputError : too few sets or rounds.
    """
    check_size(sets, rounds)
    rng = np.random.default_rng([seed, 17])
    places, statistics = first_places(parameters, sets, seed), np.empty((0, 0))
    known, found = np.empty((0, parameters)), None
    mixture = Mixture((), parameters)
    for _ in range(rounds):
        if found is not None:
            proposal = around(found, rng)
            mixture = Mixture((*mixture.parts, proposal), parameters)
            places = proposal.draw(rng, sets)
        fresh = simulate(places, len(known))
        known = np.concatenate([known, places])
        statistics = np.concatenate([statistics, fresh]) if len(statistics) else fresh
        table = SimulatedSets(known, 1.0 / mixture.density(known), statistics)
        found = find_posterior(table, observed())
    assert found is not None
    return table, found


def check_size(sets: int, rounds: int) -> None:
    """Whether these are enough.

    Raises
    ------
    InputError : they are not.
    """
    if sets < FEWEST_ACCEPTED or rounds < 1:
        raise InputError(
            f"{sets} sets of parameters in {rounds} rounds are too few",
            advice=f"Give {FEWEST_ACCEPTED} sets or more, and a round",
        )


def first_places(parameters: int, sets: int, seed: int) -> Array:
    """(sets, k) places that fill the unit cube evenly (Sobol)."""
    from scipy.stats.qmc import Sobol

    size = 1 << (sets - 1).bit_length()
    places = Sobol(parameters, rng=np.random.default_rng([seed, 16])).random(size)[:sets]
    return np.clip(places, INSIDE, 1.0 - INSIDE)


@dataclass(frozen=True, eq=False)
class Proposal:
    """Normal laws around (m, k) centres within the unit cube, and `DEFENSIVE` of the even one.

    Attributes
    ----------
    inside : the share of the normal laws that is within the cube.
    """

    centre: Array
    weight: Array
    factor: Array
    inside: float

    def draw(self, rng: np.random.Generator, number: int) -> Array:
        """(number, k) places."""
        even = rng.random((number, self.centre.shape[1]))
        others = _inside(self, rng, number)
        return np.clip(np.where(rng.random((number, 1)) < DEFENSIVE, even, others), INSIDE, 1.0 - INSIDE)

    def density(self, place: Array) -> Array:
        """(n,) at places (n, k)."""
        k = self.factor.shape[0]
        solved = np.linalg.solve(self.factor, np.concatenate([self.centre, place]).T).T
        own, there = solved[: len(self.centre)], solved[len(self.centre) :]
        scale = (2 * np.pi) ** (-k / 2) / np.abs(np.diag(self.factor)).prod() / self.inside
        result = np.empty(len(place))
        for start in range(0, len(place), 1024):
            part = there[start : start + 1024]
            square = (part**2).sum(axis=1)[:, None] + (own**2).sum(axis=1) - 2 * part @ own.T
            result[start : start + 1024] = np.exp(-np.maximum(square, 0.0) / 2) @ self.weight
        return DEFENSIVE + (1 - DEFENSIVE) * scale * result


@dataclass(frozen=True, eq=False)
class Mixture:
    """The even law of the first round and the proposals of the later ones, each as often."""

    parts: tuple[Proposal, ...]
    parameters: int

    def density(self, place: Array) -> Array:
        """(n,) at places (n, k)."""
        each = [np.ones(len(place)), *(part.density(place) for part in self.parts)]
        return np.asarray(np.mean(each, axis=0))


def around(found: Posterior, rng: np.random.Generator) -> Proposal:
    """The proposal around a posterior."""
    k = found.place.shape[1]
    covariance = np.atleast_2d(np.cov(found.place, rowvar=False, aweights=found.weight, ddof=0))
    factor: Array = np.linalg.cholesky(WIDENED * covariance + 1e-10 * np.eye(k)).astype(np.float64)
    draft = Proposal(found.place, found.weight, factor, 1.0)
    tried = 20_000
    there = _normal(draft, rng, tried)
    share = float(((there > 0) & (there < 1)).all(axis=1).mean())
    return Proposal(found.place, found.weight, factor, max(share, 1.0 / tried))


def _normal(proposal: Proposal, rng: np.random.Generator, number: int) -> Array:
    of = rng.choice(len(proposal.centre), size=number, p=proposal.weight)
    k = proposal.centre.shape[1]
    return np.asarray(proposal.centre[of] + rng.standard_normal((number, k)) @ proposal.factor.T)


def _inside(proposal: Proposal, rng: np.random.Generator, number: int) -> Array:
    """(number, k) of the normal laws, those within the cube."""
    found = np.empty((0, proposal.centre.shape[1]))
    while len(found) < number:
        tried = _normal(proposal, rng, 2 * number)
        found = np.concatenate([found, tried[((tried > 0) & (tried < 1)).all(axis=1)]])
    return found[:number]


def find_posterior(table: SimulatedSets, observed: Array) -> Posterior:
    """The posterior from the sets that were simulated.

    Parameters
    ----------
    observed : (D,) statistics, all finite.
    """
    rough = project(table.statistics, table.wanted, table.weight, squares=True)
    near = _region(table, rough, observed)
    weight = np.zeros(len(table))
    weight[near] = table.weight[near]
    return draw_with(table, rough, project(table.statistics, table.wanted, weight, squares=False), observed)


def _region(table: SimulatedSets, rough: Projection, observed: Array, without: int = -1) -> Indices:
    every = np.arange(len(table))
    return _nearest(rough.differences(table.statistics, every, observed, without), table.weight, NEARER)[0]


def draw_with(
    table: SimulatedSets, rough: Projection, fine: Projection, observed: Array, without: int = -1
) -> Posterior:
    """The nearest sets by two projections, moved to the observed statistics.

    Parameters
    ----------
    without : a set that is left out, −1 for none.
    """
    from scipy.special import ndtr

    region = _region(table, rough, observed, without)
    region = region[region != without]
    apart = fine.differences(table.statistics, region, observed, without)
    taken = [
        (near, weight / weight.sum())
        for part in ACCEPTED
        for near, kernel in [_nearest(apart, table.weight[region], part * len(table) / region.size)]
        for weight in [table.weight[region[near]] * kernel]
    ]
    near, weight = min(taken, key=lambda one: float((one[1] ** 2).sum()))
    source = region[near]
    design = np.column_stack([np.ones(near.size), apart[near]])
    wanted = table.wanted[source]
    weighted = design * weight[:, None]
    square = weighted.T @ design
    inverse = np.linalg.inv(square + 1e-9 * np.trace(square) * np.eye(len(square)))
    slope = inverse @ (weighted.T @ wanted)
    own = np.einsum("ni,ij,nj->n", design, inverse, weighted)
    left = (wanted - design @ slope) / np.maximum(1.0 - own, LEAST_LEFT)[:, None]
    return Posterior(np.clip(ndtr(slope[0] + left), INSIDE, 1.0 - INSIDE), weight, source, rough, fine)


def _nearest(apart: Array, weight: Array, part: float) -> tuple[Indices, Array]:
    """The part of (N, k) differences that is nearest to none, and Epanechnikov's weight of each."""
    spread = np.atleast_2d(np.cov(apart, rowvar=False, aweights=weight))
    inverse = np.linalg.inv(spread + (1e-9 * np.trace(spread) + 1e-300) * np.eye(len(spread)))
    square = np.einsum("ni,ij,nj->n", apart, inverse, apart)
    number = min(max(FEWEST_ACCEPTED, round(part * len(apart))), len(apart) - 1)
    near = np.argsort(square, kind="stable")[: number + 1]
    limit = square[near[-1]]
    return near[:-1], np.asarray(1.0 - square[near[:-1]] / limit if limit > 0 else np.ones(number))


def places_of_truth(table: SimulatedSets, found: Posterior, number: int, seed: int) -> Array:
    """(number, k) where known parameters lie in the posterior of their own simulation, 0…1: even if all is well.

    The simulations are those whose statistics are nearest to the observed ones, each left out of its own analysis
    (Prangle et al. 2014).
    """
    rng = np.random.default_rng([seed, 18])
    weight = table.weight[found.source]
    chosen = found.source[rng.choice(found.source.size, size=number, p=weight / weight.sum())]
    places = np.empty((number, table.place.shape[1]))
    for row, i in enumerate(chosen.tolist()):
        own = draw_with(table, found.rough, found.fine, table.statistics[i], i)
        places[row] = own.weight @ (own.place < table.place[i])
    return places


def weighted_quantiles(values: Array, weight: Array, parts: Array) -> Array:
    """Quantiles of values (m,) with weights (m,)."""
    order = np.argsort(values, kind="stable")
    up_to = np.cumsum(weight[order])
    return np.asarray(np.interp(parts, (up_to - weight[order] / 2) / up_to[-1], values[order]))

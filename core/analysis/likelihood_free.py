# SPDX-License-Identifier: GPL-3.0-or-later
"""What observed statistics say of parameters when only simulations, and no likelihood, relate the two.

Approximate Bayesian computation (Beaumont et al. 2002, 2009). Parameters are places in the unit cube, where the prior
is even. Sets of them are simulated in rounds: the first from the prior, each later one around the posterior so far;
weights 1/q make up for how they were proposed. The statistics, which may be many, are projected to one for each
parameter, its estimate by a regression (Fearnhead & Prangle 2012); the sets whose projections are nearest to the
observed ones are taken, and what is left of the difference is taken out by a local linear regression of the normal
quantile of the place, so that no draw leaves the range.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..vectors import Array, Indices

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
RIDGES = (1e-4, 1e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0, 3.0, 10.0)
"""That are tried, beside the variance 1 of each statistic."""
IDLE = 1e-9
"""A statistic that spreads less, beside its size, is always the same."""
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


@dataclass(frozen=True, eq=False)
class Projection:
    """D statistics → k estimates of the normal quantiles of places, scaled to an even spread.

    Attributes
    ----------
    centre, spread : (D,) of the statistics; infinite for one that is always the same.
    low, high : (D,) beyond which they say no more.
    squares : whether those of the statistics count too.
    coefficients : of the statistics, of their squares, and a constant, for each of the k.
    """

    centre: Array
    spread: Array
    low: Array
    high: Array
    squares: bool
    coefficients: Array

    def __call__(self, statistics: Array) -> Array:
        """(..., D) → (..., k)."""
        scaled = (np.clip(statistics, self.low, self.high) - self.centre) / self.spread
        return np.asarray(_features(scaled, self.squares) @ self.coefficients[:-1] + self.coefficients[-1])


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
    rough = project(table, table.weight, squares=True)
    near = _nearest(rough(table.statistics), table.weight, rough(observed), NEARER)[0]
    weight = np.zeros(len(table))
    weight[near] = table.weight[near]
    return draw_with(table, rough, project(table, weight, squares=False), observed)


def project(table: SimulatedSets, weight: Array, *, squares: bool) -> Projection:
    """The ridge regression of the normal quantiles of the places on the statistics.

    Parameters
    ----------
    weight : (N,) of the sets.
    squares : whether on their squares too, which bends; beyond the sets that count it is wrong soon.

    Notes
    -----
    The ridge of each parameter is that with the least error by generalised cross-validation (Golub et al. 1979): with
    few sets and many statistics the sets would else look nearer to the truth than new data can be.
    """
    from scipy.special import ndtri

    some = weight > 0
    statistics, w = table.statistics[some], weight[some] / weight[some].sum()
    low, high = np.quantile(statistics, [0.001, 0.999], axis=0)
    clipped = np.clip(statistics, low, high)
    centre = w @ clipped
    spread = np.sqrt(w @ (clipped - centre) ** 2)
    spread = np.where(spread > IDLE * np.maximum(np.abs(centre), 1.0), spread, np.inf)
    features = _features((clipped - centre) / spread, squares)
    mean = w @ features
    wanted = ndtri(table.place[some])
    middle = w @ wanted
    apart = wanted - middle
    features = features - mean
    weighted = w[:, None] * features
    square, axes = np.linalg.eigh(features.T @ weighted)
    square = np.maximum(square, 0.0)
    aim = axes.T @ (weighted.T @ apart)
    total = w @ apart**2
    number = 1.0 / float(w @ w)
    slopes = []
    for j in range(wanted.shape[1]):
        errors = []
        for ridge in RIDGES:
            rest = float(total[j] - ((square + 2 * ridge) / (square + ridge) ** 2) @ aim[:, j] ** 2)
            free = float((square / (square + ridge)).sum())
            errors.append(rest / max(1.0 - free / number, 1e-6) ** 2)
        ridge = RIDGES[int(np.argmin(errors))]
        slopes.append(axes @ (aim[:, j] / (square + ridge)))
    slope = np.stack(slopes, axis=1)
    return Projection(centre, spread, low, high, squares, np.vstack([slope, middle - mean @ slope]))


def _features(scaled: Array, squares: bool) -> Array:
    return np.concatenate([scaled, scaled**2], axis=-1) if squares else scaled


def draw_with(
    table: SimulatedSets, rough: Projection, fine: Projection, observed: Array, without: int = -1
) -> Posterior:
    """The nearest sets by two projections, moved to the observed statistics.

    Parameters
    ----------
    without : a set that is left out, −1 for none.
    """
    from scipy.special import ndtr, ndtri

    region, _ = _nearest(rough(table.statistics), table.weight, rough(observed), NEARER)
    region = region[region != without]
    projected, aim = fine(table.statistics[region]), fine(observed)
    taken = [
        (near, weight / weight.sum())
        for part in ACCEPTED
        for near, kernel in [_nearest(projected, table.weight[region], aim, part * len(table) / region.size)]
        for weight in [table.weight[region[near]] * kernel]
    ]
    near, weight = min(taken, key=lambda one: float((one[1] ** 2).sum()))
    source = region[near]
    design = np.column_stack([np.ones(near.size), projected[near] - aim])
    wanted = ndtri(table.place[source])
    weighted = design * weight[:, None]
    square = weighted.T @ design
    slope = np.linalg.solve(square + 1e-9 * np.trace(square) * np.eye(len(square)), weighted.T @ wanted)
    moved = wanted - design[:, 1:] @ slope[1:]
    return Posterior(np.clip(ndtr(moved), INSIDE, 1.0 - INSIDE), weight, source, rough, fine)


def _nearest(projected: Array, weight: Array, aim: Array, part: float) -> tuple[Indices, Array]:
    """The nearest part of (N, k) projections, and Epanechnikov's weight of each."""
    spread = np.atleast_2d(np.cov(projected, rowvar=False, aweights=weight))
    inverse = np.linalg.inv(spread + (1e-9 * np.trace(spread) + 1e-300) * np.eye(len(spread)))
    apart = projected - aim
    square = np.einsum("ni,ij,nj->n", apart, inverse, apart)
    number = min(max(FEWEST_ACCEPTED, round(part * len(projected))), len(projected) - 1)
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
    order = np.argsort(values)
    up_to = np.cumsum(weight[order])
    return np.asarray(np.interp(parts, (up_to - weight[order] / 2) / up_to[-1], values[order]))

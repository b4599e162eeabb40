# SPDX-License-Identifier: GPL-3.0-or-later
"""The observations of flights, and the free flight that fits them best."""

from dataclasses import dataclass

import numpy as np

from ..vectors import Array, Indices
from .free_flight import fall
from .picks import Picks


@dataclass(frozen=True, eq=False)
class Observations:
    """m observations of k flights, those of a flight together and in time order.

    Attributes
    ----------
    pick : (m,) index of the pick.
    flight : (m,) index of the flight, 0…k−1.
    time_s : (m,) since the start of the flight [s].
    position : (m, 3) [m].
    weight : (m,) relative weight of the squared distance.
    """

    pick: Indices
    flight: Indices
    time_s: Array
    position: Array
    weight: Array

    @property
    def count(self) -> int:
        """Number of flights."""
        return int(self.flight[-1]) + 1 if self.flight.size else 0

    @property
    def starts(self) -> Indices:
        """(k,) the first observation of each flight."""
        return np.flatnonzero(np.r_[True, np.diff(self.flight) > 0])

    def sums(self, values: Array) -> Array:
        """Sums over the observations of each flight, (m, …) → (k, …)."""
        return np.add.reduceat(values, self.starts, axis=0)


def observe(picks: Picks, first: Indices, last: Indices) -> Observations:
    """All picks from `first` to `last` (k,) of each flight.

    Weights are 1/sigma_position_m² for a flight all of whose picks have a positive one, else 1.
    """
    size = last - first + 1
    flight = np.repeat(np.arange(first.size), size)
    pick = np.arange(size.sum()) - np.repeat(np.cumsum(size) - size, size) + first[flight]
    sigma = picks.sigma_position_m[pick]
    unusable = ~(np.isfinite(sigma) & (sigma > 0))
    equal = (np.bincount(flight[unusable], minlength=first.size) > 0)[flight]
    return Observations(
        pick=pick,
        flight=flight,
        time_s=picks.time_s[pick] - picks.time_s[first][flight],
        position=picks.position[pick],
        weight=np.where(equal, 1.0, 1.0 / np.where(equal, 1.0, sigma) ** 2),
    )


def fit_parabolas(observations: Observations, gravity_mps2: float) -> tuple[Array, Array]:
    """Start positions and velocities (k, 3) of the free flights with the least weighted squared distances.

    A free flight is linear in both without its fall: a straight-line regression, in closed form.
    """
    t, w, group = observations.time_s, observations.weight, observations.flight
    straight = observations.position - fall(t, gravity_mps2)
    total = observations.sums(w)
    mean_time = observations.sums(w * t) / total
    mean = observations.sums(w[:, None] * straight) / total[:, None]
    centred = t - mean_time[group]
    spread = observations.sums(w * centred**2)
    velocity = observations.sums((w * centred)[:, None] * (straight - mean[group])) / spread[:, None]
    return mean - velocity * mean_time[:, None], velocity


def velocity_weights(observations: Observations) -> Array:
    """How the velocity of the best free flight depends on each observation: δv = Σ weight·δx, (m,) [1/s]."""
    t, w, group = observations.time_s, observations.weight, observations.flight
    mean_time = observations.sums(w * t) / observations.sums(w)
    centred = t - mean_time[group]
    return w * centred / observations.sums(w * centred**2)[group]

# SPDX-License-Identifier: GPL-3.0-or-later
"""What is counted over many runs: added up chunk by chunk, in any order, by any number of workers."""

from collections.abc import Mapping
from typing import Any, Protocol, Self

from numpy.typing import NDArray

from ..simulation.engine import Simulation

type Arrays = dict[str, NDArray[Any]]
"""The whole state of a tally: what is kept in a file, and sent between workers."""


class Tally(Protocol):
    """What runs add up to: bounded in memory, however many they are.

    Counts, whole or fixed-point sums, maxima and sketches of quantiles: after the same runs the arrays are the same
    bits, whatever the chunks were, and in whatever order they were added or merged.
    """

    def empty(self) -> Self:
        """One of the same kind to which nothing was added, for a worker to fill."""
        ...

    def add(self, simulation: Simulation) -> None:
        """Count the runs of a simulation that recorded all."""
        ...

    def merge(self, other: Self) -> None:
        """Count what another one has counted; the other is not to be used afterwards."""
        ...

    def arrays(self) -> Arrays:
        """All that it knows, in one order."""
        ...

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Self:
        """What `arrays` gave, to add to again."""
        ...

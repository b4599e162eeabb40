# SPDX-License-Identifier: GPL-3.0-or-later
"""How each run ended, where there are not too many: what tables and summaries need without the motion."""

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..simulation.engine import Simulation
from .tally import Arrays

COLUMNS: Mapping[str, Any] = {
    "end": np.int32,
    "time_s": np.float64,
    "length_m": np.float64,
    "v_max_mps": np.float64,
    "impacts": np.int32,
    "tree_hits": np.int32,
    "position": np.float64,
}
"""Attributes of a `Simulation`, one value (of the position three) for each run: 68 bytes, with the number 76."""


class RunTally:
    """The ends of all runs, in the order of their numbers."""

    def __init__(self, parts: list[dict[str, NDArray[Any]]] | None = None) -> None:
        self._parts = parts or []

    def empty(self) -> Self:
        """See `Tally`."""
        return type(self)()

    def add(self, simulation: Simulation) -> None:
        """See `Tally`."""
        columns = {name: getattr(simulation, name).astype(kind) for name, kind in COLUMNS.items()}
        self._parts.append({"number": simulation.number.astype(np.int64), **columns})

    def merge(self, other: Self) -> None:
        """See `Tally`."""
        self._parts += other._parts

    def arrays(self) -> Arrays:
        """See `Tally`: `COLUMNS`, and the number of each run, from 1."""
        if len(self._parts) != 1:
            self._parts = [self._joined()]
        return self._parts[0]

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Self:
        """See `Tally`."""
        return cls([dict(arrays)])

    def _joined(self) -> dict[str, NDArray[Any]]:
        if not self._parts:
            none = {name: np.empty((0, 3) if name == "position" else 0, kind) for name, kind in COLUMNS.items()}
            return {"number": np.empty(0, np.int64), **none}
        columns = {name: np.concatenate([part[name] for part in self._parts]) for name in ("number", *COLUMNS)}
        order = np.argsort(columns["number"], kind="stable")
        return {name: values[order] for name, values in columns.items()}

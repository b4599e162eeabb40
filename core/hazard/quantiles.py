# SPDX-License-Identifier: GPL-3.0-or-later
"""Means, quantiles and greatest values of many numbers under many keys (cells, faces), in bounded memory."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..compiled import in_chunks
from ..errors import InputError, RockfallError
from ..vectors import Array, Indices
from .tally import Arrays

RELATIVE_ERROR = 0.01
"""Of a quantile of more values than are kept; see `sketch_kernels`."""
PENDING = 4_000_000
"""So many values wait until they are sorted by their keys: then the memory of each key is looked up once for many."""


@dataclass(frozen=True, eq=False)
class Figures:
    """What k keys have, in their order; NaN where there is no value.

    Attributes
    ----------
    key : (k,).
    count, reach : (k,) values; runs that have at least one.
    over : (k, t) values above each of the limits.
    mean, greatest, error : (k, q) of each column; the error is the standard error of the 95 % value.
    quantiles : (k, q, s).
    """

    key: Indices
    count: NDArray[np.int64]
    reach: NDArray[np.int64]
    over: NDArray[np.int64]
    mean: Array
    greatest: Array
    quantiles: Array
    error: Array


class Sketches:
    """Rows of q values under keys.

    Up to 256 values of a key are kept, in single precision; of more, each column has logarithmic bins, from which
    quantiles are known to 1 %. Sums are fixed-point, so that nothing depends on the order of values, nor on how often
    and in which order sketches were merged.

    Parameters
    ----------
    keys : they are whole numbers from 0 to below this.
    units : (q,) of the sums: mean values are exact to half of it.
    column, limits : of this column it is counted how many values are above each limit.
    """

    def __init__(self, keys: int, units: Sequence[float], column: int = 0, limits: Sequence[float] = ()) -> None:
        self.keys, self.column = keys, column
        self.units, self.limits = np.array(units, np.float64), np.array(limits, np.float64)
        self._pending: list[tuple[NDArray[np.int32], NDArray[np.float32]]] = []
        self._waiting = 0
        self._sorted = np.empty((0, len(units)), np.float32)
        self._store: _Store | None = None

    def empty(self) -> "Sketches":
        """One of the same kind without values."""
        return Sketches(self.keys, self.units.tolist(), self.column, self.limits.tolist())

    def add(self, key: NDArray[np.int32], values: NDArray[np.float32]) -> None:
        """Add rows (p, q) under keys (p,), where −1 − key is that key with the first value of a run."""
        if len(key):
            self._pending.append((key, values))
            self._waiting += len(key)
            if self._waiting >= PENDING:
                self._fold()

    def merge(self, other: "Sketches") -> None:
        """Add all that another one has."""
        if not (
            self.keys == other.keys
            and np.array_equal(self.units, other.units)
            and np.array_equal(self.limits, other.limits)
            and self.column == other.column
        ):
            raise InputError("Results of other cells or faces cannot be added", advice="Add those of one simulation")
        pending, other._pending, other._waiting = other._pending, [], 0
        if other._store is not None:
            self._add_arrays(other.arrays())
        for key, values in pending:
            self.add(key, values)

    def figures(self, shares: Sequence[float], erring: float = 0.95) -> Figures:
        """Of all keys that have a value; `shares` are those of the quantiles, from 0 to 1."""
        from .sketch_kernels import edges, figures

        store, (slots, key) = self._fold(), self._slots()
        k, q = len(slots), len(self.units)
        mean, error, quantiles = np.empty((k, q)), np.empty((k, q)), np.empty((k, q, len(shares)))
        wanted, edge = np.array(shares, np.float64), edges()
        in_chunks(
            lambda i, j: figures(
                slots[i:j], wanted, erring, self.units, edge, store.pool, store.floats, store.counts, store.sums,
                store.greatest, store.raw, store.runs, mean[i:j], quantiles[i:j], error[i:j],
            ),
            k,
        )  # fmt: skip
        greatest = np.where(np.isnan(mean), np.nan, store.greatest[slots])
        counts = store.counts[slots]
        return Figures(key, counts[:, 0], counts[:, 1], store.over[slots], mean, greatest, quantiles, error)

    def arrays(self) -> Arrays:
        """All of it, in the order of the keys."""
        from .sketch_kernels import FEW, count_bins, export

        store, (slots, key) = self._fold(), self._slots()
        q, counts = len(self.units), store.counts[slots]
        rows_begin = np.concatenate([[0], np.cumsum(np.where(counts[:, 0] <= FEW, counts[:, 0], 0))])
        number = np.empty((len(slots), q), np.int64)
        in_chunks(lambda i, j: count_bins(slots[i:j], store.pool, q, store.runs, number[i:j]), len(slots))
        ends = np.cumsum(number.ravel()).reshape(number.shape)
        bin_begin = np.column_stack([ends[:, :1] - number[:, :1], ends])
        total = int(ends[-1, -1]) if len(slots) else 0
        rows = np.empty((int(rows_begin[-1]), q), np.float32)
        bins, bin_counts = np.empty(total, np.int16), np.empty(total, np.uint32)
        in_chunks(
            lambda i, j: export(
                slots[i:j], store.pool, store.floats, store.raw, store.runs, q, rows_begin[i : j + 1], rows,
                bin_begin[i:j], bins, bin_counts,
            ),
            len(slots),
        )  # fmt: skip
        return {
            "kind": np.array([self.keys, self.column]), "units": self.units, "limits": self.limits,
            "key": key.astype(np.int32), "counts": counts, "sums": store.sums[slots],
            "greatest": store.greatest[slots], "over": store.over[slots], "rows": rows, "bin_begin": bin_begin,
            "bins": bins, "bin_counts": bin_counts,
        }  # fmt: skip

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> "Sketches":
        """What `arrays` gave."""
        keys, column = arrays["kind"].tolist()
        made = cls(keys, arrays["units"].tolist(), column, arrays["limits"].tolist())
        made._add_arrays(arrays)
        return made

    def _slots(self) -> tuple[Indices, Indices]:
        """(k,) the slots that are in use, in the order of their keys, and these."""
        from .sketch_kernels import SLOTS

        store = self._fold()
        key = store.key[: store.state[SLOTS]]
        slots = np.argsort(key, kind="stable")
        return slots, key[slots].astype(np.intp)

    def _fold(self) -> "_Store":
        """Put what is pending under its keys."""
        from .sketch_kernels import count_keys, sort_values

        if self._store is None:
            self._store = _Store(self.keys, len(self.units), len(self.limits))
        if not self._pending:
            return self._store
        counts = np.zeros((self.keys, 2), np.int32)
        for key, _ in self._pending:
            count_keys(key, counts)
        wanted = np.flatnonzero(counts[:, 0])
        begin = np.concatenate([[0], np.cumsum(counts[wanted, 0], dtype=np.int64)])
        place = np.empty(self.keys, np.int64)
        place[wanted] = begin[:-1]
        if begin[-1] > len(self._sorted):  # kept: to take fresh memory costs more than to fill it
            self._sorted = np.empty((int(begin[-1]), len(self.units)), np.float32)
        values = self._sorted
        for key, rows in self._pending:
            sort_values(key, rows, place, values)
        self._pending, self._waiting = [], 0
        self._add_rows(wanted, begin, counts[wanted, 1].astype(np.int64), values)
        return self._store

    def _add_rows(self, wanted: Indices, begin: Indices, reach: NDArray[np.int64], values: NDArray[np.float32]) -> None:
        from .sketch_kernels import DONE, OVERFLOW, fold

        store, at, why = self._fold(), 0, 0
        while why != DONE:
            store.make_room(len(wanted) - at)
            at, why = fold(
                wanted, begin, reach, values, self.units, self.column, self.limits, at, store.pool, store.floats,
                store.state, store.slot_of, store.key, store.counts, store.sums, store.greatest, store.over, store.raw,
                store.runs,
            )  # fmt: skip
            if why == OVERFLOW:
                raise RockfallError(TOO_MUCH)

    def _add_arrays(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        from .sketch_kernels import DONE, FEW, OVERFLOW, fold_bins

        store, counts, key = self._fold(), arrays["counts"], arrays["key"].astype(np.intp)
        few = counts[:, 0] <= FEW
        begin = np.concatenate([[0], np.cumsum(counts[few, 0])])
        self._add_rows(key[few], begin, counts[few, 1], arrays["rows"])
        wanted = np.flatnonzero(~few)
        columns = [arrays[name][wanted] for name in ("counts", "sums", "greatest", "over")]
        bin_begin, at, why = arrays["bin_begin"][wanted], 0, 0
        while why != DONE:
            store.make_room(len(wanted) - at)
            at, why = fold_bins(
                key[wanted], at, arrays["bins"], bin_begin, arrays["bin_counts"], *columns, store.pool, store.floats,
                store.state, store.slot_of, store.key, store.counts, store.sums, store.greatest, store.over, store.raw,
                store.runs,
            )  # fmt: skip
            if why == OVERFLOW:
                raise RockfallError(TOO_MUCH)


TOO_MUCH = "The energies of so many blocks cannot be added up in one cell. Simulate fewer at once."


class _Store:
    """The arrays of the kernels, which grow."""

    def __init__(self, keys: int, columns: int, limits: int) -> None:
        from .sketch_kernels import MOST_BLOCKS, SLOTS, WIDTH

        self.slot_of = np.full(keys, -1, np.int32)
        self.state = np.full(SLOTS + 1, -1, np.int64)
        self.state[MOST_BLOCKS + 1 :] = 0
        self.pool = np.zeros((0, WIDTH), np.uint32)
        self.key = np.zeros(0, np.int32)
        self.counts, self.over = np.zeros((0, 2), np.int64), np.zeros((0, limits), np.int64)
        self.sums, self.greatest = np.zeros((0, columns), np.int64), np.zeros((0, columns), np.float32)
        self.raw, self.runs = np.zeros((0, 2), np.int64), np.zeros((0, columns, 3), np.int64)

    @property
    def floats(self) -> NDArray[np.float32]:
        """The pool as single-precision numbers."""
        return self.pool.view(np.float32)

    def make_room(self, more: int) -> None:
        """For up to `more` further slots, as far as there are keys, and for some blocks."""
        from .sketch_kernels import MOST_BLOCKS, SLOTS, USED

        slots = min(int(self.state[SLOTS]) + more, len(self.slot_of))
        old = len(self.key)
        if slots > old:
            slots = min(max(slots, old + old // 2), len(self.slot_of))
            for name in ("key", "counts", "over", "sums", "greatest", "raw", "runs"):
                column = getattr(self, name)
                column.resize((slots, *column.shape[1:]), refcheck=False)
            self.greatest[old:] = -np.inf
        used, spare = int(self.state[USED]), MOST_BLOCKS * (self.sums.shape[1] + 1)
        if used + spare > len(self.pool):
            self.pool.resize((used + used // 4 + 20 * spare, self.pool.shape[1]), refcheck=False)

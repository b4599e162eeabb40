# SPDX-License-Identifier: GPL-3.0-or-later
"""Quantiles under keys against NumPy's of all values; the same bits in any order."""

from collections.abc import Callable

import numpy as np
import pytest
from rockfall.core.errors import InputError, RockfallError
from rockfall.core.hazard.quantiles import RELATIVE_ERROR, Figures, Sketches

SHARES = (0.5, 0.9, 0.95, 0.99)
UNITS = (2.0**-20, 2.0**-10)
VALUES = 60_000
DISTRIBUTIONS: dict[str, Callable[[np.random.Generator], np.ndarray]] = {
    "log-normal over eight decades": lambda rng: np.exp(rng.normal(3, 3, (VALUES, 2))),
    "uniform": lambda rng: rng.uniform(0.01, 40, (VALUES, 2)),
    "one value": lambda rng: np.full((VALUES, 2), 17.3),
    "two humps": lambda rng: np.where(rng.random((VALUES, 2)) < 0.93, 1.5, 4000.0) * rng.uniform(0.9, 1.1, (VALUES, 2)),
    "Cauchy's tail": lambda rng: np.abs(rng.standard_cauchy((VALUES, 2))) + 1e-2,
}


def sketches(keys: int = 5) -> Sketches:
    return Sketches(keys, UNITS, column=1, limits=(30.0, 300.0))


def single(values: np.ndarray) -> np.ndarray:
    return values.astype(np.float32)


@pytest.mark.parametrize("name", DISTRIBUTIONS)
def test_quantiles_of_many_values_are_within_the_stated_error(name: str) -> None:
    values = single(DISTRIBUTIONS[name](np.random.default_rng(4)))
    made = sketches()
    made.add(np.full(len(values), 3, np.int32), values)
    figures = made.figures(SHARES)
    truth = np.quantile(values.astype(np.float64), SHARES, axis=0).T
    assert figures.key.tolist() == [3]
    assert np.abs(figures.quantiles[0] / truth - 1).max() <= RELATIVE_ERROR
    np.testing.assert_allclose(figures.mean[0], values.mean(axis=0, dtype=np.float64), rtol=1e-4)
    np.testing.assert_array_equal(figures.greatest[0], values.max(axis=0))
    np.testing.assert_array_equal(figures.over[0], [(values[:, 1] > limit).sum() for limit in (30, 300)])


def test_few_values_are_exact() -> None:
    rng = np.random.default_rng(5)
    key = rng.integers(0, 5, 900).astype(np.int32)
    values = single(np.exp(rng.normal(0, 2, (900, 2))))
    made = sketches()
    for part in np.array_split(np.arange(900), 7):
        made.add(key[part], values[part])
    figures = made.figures(SHARES)
    for k, quantiles in zip(figures.key.tolist(), figures.quantiles, strict=True):
        own = values[key == k].astype(np.float64)
        np.testing.assert_allclose(quantiles, np.quantile(own, SHARES, axis=0).T, rtol=1e-12)


def test_values_are_put_in_order_with_ties_and_with_what_is_no_number_last() -> None:
    from rockfall.core.hazard.sketch_kernels import FEW, put_in_order

    rng, out = np.random.default_rng(5), np.empty(FEW, np.float32)
    for n in (0, 1, 2, 7, 8, 9, 33, FEW):
        for steps in (3, 10, 10_000):  # of which many are the same
            values = rng.integers(-steps, steps, n).astype(np.float32)
            values[rng.random(n) < 0.2] = np.nan
            assert put_in_order(values, n, out) == np.isfinite(values).sum()
            np.testing.assert_array_equal(out[:n], np.sort(values))


def test_the_standard_error_is_what_the_95_percent_value_scatters_by() -> None:
    rng = np.random.default_rng(6)
    runs, values = 400, 2000
    key = np.repeat(np.arange(runs, dtype=np.int32), values)
    drawn = single(rng.gumbel(20, 3, (runs * values, 2)))
    made = Sketches(runs, UNITS)
    made.add(-1 - key, drawn)  # each the first value of a run
    figures: Figures = made.figures((0.95,))
    scatter = drawn.reshape(runs, values, 2).astype(np.float64)
    found = np.quantile(scatter, 0.95, axis=1).std(axis=0)
    np.testing.assert_allclose(np.median(figures.error, axis=0), found, rtol=0.15)


def test_too_few_runs_have_no_standard_error() -> None:
    made = sketches()
    made.add(np.append(np.int32(-3), np.full(99, 2, np.int32)), single(np.random.default_rng(1).random((100, 2))))
    figures = made.figures((0.95,))
    assert (figures.count[0], figures.reach[0]) == (100, 1)
    assert np.isnan(figures.error).all()


def test_any_order_of_adding_and_merging_gives_the_same_bits() -> None:
    rng = np.random.default_rng(7)
    n, keys = 30_000, 200
    key = (keys * rng.random(n) ** 4).astype(np.int32)  # some with few values, some with many
    values = single(np.exp(rng.normal(2, 1, (n, 2))))
    values[rng.random(n) < 0.1, 1] = np.nan
    whole = sketches(keys)
    whole.add(key, values)
    pieces = sketches(keys)
    for turn, part in enumerate(np.array_split(rng.permutation(n), 11)):
        one = pieces.empty()
        one.add(key[part], values[part])
        pieces.merge(Sketches.from_arrays(one.arrays()) if turn % 2 else one)
        if turn % 3 == 0:
            pieces.figures(SHARES)
    first, second = whole.arrays(), pieces.arrays()
    assert {name: values.tobytes() for name, values in first.items()} == {
        name: values.tobytes() for name, values in second.items()
    }
    again = Sketches.from_arrays(first).figures(SHARES)
    np.testing.assert_array_equal(again.quantiles, whole.figures(SHARES).quantiles)


def test_what_is_no_number_is_in_no_figure_of_its_column() -> None:
    values = single(np.column_stack([np.arange(1.0, 1001), np.arange(1.0, 1001)]))
    values[::2, 1] = np.nan
    made = sketches()
    made.add(np.zeros(1000, np.int32), values)
    figures = made.figures((0.5,))
    assert figures.mean[0].tolist() == pytest.approx([500.5, 501.0])
    assert figures.quantiles[0, :, 0].tolist() == pytest.approx([500.5, 501.0], rel=RELATIVE_ERROR)


def test_sums_that_would_overflow_are_refused() -> None:
    made = sketches()
    made.add(np.zeros(3, np.int32), single(np.full((3, 2), 4e15)))
    with pytest.raises(RockfallError, match="cannot be added up"):
        made.arrays()


def test_other_keys_are_not_merged() -> None:
    with pytest.raises(InputError, match="cannot be added"):
        sketches(5).merge(sketches(6))

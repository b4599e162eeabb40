# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers of large tables are written as Python writes them: the shortest text that reads back as the same number."""

import csv

import numpy as np
from rockfall.core.exchange.number_text import COMPILED, shortest_texts
from rockfall.core.exchange.tables import WRITTEN_ROWS, write_columns


def python_writes(values: np.ndarray) -> list[str]:
    return ["" if value != value else repr(value) for value in values.tolist()]


def test_any_bits_whatever() -> None:
    values = np.random.default_rng(3).integers(0, 2**64, 60_000, dtype=np.uint64).view(np.float64)
    assert shortest_texts(values) == python_writes(values)


def test_measured_numbers_and_few_digits() -> None:
    rng = np.random.default_rng(4)
    parts = [rng.normal(size=20_000), rng.integers(-(10**7), 10**7, 20_000) / 1000, np.arange(-3000.0, 3000.0)]
    values = np.concatenate(parts)
    assert shortest_texts(values) == python_writes(values)


def test_where_the_neighbours_are_not_equally_far_and_where_the_notation_changes() -> None:
    powers = 2.0 ** np.arange(-1074, 1024)
    tens = np.array([float(f"1e{k}") for k in range(-323, 309)])
    special = np.array([0.0, -0.0, np.nan, np.inf, -np.inf, 5e-324, 1e16, 9999999999999998.0, 1e-4, 9.999e-5, 1e23])
    values = np.concatenate([powers, np.nextafter(powers, 0.0), tens, np.nextafter(tens, np.inf), special])
    assert values.size > COMPILED
    assert shortest_texts(values) == python_writes(values)


def test_a_column_of_a_wider_table() -> None:
    table = np.random.default_rng(5).normal(size=(COMPILED, 3))
    assert shortest_texts(table[:, 1]) == python_writes(table[:, 1])


def test_a_table_is_written_as_the_csv_module_writes_it(tmp_path) -> None:
    rng, n = np.random.default_rng(6), 2 * WRITTEN_ROWS + 7
    columns = {
        "trajectory": np.array([f"Blöck {i % 9}" for i in range(n)]),
        "x_m": np.where(rng.random(n) < 0.2, np.nan, rng.normal(size=n)),
        "impact": np.arange(n),
        "note": ["" if i % 3 else "a, b" if i == n - 1 else "plain" for i in range(n)],
        "y_m": rng.integers(0, 99, n) / 4,
    }
    write_columns(tmp_path / "a.csv", columns)
    cells = [
        python_writes(values) if values is columns["x_m"] or values is columns["y_m"] else list(map(str, values))
        for values in columns.values()
    ]
    with (tmp_path / "b.csv").open("w", encoding="utf-8", newline="") as stream:
        csv.writer(stream, lineterminator="\n").writerows([columns, *zip(*cells, strict=True)])
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()

# SPDX-License-Identifier: GPL-3.0-or-later
"""Large tables are read by compiled code: the same numbers to the last bit, the same errors as row by row."""

import struct

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.exchange import csv_text
from rockfall.core.exchange.cells import Cells, split_cells
from rockfall.core.exchange.csv_text import read_table
from rockfall.core.exchange.tables import write_trajectories
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.sampling import TrajectorySamples


@pytest.fixture
def large(monkeypatch):
    """Every table counts as large."""
    monkeypatch.setattr(csv_text, "LARGE_BYTES", 0)


def column_of(texts):
    """One column of cells."""
    (cells,) = split_cells("\n".join(["h", *texts]).encode(), 2, 1) or [None]
    return cells


def random_numbers(n):
    rng = np.random.default_rng(7)
    bits = rng.integers(0, 2**63, n, dtype=np.uint64) | (rng.integers(0, 2, n, dtype=np.uint64) << np.uint64(63))
    any_double = np.frombuffer(bits.tobytes(), dtype=np.float64)
    usual = rng.normal(size=n) * 10.0 ** rng.integers(-8, 9, n)
    return np.concatenate([any_double[np.isfinite(any_double)], usual])


def test_numbers_are_correctly_rounded():
    """Python's `float` is the reference: shortest texts, long ones, and halves between two doubles."""
    values = random_numbers(8_000)
    rng = np.random.default_rng(8)
    texts = [repr(value) for value in values.tolist()]
    texts += [
        f"{value:.{digits}f}"
        for value, digits in zip(values[-8_000:].tolist(), rng.integers(0, 18, 8_000), strict=True)
    ]
    texts += [
        f"{value:.{digits}e}"
        for value, digits in zip(values[-8_000:].tolist(), rng.integers(0, 20, 8_000), strict=True)
    ]
    for exponent in range(53, 64):
        texts += [str(2**exponent + 2 ** (exponent - 53) * odd + near) for odd in (1, 3, 5) for near in (-1, 0, 1)]
    texts += [
        "9007199254740993",
        "9007199254740993e-22",
        "0.1",
        "-0",
        "-0.0",
        "1e22",
        "1e-22",
        ".5",
        "5.",
        "+3",
        "00012",
    ]
    cells = column_of(texts)
    got, unsure = cells.numbers(empty=True)
    expected = np.array([float(text) for text in texts])
    sure = np.ones(len(texts), dtype=bool)
    sure[unsure] = False
    assert struct.pack(f"{sure.sum()}d", *got[sure]) == struct.pack(f"{sure.sum()}d", *expected[sure])
    assert sure[: values.size][-8_000:].mean() > 0.6
    assert np.isnan(got[~sure]).all()


@pytest.mark.parametrize(
    "text",
    ["", " ", "nan", "inf", "1_000", "0x10", "1,5", "e5", "-", "+", ".", "1e", "1e+", "1.2.3", "1 2", "--1", "٣"],
)
def test_what_is_no_plain_number_is_left_to_python(text):
    if "," not in text:
        cells = column_of(["1", text, "2"])
        values, unsure = cells.numbers(empty=True)
        assert unsure.tolist() == [1]
        assert values[[0, 2]].tolist() == [1, 2]


def test_a_large_table_is_the_same_as_a_small_one(tmp_path, monkeypatch):
    rng = np.random.default_rng(1)
    rows = [
        f"block {i % 3}, {v!r} ,{'' if i % 4 else 'a;b'}, {w:.3e},é{i % 2}"
        for i, (v, w) in enumerate(rng.normal(size=(50, 2)).tolist())
    ]
    for ending in ("\n", "\r\n"):
        for last in ("", ending):
            path = tmp_path / "t.csv"
            path.write_bytes(b"\xef\xbb\xbf" + (ending.join(["trajectory,a,flags,b,note", *rows]) + last).encode())
            read = {}
            for name, limit in (("small", 10**9), ("large", 0)):
                monkeypatch.setattr(csv_text, "LARGE_BYTES", limit)
                read[name] = read_table(path, ("trajectory",), ("trajectory", "a", "b", "flags"))
            small, large = read["small"], read["large"]
            assert isinstance(large.columns["a"], Cells)
            assert not isinstance(small.columns["a"], Cells)
            assert list(large.row) == list(small.row)
            for name in ("trajectory", "flags", "note"):
                assert large.text(name, "?") == small.text(name, "?")
            for name in ("a", "b", "none"):
                np.testing.assert_array_equal(large.numbers(name), small.numbers(name))
            assert large.rest(("a", "b"))["note"].tolist() == small.rest(("a", "b"))["note"].tolist()


MISTAKES = {
    "text": "trajectory,a\nx,1\ny,two\n",
    "comma": 'trajectory,a\nx,1\ny,"1,5"\n',
    "infinite": "trajectory,a\nx,1\ny,inf\n",
    "underscore": "trajectory,a\nx,1_0\n",
    "empty": "trajectory,a\nx,1\ny,\n",
    "short": "trajectory,a\nx,1\ny\n",
    "long": "trajectory,a\nx,1\ny,1,2\n",
    "missing": "trajectory,b\nx,1\n",
    "twice": "trajectory,a,a\nx,1,1\n",
    "quote": 'trajectory,a\nx,1\n"y,2\n',
    "none": "trajectory,a\n",
    "semicolons": "trajectory;a\nx;1\n",
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_in_a_large_table_are_told_as_in_a_small_one(tmp_path, monkeypatch, mistake):
    path = tmp_path / "t.csv"
    path.write_text(MISTAKES[mistake], encoding="utf-8")
    messages = []
    for limit in (10**9, 0):
        monkeypatch.setattr(csv_text, "LARGE_BYTES", limit)
        with pytest.raises(InputError) as caught:
            read_table(path, ("trajectory", "a"), ("trajectory", "a")).numbers("a", required=True)
        messages.append(str(caught.value))
    assert messages[0] == messages[1]


@pytest.mark.usefixtures("large")
def test_blank_rows_and_quotes_are_read_with_care(tmp_path):
    path = tmp_path / "t.csv"
    path.write_text('trajectory,a\n\nx,1\n"y, z",2\n\n', encoding="utf-8")
    table = read_table(path, ("trajectory", "a"), ())
    assert table.text("trajectory") == ["x", "y, z"]
    assert list(table.row) == [3, 4]


def test_names_with_commas_and_quotes_are_written_so_that_they_are_read(tmp_path):
    """Rows that need no quotes are written without the csv module; one that does takes the others with it."""
    names = np.array(["plain", 'the "big" one', "a, b", "new\nline"])
    n = names.size
    samples = TrajectorySamples(
        source=np.full(n, "observed"),
        trajectory=names,
        run=np.arange(n),
        time_s=np.arange(n) * 0.1,
        position=np.ones((n, 3)),
        velocity=np.ones((n, 3)),
        height_m=np.full(n, np.nan),
        kinetic_j=np.ones(n),
        shift=GlobalShift(),
    )
    write_trajectories(samples, tmp_path / "t.csv")
    table = read_table(tmp_path / "t.csv", ("trajectory",), ())
    assert table.text("trajectory") == names.tolist()
    assert np.isnan(table.numbers("height_m")).all()
    assert table.numbers("run").tolist() == [0, 1, 2, 3]

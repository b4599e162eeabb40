# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of many rows: numbers to the last bit, the same mistakes found in any block of rows, names with commas."""

import re

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.exchange import csv_text
from rockfall.core.exchange.csv_text import read_table
from rockfall.core.exchange.tables import write_trajectories
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.sampling import TrajectorySamples


def table_of(path, texts):
    path.write_text("\n".join(["trajectory,a", *(f"x,{text}" for text in texts)]), encoding="utf-8")
    return read_table(path, ("trajectory", "a"), ("trajectory", "a"))


def test_numbers_are_exact_in_every_notation(tmp_path):
    rng = np.random.default_rng(7)
    any_double = np.frombuffer(rng.bytes(8 * 8_000))
    usual = rng.normal(size=8_000) * 10.0 ** rng.integers(-8, 9, 8_000)
    values = np.concatenate([any_double[np.isfinite(any_double)], usual])
    table = table_of(tmp_path / "t.csv", map(repr, values.tolist()))
    assert table.numbers("a").tobytes() == values.tobytes()
    notations = {"-0": -0.0, "1e22": 1e22, ".5": 0.5, "5.": 5.0, "+3": 3.0, "00012": 12.0, " 7\t": 7.0, "1E-3": 0.001}
    assert table_of(tmp_path / "t.csv", notations).numbers("a").tolist() == list(notations.values())


@pytest.mark.parametrize(
    "text",
    ["nan", "inf", "1_000", "0x10", "e5", "-", "+", ".", "1e", "1e+", "1.2.3", "1 2", "--1", "1e999", "-Infinity"],
)
def test_what_is_no_finite_number_is_refused(tmp_path, text):
    problem = rf"row 3, trajectory x: '{re.escape(text)}' in column a is not (a number|finite)"
    with pytest.raises(InputError, match=problem):
        table_of(tmp_path / "t.csv", ["1", text, "2"]).numbers("a")


@pytest.mark.parametrize("rows", [1, 3, 4, 5, 8, 50])
def test_a_table_of_any_number_of_blocks_is_read_whole(tmp_path, monkeypatch, rows):
    monkeypatch.setattr(csv_text, "BLOCK_ROWS", 4)
    values = np.random.default_rng(1).normal(size=(rows, 2))
    lines = [
        f"block {i % 3}, {v!r} ,{'' if i % 4 else 'a;b'}, {w!r},é{i % 2}" for i, (v, w) in enumerate(values.tolist())
    ]
    for ending in ("\n", "\r\n", "\r"):
        path = tmp_path / "t.csv"
        path.write_bytes(b"\xef\xbb\xbf" + ending.join(["trajectory,a,flags,b,note", *lines, "", ",,,,", ""]).encode())
        table = read_table(path, ("trajectory",), ("trajectory", "a", "b", "flags"))
        assert len(table) == rows
        assert list(table.row) == list(range(2, rows + 2))
        assert table.text("trajectory") == [f"block {i % 3}" for i in range(rows)]
        assert table.text("flags", "?") == ["?" if i % 4 else "a;b" for i in range(rows)]
        assert table.text("none", "?") == ["?"] * rows
        np.testing.assert_array_equal(np.stack([table.numbers("a"), table.numbers("b")], axis=1), values)
        np.testing.assert_array_equal(table.numbers("none"), np.full(rows, np.nan))
        assert table.rest(("a", "b"))["note"].tolist() == [f"é{i % 2}" for i in range(rows)]


MISTAKES = {
    "x,two": "row 9, trajectory x: 'two' in column a is not a number. Correct the cell.",
    'x,"1,5"': "row 9, trajectory x: '1,5' in column a has a decimal comma. Write decimals with a point.",
    "x,inf": "row 9, trajectory x: 'inf' in column a is not finite. Correct the cell.",
    "x,1_0": "row 9, trajectory x: '1_0' in column a is not a number. Correct the cell.",
    "x,": "row 9, trajectory x: The cell of a is empty. Give a number.",
    "x": "row 9: The row has 1 cells, the header has 2. Give every row as many cells as the header; ",
    "x,1,2": "row 9: The row has 3 cells, the header has 2. ",
    '"x,1': "row 9: The row cannot be read as separated text ",
}


@pytest.mark.parametrize("line", MISTAKES)
@pytest.mark.parametrize("block_rows", [3, 7, 20_000])
def test_mistakes_are_found_in_any_block(tmp_path, monkeypatch, line, block_rows):
    monkeypatch.setattr(csv_text, "BLOCK_ROWS", block_rows)
    path = tmp_path / "t.csv"
    path.write_text("trajectory,a\n" + "x,1\n" * 7 + line + "\nx,1\n", encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_table(path, ("trajectory", "a"), ("trajectory", "a")).numbers("a", required=True)
    assert str(caught.value).removeprefix(f"{path}, ").startswith(MISTAKES[line])


def test_empty_cells_of_a_column_that_need_not_be_filled(tmp_path):
    table = table_of(tmp_path / "t.csv", ["1", "", " ", "2"])
    np.testing.assert_array_equal(table.numbers("a"), [1, np.nan, np.nan, 2])


def test_a_column_without_a_name_must_be_empty(tmp_path):
    path = tmp_path / "t.csv"
    path.write_text("trajectory,a,\nx,1,\ny,2,\n", encoding="utf-8")
    assert list(read_table(path, ("trajectory", "a"), ()).columns) == ["trajectory", "a"]
    path.write_text("trajectory,a,\nx,1,\ny,2,here\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"row 3: Column 3 has no name, but a cell in it"):
        read_table(path, ("trajectory", "a"), ())


def test_blank_rows_and_quotes(tmp_path):
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

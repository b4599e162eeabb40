# SPDX-License-Identifier: GPL-3.0-or-later
"""Large tables of plain text are read as Python and the csv module read them."""

import csv
from decimal import Decimal, localcontext

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.exchange import plain_cells
from rockfall.core.exchange.cell_kernels import rounded
from rockfall.core.exchange.csv_text import read_table

KNOWN = ("trajectory", "x_m", "v1x_mps")


@pytest.fixture(autouse=True)
def of_any_size(monkeypatch):
    monkeypatch.setattr(plain_cells, "FEWEST_BYTES", 0)


def test_decimals_are_rounded_as_python_rounds_them():
    rng = np.random.default_rng(3)
    shortest = [repr(value) for value in (rng.normal(size=3000) * 10.0 ** rng.integers(-9, 12, 3000)).tolist()]
    whole = zip(rng.integers(1, 2**63, 3000).tolist(), rng.integers(-27, 56, 3000).tolist(), strict=True)
    with localcontext(prec=60):  # halfway between two doubles
        mantissas = zip(rng.integers(2**52, 2**53, 3000).tolist(), rng.integers(-9, 6, 3000).tolist(), strict=True)
        ties = [format(Decimal(2 * m + 1) * Decimal(2) ** e, "E") for m, e in mantissas]
    tried = 0
    for text in (*shortest, *(f"{w}e{q}" for w, q in whole), *ties):
        _, digits, q = Decimal(text).as_tuple()
        w = int("".join(map(str, digits)))
        if w and len(digits) <= 19 and -27 <= q <= 55:
            tried += 1
            assert np.uint64(rounded(np.uint64(w), q)).view(np.float64) == abs(float(text)), text
    assert tried > 6500


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_cells_are_those_of_the_csv_module_and_numbers_those_of_python(tmp_path, newline):
    rng = np.random.default_rng(4)
    forms = ("{:.17g}", "{:.3f}", " {:+.4e} ", "{!r}", "\t{:.25f}", "{:.2E}", "{:.0f}.", "")
    rows = [
        [f" Blöck {i % 7}", *(forms[k].format(x) for k, x in zip(rng.integers(0, 8, 2), xs, strict=True)), "end "]
        for i, xs in enumerate((rng.normal(size=(400, 2)) * 10.0 ** rng.integers(-6, 5, (400, 1))).tolist())
    ]
    rows[7][1:3] = ["1e-40", ".5e1"]
    path = tmp_path / "a.csv"
    path.write_bytes(newline.join(map(",".join, [["trajectory", "x_m", "v1x_mps", "note"], *rows])).encode())
    table = read_table(path, ("trajectory",), KNOWN)
    assert isinstance(table.columns, plain_cells.PlainCells)
    with path.open(encoding="utf-8", newline="") as stream:
        cells = [[cell.strip() for cell in row] for row in csv.reader(stream)][1:]
    assert table.text("trajectory") == [row[0] for row in cells]
    assert table.rest(KNOWN)["note"].tolist() == ["end"] * 400
    for name, place in (("x_m", 1), ("v1x_mps", 2)):
        expected = [float(row[place]) if row[place] else np.nan for row in cells]
        np.testing.assert_array_equal(table.numbers(name), expected)


def test_digits_of_any_number_are_those_of_python_wherever_a_part_of_the_file_ends(tmp_path, monkeypatch):
    monkeypatch.setattr(plain_cells, "CHUNK_BYTES", 900)
    rng = np.random.default_rng(6)
    digits = rng.integers(0, 10, (6000, 24))
    before, behind, zeros = rng.integers(0, 23, 6000), rng.integers(0, 23, 6000), rng.integers(0, 4, 6000)
    cells = []
    for i, row in enumerate(digits):
        text = "".join(map(str, row))
        whole, part = text[: before[i]], ("0" * int(zeros[i]) + text)[: behind[i]]
        point = "." if part or not whole else ""
        cells.append("-" * int(i % 3 == 0) + (whole or "0" * int(i % 2 or not part)) + point + part)
    cells += ["0", "-0", "-0.0", "0.000", "00000000", "000000001", "99999999", "12345678.87654321", "5.", ".25", "1e3"]
    rows = [f"b,{cells[i]},{cells[-i]}" for i in range(len(cells))]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["trajectory,x_m,v1x_mps", *rows]))
    read = plain_cells.plain_rows(path.read_bytes())
    assert read is not None
    assert not read.kinds[1:].any()
    expected = [[float(cell) for cell in row.split(",")[1:]] for row in rows]
    np.testing.assert_array_equal(read.values[1:].T.view(np.uint64), np.array(expected).view(np.uint64))


def test_a_column_is_text_when_a_part_of_the_file_has_text_in_it(tmp_path, monkeypatch):
    monkeypatch.setattr(plain_cells, "CHUNK_BYTES", 64)
    names = [*map(str, range(50)), " block\u2028", "\x1cé\x0b", "", *map(str, range(50))]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["trajectory,x_m", *(f"{name},{i}" for i, name in enumerate(names))]), newline="")
    table = read_table(path, ("trajectory",), KNOWN)
    assert table.columns.numbers("trajectory", False) is None
    assert table.text("trajectory") == [name.strip() for name in names]
    assert table.numbers("x_m", required=True).tolist() == list(range(103))


def test_blank_rows_above_the_header_are_passed_over(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("\n \t\n\r\n trajectory;x_m\na,b;1,5\n", newline="")
    table = read_table(path, ("trajectory",), KNOWN)
    assert (table.text("trajectory"), table.numbers("x_m").tolist()) == (["a,b"], [1.5])


@pytest.mark.parametrize(
    ("bad", "problem"),
    [
        ("b,1_0,2", "not a number"),
        ("b,inf,2", "not finite"),
        ("b,nan,2", "not finite"),
        ("b,1e400,2", "not finite"),
        ("b,1.2.3,2", "not a number"),
        ("b,,2", "empty"),
        ("b,1", "2 cells, the header has 3"),
        ("b,1,2,3", "4 cells, the header has 3"),
    ],
)
def test_what_is_wrong_is_said_with_its_row(tmp_path, bad, problem):
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["trajectory,x_m,v1x_mps", *["a,1,2"] * 50, bad, *["a,1,2"] * 3]))
    with pytest.raises(InputError, match=problem) as caught:
        read_table(path, ("trajectory",), KNOWN).numbers("x_m", required=True)
    assert caught.value.row == 52


@pytest.mark.parametrize("text", ['a,"1",2', "", ",,", "a,1\r,2"])
def test_what_is_not_plain_is_left_to_the_csv_module(tmp_path, text):
    path = tmp_path / "a.csv"
    path.write_bytes("\n".join(["trajectory,x_m,v1x_mps", "a,1,2", text, "b,3,4"]).encode())
    assert plain_cells.plain_rows(path.read_bytes()) is None


def test_other_units_are_converted_in_large_tables_too(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("trajectory,x_m,v1x_kmh\n" + "a,1,36\n" * 9)
    np.testing.assert_allclose(read_table(path, ("trajectory",), KNOWN).numbers("v1x_mps"), 10.0)

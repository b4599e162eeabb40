# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of points, and all other tables, as programs and people write them: read where it is clear, else refused with
the cause and the row.
"""

import csv
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.exchange import plain_cells
from rockfall.core.exchange.csv_text import read_table
from rockfall.core.terrain.advice import exchanged_axes
from rockfall.core.terrain.point_tables import read_xyz
from rockfall.core.terrain.readers import inspect_terrain, read_terrain

CASES = Path(__file__).parents[1] / "data" / "field_cases"
POINTS = np.array(
    [[352_000.5, 5_130_000.25, 1_200.75], [352_010.0, 5_130_007.5, 1_210.5], [352_020.25, 5_130_001.0, 998.5]]
)
NO_BREAK, NARROW = "\u00a0", "\u202f"


def grouped(value: float, group: str, decimal: str) -> str:
    """With a sign between thousands, as `format` puts commas there."""
    return f"{value:,.2f}".replace(",", "G").replace(".", decimal).replace("G", group)


def table(path: Path, separator: str, group: str = "", decimal: str = ".", header: str = "", quote: str = "") -> Path:
    lines = [separator.join(f"{quote}{grouped(v, group, decimal)}{quote}" for v in row) for row in POINTS.tolist()]
    path.write_text("\n".join([*([header] if header else []), *lines, ""]), encoding="utf-8")
    return path


@pytest.mark.parametrize("header", ["", "x;y;z"])
@pytest.mark.parametrize("quote", ["", '"'])
@pytest.mark.parametrize(
    ("separator", "group", "decimal"),
    [
        (";", "", "."), (";", "", ","), ("\t", "", ","), (" ", "", "."), (" ", "", ","), (",", "", "."),
        ("; ", "", ","),
        (";", " ", ","), (";", " ", "."), (";", NO_BREAK, ","), (";", NARROW, ","), (";", "'", "."),
        (";", "\u2019", "."),
        ("\t", " ", ","), (",", " ", "."), (",", "'", "."), (" ", "'", "."), (" ", "\u2019", "."),
    ],
)  # fmt: skip
def test_a_cloud_is_read_in_each_way_of_writing_that_is_clear(tmp_path, separator, group, decimal, header, quote):
    if quote and separator == " ":
        pytest.skip("nobody quotes between blanks")
    header = header.replace(";", separator.strip(" ") or " ")
    path = table(tmp_path / "a.xyz", separator, group, decimal, header, quote)
    np.testing.assert_array_equal(read_xyz(path).points, POINTS)


@pytest.mark.parametrize(
    ("separator", "group", "decimal", "cause"),
    [
        (";", ".", ",", '"352.000,50" has marks between its thousands'),
        (";", ",", ".", '"352,000.50" has marks between its thousands'),
        ("\t", ".", ",", '"352.000,50" has marks between its thousands'),
        (" ", ",", ".", '"352,000.50" has marks between its thousands'),
        (" ", ".", ",", '"352.000,50" has marks between its thousands'),
        (",", ",", ".", "looks as if blanks or commas stood between thousands as between columns"),
        (" ", " ", ".", "looks as if blanks or commas stood between thousands as between columns"),
        (" ", " ", ",", "looks as if blanks or commas stood between thousands as between columns"),
    ],
)
def test_a_cloud_is_refused_where_marks_mean_two_things(tmp_path, separator, group, decimal, cause):
    path = table(tmp_path / "a.csv", separator, group, decimal)
    with pytest.raises(InputError, match="between") as caught:
        read_terrain(path)
    assert cause in caught.value.problem
    assert caught.value.row == 1


def test_quoted_decimal_commas_between_commas_are_refused_with_their_cause(tmp_path):
    path = table(tmp_path / "a.csv", ",", "", ",", "x,y,z", '"')
    with pytest.raises(InputError, match=r"352000,50.* has a decimal comma") as caught:
        read_terrain(path)
    assert caught.value.row == 2


def test_a_thousand_far_down_is_refused_with_its_row_and_cause(tmp_path):
    path = tmp_path / "a.csv"
    rows = [f"{i % 40};{i // 40};{900 + i / 10:.1f}" for i in range(900)]
    rows[700] = "20;17;1,050.5"
    path.write_text("\n".join(rows))
    with pytest.raises(InputError, match=r'"1,050\.5" has marks between its thousands') as caught:
        read_terrain(path)
    assert caught.value.row == 701


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"])
@pytest.mark.parametrize("first", ["", "sep=;\n", '"sep=;"\n'])
def test_marks_at_the_beginning_of_a_file_are_read(tmp_path, encoding, first):
    path = tmp_path / "a.csv"
    text = first + table(path, ";", "", ",", "x;y;z").read_text()
    mark = {"utf-16-le": b"\xff\xfe", "utf-16-be": b"\xfe\xff"}.get(encoding, b"")
    path.write_bytes(mark + text.encode(encoding))
    np.testing.assert_array_equal(read_xyz(path).points, POINTS)
    text = first + "trajectory;x_m\na;1,5\nb;x\n"
    path.write_bytes(mark + text.encode(encoding))
    with pytest.raises(InputError, match="'x' in column x_m is not a number") as caught:
        read_table(path, ("x_m",), ("trajectory", "x_m")).numbers("x_m")
    assert caught.value.row == 3 + bool(first)


def test_a_column_that_counts_is_no_coordinate():
    """z was 5 130 000 m."""
    path = CASES / "03-point-number-first" / "numid.txt"
    expected = np.loadtxt(path)[:, 1:4]
    for read in (read_terrain, inspect_terrain):
        assert "The first column counts the points (1 to 441): x, y and z are those behind it." in read(path).summary
    np.testing.assert_array_equal(read_xyz(path).points, expected)


def test_numbers_with_gaps_count_too_and_eastings_do_not(tmp_path):
    rng = np.random.default_rng(1)
    points = np.column_stack([np.repeat(np.arange(20.0), 20), np.tile(np.arange(20.0), 20), rng.uniform(0, 5, 400)])
    numbers = 1001 + np.flatnonzero(rng.random(600) < 0.8)[:400]
    np.savetxt(tmp_path / "a.xyz", np.column_stack([numbers, points, rng.integers(0, 255, (400, 3))]), fmt="%.3f")
    source = read_xyz(tmp_path / "a.xyz")
    np.testing.assert_allclose(source.points, points, atol=6e-4)
    assert source.colours is not None
    np.savetxt(tmp_path / "b.xyz", np.column_stack([points, rng.uniform(0, 1, 400)]), fmt="%.3f")
    np.testing.assert_allclose(read_xyz(tmp_path / "b.xyz").points, points, atol=6e-4)


def test_names_of_points_in_the_first_column_are_said_to_be_names(tmp_path):
    (tmp_path / "a.txt").write_text("P1 1 2 3\nP2 2 3 4\nP3 4 1 5\n")
    with pytest.raises(InputError, match=r'The first column holds names of points \("P1"\)') as caught:
        read_terrain(tmp_path / "a.txt")
    assert caught.value.row == 1


@pytest.mark.parametrize(
    ("order", "words"),
    [
        ((0, 2, 1), "Exchange y and z in the file"),
        ((2, 0, 1), "Bring them into the order x, y, z"),
    ],
)
@pytest.mark.parametrize("place", [(352_000.0, 5_130_000.0, 1_200.0), (2_600_000.0, 1_200_000.0, 1_500.0)])
def test_heights_that_are_another_axis_are_refused_with_the_order(tmp_path, order, words, place):
    rng = np.random.default_rng(2)
    points = (np.array(place) + rng.uniform(0, 300, (400, 3)) * [1, 1, 0.5])[:, order]
    np.savetxt(tmp_path / "a.xyz", points, fmt="%.3f")
    for read in (read_terrain, inspect_terrain):
        with pytest.raises(InputError, match="nowhere on the Earth") as caught:
            read(tmp_path / "a.xyz")
        assert caught.value.advice == words


@pytest.mark.parametrize(("order", "words"), [((1, 0, 2), "looks like a northing"), ((0, 1, 2), "")])
@pytest.mark.parametrize("place", [(352_000.0, 5_130_000.0, 1_200.0), (2_600_000.0, 1_200_000.0, 1_500.0)])
def test_exchanged_axes_are_said_by_their_numbers(tmp_path, order, words, place):
    rng = np.random.default_rng(2)
    points = (np.array(place) + rng.uniform(0, 300, (400, 3)) * [1, 1, 0.5])[:, order]
    np.savetxt(tmp_path / "a.xyz", points, fmt="%.3f")
    for summary in (
        read_terrain(tmp_path / "a.xyz", max_edge_m=1e9).summary,
        inspect_terrain(tmp_path / "a.xyz").summary,
    ):
        found = [said for said in summary if "is no height" in said or "northing" in said]
        assert (words in found[0]) if words else found == []


def test_heights_up_y_with_northings_to_the_south_are_read_with_y_up():
    low, high = np.array([352_000.0, 1_200.0, -5_130_300.0]), np.array([352_300.0, 1_350.0, -5_130_000.0])
    assert "read it with Y up" in exchanged_axes(low, high)


@pytest.mark.parametrize(
    "place", [(0, 0, 0), (600_000, 200_000, 500), (3_500_000, 5_400_000, 400), (700_000, 6_600_000, 300),
              (1_000_000, 200_000, 80), (4_321_000, 3_210_000, 100), (166_000, 9_300_000, 20)],
)  # fmt: skip
def test_systems_of_other_countries_are_not_exchanged(place):
    """LV03, Gauss-Krüger, Lambert-93, a state plane in feet, LAEA Europe, UTM in the far north."""
    low = np.array(place, dtype=float)
    assert exchanged_axes(low, low + np.array([900, 800, 200])) == ""


COLUMN = ("1.5", "1234567.25", "-0.125", "1e3", "")


def numbers_of(path: Path, cells: list[str], separator: str) -> np.ndarray:
    rows = [["trajectory", "x_m", "y_m"], *([f"b{i}", cell, "1"] for i, cell in enumerate(cells))]
    with path.open("w", encoding="utf-8", newline="") as stream:
        csv.writer(stream, delimiter=separator, lineterminator="\n").writerows(rows)
    return read_table(path, ("x_m",), ("trajectory", "x_m", "y_m")).numbers("x_m")


@pytest.mark.parametrize("fewest", [0, 1 << 20])
@pytest.mark.parametrize("group", [" ", "'", "\u2019", NO_BREAK, NARROW])
@pytest.mark.parametrize(("separator", "decimal"), [(";", ","), (";", "."), ("\t", ","), (",", ".")])
def test_signs_between_thousands_are_read_in_every_table(tmp_path, monkeypatch, fewest, group, separator, decimal):
    """The quick way and the careful one agree."""
    monkeypatch.setattr(plain_cells, "FEWEST_BYTES", fewest)
    values = [1234567.25, 12.5, 1234.0, -98765.5]
    cells = [grouped(value, group, decimal) for value in values]
    np.testing.assert_array_equal(numbers_of(tmp_path / "a.csv", cells, separator), values)


@pytest.mark.parametrize("fewest", [0, 1 << 20])
@pytest.mark.parametrize(
    ("separator", "cell", "cause"),
    [
        (";", "1.234,56", "'1.234,56' in column x_m has marks between its thousands. Export numbers without them"),
        (";", "1,234.56", "'1,234.56' in column x_m has marks between its thousands"),
        (",", "1,234.56", "'1,234.56' in column x_m has marks between its thousands"),
        (",", "1.234.567", "'1.234.567' in column x_m has marks between its thousands"),
        (",", "12,5", "'12,5' in column x_m has a decimal comma. Write decimals with a point"),
        (",", "1 23", "'1 23' in column x_m is not a number"),
        ("\t", "1.234.567,8", "'1.234.567,8' in column x_m has marks between its thousands"),
    ],
)
def test_what_may_mean_two_numbers_is_refused_in_every_table(tmp_path, monkeypatch, fewest, separator, cell, cause):
    monkeypatch.setattr(plain_cells, "FEWEST_BYTES", fewest)
    with pytest.raises(InputError) as caught:
        numbers_of(tmp_path / "a.csv", ["1.5", "2.5", cell, "3.5"], separator)
    assert cause in str(caught.value).removeprefix(str(tmp_path))
    assert caught.value.row == 4


def test_one_number_with_marks_between_thousands_makes_no_other_one_a_thousand_times_smaller(tmp_path):
    """1.234 beside 5.678,9 is 1234: whatever column is asked for, the table is refused."""
    path = tmp_path / "a.csv"
    path.write_text("trajectory;x_m;note\na;1.234;5.678,9\n")
    with pytest.raises(InputError, match=r"'5\.678,9' in column note has marks between its thousands"):
        read_table(path, ("x_m",), ("trajectory", "x_m")).numbers("x_m")


def test_a_row_whose_numbers_have_commas_between_commas_says_so(tmp_path):
    path = tmp_path / "a.csv"
    for row in ("a,12,5,7,25", "a,1,234.5,7"):
        path.write_text(f"trajectory,x_m,y_m\n{row}\n")
        with pytest.raises(InputError, match="Numbers seem to have commas") as caught:
            read_table(path, ("x_m",), ("trajectory", "x_m"))
        assert caught.value.row == 2

# SPDX-License-Identifier: GPL-3.0-or-later
"""Names that a spreadsheet would compute: harmless in the file, and as they were when they are read again."""

import csv

import numpy as np
import pytest
from rockfall.core.exchange.csv_text import read_table
from rockfall.core.exchange.decimal_tables import Words, write_decimal_table
from rockfall.core.exchange.tables import read_picks, write_columns, write_picks
from rockfall.core.formats.csv_cells import FORMULA, NUMBER, guarded, unguarded
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.picks import make_picks

NAMES = ("=1+1", "-3", "+A", "@SUM(A1)", "-", "'=x", "''=x", "'a", "plain", "=a,b", "-1.5e3", "-2 to 3", "＝1", "a=b")


@pytest.mark.parametrize("name", NAMES)
def test_a_name_is_written_harmless_and_comes_back(name):
    written = guarded(name)
    assert not FORMULA.match(written) or written.startswith("'") or NUMBER.fullmatch(written)
    assert unguarded(written) == name


def test_numbers_stay_numbers():
    for number in ("-3", "+0.25", "-1.5e-07", "-.5", "-inf", "nan"):
        assert guarded(number) == number
    assert guarded("-3x") == "'-3x"


def test_picks_come_back_with_their_names(tmp_path):
    picks = make_picks(
        trajectory=list(NAMES), time_s=np.arange(len(NAMES)) * 1.0, position=np.zeros((len(NAMES), 3)),
        kind=["release"] * len(NAMES), extra={"@note": np.array([f"={name}" for name in NAMES])},
        source="x", shift=GlobalShift(),
    )  # fmt: skip
    write_picks(picks, tmp_path / "picks.csv")
    with (tmp_path / "picks.csv").open(encoding="utf-8", newline="") as stream:
        for row in csv.reader(stream):
            for cell in row:
                assert not FORMULA.match(cell) or cell.startswith("'") or NUMBER.fullmatch(cell), cell
    again = read_picks(tmp_path / "picks.csv", GlobalShift())
    assert sorted(again.trajectory.tolist()) == sorted(NAMES)
    assert sorted(again.extra["@note"].tolist()) == sorted(f"={name}" for name in NAMES)


@pytest.mark.parametrize("many", [1, 60_000])
def test_all_ways_to_write_and_read_a_table(tmp_path, many):
    """Few rows and many, quoted and not, with and without compiled code; negative numbers are as they were."""
    names = [name for name in NAMES if "," not in name] * many
    values = -np.arange(len(names), dtype=np.float64) - 0.5
    write_columns(tmp_path / "a.csv", {"name": names, "value": values})
    index = np.arange(len(names)) % len(NAMES)
    write_decimal_table(tmp_path / "b.csv", [lambda: {"name": Words(index, NAMES), "value": values}], {"value": 1})
    for file, expected in (("a.csv", names), ("b.csv", [NAMES[i] for i in index])):
        table = read_table(tmp_path / file, ("name", "value"), ("name", "value"))
        assert table.text("name") == expected
        np.testing.assert_array_equal(table.numbers("value"), values)
    first = (tmp_path / "b.csv").read_text(encoding="utf-8").split("\n")
    assert first[1:3] == ["'=1+1,-0.5", "-3,-1.5"]

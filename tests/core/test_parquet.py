# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables as Parquet files: what is read from one is what the CSV file says, with the same checks."""

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from rockfall.core import extras
from rockfall.core.cli import main
from rockfall.core.commands.demo import SITE
from rockfall.core.errors import DependencyError, InputError
from rockfall.core.exchange.tables import read_impacts, read_picks, write_impacts

pa = pytest.importorskip("pyarrow")
parquet = pytest.importorskip("pyarrow.parquet")
csv = pytest.importorskip("pyarrow.csv")


@pytest.fixture(scope="module")
def tables(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("tables") / "out"
    command = ["reconstruct", str(SITE / "picks.csv"), "--terrain", str(SITE / "terrain.ply"), "--parquet"]
    assert main([*command, "--out", str(out)]) == 0
    return out


def test_both_files_hold_the_same(tables: Path) -> None:
    one, other = read_impacts(tables / "impacts.csv"), read_impacts(tables / "impacts.parquet")
    for field in fields(one):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if isinstance(a, np.ndarray):
            np.testing.assert_array_equal(a, b, err_msg=field.name)
        elif isinstance(a, dict):
            assert a.keys() == b.keys()
            for key in a:
                np.testing.assert_array_equal(a[key], b[key], err_msg=key)


def test_pyarrow_reads_the_csv_file_as_what_is_in_the_other(tables: Path) -> None:
    """Another reader of CSV: numbers are numbers and undefined ones null."""
    expected = csv.read_csv(tables / "impacts.csv")
    found = parquet.read_table(tables / "impacts.parquet")
    assert found.column_names == expected.column_names
    for name in ("rn", "theta1_deg", "x_m", "kinetic2_J"):
        assert found[name].null_count == expected[name].null_count
        values, others = found[name].drop_null().to_numpy(), expected[name].drop_null().to_numpy()
        np.testing.assert_array_equal(values, others)
    assert found["rn"].null_count > 0


def test_tables_of_other_programs(tmp_path: Path) -> None:
    """Whole numbers, single precision, another unit, texts that are numbers."""
    table = {
        "trajectory": pa.array([1, 1, 1]),
        "time_s": pa.array(["0.0", "0.5", "1.25"]),
        "x_cm": pa.array([0, 250, 700], pa.int32()),
        "y_m": pa.array([0.5, 0.25, 0.125], pa.float32()),
        "z_m": [10.0, 8.0, 3.0],
    }
    parquet.write_table(pa.table(table), tmp_path / "picks.parquet")
    picks = read_picks(tmp_path / "picks.parquet")
    assert picks.trajectory.tolist() == ["1", "1", "1"]
    np.testing.assert_array_equal(picks.time_s, [0.0, 0.5, 1.25])
    np.testing.assert_allclose(np.diff(picks.position[:, 0]), [2.5, 4.5])
    np.testing.assert_allclose(np.diff(picks.position[:, 1]), [-0.25, -0.125])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"z_m": [1.0, np.inf, 0.0]}, "not finite"),
        ({"z_m": [1.0, None, 0.0]}, "empty"),
        ({"time_s": ["0", "soon", "2"]}, "'soon' in column time_s is not a number"),
        ({"z_m": None}, "z_m"),
        ({"trajectory": [], "time_s": [], "x_m": [], "y_m": [], "z_m": []}, "no rows"),
    ],
)
def test_bad_tables_are_refused_as_csv_files_are(change: dict[str, object], said: str, tmp_path: Path) -> None:
    good = {"trajectory": ["a"] * 3, "time_s": [0.0, 1, 2], "x_m": [0.0, 1, 2], "y_m": [0.0, 0, 0], "z_m": [2.0, 1, 0]}
    columns = {name: values for name, values in (good | change).items() if values is not None}
    path = tmp_path / "picks.parquet"
    parquet.write_table(pa.table(columns), path)
    with pytest.raises(InputError) as error:
        read_picks(path)
    assert said in error.value.problem
    assert error.value.advice
    assert str(path) in str(error.value)


def test_a_file_that_is_no_parquet_file(tmp_path: Path) -> None:
    (tmp_path / "impacts.parquet").write_text("trajectory,time_s\n")
    with pytest.raises(InputError, match="cannot be read"):
        read_impacts(tmp_path / "impacts.parquet")


def test_without_its_library_the_command_says_so_before_the_work(
    tables: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(extras, "PARQUET", ("parquet", "Parquet files", "no_such_library"))
    monkeypatch.setattr(extras, "is_there", lambda extra: False)
    with pytest.raises(DependencyError, match=r"rockfall\[parquet\]"):
        write_impacts(read_impacts(tables / "impacts.csv"), tmp_path / "impacts.parquet")
    out = tmp_path / "out"
    assert main(["reconstruct", str(SITE / "picks.csv"), "--parquet", "--out", str(out)]) == 1
    assert "pip install" in capsys.readouterr().err
    assert not out.exists()

# SPDX-License-Identifier: GPL-3.0-or-later
"""Other processors: what the script that compares them finds, and that tables of measured falls agree to 9 digits."""

import importlib.util
import math
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "scripts" / "verification" / "processors.py"


@pytest.fixture(scope="module")
def processors():
    spec = importlib.util.spec_from_file_location("processors", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def written(folder: Path, name: str, text: str) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / name).write_text(text, encoding="utf-8")
    return folder


def test_what_differs_is_counted(processors, tmp_path: Path) -> None:
    first = written(tmp_path / "a", "runs.csv", "name,x_m\nA,100\nB,0.5\n")
    same = written(tmp_path / "b", "runs.csv", "name,x_m\nA,100\nB,0.5\n")
    other = written(tmp_path / "c", "runs.csv", "name,x_m\nA,100.001\nB,0.5\n")
    assert processors.compared(first, same) == "same"
    assert processors.compared(first, other) == "1 of 6, ≤ 1e-05"
    assert processors.difference(first / "runs.csv", other / "runs.csv")[2] == pytest.approx(1e-5, rel=1e-3)
    rounding = written(tmp_path / "d", "runs.csv", "name,x_m\nA,100\nB,0.5\nC,0\n")
    zero = written(tmp_path / "e", "runs.csv", "name,x_m\nA,100\nB,0.5\nC,1e-17\n")
    assert processors.difference(rounding / "runs.csv", zero / "runs.csv")[2] == pytest.approx(1e-10)
    lost = written(tmp_path / "f", "runs.csv", "name,x_m\nA,100\n")
    assert processors.compared(first, lost) == "1 of 1, some another way"
    named = written(tmp_path / "g", "runs.csv", "name,x_m\nA,100\nC,0.5\n")
    assert math.isinf(processors.difference(first / "runs.csv", named / "runs.csv")[2])
    assert processors.compared(first, written(tmp_path / "h", "hits.csv", "a\n")) == "other files"


def test_times_and_versions_are_no_difference(processors, tmp_path: Path) -> None:
    first = written(tmp_path / "a", "summary.json", '{"seconds": 3.1, "version": "1", "runs": [1, 2.5]}')
    other = written(tmp_path / "b", "summary.json", '{"seconds": 9.9, "version": "2", "runs": [1, 2.5]}')
    assert processors.compared(first, other) == "same"


def test_measured_falls_are_equal_to_nine_digits_with_the_linear_algebra_of_an_old_processor(
    processors, tmp_path: Path
) -> None:
    words = processors.commands(tmp_path)["reconstruct"]
    for name, variables in (("own", {}), ("old", {"OPENBLAS_CORETYPE": "Prescott", "PYTHON_CPU_COUNT": "1"})):
        processors.run(words, tmp_path / name, variables, None)
    for file in (tmp_path / "own").glob("*.csv"):
        assert processors.difference(file, tmp_path / "old" / file.name)[2] < 1e-9, file.name

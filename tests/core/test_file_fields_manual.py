# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of what is read of each file: each row says what is done with a field, and names a test that there is."""

import ast
import re
from pathlib import Path

import rockfall

ROOT = Path(rockfall.__file__).parent
TABLE = ROOT / "docs" / "manual" / "file_fields.md"
CELL = re.compile(r"(?<!\\)\|")


def rows() -> list[list[str]]:
    lines = TABLE.read_text(encoding="utf-8").splitlines()
    cells = [[cell.strip() for cell in CELL.split(line)[1:-1]] for line in lines if line.startswith("| ")]
    return [row for row in cells if row[-1] != "test"]


def names_in(file: Path) -> set[str]:
    tree = ast.parse(file.read_text(encoding="utf-8"))
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


def test_each_row_says_what_is_done_and_names_a_test() -> None:
    found, wrong = rows(), []
    assert len(found) > 100
    for row in found:
        assert len(row) == 4, row
        named = re.findall(r"`((?:blender/)?test_\w+)\.py::(\w+)`", row[3])
        if not named:
            wrong.append(f"no test: {row}")
        if not re.search(r"\*\*(read|refused|said)\*\*|left out|not trusted", row[2]):
            wrong.append(f"nothing is done: {row}")
        for file, name in named:
            folder = "" if file.startswith("blender/") else "core/"
            path = ROOT / "tests" / f"{folder}{file}.py"
            if not path.is_file() or name not in names_in(path):
                wrong.append(f"no such test: {file}.py::{name}")
    assert wrong == []

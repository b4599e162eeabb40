# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall prepare``: what it has compiled is what the first commands run."""

import subprocess
import sys
from pathlib import Path

import pytest
from rockfall.core.commands.demo import SITE

WATCHED = """
import sys
from rockfall.core import cli, kept_code

asked, load = [], kept_code.KeptCode.load_overload
def watched(self, signature, target):
    asked.append(f"{self._function.__qualname__} {signature}")
    return load(self, signature, target)
kept_code.KeptCode.load_overload = watched

assert cli.main(["prepare"]) == 0
assert len(asked) > 5
asked.clear()
assert cli.main(sys.argv[1:]) == 0
print("compiled after it:", asked)
"""


@pytest.mark.parametrize(
    "command",
    [
        ["reconstruct", str(SITE / "picks.csv"), "--terrain", str(SITE / "terrain.ply")],
        ["simulate", str(SITE / "project.toml"), "--model", "wyllie_2014", "--number", "2"],
    ],
    ids=["reconstruct", "simulate"],
)
def test_after_it_commands_compile_nothing(command: list[str], tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", WATCHED, *command, "--out", str(tmp_path / "out")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert "compiled after it: []" in done.stdout, done.stdout + done.stderr

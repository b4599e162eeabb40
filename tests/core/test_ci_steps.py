# SPDX-License-Identifier: GPL-3.0-or-later
"""The runner of CI's steps: what fails is counted, what hangs is ended, what needs a failed step does not run."""

import importlib.util
import subprocess
import sys
import threading
from pathlib import Path
from types import ModuleType

import pytest

FILE = Path(__file__).parents[2] / ".ci" / "steps.py"


@pytest.fixture(scope="module")
def steps() -> ModuleType:
    spec = importlib.util.spec_from_file_location("ci_steps", FILE)
    sys.modules["ci_steps"] = module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("said", "status", "passed", "failed"),
    [
        ("rows\n1366 passed, 2 skipped in 825.69s\n", 0, 1366, 0),
        ("= 3 failed, 12 passed in 1s =\n", 1, 12, 3),
        ("= 12 passed, 1 error in 1s =\n", 1, 12, 1),
        ("core: 3 passed in 1s\n3 passed, 0 failed\n", 0, 3, 0),
        ("16 passed in 1s\nSegmentation fault\n", 139, 16, 1),
        ("All checks passed!\n", 0, 1, 0),
        ("", 124, 0, 1),
    ],
)
def test_what_a_step_counts(steps, said: str, status: int, passed: int, failed: int) -> None:
    assert steps.counted(said, status) == (passed, failed)


def test_failures_hangs_and_what_needs_them(steps, monkeypatch, tmp_path: Path, capsys) -> None:
    monkeypatch.setattr(steps, "GRACE_S", 1.0)
    child = tmp_path / "child"
    board = steps.Board(
        (
            steps.Step("good", 30, "echo 5 passed in 1s"),
            steps.Step("bad", 30, "echo before; false; echo after"),
            steps.Step("late", 0.5, f"sleep 100 & echo $! > {child}; wait"),
            steps.Step("next", 30, "echo never", ("good", "bad")),
            steps.Step("last", 30, "echo 2 passed, 0 failed", ("good",)),
        )
    )
    workers = [threading.Thread(target=board.take) for _ in range(2)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join(60)
    assert (board.passed, board.failed) == (7, 3)
    assert board.good == {"good": True, "bad": False, "late": False, "next": False, "last": True}
    printed = capsys.readouterr().out
    assert "=== bad\nbefore\n" in printed
    assert "after\n" not in printed
    assert "=== late\nstopped after 0 s\n" in printed
    assert "=== next\nnot run: bad has failed\n" in printed
    state = subprocess.run(["ps", "-o", "stat=", "-p", child.read_text()], capture_output=True, text=True, check=False)
    assert state.stdout.strip()[:1] in ("", "Z"), "what a late step had started is ended, too"


def test_the_steps_need_only_earlier_ones(steps) -> None:
    names = [step.name for step in steps.STEPS]
    assert len(set(names)) == len(names)
    for i, step in enumerate(steps.STEPS):
        assert set(step.after) <= set(names[:i])
        needed = [other for other in steps.STEPS if other.name in step.after]
        assert step.in_blender or not any(other.in_blender for other in needed), "left out where there is no Blender"

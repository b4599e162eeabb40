# SPDX-License-Identifier: GPL-3.0-or-later
"""Damaged files of every format are read, or refused in words: a short run of scripts/fuzzing."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from rockfall.core.errors import InputError

FUZZING = Path(__file__).parents[2] / "scripts" / "fuzzing"
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="the memory of a process is limited on Unix alone")


def test_damaged_files_are_read_or_refused_in_words():
    ended = subprocess.run(
        [sys.executable, FUZZING / "fuzz.py", "--cases", "600", "--seed", "11", "--quick", "--seconds", "7"],
        capture_output=True, text=True, check=False, timeout=200,
    )  # fmt: skip
    assert ended.returncode == 0, ended.stdout[-4000:] + ended.stderr[-2000:]
    assert ", 0 problems, " in ended.stdout


@pytest.fixture
def fuzz(monkeypatch):
    monkeypatch.syspath_prepend(FUZZING)
    import fuzz

    return fuzz


def _raise(error):
    raise error


@pytest.mark.parametrize(
    ("read", "problem"),
    [
        (lambda at: at, ""),
        (lambda at: _raise(InputError("It is torn", file=at, advice="Copy it")), ""),
        (lambda at: _raise(InputError("It is torn", advice="Copy it")), "the message names no file"),
        (lambda at: _raise(InputError("It is torn", file=at)), "the message has no advice"),
        (lambda at: _raise(KeyError("x")), "traceback KeyError"),
        (lambda at: os.write(2, b"decoder: bad block"), "a library speaks"),
    ],
)
def test_the_judge_sees_what_it_is_for(fuzz, tmp_path, read, problem):
    found, _ = fuzz.judge(fuzz.Case({}, (), read), tmp_path)
    assert found.startswith(problem)
    assert bool(found) == bool(problem)


def test_the_judge_sees_a_command_that_leaves_half_of_its_output(fuzz, tmp_path):
    def half(folder):
        (folder / "out").mkdir()
        os.write(2, f"rockfall: {folder}/a.csv: It is torn. Copy it.\n".encode())
        return 1

    assert fuzz.judge(fuzz.Case({}, (), half, command=True), tmp_path)[0] == "half-written"

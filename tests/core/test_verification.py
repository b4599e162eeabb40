# SPDX-License-Identifier: GPL-3.0-or-later
"""The verification manual says what is computed now, and all of its checks hold."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
WRITE = ROOT / "scripts" / "verification" / "write.py"


@pytest.mark.parametrize("chapter", ["equations", "impact_models", "simulation"])
def test_a_chapter_is_what_is_computed_now(chapter: str) -> None:
    done = subprocess.run([sys.executable, WRITE, "--check", chapter], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_page_is_in_the_contents() -> None:
    folder = ROOT / "docs" / "verification"
    contents = (folder / "README.md").read_text(encoding="utf-8")
    for page in folder.glob("*.md"):
        assert page.name == "README.md" or f"({page.name})" in contents

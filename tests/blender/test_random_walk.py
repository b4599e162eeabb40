# SPDX-License-Identifier: GPL-3.0-or-later
"""A random walk over all that can be done to a scene loses no pick, and nothing goes wrong.

More steps, or other walks: ROCKFALL_WALK_STEPS=1000 ROCKFALL_WALK_SEED=7,8.
"""

import importlib.util
import os
from pathlib import Path

import pytest

STEPS = int(os.environ.get("ROCKFALL_WALK_STEPS", "333"))
SEEDS = [int(text) for text in os.environ.get("ROCKFALL_WALK_SEED", "3,15").split(",")]


def _walk() -> type:
    spec = importlib.util.spec_from_file_location("random_walk", Path(__file__).with_name("random_walk.py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.Walk


@pytest.mark.parametrize("seed", SEEDS)
def test_a_random_walk(part, tmp_path: Path, seed: int) -> None:
    walk = _walk()(seed, tmp_path, part)
    walk.begin()
    try:
        for _ in range(STEPS):
            walk.step()
            walk.check()
    except Exception as error:
        error.add_note(f"after {len(walk.done)} steps, the last of them:\n" + "\n".join(walk.done[-12:]))
        raise
    assert len({name.split()[0].split("(")[0] for name in walk.done}) > 50

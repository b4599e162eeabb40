# SPDX-License-Identifier: GPL-3.0-or-later
"""A random walk over all that can be done to a scene loses no pick, and nothing goes wrong; nor does Blender crash.

Each walk has a process of its own. More steps, or other walks: ROCKFALL_WALK_STEPS=1000 ROCKFALL_WALK_SEED=7,8, or
scripts/fuzzing/walk_blender.py.
"""

import importlib.util
import os
from pathlib import Path

import bpy
import pytest

STEPS = int(os.environ.get("ROCKFALL_WALK_STEPS", "200"))
SEEDS = [int(text) for text in os.environ.get("ROCKFALL_WALK_SEED", "3,14").split(",")]


@pytest.mark.parametrize("seed", SEEDS)
def test_a_random_walk(seed: int) -> None:
    script = Path(__file__).resolve().parents[2] / "scripts" / "fuzzing" / "walk_blender.py"
    spec = importlib.util.spec_from_file_location("walk_blender", script)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert module.walked(seed, STEPS, bpy.app.binary_path) == ""

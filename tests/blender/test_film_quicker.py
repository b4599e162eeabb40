# SPDX-License-Identifier: GPL-3.0-or-later
"""A film whose engine is found by a frame of each: the quicker one is used, and that is said."""

from collections.abc import Callable
from types import ModuleType

import bpy
import pytest


@pytest.fixture
def quicker(rockfall: ModuleType, part: Callable[[str], ModuleType], monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The module, with engines that are only written down."""
    module = part("rockfall_addon.steps.film.quicker")
    module.used = []
    monkeypatch.setattr(module, "use_engine", lambda scene, engine: module.used.append(engine))
    return module


@pytest.mark.parametrize(
    ("seconds", "best", "said"),
    [
        (
            {"cycles": 0.5, "workbench": 0.125},
            "workbench",
            "Rendered with Workbench, which takes 0.12 s for a frame here; Cycles takes 0.50 s.",
        ),
        (
            {"cycles": 0.05, "workbench": 2.0},
            "cycles",
            "Rendered with Cycles, which takes 0.05 s for a frame here; Workbench takes 2.00 s.",
        ),
    ],
)
def test_the_quicker_engine_is_used(
    quicker: ModuleType, monkeypatch: pytest.MonkeyPatch, seconds: dict[str, float], best: str, said: str
) -> None:
    frames = []

    def frame_s(scene: bpy.types.Scene, frame: int) -> float:
        frames.append(frame)
        return seconds[quicker.used[-1]]

    monkeypatch.setattr(quicker, "_frame_s", frame_s)
    assert quicker.use_quicker(bpy.context.scene, 100, 300) == said
    assert quicker.used == ["cycles", "workbench", best]
    assert frames == [200, 200]


def test_a_short_film_is_not_measured(quicker: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(quicker, "_frame_s", lambda scene, frame: pytest.fail("measured"))
    assert quicker.use_quicker(bpy.context.scene, 0, quicker.FEWEST_FRAMES - 2) == ""
    assert quicker.used == ["cycles"]

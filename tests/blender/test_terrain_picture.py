# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall terrain`` leaves a shaded picture."""

from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np

TILE = Path(__file__).resolve().parents[1] / "data" / "tschamut_2014_terrain.asc"


def test_picture_of_a_terrain(part, tmp_path: Path, capsys, monkeypatch) -> None:
    """A small picture, with fewer samples for its edges: light and shade do not depend on them."""
    render = part("rockfall_addon.steps.film.render")
    monkeypatch.setattr(render, "HD", replace(render.HD, width=480, height=270))
    monkeypatch.setattr(part("rockfall_addon.steps.film.engine"), "PICTURE_SAMPLES", 4)
    assert part("rockfall_addon.commands").run(["terrain", str(TILE), "--out", str(tmp_path / "out")]) == 0
    assert "Written: terrain.ply, terrain.png" in capsys.readouterr().out
    picture = bpy.data.images.load(str(tmp_path / "out" / "terrain.png"))
    pixels = np.empty(picture.size[0] * picture.size[1] * 4, dtype=np.float32)
    picture.pixels.foreach_get(pixels)
    grey = pixels.reshape(picture.size[1], picture.size[0], 4)[:, :, :3].mean(axis=2)
    middle = grey[grey.shape[0] // 3 : -grey.shape[0] // 3, grey.shape[1] // 3 : -grey.shape[1] // 3]
    assert middle.mean() > 1.5 * grey[0].mean(), "the slope stands out of the background"
    assert middle.std() > 0.02, "and is shaded"

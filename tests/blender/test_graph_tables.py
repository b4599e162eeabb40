# SPDX-License-Identifier: GPL-3.0-or-later
"""The graphs of tables that are no pleasure: empty, with one impact, undefined, put aside, or very large."""

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import bpy
import numpy as np
import pytest

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture
def demo(rockfall, part):
    """The demo's impacts; the scene has none."""
    project = part("core.exchange.project").read_project(part("rockfall_addon.steps.start.operators").DEMO)
    return part("core.workflow.opening").open_project(project)[1].impacts


@pytest.fixture
def words(part, tmp_path: Path):
    """What is written in the graphs of a table of another site, all of it drawn; without one, of the scene alone."""

    def drawn(table=None, models: set[str] = frozenset({"noel_2017"})) -> str:
        scene = bpy.context.scene
        scene.rockfall_graphs.count, scene.rockfall_comparison.models = 1, set(models)
        if table is not None:
            part("core.exchange.tables").write_impacts(table, tmp_path / "impacts.csv")
            assert bpy.ops.rockfall.add_database(filepath=str(tmp_path / "impacts.csv")) == {"FINISHED"}
        svg = part("core.analysis.svg").Svg(900, 700)
        editor, look = part("rockfall_addon.view.graphs.editor"), part("rockfall_addon.view.graphs.look")
        room = part("core.analysis.graph_layout").Rectangle(0.0, 0.0, 900.0, 700.0)
        with part("rockfall_addon.view.graphs.drawing").onto(svg):
            seen = look.dressed(1.0, 12.0, (0.2, 0.2, 0.2))
            editor.find_content(editor.IMPACTS).draw(bpy.context, editor.Canvas(room, seen))
        texts = ElementTree.fromstring(svg.document()).iter(f"{SVG}text")
        return " ".join(element.text or "" for element in texts)

    return drawn


def some(part, impacts, count: int):
    return part("core.exchange.selection").rows_of(impacts, np.arange(count) % len(impacts))


def test_no_impact_and_no_model(words) -> None:
    assert "There are no impacts yet" in words()
    assert "There are no impacts yet" in words(models=set())


@pytest.mark.parametrize("count", [1, 2])
def test_very_few_impacts(demo, part, words, count: int) -> None:
    known = np.flatnonzero(np.isfinite(demo.rn))[:count]
    text = words(part("core.exchange.selection").rows_of(demo, known))
    assert f"({count})" in text
    assert "R²" not in text, "nothing can be fitted to so few"


def test_undefined_values(demo, part, words) -> None:
    names = ["v1", "v2", "vn1", "vt1", "vn2", "vt2", "rn", "rt", "r", "theta1", "theta_dev", "position", "normal"]
    nothing = {name: np.full_like(getattr(demo, name), np.nan) for name in names}
    text = words(replace(demo, **nothing))
    assert "(0)" in text
    assert f"The {len(demo)} impacts shown have no incident angle and no normal restitution. First, last" in text


def test_all_put_aside(demo, part, words) -> None:
    aside = replace(demo, flags={**demo.flags, "discarded": np.ones(len(demo), dtype=bool)})
    assert f"({int(np.isfinite(demo.rn).sum())})" in words(aside)


def test_twenty_thousand_impacts(demo, part, words) -> None:
    text = words(some(part, demo, 20_000))
    share = np.isfinite(demo.rn)[np.arange(20_000) % len(demo)].sum()
    assert f"({share})" in text
    bpy.context.scene.rockfall_graphs.colour_by = "v1_mps"
    row = bpy.context.scene.rockfall_graphs.filters.add()
    row.column, row.high = "rn", "0"
    assert "All impacts are hidden" in words()
    assert "20000 impacts" in words()

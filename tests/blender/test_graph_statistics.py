# SPDX-License-Identifier: GPL-3.0-or-later
"""The statistics beside the graphs: of the demo's impacts, of those that pass the filters, of groups by colour."""

import csv
from pathlib import Path

import bpy
import numpy as np
import pytest


@pytest.fixture
def scene(rockfall) -> bpy.types.Scene:
    assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
    return bpy.context.scene


@pytest.fixture
def statistics_of(part):
    return part("rockfall_addon.scene.picks.statistics").statistics_of


def columns(part, scene, *names: str) -> list[np.ndarray]:
    """Columns of the scene's impacts with all coefficients."""
    impacts = part("rockfall_addon.scene.models.comparison").comparison_of(scene).impacts
    known = np.isfinite(impacts.rn) & np.isfinite(impacts.r)
    return [getattr(impacts, name)[known] for name in names]


def test_all_impacts_of_the_demo(scene, part, statistics_of) -> None:
    whole = statistics_of(scene).whole
    x, y, rn, theta1 = columns(part, scene, "vt1", "vt2", "rn", "theta1")
    assert (whole.impacts, whole.used, whole.trajectories) == (104, 83, 15)
    assert whole.rt.slope == pytest.approx((x * y).sum() / (x * x).sum())
    assert [f"{value:.3f}" for value in (whole.rt.slope, whole.rt.low, whole.rt.high)] == ["0.550", "0.509", "0.591"]
    below = np.degrees(theta1) < 10
    assert (whole.classes[0].n, whole.classes[0].above_one) == (below.sum(), (rn[below] > 1).sum())
    assert statistics_of(scene).groups == {}


def test_only_what_passes_the_filters(scene, part, statistics_of) -> None:
    row = scene.rockfall_graphs.filters.add()
    row.column, row.high = "theta1_deg", "20"
    (theta1,) = columns(part, scene, "theta1")
    assert statistics_of(scene).whole.used == (np.degrees(theta1) <= 20).sum()
    row.high = "0"
    assert statistics_of(scene).whole is None
    scene.rockfall_graphs.filters.clear()
    assert statistics_of(scene).whole.used == 83


def test_groups_are_those_of_the_colours(scene, part, statistics_of) -> None:
    bpy.ops.rockfall.colour_graphs(column="trajectory")
    found = statistics_of(scene)
    (names,) = columns(part, scene, "trajectory")
    assert {name: one.used for name, one in found.groups.items()} == {
        name: (names == name).sum() for name in found.groups
    }
    assert len(found.groups) == 15
    bpy.ops.rockfall.colour_graphs(column="v1_mps")
    used = [one.impacts for one in statistics_of(scene).groups.values()]
    assert len(used) == 3
    assert max(used) - min(used) <= 2


def test_kept_until_a_pick_changes(scene, part, statistics_of) -> None:
    before = statistics_of(scene)
    assert statistics_of(scene) is before
    scene.rockfall_comparison.models = {"wyllie_2014"}
    assert statistics_of(scene) is before
    bpy.data.objects.remove(next(obj for obj in scene.objects if obj.get("rockfall_role") == "pick"))
    part("rockfall_addon.scene.footage.sync").sync(scene)
    after = statistics_of(scene)
    assert after is not before
    assert after.whole != before.whole


def test_no_impacts(rockfall, statistics_of) -> None:
    assert statistics_of(bpy.context.scene).whole is None


def test_whether_groups_differ_is_told_as_on_the_command_line(scene, part, statistics_of, tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="poll"):
        bpy.ops.rockfall.test_groups()
    bpy.ops.rockfall.colour_graphs(column="theta1_deg")
    assert statistics_of(scene).tests is None
    assert bpy.ops.rockfall.test_groups() == {"FINISHED"}
    found = statistics_of(scene)
    assert found.command == "rockfall statistics --group theta1_deg --classes 3"
    assert len(found.tests.tests.pairs) == 3 * len(found.tests.tests.tests)
    table, out = tmp_path / "impacts.csv", tmp_path / "out"
    part("core.exchange.tables").write_impacts(
        part("rockfall_addon.scene.models.comparison").comparison_of(scene).impacts, table
    )
    command = ["statistics", str(table), "--group", "theta1_deg", "--classes", "3", "--tables-only", "--out", str(out)]
    assert part("core.cli").main(command) == 0
    for name, tests in (("group_tests", found.tests.tests.tests), ("group_pairs", found.tests.tests.pairs)):
        with (out / f"{name}.csv").open(encoding="utf-8", newline="") as stream:
            rows = list(csv.DictReader(line for line in stream if not line.startswith("#")))
        assert [float(row["p"]) for row in rows] == pytest.approx([one.p for one in tests], rel=1e-4)
    scene.rockfall_graphs.filters.add().column = "rn"
    assert statistics_of(scene).tests is None, "of other impacts nothing is told yet"

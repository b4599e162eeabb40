# SPDX-License-Identifier: GPL-3.0-or-later
"""The statistics beside the graphs: of the demo's impacts, of those that pass the filters, of groups by colour."""

import bpy
import numpy as np
import pytest


@pytest.fixture
def scene(rockfall) -> bpy.types.Scene:
    assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
    return bpy.context.scene


@pytest.fixture
def statistics_of(part):
    return part("rockfall_addon.scene.statistics").statistics_of


def columns(part, scene, *names: str) -> list[np.ndarray]:
    """Columns of the scene's impacts with all coefficients."""
    impacts = part("rockfall_addon.scene.comparison").comparison_of(scene).impacts
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
    part("rockfall_addon.scene.sync").sync(scene)
    after = statistics_of(scene)
    assert after is not before
    assert after.whole != before.whole


def test_no_impacts(rockfall, statistics_of) -> None:
    assert statistics_of(bpy.context.scene).whole is None

# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of impacts: it selects, follows the selection, sorts and filters."""

from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from two_runs import picks_of


def test_the_table_selects_and_follows_the_selection(scene: bpy.types.Scene, part) -> None:
    rows = part("rockfall_addon.scene.picks.impact_rows")
    assert [(row.trajectory, row.number) for row in scene.rockfall_impacts] == [
        (name, i) for name in "AB" for i in (1, 2, 3)
    ]
    scene.rockfall.impact_index = 4
    pick = picks_of(scene, "B")[2]
    assert bpy.context.view_layer.objects.active == pick
    assert pick.select_get()
    assert scene.frame_current_final == pytest.approx(pick["rockfall_key_frame"], abs=1e-3)
    rows.highlight(scene, picks_of(scene, "A")[1]["rockfall_id"])
    assert scene.rockfall.impact_index == 0


def test_the_table_sorts_and_filters(scene: bpy.types.Scene, part) -> None:
    table = part("rockfall_addon.steps.impacts.table")
    rows = list(scene.rockfall_impacts)

    def listed() -> list:
        shown, order = table.arranged(rows, scene.rockfall, "A")
        return [row for _, row, seen in sorted(zip(order, rows, shown, strict=True), key=lambda x: x[0]) if seen]

    for column in ("r", "theta1_deg", "speed1_mps", "time_s"):
        for down in (False, True):
            scene.rockfall.table_sort, scene.rockfall.table_descending = column, down
            numbers = [getattr(row, column) for row in listed()]
            known = [value for value in numbers if not np.isnan(value)]
            assert known == sorted(known, reverse=down)
            assert np.isfinite(numbers[: len(known)]).all(), "what is not defined comes last"
    scene.rockfall.table_trajectory = True
    assert {row.trajectory for row in listed()} == {"A"}
    scene.rockfall.table_trajectory, scene.rockfall.table_flagged = False, True
    assert [row.flags for row in listed()] == [row.flags for row in listed() if row.flags]
    assert bpy.ops.rockfall.sort_impacts(column="rn") == {"FINISHED"}
    assert (scene.rockfall.table_sort, scene.rockfall.table_descending) == ("rn", False)
    assert bpy.ops.rockfall.sort_impacts(column="rn") == {"FINISHED"}
    assert scene.rockfall.table_descending


def test_a_heading_says_what_its_numbers_are(scene: bpy.types.Scene, part) -> None:
    """The heading has room for a symbol alone: its tooltip has the words and the unit of the manual's table."""
    operators = part("rockfall_addon.steps.impacts.operators")
    for column, words in {"speed1_mps": "Incident speed [m/s]", "theta_dev_deg": "[°]", "rn": "normal"}.items():
        said = operators.ROCKFALL_OT_sort_impacts.description(bpy.context, SimpleNamespace(column=column))
        assert words in said
        assert "Sort the impact table" in said
    assert "Sort" in operators.ROCKFALL_OT_sort_impacts.description(bpy.context, SimpleNamespace(column="none"))


def test_the_panel_shows_what_is_stored_of_a_pick(scene: bpy.types.Scene, part) -> None:
    store = part("rockfall_addon.scene.storage.store")
    pick = picks_of(scene, "A")[1]
    for status in ("ok", "doubtful", "shattered", "discarded"):
        pick[store.STATUS] = status
        assert pick.rockfall_pick.status == status
    for status in ("doubtful", "ok"):
        pick.rockfall_pick.status = status
        assert pick[store.STATUS] == status
    for kind in ("impact", "release", "pass", "contact", "stop", "takeoff"):
        pick[store.KIND] = kind
        assert pick.rockfall_pick.kind == kind

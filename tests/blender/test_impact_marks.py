# SPDX-License-Identifier: GPL-3.0-or-later
"""The marks of the impact strip follow the picks."""

import bpy
import numpy as np
import pytest


def frames_of(scene: bpy.types.Scene) -> dict[str, float]:
    """Where Blender has the key of each pick, by id."""
    found = {}
    for obj in scene.objects:
        if obj.get("rockfall_role") == "pick":
            found[obj["rockfall_id"]] = obj.animation_data.action.frame_range[0]
    return found


def test_marks_are_where_the_keys_are_and_follow_edits(rockfall, part) -> None:
    assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
    scene, impact_marks = bpy.context.scene, part("rockfall_addon.scene.picks.impact_marks")

    def check() -> object:
        marks, keys = impact_marks.marks(scene), frames_of(scene)
        assert set(marks.identifier) == set(keys)
        np.testing.assert_allclose(marks.frame, [keys[each] for each in marks.identifier], atol=1e-3)
        assert (np.diff(marks.start) >= 0).all()
        return marks

    before = check()
    assert impact_marks.marks(scene) is before, "kept"
    pick = part("rockfall_addon.scene.picks.picks").with_id(scene, before.identifier[4])
    part("rockfall_addon.scene.footage.sync").nudge(scene, pick, 0.3)
    after = check()
    assert np.abs(after.frame - before.frame).sum() == pytest.approx(0.3, abs=1e-3), "one has moved"
    pick.rockfall_pick.status = "doubtful"
    marked = check()
    assert marked.alarming.sum() == after.alarming.sum() + 1
    bpy.data.objects.remove(pick)
    bpy.context.view_layer.update()
    assert len(check().frame) == len(before.frame) - 1

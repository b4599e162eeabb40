# SPDX-License-Identifier: GPL-3.0-or-later
"""A pick that two scenes show keeps what was done to it, whichever scene looks at it first."""

import bpy
import pytest
from two_runs import RATE, check_shown, key_frames, picks_of, update


@pytest.fixture(params=["A first", "Z last"])
def other(request: pytest.FixtureRequest, scene: bpy.types.Scene) -> bpy.types.Scene:
    """A scene before or after the first one, of another frame rate, that shows one pick of A."""
    made = bpy.data.scenes.new(request.param)
    made.render.fps = 60
    made["rockfall_shift_m"] = list(scene.get("rockfall_shift_m", (0.0, 0.0, 0.0)))
    made.collection.objects.link(picks_of(scene, "A")[2])
    update()
    return made


def look(part, *scenes: bpy.types.Scene) -> None:
    for each in scenes:
        part("rockfall_addon.scene.footage.sync").sync(each)


@pytest.mark.parametrize("first", [0, 1])
def test_it_stays_where_it_was_moved_to(scene: bpy.types.Scene, other: bpy.types.Scene, part, first: int) -> None:
    pick, order = picks_of(scene, "A")[2], [scene, other] if first == 0 else [other, scene]
    look(part, *order)
    pick.location.y += 500.0
    look(part, *order, *order)
    assert pick["rockfall_position_m"][1] == pytest.approx(500.0)
    assert pick.location.y == pytest.approx(500.0)
    assert [key for curve in pick.animation_data.action.layers[0].strips[0].channelbags[0].fcurves
            for key in (point.co[1] for point in curve.keyframe_points)][1] == pytest.approx(500.0)  # fmt: skip
    check_shown(scene, part)


@pytest.mark.parametrize("first", [0, 1])
def test_its_key_moves_it_by_the_frames_of_one_scene(
    scene: bpy.types.Scene, other: bpy.types.Scene, part, first: int
) -> None:
    pick, order = picks_of(scene, "A")[2], [scene, other] if first == 0 else [other, scene]
    look(part, *order)
    time = pick["rockfall_time_s"]
    before = key_frames(pick)
    for curve in pick.animation_data.action.layers[0].strips[0].channelbags[0].fcurves:
        curve.keyframe_points[0].co_ui[0] += 2.5
        curve.update()
    look(part, *order, *order)
    assert pick["rockfall_time_s"] == pytest.approx(time + 2.5 / RATE, abs=1e-6)
    assert key_frames(pick) == [[pytest.approx(frame + 2.5, abs=1e-3)] for (frame,) in before]
    check_shown(scene, part)


def test_another_frame_rate_of_the_scene_that_only_shows_it_leaves_its_key(
    scene: bpy.types.Scene, other: bpy.types.Scene, part
) -> None:
    pick = picks_of(scene, "A")[2]
    look(part, scene, other)
    before, time = key_frames(pick), pick["rockfall_time_s"]
    other.render.fps = 120
    look(part, other, scene)
    assert key_frames(pick) == before
    assert pick["rockfall_time_s"] == time
    scene.render.fps = 30
    look(part, other, scene)
    assert key_frames(pick) == [[pytest.approx(frame * 30 / RATE, rel=1e-6)] for (frame,) in before]
    assert pick["rockfall_time_s"] == time


def test_its_name_is_its_number_in_the_scene_that_keeps_it(
    scene: bpy.types.Scene, other: bpy.types.Scene, part
) -> None:
    pick = picks_of(scene, "A")[2]
    look(part, scene, other)
    assert pick.name == "A impact 2", "not 1, which it would be in the other scene"
    assert not part("rockfall_addon.scene.footage.sync").sync(other).step_changed

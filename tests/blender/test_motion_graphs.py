# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion graphs in the scene: on the time that it plays, computed again only for what has changed."""

from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Vector

HEADER = "trajectory,time_s,x_m,y_m,z_m\n"
TIMES, DELAY_S = (0.0, 1.0, 2.0, 3.0), 0.5


@pytest.fixture
def scene(part, tmp_path: Path) -> bpy.types.Scene:
    """Three runs without terrain, at 25 frames a second, played together with a delay."""
    rows = [
        f"{name},{begin + time!r},{5.0 * i!r},{begin!r},{-3.0 * i!r}"
        for name, begin in (("A", 0.0), ("B", 100.0), ("C", 200.0))
        for i, time in enumerate(TIMES)
    ]
    path = tmp_path / "picks.csv"
    path.write_text(HEADER + "\n".join(rows) + "\n", encoding="utf-8")
    scene = bpy.context.scene
    scene.render.fps, scene.rockfall.stagger_s = 25, DELAY_S
    assert bpy.ops.rockfall.import_picks(filepath=str(path)) == {"FINISHED"}
    return scene


def picks_of(scene: bpy.types.Scene, name: str) -> list[bpy.types.Object]:
    found = [o for o in scene.objects if o.get("rockfall_role") == "pick" and o["rockfall_trajectory"] == name]
    return sorted(found, key=lambda obj: obj["rockfall_time_s"])


def test_times_are_those_at_which_the_scene_plays_the_impacts(scene, part) -> None:
    courses = part("rockfall_addon.scene.models.motion").motion_of(scene).courses
    assert [course.trajectory for course in courses] == ["A", "B", "C"]
    for course in courses:
        frames = [obj["rockfall_key_frame"] / 25 for obj in picks_of(scene, course.trajectory)]
        np.testing.assert_allclose(course.impact_time_s, frames, atol=1e-9)
        assert course.time_s[0] == pytest.approx(frames[0])
    speed = part("core.analysis.motion_graphs").SPEED
    assert courses[1].at(speed, DELAY_S) == pytest.approx(np.hypot(5.0, -3.0 + 9.81 / 2))
    scene.rockfall.playback = "REAL"
    assert part("rockfall_addon.scene.models.motion").motion_of(scene).courses[1].impact_time_s[0] == pytest.approx(
        100.0
    )


def test_only_what_has_changed_is_computed_again(scene, part, monkeypatch) -> None:
    motion, sync = part("rockfall_addon.scene.models.motion"), part("rockfall_addon.scene.footage.sync")
    before = motion.motion_of(scene)
    assert motion.motion_of(scene) is before
    picks_of(scene, "B")[1]["rockfall_time_s"] += 0.1
    sync.sync(scene, ["B"])
    after = motion.motion_of(scene)
    assert after.version != before.version
    assert [one is two for one, two in zip(before.courses, after.courses, strict=True)] == [True, False, True]
    assert after.courses[1].impact_time_s[1] == pytest.approx(1.0 + DELAY_S + 0.1)
    scene.rockfall.density_kgpm3 = 2000.0
    kinetic = [course.values["kinetic_kj"][0] for course in motion.motion_of(scene).courses]
    np.testing.assert_allclose(kinetic[0], after.courses[0].values["kinetic_kj"][0] * 2000 / 2650, rtol=1e-6)
    for obj in picks_of(scene, "A"):
        bpy.data.objects.remove(obj)
    sync.sync(scene)
    assert [course.trajectory for course in motion.motion_of(scene).courses] == ["B", "C"]


def test_a_pick_is_followed_while_it_is_dragged(scene, part) -> None:
    motion, sync = part("rockfall_addon.scene.models.motion"), part("rockfall_addon.scene.footage.sync")
    before = motion.motion_of(scene).courses
    picks_of(scene, "C")[2].location.x += 1.0
    bpy.context.view_layer.update()
    sync.sync(scene, ["C"], dragging=True)
    after = motion.motion_of(scene).courses
    assert after[0] is before[0]
    speed = part("core.analysis.motion_graphs").SPEED
    assert after[2].at(speed, 2 * DELAY_S + 1.0) == pytest.approx(np.hypot(6.0, -3.0 + 9.81 / 2), rel=1e-5)


def test_a_bad_trajectory_is_told_and_the_others_are_shown(scene, part) -> None:
    motion, sync = part("rockfall_addon.scene.models.motion"), part("rockfall_addon.scene.footage.sync")
    first, second, *_ = picks_of(scene, "A")
    second["rockfall_time_s"] = first["rockfall_time_s"]
    sync.sync(scene, ["A"])
    found = motion.motion_of(scene)
    assert [course.trajectory for course in found.courses] == ["B", "C"]
    assert len(found.problems) == 1
    assert "A" in found.problems[0]


def test_limits_are_kept_with_the_scene_and_reset(scene, part) -> None:
    sheet, settings = (
        part("rockfall_addon.view.graphs.motion_sheet"),
        part("rockfall_addon.scene.models.motion_settings"),
    )
    graphs = part("core.analysis.motion_graphs")
    kept = sheet._kept(scene)
    kept.shown = sheet._Shown(quantities=(graphs.SPEED, graphs.KINETIC))
    sheet.set_limits(scene, 1, (1.0, 2.0), (0.0, 3.0))
    assert settings.limits_of(scene) == {"time": (1.0, 2.0), "kinetic_kj": (0.0, 3.0)}
    scene.rockfall_motion.in_frames = True
    sheet.set_limits(scene, 0, (25.0, 75.0), None)
    assert settings.limits_of(scene)["time"] == (1.0, 3.0)
    sheet.reset(scene, 1)
    assert settings.limits_of(scene) == {}


def test_the_line_under_the_mouse_is_the_nearest_one(rockfall, part) -> None:
    layout, axes = part("core.analysis.graph_layout"), part("core.analysis.axes")
    lines = part("rockfall_addon.view.graphs.motion_lines")
    whole = axes.Axis((0.0, 10.0)), axes.Axis((0.0, 20.0))
    plot = layout.Rectangle(100.0, 50.0, 400.0, 200.0)
    zoomed = layout.Frame(plot, plot, axes.Axis((0.0, 5.0)), axes.Axis((0.0, 10.0)), None, None)
    ends = np.array([[[0.0, 0.1], [0.5, 0.1]], [[0.0, 0.3], [0.5, 0.3]], [[0.5, 0.1], [0.5, 0.9]]], dtype=np.float32)
    found = lines.Bundle((), ends, lines.span_of(ends), np.array([0, 1, 2]), None, None)
    # a value of 2 of 20 is at 0.2 of the zoomed axis: 40 px above the bottom
    assert lines.nearest_line(found, zoomed, *whole, (200.0, 93.0), 8.0) == (pytest.approx(3.0, abs=1e-4), 0)
    assert lines.nearest_line(found, zoomed, *whole, (200.0, 165.0), 8.0) == (pytest.approx(5.0, abs=1e-4), 1)
    assert lines.nearest_line(found, zoomed, *whole, (200.0, 130.0), 8.0) == (np.inf, -1)
    assert lines.nearest_line(found, zoomed, *whole, (497.0, 200.0), 8.0)[1] == 2
    none = np.empty((0, 2, 2), np.float32)
    nothing = lines.Bundle((), none, lines.span_of(none), np.empty(0, np.intp), None, None)
    assert lines.nearest_line(nothing, zoomed, *whole, (200.0, 93.0), 8.0) == (np.inf, -1)


def test_the_pick_of_an_impact_is_found_by_its_number(scene, part) -> None:
    sheet = part("rockfall_addon.view.graphs.motion_sheet")
    assert sheet.pick_of(scene, "B", 2) == picks_of(scene, "B")[1]
    assert sheet.pick_of(scene, "B", 9) is None


def test_a_dragged_pick_lies_on_the_terrain_as_its_flights_do(part, tmp_path: Path) -> None:
    """A pick on level ground that is held 10 cm above it, nearer than its block's radius, is on the ground."""
    surface = part("core.terrain.surface").Surface(
        np.array([[-50.0, -50, 0], [50, -50, 0], [50, 50, 0], [-50, 50, 0]]),
        np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32),
        part("core.georeference").GlobalShift(),
        "level",
    )
    scene = bpy.context.scene
    part("rockfall_addon.scene.terrain.terrain").add_terrain(
        scene, surface, part("core.terrain.shading").shade(surface)
    )
    path = tmp_path / "picks.csv"
    path.write_text(HEADER + "".join(f"A,{t!r},{5.0 * t!r},0.0,0.0\n" for t in TIMES), encoding="utf-8")
    assert bpy.ops.rockfall.import_picks(filepath=str(path)) == {"FINISHED"}
    motion, sync = part("rockfall_addon.scene.models.motion"), part("rockfall_addon.scene.footage.sync")
    height = part("core.analysis.motion_graphs").HEIGHT
    (course,) = motion.motion_of(scene).courses
    assert course.at(height, 1.5) == pytest.approx(9.81 / 8, abs=1e-3)
    obj = picks_of(scene, "A")[1]
    obj.location += Vector((0.4, 0.0, 0.1))
    bpy.context.view_layer.update()
    sync.sync(scene, ["A"], dragging=True)
    (course,) = motion.motion_of(scene).courses
    assert course.at(height, 1.0) == pytest.approx(0.0, abs=1e-6)
    assert course.at(part("core.analysis.motion_graphs").SPEED, 1.0) == pytest.approx(np.hypot(4.6, 9.81 / 2), rel=1e-5)

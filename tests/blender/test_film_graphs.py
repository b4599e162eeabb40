# SPDX-License-Identifier: GPL-3.0-or-later
"""Graphs in a film's picture: what stands there at a frame is what has happened until then."""

from pathlib import Path

import bpy
import numpy as np
import pytest

HEADER = "trajectory,time_s,x_m,y_m,z_m,kind,status,nx,ny,nz\n"
TIMES = (0.0, 0.8, 1.6, 2.4, 3.2)
NORMAL = "0.5,0.0,0.8660254037844386"
RATE, DISC, DELAY_S = 25, 12, 0.4


@pytest.fixture
def scene(rockfall, tmp_path: Path) -> bpy.types.Scene:
    """Two runs of five picks, the second beside the first and 50 s later; four impacts each."""
    rows = []
    for name, later in (("A", 0.0), ("B", 50.0)):
        for i, time in enumerate(TIMES):
            kind = "impact" if i else "release"
            rows.append(f"{name},{time + later!r},{6.0 * i!r},{later / 10!r},{40 - 3.4 * i!r},{kind},ok,{NORMAL}")
    path = tmp_path / "picks.csv"
    path.write_text(HEADER + "\n".join(rows) + "\n", encoding="utf-8")
    bpy.context.scene.render.fps = RATE
    assert bpy.ops.rockfall.import_picks(filepath=str(path)) == {"FINISHED"}
    return bpy.context.scene


@pytest.fixture
def preset(part):
    return part("core.exchange.project").RenderPreset(
        "tiny", width=640, height=360, fps=float(RATE), engine="cycles", stagger_s=DELAY_S, time_scale=0.5
    )


def corners(scene: bpy.types.Scene, name: str) -> int:
    obj = next(obj for obj in scene.objects if obj.name.startswith(name))
    return len(obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data.vertices)


def test_points_of_impacts_appear_as_they_happen(scene, preset, part) -> None:
    part("rockfall_addon.steps.film.dressing").set_up_film(scene, preset, "cycles", "impacts")
    rate = 1 / part("core.film.presets").FilmTiming(preset.fps, preset.time_scale).frame_s
    left_again = np.array([*TIMES[1:4], *(np.array(TIMES[1:4]) + DELAY_S)])  # both sides of an impact are known there
    for time_s in (0.0, 0.81, 1.21, 1.7, 5.0):
        scene.frame_set(int(time_s * rate), subframe=time_s * rate % 1)
        happened = int((left_again <= time_s).sum())
        assert corners(scene, "Film graphs points") == 4 * DISC * happened
    words = {obj.modifiers[0].name for obj in scene.objects if obj.name.startswith("Film graphs text")}
    assert words == {"Caption"}


def test_motion_is_drawn_up_to_the_cursor(scene, preset, part) -> None:
    part("rockfall_addon.steps.film.dressing").set_up_film(scene, preset, "cycles", "motion")
    rate = 1 / part("core.film.presets").FilmTiming(preset.fps, preset.time_scale).frame_s
    last_s = TIMES[-1] + DELAY_S
    cursor = next(obj for obj in scene.objects if obj.name.startswith("Film graphs cursor"))
    lines = next(obj for obj in scene.objects if obj.name.startswith("Film graphs lines"))
    ends, counts = [], []
    for share in (0.0, 0.25, 0.5, 1.0):
        frame = share * last_s * rate
        scene.frame_set(int(frame), subframe=frame % 1)
        mesh = lines.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        x = np.array([vertex.co.x for vertex in mesh.vertices])
        ends.append(cursor.matrix_local.translation.x)
        counts.append(len(x))
        if len(x):
            assert ends[-1] - 0.02 < x.max() < ends[-1] + 0.01
    assert np.diff(ends) == pytest.approx(np.array([0.25, 0.25, 0.5]) * (ends[-1] - ends[0]), rel=1e-3)
    assert counts == sorted(counts)
    assert counts[0] < counts[1] < counts[2] < counts[3]


def test_the_slope_is_left_of_the_graphs_and_all_is_taken_away(scene, preset, part) -> None:
    from bpy_extras.object_utils import world_to_camera_view
    from mathutils import Vector

    before = {obj.name for obj in scene.objects}
    scene.rockfall_film.size, scene.rockfall_film.engine, scene.rockfall_film.graphs = "preview", "cycles", "MOTION"
    assert bpy.ops.rockfall.set_up_film() == {"FINISHED"}
    bpy.context.view_layer.update()
    motions = part("rockfall_addon.steps.film.motions").motions_of(scene)
    across = [world_to_camera_view(scene, scene.camera, Vector(p)).x for m in motions for p in m.position]
    assert max(across) < 0.62
    assert any(obj.name.startswith("Film graphs panel") for obj in scene.objects)
    scene.rockfall_film.graphs = "NONE"
    assert bpy.ops.rockfall.set_up_film() == {"FINISHED"}
    assert not any(obj.name.startswith("Film graphs") for obj in scene.objects)
    assert bpy.ops.rockfall.remove_film() == {"FINISHED"}
    assert {obj.name for obj in scene.objects} == before


def test_without_a_flight_the_graphs_are_refused_in_words(scene, preset, part) -> None:
    for obj in [
        obj for obj in scene.objects if obj.get("rockfall_role") == "pick" and obj["rockfall_time_s"] not in (0.0, 50.0)
    ]:
        bpy.data.objects.remove(obj)
    part("rockfall_addon.scene.footage.sync").sync(scene)
    errors = part("core.errors")
    graphs = part("rockfall_addon.steps.film.graphs")
    with pytest.raises(errors.InputError, match="No trajectory has a flight"):
        graphs.graphs_of(scene, "motion", (640, 360), None)
    with pytest.raises(errors.InputError, match="no impact"):
        graphs.graphs_of(scene, "impacts", (640, 360), None)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Two runs down a plane, with and without its terrain, and what is shown of them."""

from pathlib import Path

import bpy
import numpy as np
import pytest

GRAVITY = 9.81
RATE = 24.0
SLOPE = 0.7  # fall per metre along x


def ground(x: float) -> float:
    return 50.0 - SLOPE * x


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """Two runs down a plane, the second 30 s later and 5 m beside the first; B's last impact is doubtful."""
    rows = ["trajectory,time_s,x_m,y_m,z_m,kind,status,sigma_position_m,note"]
    for name, later, y in (("A", 0.0, 0.0), ("B", 30.0, 5.0)):
        kinds = ("release", "impact", "impact", "impact", "stop")
        for time, x, kind in zip(
            (10.0, 10.7312, 11.90017, 12.4, 13.0), (0.0, 4.0, 12.0, 16.0, 19.0), kinds, strict=True
        ):
            status = "doubtful" if name == "B" and time == 12.4 else "ok"
            rows.append(f"{name},{time + later!r},{x!r},{y!r},{ground(x)!r},{kind},{status},0.05,seen")
    path = tmp_path / "picks.csv"
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


@pytest.fixture
def terrain_file(tmp_path: Path) -> Path:
    path = tmp_path / "plane.obj"
    corners = [(x, y, ground(x)) for x, y in ((-10, -20), (60, -20), (60, 30), (-10, 30))]
    path.write_text("".join(f"v {x} {y} {z}\n" for x, y, z in corners) + "f 1 2 3\nf 1 3 4\n", encoding="utf-8")
    return path


@pytest.fixture
def scene(part, table: Path) -> bpy.types.Scene:
    assert bpy.ops.rockfall.import_picks(filepath=str(table)) == {"FINISHED"}
    return bpy.context.scene


@pytest.fixture
def slope(part, table: Path, terrain_file: Path) -> bpy.types.Scene:
    """The scene with its terrain."""
    surface = part("core.terrain.readers").read_terrain(terrain_file)
    part("rockfall_addon.scene.terrain.terrain").add_terrain(
        bpy.context.scene, surface, part("core.terrain.shading").shade(surface)
    )
    assert bpy.ops.rockfall.import_picks(filepath=str(table)) == {"FINISHED"}
    return bpy.context.scene


def update() -> None:
    bpy.context.view_layer.update()


def picks_of(scene: bpy.types.Scene, name: str) -> list[bpy.types.Object]:
    found = [o for o in scene.objects if o.get("rockfall_role") == "pick" and o["rockfall_trajectory"] == name]
    return sorted(found, key=lambda o: o["rockfall_time_s"])


def trail(scene: bpy.types.Scene, name: str) -> bpy.types.Object:
    (found,) = [o for o in scene.objects if o.get("rockfall_role") == "flights" and o["rockfall_trajectory"] == name]
    return found


def places(mesh: bpy.types.Mesh) -> np.ndarray:
    values = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("co", values)
    return values.reshape(-1, 3)


def values(mesh: bpy.types.Mesh, name: str) -> np.ndarray:
    attribute = mesh.attributes[name]
    found = np.empty(len(mesh.vertices), dtype=bool if attribute.data_type == "BOOLEAN" else np.float32)
    attribute.data.foreach_get("value", found)
    return found


def key_frames(obj: bpy.types.Object) -> list[list[float]]:
    (layer,) = obj.animation_data.action.layers
    bag = layer.strips[0].channelbag(obj.animation_data.action_slot)
    return [[point.co[0] for point in bag.fcurves.find("location", index=i).keyframe_points] for i in range(3)]


def move_key(obj: bpy.types.Object, frames: float) -> None:
    bag = obj.animation_data.action.layers[0].strips[0].channelbag(obj.animation_data.action_slot)
    for curve in bag.fcurves:
        for point in curve.keyframe_points:
            point.co_ui[0] += frames
        curve.update()
    update()


def check_shown(scene: bpy.types.Scene, part) -> None:
    """What is shown is what a reconstruction of the picks from nothing gives."""
    result = part("rockfall_addon.scene.picks.reconstruction").reconstruct_scene(scene)
    rows = {(row.trajectory, row.number): row for row in scene.rockfall_impacts}
    numbers = part("rockfall_addon.scene.picks.impact_numbers").of
    assert len(rows) == len(result.impacts)
    for i in range(len(result.impacts)):
        row = rows[str(result.impacts.trajectory[i]), int(result.impacts.impact[i])]
        np.testing.assert_allclose([row.r, row.rn], [result.impacts.r[i], result.impacts.rn[i]], rtol=1e-6)
        pick = next(o for o in scene.objects if o.get("rockfall_id") == row.pick)
        assert pick["rockfall_time_s"] == result.impacts.time_s[i]
        np.testing.assert_array_equal(pick["rockfall_position_m"], result.impacts.position[i])
        np.testing.assert_array_equal(numbers(pick)["incident_mps"], result.impacts.v1[i])
    for name in set(result.picks.trajectory.tolist()):
        which = np.flatnonzero(result.flights.trajectory == name)
        shown = places(trail(scene, name).data)
        for point in (*result.flights.start_position[which], result.flights.end_position[which[-1]]):
            assert np.linalg.norm(shown - point, axis=1).min() < 1e-4

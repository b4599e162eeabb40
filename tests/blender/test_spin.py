# SPDX-License-Identifier: GPL-3.0-or-later
"""Spin from marks in the demo's footage, against the turning of its truth; marks are kept, undone, saved, exported."""

import csv
import math
from pathlib import Path

import bpy
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

DEMO = Path(__file__).resolve().parents[2] / "assets" / "demo"
TRUTH = DEMO / "footage" / "truth"
OFFSET_S, RADIUS = 465.499, 0.195
ORIGIN = np.array([988400.0, 6375600.0, 1500.0])
NAME = "B10"


def rows(name: str) -> list[dict[str, str]]:
    with (TRUTH / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def numbers(row: dict[str, str], *names: str) -> np.ndarray:
    return np.array([float(row[name]) for name in names])


def local(row: dict[str, str], *names: str) -> np.ndarray:
    return numbers(row, *names) - ORIGIN


@pytest.fixture(scope="session")
def impacts() -> list[dict[str, str]]:
    """Three true impacts that are in the picture: two flights."""
    return [row for row in rows("impacts.csv") if float(row["time_s"]) > 1.3][:3]


@pytest.fixture
def site(part, impacts) -> bpy.types.Scene:
    """The footage with its true camera, and true picks with their normals; no terrain is needed."""
    scene = bpy.context.scene
    part("rockfall_addon.scene.terrain.georeference").write_shift(scene, part("core.georeference").GlobalShift(*ORIGIN))
    camera = part("rockfall_addon.scene.footage.new_videos").add_video(scene, DEMO / "footage" / "footage.mp4")
    poses = rows("camera.csv")
    place = np.array([local(row, "x_m", "y_m", "z_m") for row in poses])
    turn = np.array([[float(row[f"r{i}{j}"]) for i in "123" for j in "123"] for row in poses]).reshape(-1, 3, 3)
    lens = part("core.camera.model").Camera(
        1280, 720, 2100.0, 2100.0, 640.0, 360.0, position=place[0], rotation=turn[0],
        shift=part("core.georeference").GlobalShift(*ORIGIN),
    )  # fmt: skip
    times, nothing = np.array([float(row["time_s"]) for row in poses]), np.zeros(len(poses))
    scene["rockfall_time_origin_s"] = OFFSET_S
    part("rockfall_addon.scene.footage.clocks").set_clock(camera, part("core.footage.clock").Clock(OFFSET_S))
    path = part("core.camera.path").CameraPath(lens, times, place, turn, nothing, nothing)
    part("rockfall_addon.scene.footage.camera_paths").set_camera_path(scene, camera, path)
    scene.camera = camera
    scene.rockfall.block_diameter_m = 2 * RADIUS
    scene.rockfall_picking.trajectory = NAME
    picks = part("rockfall_addon.scene.picks.picks")
    for row in impacts:
        normal = numbers(row, "nx", "ny", "nz")
        obj = picks.add_pick(
            scene, NAME, OFFSET_S + float(row["time_s"]), local(row, "x_m", "y_m", "z_m") - RADIUS * normal
        )
        obj["rockfall_normal"] = normal.tolist()
    part("rockfall_addon.scene.footage.sync").sync(scene)
    return scene


def camera_of(scene: bpy.types.Scene, part) -> bpy.types.Object:
    return part("rockfall_addon.scene.footage.videos").cameras(scene)[0]


def picks_of(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    found = [obj for obj in scene.objects if obj.get("rockfall_role") == "pick"]
    return sorted(found, key=lambda obj: obj["rockfall_time_s"])


def pixels(part, scene: bpy.types.Scene, impacts, flight: int, count: int) -> list[tuple[int, float, np.ndarray]]:
    """Frame, video time and pixel of a point of the true block, in pictures next to one another, on the near side."""
    camera, pictures = camera_of(scene, part), part("rockfall_addon.scene.footage.pictures")
    project = part("core.camera.model").project
    omega = numbers(impacts[flight], "omega2x_radps", "omega2y_radps", "omega2z_radps")
    leave, arrive = float(impacts[flight]["leave_time_s"]), float(impacts[flight + 1]["time_s"])
    times = part("rockfall_addon.scene.footage.videos").times_of(camera)
    block = {int(row["frame"]): row for row in rows("block.csv")}
    frames = np.flatnonzero((times > leave + 0.1) & (times < arrive))[:count]
    middle = float(times[frames].mean())
    seen = pictures.posed(camera, middle)
    axis = omega / np.linalg.norm(omega)
    away = seen.position - local(block[int(frames[count // 2])], "x_m", "y_m", "z_m")
    way = away / np.linalg.norm(away) + 0.35 * axis
    found = []
    for frame in frames.tolist():
        turned = Rotation.from_rotvec((times[frame] - middle) * omega).apply(way / np.linalg.norm(way))
        place = local(block[frame], "x_m", "y_m", "z_m") + RADIUS * turned
        pixel = project(pictures.posed(camera, float(times[frame])), place[None])[0]
        found.append((frame, float(times[frame]), pixel))
    return found


def mark(part, scene: bpy.types.Scene, marks, **_) -> None:
    """As the tool does, without a window."""
    spins = part("rockfall_addon.scene.picks.spins")
    for frame, video_s, pixel in marks:
        spins.mark(camera_of(scene, part), NAME, frame, video_s, pixel, 0.5)
    part("rockfall_addon.steps.spin.operators").follow(scene, NAME)


def test_the_frame_rate_and_the_count_by_eye(site, part, impacts) -> None:
    """12.3 turns/s at 30 pictures/s: two rates fit, and the one that was counted is the true one."""
    spins = part("rockfall_addon.scene.picks.spins")
    mark(part, site, pixels(part, site, impacts, 0, 4))
    ((obj, one),) = spins.of_trajectory(site, NAME)
    assert obj == picks_of(site)[1]
    assert (one.verdict, one.flight, one.marks) == ("ambiguous", 1, 4)
    true = float(np.linalg.norm(numbers(impacts[0], "omega2x_radps", "omega2y_radps", "omega2z_radps")))
    assert min(abs(rate - true / (2 * np.pi)) for rate in one.others) < 1.0
    assert "turns/s fit alike" in one.remarks[0]
    assert "rockfall_angular_velocity_radps" not in obj
    assert spins.words(obj) == []
    assert bpy.ops.rockfall.count_turns(turns_per_s=12.0, flight=1) == {"FINISHED"}
    one = spins.of(obj)
    assert one.verdict == "counted"
    assert abs(one.rate - true) < 2 * one.sigma_rate
    assert 0.01 * true < one.sigma_rate < 0.3 * true
    measured = part("rockfall_addon.scene.picks.reconstruction").reconstruct_scene(site).impacts
    np.testing.assert_allclose(measured.angular_velocity[1], one.omega)
    np.testing.assert_allclose(measured.rotational1_j[1], one.energy_j)
    assert "± " in spins.words(obj)[0][1]
    assert any("rad/s" in line for line in part("rockfall_addon.view.impact_words").numbers(obj))
    assert bpy.ops.rockfall.count_turns(turns_per_s=0.0, flight=1) == {"FINISHED"}
    assert spins.of(obj).verdict == "ambiguous"
    assert "rockfall_angular_velocity_radps" not in obj


def test_marks_move_go_and_follow_the_picks(site, part, impacts) -> None:
    spins = part("rockfall_addon.scene.picks.spins")
    made = pixels(part, site, impacts, 0, 3)
    mark(part, site, made)
    bpy.ops.rockfall.count_turns(turns_per_s=12.0, flight=1)
    obj = picks_of(site)[1]
    before = spins.of(obj).rate
    frame, video_s, pixel = made[2]
    mark(part, site, [(frame, video_s, pixel + np.array([3.0, 0.0]))])
    assert spins.of(obj).marks == 3
    assert spins.of(obj).rate != before
    mark(part, site, made[2:])
    assert spins.of(obj).rate == pytest.approx(before, rel=1e-12)

    site.rockfall.block_diameter_m = 0.5
    assert spins.of(obj).rate != pytest.approx(before)
    site.rockfall.block_diameter_m = 2 * RADIUS
    assert spins.of(obj).rate == pytest.approx(before, rel=1e-6)
    part("rockfall_addon.scene.footage.sync").nudge(site, obj, 0.3)
    assert spins.of(obj).rate != pytest.approx(before)
    part("rockfall_addon.scene.footage.sync").nudge(site, obj, -0.3)
    assert spins.of(obj).rate == pytest.approx(before, rel=1e-6)

    assert bpy.ops.rockfall.set_spin_axis(axis="sight") == {"FINISHED"}
    assert spins.of(obj).axis == "sight"
    assert bpy.ops.rockfall.remove_spin_mark(frame=frame) == {"FINISHED"}
    assert spins.of(obj).marks == 2
    assert bpy.ops.rockfall.clear_spin_marks() == {"FINISHED"}
    assert spins.of(obj) is None
    assert "rockfall_angular_velocity_radps" not in obj
    assert not bpy.ops.rockfall.clear_spin_marks.poll()


def test_a_clock_that_has_changed_is_noticed(site, part, impacts) -> None:
    spins, clocks = part("rockfall_addon.scene.picks.spins"), part("rockfall_addon.scene.footage.clocks")
    mark(part, site, pixels(part, site, impacts, 0, 3))
    assert not spins.is_stale(site, NAME)
    clocks.set_clock(camera_of(site, part), part("core.footage.clock").Clock(OFFSET_S + 30.0))
    assert spins.is_stale(site, NAME)
    assert bpy.ops.rockfall.measure_spin() == {"FINISHED"}
    assert not spins.is_stale(site, NAME)
    assert spins.of_trajectory(site, NAME) == []
    assert "in no flight" in spins.homeless(site, NAME)[0]


def test_saved_loaded_and_exported(site, part, impacts, tmp_path) -> None:
    spins = part("rockfall_addon.scene.picks.spins")
    mark(part, site, pixels(part, site, impacts, 0, 3))
    mark(part, site, pixels(part, site, impacts, 1, 3)[:1])
    bpy.ops.rockfall.count_turns(turns_per_s=12.0, flight=1)
    before = spins.of(picks_of(site)[1]).rate
    assert bpy.ops.rockfall.export_tables(directory=str(tmp_path / "tables")) == {"FINISHED"}
    with (tmp_path / "tables" / "spin.csv").open(encoding="utf-8", newline="") as file:
        table = list(csv.DictReader(file))
    assert [row["verdict"] for row in table] == ["counted", "unknown"]
    assert [row["impact"] for row in table] == ["2", "3"]
    assert float(table[0]["omega_radps"]) == pytest.approx(before, rel=1e-9)
    with (tmp_path / "tables" / "impacts.csv").open(encoding="utf-8", newline="") as file:
        omega = [row["omega1x_radps"] for row in csv.DictReader(file)]
    assert [bool(cell) for cell in omega] == [False, True, False]

    assert bpy.ops.rockfall.export_project(directory=str(tmp_path / "project")) == {"FINISHED"}
    assert (
        part("core.cli").main(["spin", str(tmp_path / "project" / "project.toml"), "--out", str(tmp_path / "out")]) == 0
    )
    with (tmp_path / "out" / "spin.csv").open(encoding="utf-8", newline="") as file:
        again = list(csv.DictReader(file))
    assert float(again[0]["omega_radps"]) == pytest.approx(before, rel=1e-6)

    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "site.blend"))
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "site.blend"))
    scene = bpy.context.scene
    assert spins.of(picks_of(scene)[1]).rate == before
    assert [len(spins.marks_in(camera_of(scene, part), NAME))] == [4]

    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    part("rockfall_addon.scene.project").load_project(scene, tmp_path / "project" / "project.toml")
    assert spins.of(picks_of(scene)[1]).rate == pytest.approx(before, rel=1e-6)
    assert math.isnan(spins.of(picks_of(scene)[2]).rate)


def test_what_is_drawn(site, part, impacts) -> None:
    """The hand of this picture, the other marks about the block, and the ring where the spin takes the point."""
    made = pixels(part, site, impacts, 0, 3)
    mark(part, site, made)
    bpy.ops.rockfall.count_turns(turns_per_s=12.0, flight=1)
    camera = camera_of(site, part)
    frame, _, pixel = made[1]
    site.frame_set(round(part("rockfall_addon.scene.footage.clocks").scene_frame_of(site, camera, frame)))
    drawn = part("rockfall_addon.view.footage_view").draw(site, camera, None)
    (hand,) = [one for one in drawn.marks if one.shape == "diamond"]
    np.testing.assert_allclose(hand.pixel, pixel)
    rings = [one.pixel for one in drawn.marks if one.shape == "ring" and one.colour[1] == hand.colour[1]]
    assert len(rings) == 1
    assert np.linalg.norm(rings[0] - pixel) < 4.0, "a fifth of the block"


def test_a_frame_rate_that_cannot_tell_the_turns_is_said_before_anything_is_marked(site, part, monkeypatch) -> None:
    spins, store = (part(f"rockfall_addon.scene.{name}") for name in ("picks.spins", "storage.store"))
    camera = camera_of(site, part)
    (flights,) = store.with_role(site, store.FLIGHTS_ROLE)
    flights[store.TOP_SPEED] = 9.0
    said = spins.uncountable(site, camera, NAME)
    assert said.startswith("At 9 m/s a rolling block of 0.39 m diameter turns 7.3 times a second")
    assert said.endswith("this video has 30.")
    camera[store.CAPTURE_RATE] = 120.0
    assert spins.uncountable(site, camera, NAME) == "", "slow motion"
    assert spins.uncountable(site, camera, "nobody") == ""
    panel, written = bpy.types.ROCKFALL_PT_spin, []
    del camera[store.CAPTURE_RATE]
    of = part("rockfall_addon.steps.spin.panel")
    for name in ("paragraph", "advise"):
        monkeypatch.setattr(of, name, lambda _, __, *said: written.extend(said))
    plain = type("Plain", (), {"draw": panel.draw, "layout": Anything()})()
    plain.draw(bpy.context)
    assert said in written


class Anything:
    """Stands in for a Blender layout, which exists only while a window is drawn."""

    def __getattr__(self, name: str) -> object:
        return lambda *_, **__: self

# SPDX-License-Identifier: GPL-3.0-or-later
"""camera.toml, pairs.csv and the tables of pixels: exact round trips, and a clear message for each mistake."""

import numpy as np
import pytest
from rockfall.core.camera.model import Camera, look_at, rotation_from_vector
from rockfall.core.camera.path import CameraPath, fixed
from rockfall.core.errors import InputError
from rockfall.core.exchange.cameras import read_camera, read_pairs, write_camera, write_pair_residuals
from rockfall.core.exchange.csv_text import read_table
from rockfall.core.exchange.footage_tables import (
    read_clicks,
    read_events,
    read_track,
    write_events,
    write_refinement_residuals,
    write_track,
)
from rockfall.core.georeference import GlobalShift

SHIFT = GlobalShift(2_600_000.0, 1_200_000.0, 1_500.0, "EPSG:2056")


def a_camera() -> Camera:
    # The position is a survey coordinate that a double can hold: what a file gives.
    survey = np.array([2_600_123.456789012, 1_200_045.1, 1_567.000000001])
    rotation = rotation_from_vector([1.1, -0.2, 0.3])
    lens = {"k1": -0.1 / 3, "k2": 0.01, "k3": 1e-17, "p1": 1e-4 / 7, "p2": -2e-4}
    return Camera(1920, 1080, 1400.1, 1400.3, 960.25, 539.5, **lens, position=SHIFT.to_local(survey),
                  rotation=rotation, shift=SHIFT)  # fmt: skip


def a_path() -> CameraPath:
    camera, rng = a_camera(), np.random.default_rng(3)
    time = np.sort(rng.random(7)) * 5 + 1.4
    position = SHIFT.to_local(SHIFT.to_survey(camera.position + 0.05 * rng.normal(size=(7, 3))))
    turns = rotation_from_vector(0.01 * rng.normal(size=(7, 3)))
    sigma = rng.random((2, 7))
    sigma[:, 3] = np.inf  # a frame in which nothing was recognised
    return CameraPath(camera, time, position, turns @ camera.rotation, 0.01 * sigma[0], 1e-4 * sigma[1])


def same(one: CameraPath, other: CameraPath) -> bool:
    names = ("time_s", "position", "rotation", "sigma_position_m", "sigma_rotation")
    mine, yours = one.reference, other.reference
    return (
        mine.size == yours.size
        and np.array_equal(mine.intrinsics, yours.intrinsics)
        and np.array_equal(mine.position, yours.position)
        and np.array_equal(mine.rotation, yours.rotation)
        and all(np.array_equal(getattr(one, name), getattr(other, name)) for name in names)
    )


@pytest.mark.parametrize("make", [lambda: fixed(a_camera()), a_path])
def test_a_camera_is_the_same_after_writing_and_reading_to_the_last_bit(tmp_path, make):
    camera, path = make(), tmp_path / "camera.toml"
    root = np.random.default_rng(1).normal(size=(6, 6))
    covariance = root @ root.T
    sigma = {"fx": 1.5, "x": 0.02, "kappa": 1e-5}
    write_camera(path, camera, rmse_px=1 / 3, sigma=sigma, pose_covariance=(covariance + covariance.T) / 2,
                 extra={"operator": "kept", "lens": {"make": "kept"}})  # fmt: skip
    read = read_camera(path, SHIFT)
    assert "\n  [" in path.read_text()
    assert same(read.path, camera)
    assert read.rmse_px == 1 / 3
    assert read.sigma == sigma
    assert read.crs == "EPSG:2056"
    assert np.array_equal(read.pose_covariance, (covariance + covariance.T) / 2)
    assert read.extra == {"operator": "kept", "lens": {"make": "kept"}}
    again = tmp_path / "again.toml"
    write_camera(again, read.path, rmse_px=read.rmse_px, sigma=read.sigma, crs=read.crs,
                 pose_covariance=read.pose_covariance, extra=read.extra)  # fmt: skip
    assert again.read_bytes() == path.read_bytes()


def test_the_file_has_survey_coordinates_and_a_shift_of_its_own_is_found(tmp_path):
    write_camera(tmp_path / "camera.toml", fixed(a_camera()))
    assert "2600123.456789012" in (tmp_path / "camera.toml").read_text()
    camera = read_camera(tmp_path / "camera.toml").path.reference
    assert np.abs(camera.position[:2]).max() < 100
    assert camera.shift.to_survey(camera.position).tolist() == [2_600_123.456789012, 1_200_045.1, 1_567.000000001]


def test_a_rotation_of_few_decimals_becomes_the_nearest_rotation(tmp_path):
    path = tmp_path / "camera.toml"
    write_camera(path, fixed(a_camera()))
    exact = a_camera().rotation
    text = path.read_text()
    for value in exact.ravel().tolist():
        text = text.replace(repr(value), f"{value:.4f}")
    path.write_text(text)
    rotation = read_camera(path).path.reference.rotation
    assert np.abs(rotation @ rotation.T - np.eye(3)).max() < 1e-14
    assert 0 < np.abs(rotation - exact).max() < 1e-4


SIMPLE = """width = 1920
height = 1080
fx = 1400.0
fy = 1400.0
cx = 960.0
cy = 540.0
position = [2600000.0, 1200000.0, 1500.0]
rotation = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
[sigma]
fx = 1.0
[[frame]]
time_s = 1.0
position = [2600000.0, 1200000.0, 1500.0]
rotation = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
[[frame]]
time_s = 1.5
position = [2600000.0, 1200000.0, 1500.0]
rotation = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
"""


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("fx = 1400.0\n", "", ["fx is missing"]),
        ("fy = 1400.0", "fy = -1400.0", ["fy is -1400", "above zero"]),
        ("width = 1920", "width = 0", ["width", "whole number"]),
        ("cx = 960.0", 'cx = "960"', ["cx", "quotation marks"]),
        ("position = [2600000.0, 1200000.0, 1500.0]", "position = [2600000.0, 1200000.0]", ["position", "[x, y, z]"]),
        ("[0.0, 1.0, 0.0]]", "[0.0, 1.1, 0.0]]", ["rotation is no rotation", "0.21", "unit length"]),
        ("[0.0, 1.0, 0.0]]", "[0.0, -1.0, 0.0]]", ["rotation mirrors", "left-handed"]),
        ("[0.0, 1.0, 0.0]]", "[0.0, 1.0]]", ["rotation is not 3 rows of 3 numbers"]),
        ("time_s = 1.5", "time_s = 1.0", ["frame 2: time_s", "order"]),
        ("time_s = 1.5\n", "", ["frame 2: time_s is missing"]),
        ("fx = 1.0", 'fx = "small"', ["sigma.fx"]),
        ("[sigma]", "[sigma", ["TOML"]),
        ("[sigma]", f"pose_covariance = {np.diag([1, 1, 1, 1, 1, -1.0]).tolist()}\n[sigma]", ["pose_covariance"]),
    ],
)
def test_a_wrong_camera_names_the_file_the_key_and_what_to_do(tmp_path, old, new, said):
    assert old in SIMPLE
    path = tmp_path / "camera.toml"
    path.write_text(SIMPLE)
    assert read_camera(path).path.time_s.tolist() == [1.0, 1.5]
    path.write_text(SIMPLE.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        read_camera(path)
    message = str(caught.value)
    assert message.startswith(str(path))
    for text in said:
        assert text in message.removeprefix(str(path))
    assert caught.value.advice


PAIRS = """name,u_px,v_px,x_m,y_m,z_m,sigma_px,used,frame
spire,100.5,200.25,2600010.1,1200020.2,1510.3,0.5,1,0
,300,400,2600011,1200021,1511,,0,
"""


def test_pairs_and_their_residuals(tmp_path):
    (tmp_path / "pairs.csv").write_text(PAIRS)
    pairs = read_pairs(tmp_path / "pairs.csv", SHIFT)
    assert pairs.pixel.tolist() == [[100.5, 200.25], [300.0, 400.0]]
    assert pairs.point[1].tolist() == [11.0, 21.0, 11.0]
    assert pairs.name.tolist() == ["spire", "2"]
    assert pairs.used.tolist() == [True, False]
    assert pairs.frame.tolist() == [0, -1]
    assert pairs.sigma_px[0] == 0.5
    assert np.isnan(pairs.sigma_px[1])
    residual = np.array([[0.1, -0.2], [np.nan, np.nan]])
    write_pair_residuals(tmp_path / "out.csv", pairs, residual, np.array([0.01, np.nan]), pairs.used)
    assert (tmp_path / "out.csv").read_text().splitlines() == [
        "pair,u_px,v_px,residual_u_px,residual_v_px,residual_m,used,name,frame",
        "1,100.5,200.25,0.1,-0.2,0.01,1,spire,0",
        "2,300.0,400.0,,,,0,2,",
    ]


@pytest.mark.parametrize(
    ("old", "new", "row", "said"),
    [
        ("100.5", "1OO", 2, "not a number"),
        ("1511,,0,", "1511,-1,0,", 3, "sigma_px is below zero"),
        ("1511,,0,", "1511,,perhaps,", 3, "neither 1 nor 0"),
        (",1,0\n", ",1,0.5\n", 2, "no whole number"),
        ("x_m", "easting", 1, "x_m"),
    ],
)
def test_a_wrong_pair_is_located(tmp_path, old, new, row, said):
    (tmp_path / "pairs.csv").write_text(PAIRS.replace(old, new, 1))
    with pytest.raises(InputError, match=said) as caught:
        read_pairs(tmp_path / "pairs.csv")
    assert caught.value.row == row


TRACK = """trajectory,frame,time_s,u_px,v_px,sigma_px,score,weather
B1,40,1.5,10.0,20.5,0.3,0.9,rain
B1,41,1.533,11.0,21.0,,,
"""


def test_tables_of_pixels_keep_what_they_do_not_know(tmp_path):
    (tmp_path / "track.csv").write_text(TRACK)
    track = read_track(tmp_path / "track.csv")
    assert track.frame.tolist() == [40, 41]
    assert np.isnan(track.sigma_px).tolist() == [False, True]
    write_track(track, tmp_path / "again.csv")
    assert (tmp_path / "again.csv").read_text() == TRACK

    events = "trajectory,frame,time_s,u_px,v_px,sigma_time_s,kind,weather\nB1,,1.5,10.0,20.5,0.01,impact,rain\n"
    (tmp_path / "events.csv").write_text(events)
    write_events(read_events(tmp_path / "events.csv"), tmp_path / "again.csv")
    assert (tmp_path / "again.csv").read_text() == events

    (tmp_path / "clicks.csv").write_text("frame,u_px,v_px\n3,10,20\n")
    clicks = read_clicks(tmp_path / "clicks.csv")
    assert (clicks.trajectory.tolist(), clicks.frame.tolist()) == ([""], [3])


@pytest.mark.parametrize(
    ("reader", "old", "new", "row", "said"),
    [
        (read_track, "1.533", "1.5", 3, "does not come after"),
        (read_track, "0.3,0.9", "0,0.9", 2, "sigma_px is 0"),
        (read_track, "40,1.5", "-4,1.5", 2, "no whole number"),
        (read_track, "10.0,20.5", "10.0,", 2, "v_px is empty"),
        (read_clicks, "B1,41", "B1,", 3, "frame is empty"),
        (read_events, "sigma_px,score,weather\n", "sigma_time_s,kind,weather\n", 2, "Unknown kind '0.9'"),
    ],
)
def test_a_wrong_row_of_pixels_is_located(tmp_path, reader, old, new, row, said):
    assert old in TRACK
    (tmp_path / "table.csv").write_text(TRACK.replace(old, new, 1))
    with pytest.raises(InputError, match=said) as caught:
        reader(tmp_path / "table.csv")
    assert caught.value.row == row


def test_residuals_of_a_refinement(tmp_path):
    path = tmp_path / "residuals.csv"
    write_refinement_residuals(
        path,
        trajectory=np.array(["B1", "B1"]),
        video=np.array(["left", "right"]),
        frame=np.array([4, -1]),
        time_s=np.array([0.1, 0.2]),
        pixel=np.array([[1.0, 2.0], [3.0, 4.0]]),
        residual_px=np.array([[0.5, -0.5], [np.nan, np.nan]]),
        outlier=np.array([False, True]),
    )
    table = read_table(path, ("trajectory", "video"), ())
    assert table.text("frame") == ["4", ""]
    assert table.text("outlier") == ["0", "1"]
    assert table.numbers("residual_v_px")[0] == -0.5


def test_a_camera_that_looks_somewhere_reads_back_for_any_place(tmp_path):
    for seed in range(20):
        rng = np.random.default_rng(seed)
        survey = rng.uniform([2.5e6, 1.1e6, 0], [2.8e6, 1.3e6, 4000])
        shift = GlobalShift(*np.round(survey, -2).tolist())
        camera = look_at(640, 480, shift.to_local(survey), shift.to_local(survey + rng.normal(size=3)), fov_deg=50)
        write_camera(tmp_path / "camera.toml", fixed(camera if seed % 2 else Camera(**vars(camera) | {"shift": shift})))
        if not seed % 2:
            read = read_camera(tmp_path / "camera.toml", shift).path.reference
            assert shift.to_survey(read.position).tolist() == survey.tolist()

# SPDX-License-Identifier: GPL-3.0-or-later
"""The demo site's footage agrees with its truth, as measured in the pictures themselves."""

import csv
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest

FOOTAGE = Path(__file__).parents[2] / "assets" / "demo" / "footage"
FILM = FOOTAGE / "footage.mp4"
MATRIX = [f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3)]


def table(name: str) -> list[dict[str, str]]:
    with (FOOTAGE / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def numbers(rows: list[dict[str, str]], *names: str) -> np.ndarray:
    return np.array([[float(row[name]) for name in names] for row in rows])


def projected(points: np.ndarray, camera: list[dict[str, str]]) -> np.ndarray:
    """Pixels (n, 2) of points (n, 3), each seen by the camera of its own row."""
    rotation = numbers(camera, *MATRIX).reshape(-1, 3, 3)
    seen = np.einsum("nij,nj->ni", rotation, points - numbers(camera, "x_m", "y_m", "z_m"))
    return numbers(camera, "fx_px", "fy_px") * seen[:, :2] / seen[:, 2:] + numbers(camera, "cx_px", "cy_px")


@pytest.fixture(scope="module")
def film() -> tuple[list[float], dict[int, np.ndarray]]:
    """All timestamps [s], and every tenth frame."""
    video, times, frames = cv2.VideoCapture(str(FILM)), [], {}
    while True:
        good, image = video.read()
        if not good:
            break
        if len(times) % 10 == 0:
            frames[len(times)] = image
        times.append(video.get(cv2.CAP_PROP_POS_MSEC) / 1000.0)
    video.release()
    return times, frames


def test_the_film_has_all_frames_at_thirty_a_second(film) -> None:
    times, frames = film
    assert len(times) == 300
    assert frames[0].shape == (720, 1280, 3)
    np.testing.assert_allclose(times, np.arange(300) / 30.0, atol=1e-6)
    np.testing.assert_allclose(numbers(table("truth/block.csv"), "time_s")[:, 0], times, atol=1e-6)
    assert FILM.stat().st_size < 6e6


def shaded_ball(image: np.ndarray, near: np.ndarray, radius: float) -> np.ndarray:
    """Centre (2,) of a ball of a radius [px] near a place: least squares of a shaded disc before even ground.

    The sunny side is brighter, so that a threshold would be pulled towards it; brightness is linear in the normal.
    """
    left, top = (int(value) - 12 for value in near)
    window = image[top : top + 25, left : left + 25].astype(float).mean(axis=2).ravel()
    rows, columns = (index.ravel() + 0.5 for index in np.indices((25, 25)))
    best, found = np.inf, near
    for u in np.arange(8.5, 16.6, 0.25):
        for v in np.arange(8.5, 16.6, 0.25):
            x, y = (columns - u) / radius, (rows - v) / radius
            inside = np.clip((1.0 - np.hypot(x, y)) * radius + 0.5, 0.0, 1.0)
            near_by = np.hypot(x, y) < 1.7
            depth = np.sqrt(np.clip(1.0 - x**2 - y**2, 0.0, None))
            design = np.column_stack([1.0 - inside, inside, inside * x, inside * y, inside * depth])[near_by]
            rest = window[near_by] - design @ np.linalg.lstsq(design, window[near_by], rcond=None)[0]
            misfit = float(np.mean(np.minimum(np.abs(rest), 30.0)))
            if misfit < best:
                best, found = misfit, np.array([left + u, top + v])
    return found


def test_the_block_is_where_the_truth_says(film) -> None:
    """The ball that fits decoded frames best, given its size; dust and corners of the rock spoil a few."""
    block, camera = table("truth/block.csv"), table("truth/camera.csv")
    diameter = float(table("truth/impacts.csv")[0]["diameter_m"])
    off = []
    for frame in range(50, 300, 20):
        row, pose = block[frame : frame + 1], camera[frame : frame + 1]
        distance = np.linalg.norm(numbers(row, "x_m", "y_m", "z_m") - numbers(pose, "x_m", "y_m", "z_m"))
        radius = numbers(pose, "fx_px")[0, 0] * diameter / 2.0 / distance
        pixel = numbers(row, "u_px", "v_px")[0]
        off.append(shaded_ball(film[1][frame], pixel, radius) - pixel)
    miss = np.linalg.norm(off, axis=1)
    assert np.median(miss) < 0.9
    assert np.quantile(miss, 0.8) < 1.5


def test_pixels_of_the_block_are_those_of_the_camera() -> None:
    block = table("truth/block.csv")
    pixels = projected(numbers(block, "x_m", "y_m", "z_m"), table("truth/camera.csv"))
    np.testing.assert_allclose(pixels, numbers(block, "u_px", "v_px"), atol=0.01)


@pytest.mark.parametrize(("name", "frame"), [("pairs.csv", 0), ("pairs_middle.csv", 90)])
def test_survey_targets_agree_with_the_camera(name: str, frame: int) -> None:
    """Pixels come from the picture, places from the survey: a centimetre there is a quarter of a pixel."""
    pairs, camera = table(name), table("truth/camera.csv")[frame : frame + 1]
    assert 10 <= len(pairs) <= 14
    off = numbers(pairs, "u_px", "v_px") - projected(numbers(pairs, "x_m", "y_m", "z_m"), camera * len(pairs))
    assert 0.02 < np.sqrt((off**2).mean()) < 0.7
    assert np.ptp(numbers(pairs, "u_px")) > 900
    assert np.ptp(numbers(pairs, "v_px")) > 450


def test_the_clicks_are_on_the_block() -> None:
    block = table("truth/block.csv")
    for click in table("clicks.csv"):
        row = block[int(click["frame"])]
        assert row["visible"] == "1"
        assert np.abs(numbers([click], "u_px", "v_px") - numbers([row], "u_px", "v_px")).max() <= 2.5


def test_the_block_flies_on_parabolas_between_its_impacts() -> None:
    block, impacts = table("truth/block.csv"), table("truth/impacts.csv")
    times, places = numbers(block, "time_s")[:, 0], numbers(block, "x_m", "y_m", "z_m")
    assert len(impacts) >= 6
    for before, after in pairwise(impacts):
        start = float(before["leave_time_s"])
        t = times - start
        flying = (t > 0.0) & (times < float(after["time_s"]))
        place = numbers([before], "leave_x_m", "leave_y_m", "leave_z_m")
        velocity = numbers([before], "v2x_mps", "v2y_mps", "v2z_mps")
        drop = np.outer(0.5 * 9.81 * t**2, [0.0, 0.0, 1.0])
        np.testing.assert_allclose((place + velocity * t[:, None] - drop)[flying], places[flying], atol=1e-5)


def test_impacts_are_those_of_the_campaign() -> None:
    """Where the demo site's own truth knows the impact, it is the same one on another clock."""
    campaign = {
        row["impact"]: row
        for row in csv.DictReader((FOOTAGE.parent / "truth.csv").open())
        if row["trajectory"] == "B10"
    }
    offsets = []
    for row in table("truth/impacts.csv"):
        if row["campaign_impact"]:
            known = campaign[row["campaign_impact"]]
            offsets.append(float(known["time_s"]) - float(row["time_s"]))
            assert {key: row[key] for key in row if key.startswith(("x_", "contact_", "v1", "v2", "omega"))} == {
                key: known[key] for key in known if key.startswith(("x_", "contact_", "v1", "v2", "omega"))
            }
    assert len(offsets) == 6
    np.testing.assert_allclose(offsets, 465.499, atol=1e-6)


def test_no_part_of_the_visible_run_is_hidden() -> None:
    block = table("truth/block.csv")
    seen = numbers(block, "visible")[:, 0] > 0
    assert seen[50:].all()
    assert not seen[:30].any()
